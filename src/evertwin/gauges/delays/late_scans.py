"""Does a pose that scans tell come late behind the commands, or early, by one time for all of it?

Heading and way that are late by the same time are so by the stamps of the scans, or by a drive that
does all later than it is told; which of the two nobody can tell from them. What comes before its
command is no drive: stamps are wrong. So commands are put later and later; where predictions with
them are right best, by heading and by way, is how late the pose is.

>>> from evertwin.fold import make_block
>>> t = np.arange(5) * 10**9
>>> block = make_block(t=t, u=np.array([[0.0], [1.0], [1.0], [3.0], [3.0]]), y=np.zeros((5, 1)))
>>> put_later(block, 0.5).u[:, 0].tolist()
[0.0, 0.5, 1.0, 2.0, 3.0]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block, Windows
from evertwin.gauges.rows.scanned import pose_of
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.gauges.rows.unlike import Changes
from evertwin.gauges.units.misread import ROWS, newest_rows, seen
from evertwin.models import Model
from evertwin.rows.channels import recorded_as
from evertwin.setup.setup import Setup
from evertwin.types import ParameterVector, Vector

TRIED = np.linspace(-0.8, 0.8, 33)
"""Times by which commands are put later [s]."""
FEW = 100
"""Poses that tell it, at least."""
LEAST, SURE, ALIKE = 0.03, (5.0, 3.0), 3.0
"""Time from which on it is told [s]; standard errors that heading and way have to be away from
none; and within which the two have to agree."""
ROUGH = 0.2
"""Share of the time by which the two may differ as well: the way errs by what its law leaves."""
LEFT = 0.7
"""Share of the squared deviation of the heading that it leaves at most."""


class Delay(NamedTuple):
    """How late one thing is.

    >>> Delay(0.2, 0.01, 0.5).seconds
    0.2
    """

    seconds: float
    """Behind what is commanded; negative: before it."""
    sigma: float
    """Standard error [s]."""
    left: float
    """Share of the squared deviation that is left with commands so late."""


def put_later(window: Block, seconds: float) -> Block:
    """The rows, with commands that act later; what is measured outside of them is unknown then."""
    t = (window.t - window.t[0]) * 1e-9
    steps = np.where(np.isfinite(window.u), window.u, 0.0) * window.dt[:, None]
    whole, at = np.cumsum(steps, axis=0), t - seconds
    moved = np.column_stack([np.interp(at, t, column) for column in whole.T])
    dt = np.diff(t, prepend=t[0])[:, None]
    u = np.diff(moved, axis=0, prepend=moved[:1]) / np.where(dt > 0.0, dt, 1.0)
    known = np.isfinite(window.u) & (dt > 0.0)
    outside = (at < t[0]) | (at > t[-1])
    return window._replace(
        u=np.where(known, u, window.u), y=np.where(outside[:, None], np.nan, window.y)
    )


@unmeasured()
def late_scans(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows
) -> tuple[Delay, Delay] | None:
    """How late heading and way are, where both are by one time; None: they are not, or who knows.

    Args:
        setup: of a twin whose pose scans tell; of another nothing is told.
        model: its model, with parameters ``p`` (np,).
        windows: rows, of which the newest are looked at.
    """
    pose = pose_of(setup.spec, model)
    if pose is None or not windows:
        return None
    rows = newest_rows(windows, ROWS)
    found = [seen(setup, model, p, [put_later(one, by) for one in rows]) for by in TRIED]
    columns = [model.outputs.names.index(name) for name in pose]
    turn, way = (_delay(found, some) for some in (columns[2:], columns[:2]))
    if turn is None or way is None:
        return None
    apart, most = abs(turn.seconds - way.seconds), ALIKE * np.hypot(turn.sigma, way.sigma)
    same = apart <= max(most, ROUGH * abs(turn.seconds))
    both = zip((turn, way), SURE, strict=True)
    sure = all(abs(one.seconds) > max(LEAST, times * one.sigma) for one, times in both)
    return (turn, way) if same and sure and turn.left < LEFT else None


def _delay(found: Sequence[Changes], columns: Sequence[int]) -> Delay | None:
    """Where least is left of some outputs, of what is found at each of `TRIED`, whatever their
    gain; None: at neither."""
    sides = [np.stack([one.measured, one.predicted])[:, :, columns] for one in found]
    known = np.isfinite(sides).all(axis=(0, 1, 3))
    measured, predicted = np.moveaxis(np.array(sides)[:, :, known], 1, 0)
    like = np.sum(measured * predicted, axis=(1, 2)) / np.sum(predicted**2, axis=(1, 2))
    sums: Vector = np.sum((measured - like[:, None, None] * predicted) ** 2, axis=(1, 2))
    k, step = int(np.argmin(sums)), float(TRIED[1] - TRIED[0])
    if np.count_nonzero(known) < FEW or k in (0, len(sums) - 1):
        return None
    low, here, high = sums[k - 1 : k + 2]
    bend = (low + high - 2.0 * here) / step**2
    if not bend > 0.0:
        return None
    sigma = float(np.sqrt(2.0 * here / np.count_nonzero(known) / bend))
    none = sums[len(sums) // 2]
    return Delay(float(TRIED[k] + 0.5 * (low - high) / step / bend), sigma, float(here / none))


def said_late(setup: Setup, found: tuple[Delay, Delay]) -> str:
    """What is late, by how much, and what to do."""
    rule, turn = setup.spec.perception, found[0]
    commands = {recorded_as(setup.spec, name) for name in setup.model.inputs.names}
    sources = [one.name for one in setup.spec.source if commands & {*one.channels}]
    scans, told = (rule.scan if rule else ""), " and ".join(sources) or "the commands"
    by, both = turn.seconds, f"heading and way by {scans} come both"  # which knows it far better
    size = f"{abs(by):.2g} s (± {1.96 * turn.sigma:.1g} s)"
    step = f"offset = '{by:.2g} s' in [[source]] of {told} takes it away"
    if by > 0.0:
        drive = "the drive does all later than it is told"
        either = f"either {drive}, or the stamps of {scans} are late"
        return f"{both} {size} after what {told} says: {either} ({step})"
    return f"{both} {size} before what {told} says, as no drive does: stamps are wrong ({step})"
