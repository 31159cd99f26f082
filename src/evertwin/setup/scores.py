"""The scores of the loop: one compiled pass over released rows.

For each row: deviations of the champion and of the first champion, all and moving, and the paired
loss of champion and challenger, which is handed on where a segment ends. No figure is of rows in
which something outside acts; a loss is, since it may be a load that is on trial.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.setup.deviation import Usual, count_in, mean_square, new_sums
from evertwin.setup.released import Released
from evertwin.setup.twin_state import Scores
from evertwin.types import Bool, Int64

PARTS = 8
"""Parts of a window at whose ends is kept what its rows come to: a window ends anywhere."""


def new_scores(usual: Usual, updates: np.ndarray, row: int, scale: np.ndarray) -> Scores:
    """Empty scores, as at the start and at each change of champion."""
    outputs = len(usual.samples)
    watch, live, first, live_moving, first_moving = (new_sums(outputs) for _ in range(5))
    return Scores(
        watch, live, first, live_moving, first_moving, updates, row, np.zeros(1, np.int64),
        no_past(outputs), np.zeros(outputs, dtype=np.bool_), np.zeros(3), np.zeros(3), scale, usual,
    )  # fmt: skip


def no_past(outputs: int) -> np.ndarray:
    """Nothing is known of rows before those since the deviation was last judged."""
    past = np.zeros((2, PARTS, 3, outputs))
    past[0, 1:] = np.nan
    return past


def judged_anew(scores: Scores, *, held: bool = False) -> Scores:
    """Scores whose deviation is judged on the rows to come; beside those before, if these were
    within what is asked."""
    outputs = len(scores.watch.samples)
    past = no_past(outputs)
    if held:
        past = scores.past.copy()
        end(tuple(scores.watch), past)
    seen = np.zeros(1, dtype=np.int64)
    return scores._replace(watch=new_sums(outputs), seen=seen, past=past)


class Watch(NamedTuple):
    """When the champion's deviation is judged, and against what.

    >>> Watch(np.array([10]), 5, 3, 0.1, False, np.array([True]), False).limit
    0.1
    """

    beats: Int64[np.ndarray, " beats"]
    """Row numbers before which it is judged."""
    rows: int
    """Rows that have to have come since it was last judged."""
    least: int
    """Samples of an output that it needs; fewer where there are fewer rows."""
    limit: float
    """Largest deviation; infinite: it is never judged."""
    relative: bool
    outputs: Bool[np.ndarray, " ny"]
    """Outputs that are held to it."""
    held: bool
    """Was the champion within it before? Then what cannot be within it any more is told at once; of
    one that never was, the more rows tell the more."""

    def enough(self, scores: Scores) -> bool:
        """Is there enough to judge it?"""
        if max(scores.watch.samples.tolist(), default=0) < min(self.least, self.rows):
            return False
        whole = int(scores.seen[0]) >= self.rows
        early = self.held and exceeds(scores.watch, scores.seen, scores.past, scores.usual, self)
        return whole or bool(early)


@njit(cache=True)
def mark(sums: Any, seen: Any, past: Any, rows: int) -> None:
    """Keeps what the rows of a window come to, where a part of it has just ended."""
    part = min(seen[0] * PARTS // rows, PARTS - 1)
    if past[0, part, 2, 0] != past[0, part, 2, 0]:
        past[0, part, 0], past[0, part, 1], past[0, part, 2] = sums


@njit(cache=True)
def end(sums: Any, past: Any) -> None:
    """The window has ended: what is kept is what came behind each of its parts."""
    residual, measured, samples = sums
    known = PARTS  # the part that ended next
    for part in range(PARTS - 1, -1, -1):
        if past[0, part, 2, 0] == past[0, part, 2, 0]:
            known = part
        past[1, part] = 0.0
        if known < PARTS:
            past[1, part, 0] = residual - past[0, known, 0]
            past[1, part, 1] = measured - past[0, known, 1]
            past[1, part, 2] = samples - past[0, known, 2]
    past[0, 1:] = np.nan


@njit(cache=True)
def exceeds(sums: Any, seen: Any, past: Any, usual: Any, watch: Any) -> bool:
    """Is an output off by more than the limit, and more than noise makes it, over the rows of a
    window: were those perfect that have not come yet, or with those before, if it is now, too?"""
    residual, _, samples = sums
    whole = max(1.0, watch.rows / seen[0])
    part = -(-seen[0] * PARTS // watch.rows)
    for k in range(samples.shape[0]):
        if watch.outputs[k] and samples[k] > 0:
            base = mean_square(k, sums, usual) if watch.relative else 1.0
            limit = max(watch.limit * watch.limit * base, usual[6][k] * usual[6][k])
            if residual[k] > limit * samples[k] * whole:
                return True
            if part < PARTS and past[1, part, 2, k] > 0.0 and residual[k] > limit * samples[k]:
                before = past[1, part]
                rows = seen[0] + watch.rows * (PARTS - part) / PARTS
                more = limit * (samples[k] + before[2, k]) * max(1.0, watch.rows / rows)
                if residual[k] + before[0, k] > more:
                    return True
    return False


@njit(cache=True)
def judged(sums: Any, seen: Any, past: Any, usual: Any, watch: Watch) -> bool:
    """May the twin go on? Then sums that were enough to say so begin anew."""
    residual, measured, samples = sums
    mark(sums, seen, past, watch.rows)
    if samples.max() < min(watch.least, watch.rows) or not np.isfinite(watch.limit):
        return True
    if (watch.held or seen[0] >= watch.rows) and exceeds(sums, seen, past, usual, watch):
        return False
    if seen[0] >= watch.rows:
        end(sums, past)
        residual[:], measured[:], samples[:], seen[:] = 0.0, 0.0, 0, 0
    return True


@njit(cache=True)
def _accumulate(
    number: Any, rows: Any, sums: Any, seen: Any, past: Any, usual: Any, losses: Any, watch: Watch
) -> tuple[int, int, int]:
    measured, live, first, other, moving, end, outside = rows
    pair, back, scale, pairs = losses
    count, beat, earlier = 0, 0, 0
    for i in range(live.shape[0]):
        while beat < watch.beats.shape[0] and watch.beats[beat] <= number[i]:
            if not judged(sums[0], seen, past, usual, watch):
                return count, earlier, beat
            beat += 1
        seen[0] += 1
        for k in range(live.shape[1]):
            y, a, b, c = measured[i, k], live[i, k], first[i, k], other[i, k]
            if a == a and moving[i, k]:
                count_in(k, usual, y)
            usual[4][k] = y
            for s in range(1 if outside[i] else 5):  # what watches forgets a contact
                r = b if s == 2 or s == 4 else a
                if r != r or ((s == 0 or s >= 3) and not moving[i, k]):
                    continue
                sums[s][0][k] += r * r
                sums[s][1][k] += y * y
                sums[s][2][k] += 1
            if a == a and c == c and moving[i, k]:
                pair[0] += (a / scale[k]) * (a / scale[k])
                pair[1] += (c / scale[k]) * (c / scale[k])
                pair[2] += 1.0
            if a == a and b == b and moving[i, k]:
                back[0] += (a / scale[k]) * (a / scale[k])
                back[1] += (b / scale[k]) * (b / scale[k])
                back[2] += 1.0
        if end[i] and pair[2] > 0.0:
            pairs[count, 0] = pair[0] / pair[2]
            pairs[count, 1] = pair[1] / pair[2]
            count += 1
        if end[i] and back[2] > 0.0:
            pairs[earlier, 2] = back[0] / back[2]
            pairs[earlier, 3] = back[1] / back[2]
            pairs[earlier, 4] = number[i]
            earlier += 1
        if end[i]:
            pair[:], back[:] = 0.0, 0.0
    while beat < watch.beats.shape[0]:
        if not judged(sums[0], seen, past, usual, watch):
            return count, earlier, beat
        beat += 1
    return count, earlier, -1


NEVER = Watch(np.zeros(0, np.int64), 1, 1, np.inf, False, np.zeros(0, np.bool_), False)
"""Nothing is judged on the way."""


def accumulate(
    scores: Scores, rows: Released, watch: Watch = NEVER
) -> tuple[Scores, np.ndarray, np.ndarray, int]:
    """The scores with more rows, and the paired losses of the segments that ended, (m, 2): against
    the challenger; against the first champion with the row of the end, (k, 3).

    Consumes ``scores``. A loss is the mean of (residual / scale)² over the segment's moving rows
    and outputs at which both versions have one. Last: the first of ``watch``'s beats at which the
    champion is off by more than its limit, where the rows after it were left; −1: there is none.
    """
    pairs = np.empty((len(rows.end), 5))
    sums = (scores.watch, scores.live, scores.first, scores.live_moving, scores.first_moving)
    count, earlier, stop = _accumulate(
        rows.row, rows[3:], tuple(tuple(s) for s in sums), scores.seen, scores.past,
        tuple(scores.usual), (scores.pair, scores.back, scores.scale, pairs), watch,
    )  # fmt: skip
    against, back = pairs[:count, :2].copy(), pairs[:earlier, 2:].copy()
    return scores, against, back, stop
