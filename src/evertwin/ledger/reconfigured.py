"""A model as configured that is not the one in the store: does what was found before still hold?

A model that only has more numbers, of which none acts yet, is the same machine's: a payload of
nothing, a term of friction at zero. So is one without numbers that are zero. What was tuned goes
on. Where a number that was there is another one, or a new one acts, nobody knows what the old ones
mean now.
"""

from __future__ import annotations

import numpy as np

from evertwin.errors import EvertwinError
from evertwin.models import Model
from evertwin.models.form import Version
from evertwin.types import ParameterVector

ROWS, STEP = 50, 0.1
"""Rows that a number is tried on, and their distance [s]."""
ALIKE = 1e-9
"""Part of an output that a number that does not act may change."""


def carried(
    model: Model, found: Version, before: Version, now: Version
) -> tuple[dict[str, float], tuple[str, ...]] | None:
    """The numbers of ``found`` that the model still has, and the names of those that it did not
    have then; None where they do not hold.

    >>> from evertwin.machines.drive import DriveForce
    >>> from evertwin.models.form import Form
    >>> def version(law, **tuned):
    ...     own = DriveForce(law).parameters.with_values(tuned)
    ...     return Version(0, Form(), own.names, tuple(own.values.tolist()))
    >>> old, more, tuned = version("tanh"), version("tanh+stribeck"), version("tanh", Fc=9.0)
    >>> carried(DriveForce("tanh+stribeck"), tuned, old, more)[1]
    ('Fs', 'vs')
    >>> carried(DriveForce("tanh+stribeck"), tuned, old, version("tanh+stribeck", Fs=2.0))

    Args:
        model: as it is now, in the form of ``found``.
        found: of the model as it was.
        before: as it was configured.
        now: as it is.
    """
    old, new, values = (
        dict(zip(one.names, one.values, strict=True)) for one in (before, now, found)
    )
    more = tuple(name for name in new if name not in old)
    kept = {name: value for name, value in values.items() if name in model.parameters.names}
    changed = any(new[name] != value for name, value in old.items() if name in new)
    if changed or any(value for name, value in values.items() if name not in kept):
        return None
    p = model.parameters.with_values(new | kept).values
    moved = p.copy()
    moved[[model.parameters.index(name) for name in more]] *= 2.0
    return (kept, more) if _alike(model, p, moved) else None


def _alike(model: Model, p: ParameterVector, other: ParameterVector) -> bool:
    """Does the model say the same with either?"""
    rng, dt = np.random.default_rng(0), np.full(ROWS, STEP)
    u = rng.normal(size=(ROWS, len(model.inputs)))
    u = np.clip(u, [c.low for c in model.inputs], [c.high for c in model.inputs])
    try:
        one, two = (model.simulate(model.initial(q), u, dt, q)[1] for q in (p, other))
    except EvertwinError:
        return False
    return bool(np.allclose(one, two, rtol=ALIKE, atol=0.0, equal_nan=True))
