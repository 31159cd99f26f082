"""A state that nothing measures begins anew with each recording: each has a number of its own.

The first recording has the model's own parameter; those after it have one more each, which is only
a number of the fit. Where it is not tuned, a recording begins as the first does.

>>> from evertwin.machines.thermal import ThermalBox
>>> own_names(ThermalBox(), ("box_capacity", "heater_start"), 2)
('box_capacity', 'heater_start', 'heater_start of recording 2')
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.models import Model, Parameters
from evertwin.types import Bools, Int64, ParameterVector, Vector


def initials(model: Model) -> tuple[str, ...]:
    """Parameters of a model that belong to a recording; none where it names none.

    >>> from evertwin.machines.thermal import ThermalBox
    >>> initials(ThermalBox())
    ('heater_start',)
    """
    found: tuple[str, ...] = getattr(model, "initials", ())
    return found


def given(model: Model, p: ParameterVector) -> Bools:
    """States whose start is a parameter that belongs to a recording, (nx,): these are fitted."""
    other = p.copy()
    for name in initials(model):
        other[model.parameters.index(name)] += 1.0
    return np.asarray(model.initial(other) != model.initial(p))


def own_names(model: Model, names: Sequence[str], recordings: int) -> tuple[str, ...]:
    """``names``, and each start among them once more for every recording after the first."""
    starts = [name for name in initials(model) if name in names]
    return (*names, *(_own(n, k) for k in range(1, recordings) for n in starts))


def extended(parameters: Parameters, model: Model, recordings: int) -> Parameters:
    """The model's parameters, then the starts of every recording after the first."""
    starts = initials(model)
    more = [replace(parameters[n], name=_own(n, k)) for k in range(1, recordings) for n in starts]
    return parameters + Parameters(tuple(more)) if more else parameters


def places(
    parameters: Parameters, model: Model, names: Sequence[str], k: int
) -> Int64[np.ndarray, " np"]:
    """Where the model's parameters for recording ``k`` stand among the `extended` ones, (np,)."""
    found = np.arange(len(model.parameters))
    for name in initials(model):
        if _own(name, k) in names:
            found[model.parameters.index(name)] = parameters.index(_own(name, k))
    return found


def started(
    model: Model, p: ParameterVector, fitted: tuple[Sequence[str], Vector], k: int
) -> ParameterVector:
    """``p`` (np,) with what recording ``k`` (0, 1, …) of a fit (names, values) began with."""
    values, out = dict(zip(*fitted, strict=True)), p.copy()
    for name in initials(model):
        place = model.parameters.index(name)
        out[place] = values.get(_own(name, k), out[place])
    return out


def beginning(model: Model, names: Sequence[str]) -> tuple[str, ...]:
    """Those of the tuned ``names`` that belong to a recording, not to the machine."""
    own = initials(model)
    return tuple(name for name in names if name in own or name not in model.parameters.names)


def _own(name: str, k: int) -> str:
    return f"{name} of recording {k + 1}"
