"""An output that stays where it is though the machine is predicted to move as before."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from evertwin.errors import TooFew
from evertwin.fold import Block
from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.gauge_rows import LEAST, Rows
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.models.kernels.kernel import CONTINUE
from evertwin.rows.ring import called
from evertwin.types import Bools, Outputs, Vector

FEW = 300
"""Rows that a silent output is waited for."""
VARIES = 0.3
"""Motion that is expected by what the inputs do, at least [of what is expected]."""
STILL = 0.1
"""Response, and scatter, below which a sensor does not answer [of what is predicted]."""
WIDE = 6.0
"""How far what stays is from where it stays, at most [of its scatter]."""
OF_USUAL = 0.3
"""Scatter of what stays where it is, at most [of how it moved before]."""
OF_NOISE = 5.0
"""Size of the predicted motion from which an answer is missed [of the scatter]."""


@unmeasured()
def silent(rows: Rows) -> SensorChange | None:
    """An output that stays where it is though the machine is predicted to move as before."""
    model = rows.setup.model
    if not len(model.states):
        return None
    whole = rows.whole
    y, used = whole.rows.y, whole.rows.used
    base = _base(y, whole.restart.code)
    measured, expected = y - base, whole.predict(whole.start) - base
    for k in range(len(model.outputs)):  # what nobody asked about moves the others, too
        since = _still_since(y[: rows.stop, k])
        good = np.isfinite(measured[:, k]) & np.isfinite(expected[:, k]) & used[:, k]
        now, then = good.copy(), good.copy()
        now[:since], now[rows.stop :], then[since:] = False, False, False
        still = np.count_nonzero(now) >= LEAST and _still(measured[now, k], expected[now, k])
        if not still:
            continue
        size, level = _rms(expected[now, k]), y[now, k]
        if np.std(level) * OF_NOISE > size:  # it goes its own way, slower than is expected
            continue
        alike = then & (np.abs(expected[:, k]) <= 2.0 * size)
        before = np.count_nonzero(alike) >= LEAST
        if before and not (
            _answered(measured[alike, k], expected[alike, k], size)
            and np.std(level) < OF_USUAL * _rms(measured[alike, k])
        ):
            continue
        channel = model.outputs.channels[k]
        if not _driven(rows, now, k, size):
            if np.count_nonzero(now) < FEW:
                raise TooFew(f"{channel.name} stays where it is, and so do the inputs")
            continue
        place = in_words.level(rows.setup, channel, float(np.mean(level)))
        said = (
            f"{channel.name} stays at {place} from "
            f"{called(rows.row(since))}{rows.until(rows.stop)}, however the machine is moved"
            f"{', where it answered before' if before else ''}: its sensor no longer answers, or "
            "the machine does not; nothing is learned from it"
        )
        over = rows.refused((channel.name,), since, rows.stop)
        return SensorChange(channel.name, 0.0, said, over, rows.goes_on(since, rows.stop))
    return None


def _still_since(y: Vector) -> int:
    """Position from which on a channel has stayed about where it is at the end."""
    known = np.flatnonzero(np.isfinite(y))
    newest = y[known[-LEAST:]]
    if not len(newest):
        return len(y)
    level, steps = np.median(newest), np.abs(np.diff(y[known]))
    digit = float(np.min(steps[steps > 0.0], initial=np.inf))  # it may be recorded coarsely
    spread = max(
        1.4826 * float(np.median(np.abs(newest - level))), digit if digit < np.inf else 0.0
    )
    away = np.flatnonzero(np.abs(y[known] - level) > WIDE * spread)
    return int(known[away[-1]]) + 1 if len(away) else int(known[0])


def _base(y: Outputs, code: np.ndarray) -> Outputs:
    """What was measured where the prediction of each row began, or first since then, (n, ny)."""
    out = np.full(y.shape, np.nan)
    for start, stop in pairwise([*np.flatnonzero(code != CONTINUE).tolist(), len(y)]):
        part = y[start:stop]
        known = np.isfinite(part)
        for k in np.flatnonzero(known.any(axis=0)).tolist():
            out[start:stop, k] = part[int(np.argmax(known[:, k])), k]
    return out


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def _driven(rows: Rows, now: Bools, k: int, size: float) -> bool:
    """Is output ``k`` expected to move on these rows by what the inputs do? Else a model that is
    off expects motion of a machine that has come to rest, or stays at its speed."""
    places = np.flatnonzero(now)

    def held(block: Block) -> Block:
        return block._replace(u=np.repeat(block.u[:1], len(block.u), axis=0))

    posed = rows.pose(rows.changed(int(places[0]), int(places[-1]) + 1, held))
    by_inputs = rows.whole.predict(rows.whole.start)[now, k] - posed.predict(posed.start)[now, k]
    return _rms(by_inputs[np.isfinite(by_inputs)]) > VARIES * size


def _still(measured: Vector, expected: Vector) -> bool:
    """Is what is expected missing altogether?"""
    power = float(expected @ expected)
    response = abs(float(measured @ expected)) / power if power > 0 else 1.0
    return response < STILL and float(measured @ measured) * OF_NOISE**2 < power


def _answered(measured: Vector, expected: Vector, size: float) -> bool:
    """Did it answer to motion of this size?"""
    power = float(expected @ expected)
    enough = power > 0.25 * size**2 * LEAST
    return enough and float(measured @ expected) > 0.5 * power
