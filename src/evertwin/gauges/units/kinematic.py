"""A position and its speed, both recorded: one that is read otherwise contradicts the other."""

from __future__ import annotations

import numpy as np

from evertwin.anomaly.kinematics import FEWEST, STRETCH
from evertwin.fold import Windows
from evertwin.gauges.changes.change import split
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.gauges.rows.sensor_change import SensorChange
from evertwin.rows.ring import called
from evertwin.setup.setup import Setup
from evertwin.types import Vector

MOVES = 10
"""Stretches at least that tell whether the two say the same."""
FEW = 3
"""The same of one that is compared with what it was."""
LITTLE = 0.03
"""Share by which one may go on from what it was beside the other."""
SURE = 5.0
"""So many standard errors it has to be."""
SIGMA = 1.4826
"""Standard deviation of a normal law over the median of its distances from the middle."""


def contradicted(setup: Setup, windows: Windows, rows: tuple[int, int], factors: Vector) -> bool:
    """Do a position and its speed say the same as they were recorded, and less so under a reading?

    Args:
        setup: of the twin; its pairs are among the inputs.
        windows: rows of the recording.
        rows: first of those that are read otherwise, and the one after the last.
        factors: what each input is multiplied by under the reading, (nu,).
    """
    for position, speed, angle in setup.kinematics.columns:
        if factors[position] == factors[speed]:
            continue
        ways = [_ways(setup, w.u[:, [position, speed]], w.dt, bool(angle))
                for w in split(split(windows, rows[1])[0], rows[0])[1]]  # fmt: skip
        if sum(len(one) for one in ways) < MOVES:
            continue
        went, said = np.concatenate(ways).T
        recorded = _apart(went, said)
        if recorded < _apart(went * factors[position], said * factors[speed]):
            return True
    return False


def apart(rows: Rows) -> SensorChange | None:
    """That a speed is not what it was beside its position since a machine that held is off by more:
    no machine does that; None: it is."""
    early, late = split(rows.windows, rows.since)
    for position, speed, angle in rows.setup.kinematics.columns:
        (was, about), (now, sure) = (
            _share(rows.setup, some, position, speed, angle=bool(angle))
            for some in ((*rows.earlier, *early), late)
        )
        if not abs(was) > SURE * about:  # it stood, but for noise: the position told nothing of it
            continue
        change = now / was
        if abs(now - was) > max(LITTLE * abs(was), SURE * float(np.hypot(about * change, sure))):
            names, row = rows.setup.model.inputs.names, rows.row(rows.since)
            return SensorChange(names[speed], change, (
                f"{names[speed]} is {change:.3g} times what it was beside the way that "
                f"{names[position]} goes, from {called(row)} on: one of the two is read otherwise "
                "than before, whatever the machine does; nothing is learned from them"
            ), None, row)  # fmt: skip
    return None


def _share(
    setup: Setup, windows: Windows, position: int, speed: int, *, angle: bool
) -> tuple[float, float]:
    """The way by the speed, of that by the position, and its standard error, by medians; NaN: too
    few move."""
    ways = [_ways(setup, w.u[:, [position, speed]], w.dt, angle) for w in windows]
    went, said = np.concatenate([np.zeros((0, 2)), *ways]).T
    size = np.abs(went)
    if len(went) < FEW or not size.any():
        return np.nan, np.nan
    weight, of = size[size > 0.0] / size.sum(), said[size > 0.0] / went[size > 0.0]
    share = _middle(of, weight)  # one sample that is none (all zeros, say) tells nothing of it
    spread = SIGMA * _middle(np.abs(of - share), weight)
    return share, spread * float(np.linalg.norm(weight)) * np.sqrt(0.5 * np.pi)


def _middle(values: Vector, weight: Vector) -> float:
    """Weighted median; the weights add up to one."""
    order = np.argsort(values)
    return float(values[order][np.searchsorted(np.cumsum(weight[order]), 0.5 - 1e-12)])


def _ways(setup: Setup, u: np.ndarray, dt: Vector, angle: bool) -> np.ndarray:
    """Of each stretch: how far the position went, and how far by the speed, (n, 2)."""
    wide = max(FEWEST, round(STRETCH * setup.kinematics.rate))
    ends = np.arange(0, len(u), wide)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (u[1:, 1] + u[:-1, 1]) * dt[1:])])
    went = np.diff(np.unwrap(u[:, 0])[ends] if angle else u[ends, 0])
    found = np.stack([went, np.diff(way[ends])], axis=1)
    return np.asarray(found[np.isfinite(found).all(axis=1)])


def _apart(went: Vector, said: Vector) -> float:
    """How far the two are from each other, of how far they go."""
    return float(np.abs(went - said).sum() / max(np.abs(went).sum() + np.abs(said).sum(), 1e-300))
