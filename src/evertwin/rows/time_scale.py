"""Do the stamps of rows go with the times that a twin is about?

Whole numbers that advance by 20 a row may be seconds, or milliseconds that are read as seconds: the
file alone cannot say it. The twin can: rows that are further apart than predictions reach ahead,
or, where no horizon is set, than the model's states remember by far, are no rows of this machine.
Rows of one a second or one a minute are none the less, where the horizon or the states last longer.
Where the file states the unit, or stamps have decimals, only a far shorter horizon is held against.

>>> from evertwin.machines.mobile import Robot1D
>>> doubt(20.0, "s", 0.5, Robot1D())[:60]
'rows come every 20 s, and predictions are 0.5 s ahead: are t'
>>> doubt(20.0, "s", 60.0, Robot1D()), doubt(20.0, "s", float("inf"), Robot1D())
('', '')
"""

from __future__ import annotations

import math

import numpy as np

from evertwin.models import Model
from evertwin.sources.clocks.stamps import UNITS, seconds_of

FORGOTTEN = 5.0
"""Time constants after which a state has forgotten where it was."""
FARTHER = 10.0
"""Horizons by which rows are apart, at least, where their unit is likely."""
STATES = 20
"""Of a model with more of them no time constant is sought."""
SMALLEST = 1e-6
"""Part of a change that is left after a thousandth of a row: below, a state jumps, as at rest."""


def doubt(step: float, unit: str, horizon: float, model: Model, *, likely: bool = False) -> str:
    """The question whether stamps are in the unit that they are read in; empty where none is open.

    Args:
        step: what stamps advance by from row to row, in ``unit``.
        unit: what they are read in.
        horizon: how far ahead predictions are [s]; infinite: nobody says.
        model: what predicts.
        likely: the file states a unit, or stamps have decimals: only a horizon that is far shorter,
            which somebody stated as well, is held against that.
    """
    seconds = step * (seconds_of(unit) or 0.0)
    if (
        not seconds or len(model.states) == 0 or (seconds <= 3600 and seconds % 60 == 0)
    ):  # nobody logs each 60 ms
        return ""
    if math.isfinite(horizon):
        limit, said = horizon, f"predictions are {horizon:.3g} s ahead"
    elif likely:
        return ""
    else:
        memory = remembers(model, seconds / 1000)
        limit, said = FORGOTTEN * memory, f"the model's states remember {memory:.2g} s"
    finer = [one for one, power in UNITS.items() if power < UNITS.get(unit, 0)]
    fits = [one for one in finer if step * (seconds_of(one) or 0.0) <= limit]
    if seconds <= (FARTHER if likely else 1.0) * limit or not fits:
        return ""
    numbers = "whole numbers" if step.is_integer() else "numbers"
    return (
        f"rows come every {seconds:.4g} s, and {said}: are the stamps {fits[0]} ({numbers} "
        f"that advance by {step:g}), read as {unit}? Then set time = {{ unit = '{fits[0]}' }}"
    )


def would_fit(long: float, unit: str) -> str:
    """What to set where samples are ``long`` times as far apart as they should be, if a finer unit
    brings them within a factor of thirty; else empty.

    >>> would_fit(1000.0, "s"), would_fit(500.0, "ms"), would_fit(1e5, "iso")
    (': ms, read as s?', ': us, read as ms?', '')
    """
    power = 3 * round(math.log10(long) / 3)
    for one, finer in UNITS.items():
        if power > 0 and UNITS.get(unit, 0) - finer == power:
            return f": {one}, read as {unit}?"
    return ""


def remembers(model: Model, dt: float) -> float:
    """The longest time constant of a model about its start, from one step of ``dt`` [s]; infinite
    where a state keeps what it has, or jumps.

    >>> from evertwin.machines.mobile import Robot1D
    >>> remembers(Robot1D(), 0.1)  # a position
    inf
    """
    p = model.parameters.values
    x, count = np.asarray(model.initial(p), dtype=np.float64), len(model.states)
    if count > STATES:
        return math.inf
    u, interval = np.zeros((1, len(model.inputs))), np.array([dt])
    after = np.asarray(model.simulate(x.copy(), u, interval, p)[0])
    slopes = np.empty((count, count))
    for k in range(count):
        moved = x.copy()
        moved[k] += 1e-4 * max(1.0, abs(x[k]))
        change = np.asarray(model.simulate(moved.copy(), u, interval, p)[0]) - after
        slopes[:, k] = change / (moved[k] - x[k])
    if not np.isfinite(slopes).all():
        return math.inf
    left = float(np.abs(np.linalg.eigvals(slopes)).max())
    return -dt / math.log(left) if SMALLEST < left < 1.0 - 1e-9 else math.inf
