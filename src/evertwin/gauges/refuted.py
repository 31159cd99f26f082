"""Is a channel, which was said to be read wrongly, read rightly after all, by later rows alone?

A twin that never held is in doubt until somebody says what it was, unless later rows say so: read
as it was said to be, they would be far worse off than as they were recorded.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evertwin.fold import Windows
from evertwin.gauges.changes.change import split
from evertwin.gauges.rows.gauge_rows import FAR, LEAST, unchanged
from evertwin.gauges.rows.reading import possible
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.gauges.shifts.constant import STEP
from evertwin.gauges.shifts.off_by import Column, left_with
from evertwin.gauges.units.turned import Numbered, turned
from evertwin.setup.setup import Setup
from evertwin.setup.task import Doubt
from evertwin.signals.sizes import rms
from evertwin.tuning import Problem
from evertwin.types import Outputs

CLEARLY = 2.0
"""So many times the squared deviation each such reading has to leave."""


HALF = 0.5
"""Share of the squared deviation that a constant, or a share, leaves at most if it is there."""
ROUNDS = 2
"""Steps to a constant."""
MOVES = 0.3
"""How far what stayed goes, at least [of how far it went before]."""
SHORT = 3
"""Rows of a prediction, at least."""
SCALED = (False, True)
"""A constant, and a share."""


@unmeasured()
def refuted(
    setup: Setup, pose: Callable[[Windows], Problem], rows: tuple[Windows, Windows], doubt: Doubt
) -> bool:
    """Would every reading of a channel by such a number leave clearly more than none does; does no
    constant explain what is off; or does what stayed where it was move as it did?

    Args:
        setup: of the twin.
        pose: the version as it is, on some rows.
        rows: those that are kept from before, and those that are looked at; of these the newest
            that came after it was said tell.
        doubt: channel, and recorded over what fits.
    """
    place = sum(min(max(doubt.row - one.row, 0), len(one.t)) for one in rows[1])
    before, windows = split(rows[1], place)
    count = sum(len(one.t) for one in windows)
    windows, earlier = split(windows, max(count - setup.enough, 0))[1], (*rows[0], *before)
    if not windows:
        return False
    (name, number, _), model, whole = doubt, setup.model, pose(windows)
    off = unchanged(whole)
    size, nu = rms(off), len(model.inputs)
    few = np.isfinite(off).any(axis=1).sum() < LEAST
    if few or not set(model.states.names) <= set(model.outputs.names):
        return False  # what is hidden is known from before alone
    angle = turned(setup, [Numbered(whole.model, whole.full(whole.start))], windows)
    if angle and (angle.channel, angle.number) == (name, number):
        return False
    names = [c.name for c in (*model.inputs, *model.outputs)]
    if number == 0.0:
        k = names.index(name)
        return _moves(setup, windows, k) >= MOVES * _moves(setup, earlier, k) > 0.0
    shares = list[float]()
    for one in possible(setup, model):
        if name not in one.channels or not np.isclose(one.number, number, rtol=1e-3):
            continue
        factors = np.where(model.outputs.angles, 1.0, one.factors[nu:])
        left = unchanged(pose(tuple(one.undone(window) for window in windows))) / factors
        left = np.where(np.isfinite(off) & ~np.isfinite(left), FAR * size, left)
        shares.append(_share(off, left))
    if number != 1.0:
        return bool(shares) and min(shares) > CLEARLY
    k = names.index(name)
    return min(*shares, *(_constant(setup, pose, windows, (k, s)) for s in SCALED)) > HALF


def _moves(setup: Setup, windows: Windows, k: int) -> float:
    """How far a channel usually goes within a prediction, from a model with states; an input, which
    may be held for longer, within all rows."""
    nu = len(setup.model.inputs)
    spans = list[float]()
    for window in windows:
        values = window.u[:, k] if k < nu else window.y[:, k - nu]
        dt = float(np.median(window.dt))
        ahead = np.isfinite(setup.horizon) and dt > 0.0 and k >= nu
        wide = max(round(setup.horizon / dt), SHORT) if ahead else len(values)
        parts = np.array_split(values, max(len(values) // max(wide, 1), 1))
        spans += [float(np.nanstd(part)) for part in parts]
    return float(np.nanmedian(spans)) if spans else 0.0


def _constant(
    setup: Setup, pose: Callable[[Windows], Problem], windows: Windows, one: Column
) -> float:
    """Share of the squared deviation that the best constant, or share, of a column leaves."""

    def left(by: float) -> Outputs:
        return left_with(setup, pose, windows, one, np.full(len(column), by))

    sides = [np.concatenate([window.u, window.y], axis=1) for window in windows]
    column = np.concatenate(sides)[:, one[0]]
    here, shift = left(0.0), 0.0
    size, first = rms(here), here
    step = STEP if one[1] else STEP * max(float(np.nanmax(np.abs(column))), 1e-300)
    for _ in range(ROUNDS):
        slope, off = (left(shift + step) - here) / step / size, here / size
        known = np.isfinite(slope) & np.isfinite(off)
        power = float(np.sum(slope[known] ** 2))
        shift -= float(np.sum(slope[known] * off[known])) / power if power > 0.0 else 0.0
        here = left(shift)
    return _share(first, here)


def _share(before: Outputs, left: Outputs) -> float:
    """Share of the squared deviation that is left, each output by how far it is moved: those that
    are not tell nothing, however many there are."""
    size = rms(before)
    moved = np.nansum(np.square((left - before) / size), axis=0)
    shares = np.nansum(np.square(left / size), axis=0) / np.nansum(np.square(before / size), axis=0)
    known = (moved > 0.0) & np.isfinite(shares)
    return float(np.average(shares[known], weights=moved[known])) if known.any() else 1.0
