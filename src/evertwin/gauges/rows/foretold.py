"""How much of what a static map leaves could have been foretold, by its past or by its inputs.

The noise of an input that counts much, such as an acceleration, which is a derivative, leaves as
much of an output as it would of any form. It has no memory beyond the rows that a filter and a
derivative are computed from, and nothing to do with what the machine did before. What a form lacks
goes on for as long as a motion does, or comes back with it.

>>> rng, t = np.random.default_rng(0), np.arange(2000) * 0.05
>>> seen, lacked = np.sin(t)[:, None], np.cos(3.0 * t) ** 3
>>> whole = np.zeros(2000, dtype=np.int64)
>>> by = Past(seen, whole, 3)
>>> by.share(rng.normal(0.0, 1.0, 2000)), by.share(lacked + rng.normal(0.0, 0.1, 2000)) > 0.9
(0.0, True)
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from evertwin.types import Float64, Inputs, Int64, Vector

SPANS = (1, 2, 4, 8, 16, 32)
"""Newest rows that share no noise with this one, over which the residual's mean is known."""
TIMES = 20
"""Rows for each number that foretells, below which nothing can be said."""
PARTS = 10
"""Parts of the rows, every other of which tells of the rest: all see the same motions."""
WIDE = 4.5
"""Times the median size of a residual, that of 3 standard deviations, at which rows are cut: where
a command steps, a derivative is wrong by more than all else."""
FEW = 6
"""Inputs up to which each two of them are looked at together."""


def clipped(left: Vector) -> Vector:
    """A residual whose few largest rows are cut down.

    >>> clipped(np.array([1.0, -1.0, 1.0, 90.0])).tolist()
    [1.0, -1.0, 1.0, 4.5]
    """
    size = WIDE * float(np.nanmedian(np.abs(left))) if np.isfinite(left).any() else 0.0
    found: Vector = np.clip(left, -size, size)
    return found


class Past(NamedTuple):
    """What a residual may be foretold by."""

    u: Inputs
    """Inputs of the model."""
    window: Int64[np.ndarray, " n"]
    """To which window each row belongs."""
    reach: int
    """Rows apart from which on two rows share no noise."""

    def share(self, left: Vector) -> float:
        """Share of the mean square that is foretold on rows that nothing was learned from, the few
        largest of which would hide what is; 1: there are too few to say.

        Args:
            left: residual of an output, NaN where it is not known.
        """
        bulk, inputs = clipped(left), self._inputs()
        part = float(np.nansum(np.square(bulk)) / max(np.nansum(np.square(left)), 1e-300))
        return max(self._share(left, inputs), part * self._share(bulk, inputs))

    def _share(self, left: Vector, inputs: Float64[np.ndarray, "rows columns"]) -> float:
        known = np.isfinite(left)
        y, part = left[known], np.arange(known.sum()) * PARTS // max(known.sum(), 1) % 2 == 0
        found = [0.0]
        for by in (self._residuals(left)[known], inputs[known]):
            if min(part.sum(), (~part).sum()) < TIMES * by.shape[1]:
                return 1.0
            lost = 0.0
            for mine in (part, ~part):
                weights = np.linalg.lstsq(by[~mine], y[~mine], rcond=1e-9)[0]
                lost += float(np.sum(np.square(y[mine] - by[mine] @ weights)))
            found.append(1.0 - lost / max(float(np.sum(np.square(y))), 1e-300))
        return max(found)

    def _before(self, columns: np.ndarray, rows: int) -> np.ndarray:
        """So many rows before, of the same window; 0 where there is none."""
        found = np.zeros_like(columns)
        found[rows:] = columns[:-rows]
        found[rows:][self.window[rows:] != self.window[:-rows]] = 0.0
        return found

    def _residuals(self, left: Vector) -> Float64[np.ndarray, "n spans"]:
        sums = np.cumsum(np.nan_to_num(left))
        means = [(sums - np.pad(sums, (span, 0))[: len(sums)]) / span for span in SPANS]
        return self._before(np.stack(means, axis=1), self.reach)

    def _inputs(self) -> Float64[np.ndarray, "n k"]:
        u = np.nan_to_num(
            (self.u - np.nanmean(self.u, axis=0)) / (np.nanstd(self.u, axis=0) + 1e-300)
        )
        sign = np.sign(np.nan_to_num(self.u))
        before = self._before(np.column_stack([u, np.abs(u), sign]), self.reach)
        pairs = combinations(u.T, 2) if u.shape[1] <= FEW else ()
        return np.column_stack([np.ones(len(u)), before, *(a * b for a, b in pairs)])
