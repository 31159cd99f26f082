"""A model in one line, as a prompt shows it."""

from __future__ import annotations

from evertwin.errors import few
from evertwin.models.contract import Model


def one_line(model: Model) -> str:
    """Kind, channels, parameters with their start values; for a class: ``__repr__ = one_line``.

    >>> from evertwin.models.compiled import Compiled
    >>> from evertwin.models.parameters import Parameters
    >>> from evertwin.signals.channels import Layout
    >>> one_line(Compiled(Layout(), Layout.of(x="m"), Layout(), Parameters.of(k=(2.0, "1")), 0, 0))
    '<Compiled: none -> x; k=2>'
    """
    told = few(f"{one.name}={one.value:.6g}" for one in model.parameters)
    names = f"{few(model.inputs.names)} -> {few(model.outputs.names)}"
    return f"<{type(model).__name__}: {names}; {told}>"
