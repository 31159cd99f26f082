"""Has the level of a residual risen, whatever it is?

A residual that is never calm, because the form is wrong or more is asked than it reaches, gives no
limit; how much there is of it is known all the same. Counted is how many predictions, each over its
horizon, are off by more than a fifth of those before were: Page's cumulative sum of a share that is
three times as large, divided by how many neighbours are alike. What they are off by may be spread
as it likes, and one that is far off counts as one. Where the level fell it is learned anew, in
silence.

E. S. Page, "Continuous inspection schemes", Biometrika 41 (1954).

>>> level, rng = Level(("x",), (0,)), np.random.default_rng(0)
>>> off = rng.normal(size=(1000, 1)) * np.where(np.arange(1000) < 700, 1.0, 2.0)[:, None]
>>> ends, moving = np.arange(1000) % 10 == 9, np.ones((1000, 1), dtype=np.bool_)
>>> state, risen = level.step(level.init(), np.arange(1000), off, moving, ends)
>>> [(one.name, one.first, one.row) for one in risen]
[('x', 690, 789)]
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import copied, ordered
from evertwin.signals import Layout
from evertwin.types import Bool, Bools, Int64, Outputs

RARE, OFTEN = 0.2, 0.6
"""Share of the predictions that are farther off than what is usual, before and after a rise."""
LIMIT = 10.0
"""Sum from which on it has risen: ten predictions in a row, of neighbours that are not alike."""
LEAST, KEPT = 30, 200
"""Predictions that tell a level at least, of those that are not alike, and at most."""
SUM, ROWS, COUNT, UP, SINCE, DOWN, BELOW, FIRST, BEGAN, HEAD = range(10)
"""Of the running prediction: sum of squares, rows, first row; of those that are kept: their number;
the sums for more and for less, how many came since each left zero, and the first row of those."""


class Rise(NamedTuple):
    """An output is off by more than it was.

    >>> Rise(59, 40, "x", 2.0).row
    59
    """

    row: int = 0
    """At which it is known."""
    first: int = 0
    """From which on it is."""
    name: str = ""
    """Empty: none is."""
    times: float = 1.0
    """Rms since then over that before."""
    beyond: float = 1.0
    """The same over that of the fifth of the predictions before that were farthest off."""


@dataclass(frozen=True)
class Level:
    """Watches the level of residuals; its state is changed in place.

    >>> Level(("x", "y"), (0, 0)).init().shape
    (1, 209)
    """

    names: tuple[str, ...]
    """Of the outputs."""
    groups: tuple[int, ...]
    """Of each output: those of one group are summed, as x and y are off by turns; −1: left out."""

    @classmethod
    def of(cls, outputs: Layout, watched: Bool[np.ndarray, " ny"]) -> Level:
        """Outputs that are adopted together and have one unit are one group."""
        kinds = [(one.group, one.unit) for one in outputs]
        known = list(dict.fromkeys(kinds[k] for k in np.flatnonzero(watched).tolist()))
        groups = (known.index(kinds[k]) if on else -1 for k, on in enumerate(watched))
        return cls(outputs.names, tuple(groups))

    def init(self) -> np.ndarray:
        """Nothing is known of any level."""
        return np.zeros((max(self.groups, default=-1) + 1, HEAD + KEPT))

    def step(
        self, state: np.ndarray, row: Int64[np.ndarray, " n"], off: Outputs,
        moving: Bool[np.ndarray, "n ny"], ends: Bools,
    ) -> tuple[np.ndarray, tuple[Rise, ...]]:  # fmt: skip
        """More rows: residuals (n, ny), which of them count, and where predictions end."""
        found = np.zeros((len(row) * len(state), 5))
        count = _step(state, np.array(self.groups), (row, off, moving, ends), found)
        return state, tuple(
            Rise(int(at), int(first), self.names[self.groups.index(int(g))], times, beyond)
            for at, first, g, times, beyond in found[:count].tolist()
        )

    def handed_on(self, state: np.ndarray, rows: int) -> np.ndarray:
        """The state of a run of so many ``rows``, as that of the run after it."""
        state[:, [FIRST, BEGAN]] -= rows
        return state


@njit(cache=True)
def _step(state: Any, groups: Any, rows: Any, found: Any) -> int:
    number, off, moving, ends = rows
    count = 0
    for i in range(off.shape[0]):
        for k in range(off.shape[1]):
            r = off[i, k]
            if groups[k] >= 0 and r == r and moving[i, k]:
                one = state[groups[k]]
                if one[ROWS] == 0.0:
                    one[FIRST] = number[i]
                one[SUM] += r * r
                one[ROWS] += 1.0
        if not ends[i]:
            continue
        for g in range(state.shape[0]):
            one = state[g]
            if one[ROWS] == 0.0:
                continue
            times, beyond = _rises(one[:HEAD], one[HEAD:], one[SUM] / one[ROWS])
            one[SUM], one[ROWS] = 0.0, 0.0
            if times > 0.0:
                row = found[count]
                row[0], row[1], row[2] = float(number[i]), one[BEGAN], float(g)
                row[3], row[4] = times, beyond
                count += 1
    return count


@njit(cache=True)
def _mean(values: Any) -> float:
    total = 0.0
    for value in values:
        total += value
    return total / len(values)


@njit(cache=True)
def _alike(kept: Any, high: float) -> float:
    """How many neighbours tell as much as one that stands alone: the mean length of runs above
    ``high``, by that of values that do not depend on each other."""
    above, runs = 0, 0
    for i in range(kept.shape[0]):
        if kept[i] > high:
            above += 1
            runs += 1 if i == 0 or kept[i - 1] <= high else 0
    return max(above * (1.0 - RARE) / max(runs, 1), 1.0)


@njit(cache=True)
def _rises(one: Any, kept: Any, mean: float) -> tuple[float, float]:
    """One more mean square: how many times the rms has risen, by all before and by the farthest of
    them; 0: it has not."""
    n, times, beyond = int(one[COUNT]), 0.0, 0.0
    behind = n - int(max(one[SINCE], one[BELOW]))
    high = low = math.nan
    alike = 1.0
    if behind >= LEAST:
        usual = ordered(kept[:behind])
        high, low = usual[int((1.0 - RARE) * behind)], usual[int(RARE * behind)]
        alike = _alike(kept[:behind], high)
    if behind < LEAST * alike:  # it came so slowly that it is what is usual, or little is known yet
        one[UP], one[SINCE], one[DOWN], one[BELOW] = 0.0, 0.0, 0.0, 0.0
    else:
        more, less = math.log(OFTEN / RARE) / alike, math.log((1.0 - OFTEN) / (1.0 - RARE)) / alike
        if one[UP] == 0.0:
            one[BEGAN] = one[FIRST]
        one[UP] = max(one[UP] + (more if mean > high else less), 0.0)
        one[DOWN] = max(one[DOWN] + (more if mean < low else less), 0.0)
        one[SINCE] = one[SINCE] + 1.0 if one[UP] > 0.0 else 0.0
        one[BELOW] = one[BELOW] + 1.0 if one[DOWN] > 0.0 else 0.0
    if n == len(kept):  # the oldest one goes
        copied(kept[:-1], kept[1:])
        n -= 1
    kept[n] = mean
    one[COUNT] = n + 1.0
    if max(one[UP], one[DOWN]) > LIMIT:
        rose = one[UP] > LIMIT
        new = int(one[SINCE] if rose else one[BELOW])
        if rose:
            now, before = _mean(kept[n + 1 - new : n + 1]), ordered(kept[: n + 1 - new])
            times = math.sqrt(now / _mean(before))
            beyond = math.sqrt(now / _mean(before[int((1.0 - RARE) * len(before)) :]))
        copied(kept[:new], kept[n + 1 - new : n + 1])
        one[COUNT], one[UP], one[SINCE], one[DOWN], one[BELOW] = new, 0.0, 0.0, 0.0, 0.0
    return times, beyond
