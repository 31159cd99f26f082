"""Has a sensor changed its unit, sign or place, since when the rows are of the machine as it is?

A static map predicts forces from motion. If they become one number times as large, in every motion
and by a number that divides two units, then no friction and no mass explains it: all of them would
have changed by that number together. It could still be the machine; so nothing is learned, and
whoever knows is asked. An input may have changed so too: what it divides by then leaves next to
nothing of the deviation.
"""

from __future__ import annotations

import numpy as np

from evertwin.errors import TooFew
from evertwin.fold import Windows
from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.sensor_change import SensorChange, since_change
from evertwin.gauges.units.exchanged import exchanged
from evertwin.gauges.units.rescaled import rescaled
from evertwin.models import Model
from evertwin.rows.channels import size_recorded, unit_recorded
from evertwin.setup.evaluation import predict
from evertwin.setup.setup import Setup
from evertwin.signals import Channel
from evertwin.signals.mistaken import SIGN, numbers
from evertwin.types import Inputs, Outputs, ParameterVector, Vector

NEAR = 0.01
"""Relative distance within which a number is taken for one of them."""
ABOUT = 0.05
"""The same of a turned sign, which no machine comes near."""
EXPLAINED = 0.99
"""Share of the deviation's square that the number has to take away."""


PARTS = (1.0, 0.5, 0.25)
"""Shares of the rows, the newest, of which one may be of the sensor as it is now alone."""


def unit_change(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows
) -> SensorChange | None:
    """Outputs that have changed places; one that is one number times what is predicted, or does
    not answer any more; an input that is one number times what it was; None: none is.

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
    u = np.concatenate([window.u for window in windows])
    crossed = _crossed(setup, y, expected, moving)
    if crossed is not None:
        return crossed
    for k in np.flatnonzero(setup.watched).tolist():
        rows = np.isfinite(y[:, k]) & np.isfinite(expected[:, k]) & moving[:, k]
        a, b = y[rows, k], expected[rows, k]
        channel = setup.model.outputs.channels[k]
        for part in PARTS:
            newest = slice(round((1.0 - part) * len(a)), None)
            said = of_sensor(setup, channel, a[newest], b[newest], u[rows][newest])
            if said is None:
                continue
            if part * len(y) >= setup.enough:
                return rescaled(setup, model, p, windows, (y - expected, said)) or said
            if part == 1.0:  # in a few motions much is one number times as large
                raise TooFew(f"{len(y)} rows do not tell a change of unit from another")
    return rescaled(setup, model, p, windows, (y - expected, None))


def _crossed(
    setup: Setup, y: Outputs, expected: Outputs, moving: np.ndarray
) -> SensorChange | None:
    """Outputs that have changed places since the deviation has been what it is.

    Raises:
        TooFew: it looks so, on fewer rows than a deviation is judged on.
    """
    names, first = setup.model.outputs.names, since_change((y - expected)[:, setup.watched])
    rows = first + np.flatnonzero(moving[first:].any(axis=1))
    sizes = np.array([size_recorded(setup.spec, name) for name in names])
    for size in (np.ones(len(names)), sizes):
        looks = exchanged(y[rows], expected[rows], setup.model.outputs.units, size)
        moved = [k for k, other in enumerate(looks) if k != other]
        if moved:
            break
    else:
        return None
    if len(y) - first < setup.enough:
        raise TooFew(f"{len(y) - first} rows do not tell crossed outputs from others")
    said = ", ".join(f"{names[k]} is what {names[looks[k]]} would be" for k in moved)
    cause = "as crossed cables or columns would make it, so nothing is learned"
    return SensorChange(names[moved[0]], 1.0, f"{said}, {cause}")


def _answers(a: Vector, u: Inputs) -> bool:
    """Does what is measured go by the inputs, whatever the model makes of them?"""
    if len(a) <= u.shape[1] + 1:  # so few go by anything
        return True
    columns = np.column_stack([np.ones(len(u)), np.nan_to_num(u)])
    left = a - columns @ np.linalg.lstsq(columns, a, rcond=None)[0]
    return bool(left @ left < 0.5 * np.sum((a - a.mean()) ** 2))


def of_sensor(
    setup: Setup, channel: Channel, a: Vector, b: Vector, u: Inputs
) -> SensorChange | None:
    """Measured ``a`` beside expected ``b``, at inputs ``u``."""
    off = float(np.sum((a - b) ** 2))
    if not (b @ b > 0 and off > 0):
        return None
    level, left = float(a.mean()), float(np.sum((a - a.mean()) ** 2))
    still = left <= (1.0 - EXPLAINED) * min(off, float(np.sum((b - b.mean()) ** 2)))
    last = slice(round((1.0 - PARTS[-1]) * len(a)), None)
    if still and not _answers(a, u) and not _answers(a[last], u[last]):
        return SensorChange(channel.name, 0.0, (
            f"{channel.name} stays at {in_words.level(setup, channel, level)}, however the machine "
            "moves: its sensor no longer answers, so nothing is learned from it"
        ))  # fmt: skip
    number = float(a @ b / (b @ b))
    if np.sum((a - number * b) ** 2) > (1.0 - EXPLAINED) * off:
        return None
    for known, told in numbers(channel.unit, unit_recorded(setup.spec, channel.name)):
        if abs(number / known - 1.0) <= (ABOUT if known == SIGN else NEAR):
            return SensorChange(channel.name, number, (
                f"{channel.name} is {number:.4g} times what is predicted, as {told} would make "
                "it, or a machine that changed so: that cannot be told from these data, and is "
                "not learned"
            ))  # fmt: skip
    return None
