"""Windows laid end to end: which rows count, and what one filter makes of every side.

A row counts for an output that was measured and trusted there, if its inputs are known and, where
the model has states, past the row that it starts from. What does not count is NaN.

>>> from evertwin.fold import make_block
>>> windows = (make_block(t=[0, 1], u=[[1.0], [2.0]], y=[[3.0], [np.nan]]),)
>>> known(windows, stateful=False).ravel().tolist()
[True, False]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from evertwin.errors import DataError
from evertwin.fold import Block
from evertwin.sync.horizon.horizon import finite, openings, trusted
from evertwin.sync.horizon.horizon_loop import began, counted
from evertwin.tuning.residuals.classes import Classes
from evertwin.types import Bool, Bools, Inputs, Intervals, Outputs

Segments: TypeAlias = tuple[tuple[int, int], ...]
"""[start, stop) of stretches of rows."""
Filter: TypeAlias = Callable[[Any], Any]
"""``filter(columns (n, k)) -> (n, k)``: linear, over the rows of one task."""


@dataclass(frozen=True, eq=False)
class Rows:
    """All windows one after another, prepared once.

    >>> one = np.ones((1, 1))
    >>> Rows(one, np.ones(1), one, one > 0, one > 0, ()).classes.number.tolist()
    [[0]]
    """

    u: Inputs
    dt: Intervals
    y: Outputs
    """Measured outputs, filtered; NaN where they do not count."""
    used: Bool[np.ndarray, "n ny"]
    moving: Bool[np.ndarray, "n ny"]
    """Of the rows that count, those that move; all where the problem does not say."""
    segments: Segments
    """[start, stop) of each stretch that the filter runs over."""

    @cached_property
    def classes(self) -> Classes:
        """Of the inputs, for the question what a residual depends on."""
        return Classes.of(self.u)


def known(windows: Sequence[Block], stateful: bool) -> Bool[np.ndarray, "n ny"]:
    """Where each output counts."""
    return np.asarray(joined([_counts(block, stateful) for block in windows]))


def _counts(block: Block, stateful: bool) -> Bool[np.ndarray, "n ny"]:
    counts = counted(block.u, block.y, block.mark)
    if stateful:
        opens = openings(block)
        counts &= began(opens, ~np.isnan(trusted(block)))
        counts &= ~opens[:, None]
    return np.asarray(counts)


def joined(arrays: Sequence[Any], axis: int = 0) -> Any:
    """Arrays one after another; a single one as it is."""
    return np.ascontiguousarray(arrays[0] if len(arrays) == 1 else np.concatenate(arrays, axis))


def prepared(
    windows: Sequence[Block], stateful: bool, rule: Filter | None
) -> tuple[Outputs, Bool[np.ndarray, "n ny"], Segments]:
    """(filtered outputs, where they count, stretches that a filter may run over).

    Raises:
        DataError: no stretch is long enough for the filter.
    """
    used, y = known(windows, stateful), joined([block.y for block in windows])
    if not used.all():
        y = np.where(used, y, np.nan)
    if rule is None:
        return y, used, ()
    opens = joined([openings(block) for block in windows])
    # A row that is not predicted (the start of a state, an input that is not known) is none to
    # filter over.
    without = opens if stateful else joined([~finite(block.u) for block in windows])
    segments = _segments(opens, without)
    y, segments = _filtered(rule, _bridge(y, segments), segments)
    used &= ~np.isnan(y)
    return np.where(used, y, np.nan), used, segments


def smooth(rule: Filter, columns: Any, segments: Segments) -> Any:
    """``columns`` (n, k) filtered stretch by stretch, the same for every side; NaN between."""
    out = np.full_like(columns, np.nan)
    for a, b in segments:
        out[a:b] = rule(columns[a:b])
    return out


def _filtered(rule: Filter, y: Outputs, segments: Segments) -> tuple[Outputs, Segments]:
    """``y`` filtered, and the stretches that are long enough; the others do not count."""
    out, kept, reason = np.full_like(y, np.nan), [], "there is none"
    for a, b in segments:
        try:
            out[a:b] = rule(y[a:b])
        except ValueError as error:
            reason = f"rows {a} to {b} ({b - a} rows) cannot be filtered: {error}"
            continue
        kept.append((a, b))
    if not kept:
        raise DataError(f"filter: no stretch of rows is long enough; {reason}")
    return out, tuple(kept)


def _segments(opens: Bools, without: Bools) -> Segments:
    """Stretches between openings; an opening row that is ``without`` a prediction is left out."""
    edges = [*np.flatnonzero(opens).tolist(), len(opens)]
    starts = ((a + int(without[a]), b) for a, b in pairwise(edges))
    return tuple((a, b) for a, b in starts if b > a)


def _bridge(y: Outputs, segments: Segments) -> Outputs:
    """Missing values filled by straight lines, so that a filter can run over them."""
    if not np.isnan(y).any():
        return y
    out = y.copy()
    for a, b in segments:
        for k in range(y.shape[1]):
            bad = np.isnan(y[a:b, k])
            if bad.all() or not bad.any():
                continue
            at = np.arange(b - a)
            out[a:b, k] = np.interp(at, at[~bad], y[a:b, k][~bad])
    return out
