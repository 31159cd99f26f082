"""A channel that is off by a constant or by a share of what it is read, row by row.

What it is off by is taken off the rows, and what the version as it is leaves of them is told in
what was recorded. A share is one of what the channel records beyond its zero: of a temperature in
degrees Celsius beyond 273.15 K.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from evertwin.fold import Block, Windows
from evertwin.gauges.rows.gauge_rows import Rows, unchanged, zero_of
from evertwin.setup.setup import Setup
from evertwin.tuning import Problem
from evertwin.types import Bools, Float64, Outputs, Vector

STEPS = 8
"""Steps towards what it is off by, at most."""
CLOSE = 1e-3
"""Part of it that a step moves where it is the last."""
SHARE = 0.1
"""What a share is tried with."""

Column: TypeAlias = tuple[int, bool]
"""Which column of inputs and outputs, and whether it is off by a share."""


def undone(setup: Setup, windows: Windows, one: Column, by: Vector) -> Windows:
    """The rows without what a column is off ``by``, in SI or as a share, (n,)."""
    (k, scaled), nu, zero = one, len(setup.model.inputs), zero_of(setup, one[0])
    found, at = list[Block](), 0
    for window in windows:
        own = by[at : at + len(window.t)]
        side, column = (window.u.copy(), k) if k < nu else (window.y.copy(), k - nu)
        read = side[:, column]
        true = zero + (read - zero) / (1.0 + own) if scaled else read - own
        side[:, column] = np.where(own == 0.0, read, true)
        at += len(own)
        found.append(window._replace(u=side) if k < nu else window._replace(y=side))
    return tuple(found)


def recorded(setup: Setup, left: Outputs, one: Column, by: Vector) -> Outputs:
    """A residual of such rows, (n, ny), in what was recorded."""
    (k, scaled), nu = one, len(setup.model.inputs)
    if scaled and k >= nu:
        left = left.copy()
        left[:, k - nu] *= 1.0 + by
    return left


def left_with(
    setup: Setup, pose: Callable[[Windows], Problem], windows: Windows, one: Column, by: Vector
) -> Outputs:
    """What the version as it is leaves of such rows, in what was recorded, (n, ny)."""
    return recorded(setup, unchanged(pose(undone(setup, windows, one, by))), one, by)


def learned(
    rows: Rows, one: Column, lines: Float64[np.ndarray, "n k"], seen: Bools | None = None
) -> tuple[Float64[np.ndarray, " n"], Outputs, Float64[np.ndarray, "n ny k"]] | None:
    """What a column has to be off by for the version as it is to leave least, a sum of ``lines``,
    (n,); what it leaves, (n, ny), and how that goes with each line there; None: by nothing that a
    sensor can be off by. Of rows that are ``seen``, (n,), alone."""
    (k, scaled), nu = one, len(rows.setup.model.inputs)
    step = float(np.nanstd(rows.values[:, k])) if k < nu else 5.0 * float(rows.sizes[k - nu])
    step = SHARE if scaled else step
    if not step > 0.0:
        return None

    def left(by: Vector) -> Outputs:
        return left_with(rows.setup, rows.posed, rows.windows, one, by)

    on, by, here = lines.any(axis=1), np.zeros(rows.count), rows.before
    for _ in range(STEPS):
        slope = (left(by + np.where(on, step, 0.0)) - here) / step
        columns = slope[:, :, None] * lines[:, None, :]
        more = lines @ rows.least(columns, here, seen)
        by = by + more
        if scaled and (by <= -1.0 + SHARE).any():
            return None
        here = left(by)
        if np.abs(more).max() <= CLOSE * np.abs(by).max():
            break
    return by, here, columns
