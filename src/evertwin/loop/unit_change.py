"""Has a sensor changed its unit or its sign, since when the rows are of the machine as it is now?

A static map predicts forces from motion. If they become one number times as large, in every motion
and by a number that divides two units, then no friction and no mass explains it: all of them would
have changed by that number together. It could still be the machine; so nothing is learned, and
whoever knows is asked.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.correction.improve import TooFew
from evertwin.loop.evaluation import predict
from evertwin.loop.setup import Setup
from evertwin.loop.task import Windows
from evertwin.models import Model
from evertwin.signals import Channel
from evertwin.types import ParameterVector, Vector

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


PARTS = (1.0, 0.5, 0.25)
"""Shares of the rows, the newest, of which one may be of the sensor as it is now alone."""


class SensorChange(NamedTuple):
    """What an output has become, as one number.

    >>> SensorChange("tau", -1.0, "tau is …").number
    -1.0
    """

    output: str
    number: float
    """Measured over predicted; 0: it does not answer."""
    said: str


def unit_change(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows
) -> SensorChange | None:
    """An output that is one number times what is predicted, or no longer answers; None: none is.

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
        channel = setup.model.outputs.channels[k]
        for part in PARTS:
            newest = slice(round((1.0 - part) * len(a)), None)
            said = _of_sensor(a[newest], b[newest], channel)
            if said is None:
                continue
            if part * len(y) >= setup.enough:
                return said
            if part == 1.0:  # in a few motions much is one number times as large
                raise TooFew(f"{len(y)} rows do not tell a change of unit from another")
    return None


def _of_sensor(a: Vector, b: Vector, channel: Channel) -> SensorChange | None:
    """Measured ``a`` beside expected ``b``."""
    off = float(np.sum((a - b) ** 2))
    if not (b @ b > 0 and off > 0):
        return None
    level, left = float(a.mean()), float(np.sum((a - a.mean()) ** 2))
    if left <= (1.0 - EXPLAINED) * min(off, float(np.sum((b - b.mean()) ** 2))):
        return SensorChange(channel.name, 0.0, (
            f"{channel.name} stays at {level:.4g} {channel.unit}, however the machine moves: its "
            "sensor no longer answers, so nothing is learned from it"
        ))  # fmt: skip
    number = float(a @ b / (b @ b))
    if np.sum((a - number * b) ** 2) > (1.0 - EXPLAINED) * off:
        return None
    for factor, name in UNITS.items():
        for known, told in ((factor, name), (1.0 / factor, f"{name}, the other way round")):
            if abs(number / known - 1.0) <= NEAR:
                return SensorChange(channel.name, number, (
                    f"{channel.name} is {number:.4g} times what is predicted, as {told} would make "
                    "it, or a machine that changed so: that cannot be told from these data, and is "
                    "not learned"
                ))  # fmt: skip
    return None
