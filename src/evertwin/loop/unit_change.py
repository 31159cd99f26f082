"""Has a sensor changed its unit or its sign, since when the rows are of the machine as it is now?

A static map predicts forces from motion. If they become one number times as large, in every motion
and by a number that divides two units, then no friction and no mass explains it: all of them would
have changed by that number together. It could still be the machine; so nothing is learned, and
whoever knows is asked.
"""

from __future__ import annotations

import numpy as np

from evertwin.correction.improve import TooFew
from evertwin.loop.evaluation import predict
from evertwin.loop.setup import Setup
from evertwin.loop.task import Windows
from evertwin.models import Model
from evertwin.types import ParameterVector

UNITS = {
    -1.0: "a turned sign", 4.44822: "newtons for pounds", 9.80665: "newtons for kilograms",
    1.35582: "newton metres for foot pounds", 8.85075: "inch pounds for newton metres",
    6.89476: "kilopascals for psi", 14.5038: "psi for bars", 3.6: "km/h for m/s",
    60.0: "another unit of time", 9.5493: "rpm for rad/s", 57.2958: "degrees for radians",
    25.4: "millimetres for inches", 39.3701: "inches for metres", 3.28084: "feet for metres",
    10.0: "a decimal prefix", 100.0: "a decimal prefix", 1000.0: "a decimal prefix",
}  # fmt: skip
"""Numbers that divide two units, and what they stand for; the inverse is that the other way."""
NEAR = 0.01
"""Relative distance within which a number is taken for one of them."""
EXPLAINED = 0.99
"""Share of the deviation's square that the number has to take away."""


def unit_change(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows
) -> tuple[str, float, str] | None:
    """Output, measured over predicted, what this number stands for; None: nothing like it.

    Of static maps alone: a state adopts what is measured, and the arbiter answers for it.

    Raises:
        TooFew: it looks so, on fewer rows than a deviation is judged on.
    """
    if len(model.initial(p)) or not windows:
        return None
    found = [predict(setup, model, p, window) for window in windows]
    moving = np.concatenate([one.moving for one in found])
    y = np.concatenate([one.measured for one in found])
    expected = np.concatenate([one.measured - one.residual for one in found])
    for k in np.flatnonzero(setup.watched).tolist():
        rows = np.isfinite(y[:, k]) & np.isfinite(expected[:, k]) & moving[:, k]
        a, b = y[rows, k], expected[rows, k]
        if not b @ b > 0:
            continue
        number = float(a @ b / (b @ b))
        if np.sum((a - number * b) ** 2) > (1.0 - EXPLAINED) * np.sum((a - b) ** 2):
            continue
        for factor, name in UNITS.items():
            for known, told in ((factor, name), (1.0 / factor, f"{name}, the other way round")):
                if abs(number / known - 1.0) > NEAR:
                    continue
                if len(y) < setup.enough:  # in a few motions much is one number times as large
                    raise TooFew(f"{len(y)} rows do not tell a change of unit from another")
                return setup.model.outputs.names[k], number, told
    return None
