"""The same model with other start values, bounds or channel limits.

>>> from evertwin.models.functions.function import FunctionModel
>>> from evertwin.models.parameters import Parameters
>>> from evertwin.signals import Layout
>>> gain = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(u="1"),
...     Layout.of(y="1"), Layout(), Parameters.of(k=(1.0, "1")))
>>> configured(gain, parameters=Parameters.of(k=(2.0, "1"))).parameters.values.tolist()
[2.0]
"""

from __future__ import annotations

import copy
from typing import TypeVar

from evertwin.errors import UsageError
from evertwin.models.contract import Model
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout

M = TypeVar("M", bound=Model)


def configured(
    model: M,
    *,
    parameters: Parameters | None = None,
    inputs: Layout | None = None,
    outputs: Layout | None = None,
) -> M:
    """A copy of a model that differs in its parameters' settings or its channels' limits.

    Models build these from their own options, so a copy is changed instead of a new one built.

    Raises:
        UsageError: names differ from the model's own.
    """
    changes = {"parameters": parameters, "inputs": inputs, "outputs": outputs}
    clone = copy.copy(model)
    for name, new in changes.items():
        if new is None:
            continue
        old = getattr(model, name)
        if new.names != old.names:
            raise UsageError(f"{name}: expected {', '.join(old.names)}, got {', '.join(new.names)}")
        object.__setattr__(clone, name, new)
    return clone
