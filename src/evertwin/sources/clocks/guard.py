"""A guard over one source's clock: what comes out increases strictly, whatever went in.

A repeated stamp is dropped and counted: nobody can say which of the two values is right in time.
A stamp far ahead or behind is *held*: if the rows after it return to the old clock it was one bad
stamp and is dropped; if they go on from it (``confirm`` rows), a step forward is a pause and stays,
while a step back, or one of more than a month forward, is a clock that was set. Then the stamps
after it are moved to follow the last good one behind a gap, because intervals stay true when the
clock does not, and the step is reported. So one absurd stamp can never stop a twin. The first rows
are held in the same way, because a first stamp has no clock before it to be judged by.

>>> import numpy as np
>>> t = np.array([0, 1, 2, 3, 900, 4, 4, 5]) * 10**9
>>> watch = Watch(10**8)
>>> out = watch.take(np.arange(8), t, np.zeros((8, 1))), watch.finish(1)
>>> (np.concatenate([o.t for o in out]) // 10**9).tolist()
[0, 1, 2, 3, 4, 5]
>>> [problem.kind for o in out for problem in o.problems]
['clock_jump', 'repeated']
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.sources.clocks.stamps import NO_STAMP
from evertwin.sources.columns.table import Problem
from evertwin.types import Int64, Outputs, Stamps

_MONTH = 31 * 86_400 * 10**9
_FAR = 2**62
GAP = 10**9
"""Interval that a moved clock leaves behind the last good stamp [ns]."""
CONFIRM = 3
"""Rows that must follow a held one on its own clock before it is believed."""


class Guarded(NamedTuple):
    """Rows that passed, and the problems found up to them.

    >>> Guarded(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 1)), ()).problems
    ()
    """

    line: Stamps
    t: Stamps
    v: Outputs
    problems: tuple[Problem, ...]


Piece = tuple[Stamps, Stamps, Outputs]


def typical(t: Stamps) -> int:
    """The median forward step of the first rows [ns]; a second where there is none.

    >>> typical(np.array([0, 10, 20, 5, 15]))
    10
    """
    steps = np.diff(t[:1000][t[:1000] != NO_STAMP])
    forward = steps[steps > 0]
    return int(np.median(forward)) if len(forward) else 10**9


class _Row(NamedTuple):
    """One row, as slices of length one."""

    line: Stamps
    stamp: Stamps
    v: Outputs

    @property
    def t(self) -> int:
        return int(self.stamp[0])


class Watch:
    """The state along one stream; `take` its pieces in order, then `finish`.

    >>> Watch(step=10**7).jump
    1000000000
    """

    def __init__(self, step: int) -> None:
        self.jump = max(100 * step, 10**9)
        self.last: int | None = None
        self.shift = 0
        self.held: list[_Row] = []
        self.problems: list[Problem] = []
        self.passed: list[Piece] = []

    def take(self, line: Stamps, t: Stamps, v: Outputs) -> Guarded:
        """The rows of one piece: even stretches whole, what is odd row by row."""
        breaks = np.append(self._breaks(t), len(t))
        i = 0
        while i < len(t):
            ahead = None if self.last is None else int(t[i]) + self.shift - self.last
            if not self.held and ahead is not None and 0 < ahead <= self.jump:
                stop = int(breaks[np.searchsorted(breaks, i, side="right")])
                self._pass(line[i:stop], t[i:stop], v[i:stop])
                i = stop
            else:
                self._row(_Row(line[i : i + 1], t[i : i + 1], v[i : i + 1]))
                i += 1
        return self._out(v.shape[1])

    def finish(self, width: int) -> Guarded:
        """The end of the stream."""
        if self.last is None and self.held:
            self._believe()
        self._drop_held()
        return self._out(width)

    def _breaks(self, t: Stamps) -> Int64[np.ndarray, " breaks"]:
        """Rows that do not follow the one before by a credible step."""
        steps = np.diff(t)
        sane = (t > -_FAR) & (t < _FAR)  # beyond, differences would overflow
        good = (steps > 0) & (steps <= self.jump) & sane[1:] & sane[:-1]
        return np.flatnonzero(~good) + 1

    def _row(self, row: _Row) -> None:
        t, line = row.t, int(row.line[0])
        if t == NO_STAMP:
            self.problems.append(Problem("no_stamp", line, "the stamp is empty or absurd"))
            return
        ahead = None if self.last is None else t + self.shift - self.last
        if ahead is not None and 0 < ahead <= self.jump:
            self._drop_held()
            self._pass(*row)
        elif self.held and 0 < t - self.held[-1].t <= self.jump:
            self.held.append(row)
            if len(self.held) > CONFIRM:
                self._believe()
        elif ahead == 0 or (self.held and t == self.held[-1].t):
            self.problems.append(Problem("repeated", line, "the stamp of the row before again"))
        else:
            self._drop_held(t)
            self.held = [row]

    def _pass(self, line: Stamps, t: Stamps, v: Outputs) -> None:
        self.last = int(t[-1]) + self.shift
        self.passed.append((line, t + self.shift, v))

    def _drop_held(self, after: int | None = None) -> None:
        """What is held was wrong; ``after``: the stamp that shows it, where none was good yet."""
        for row in self.held:
            step = 0 if self.last is None else row.t + self.shift - self.last
            if self.last is None and after is not None and after < row.t:
                step = after - row.t
            kind = "backward" if step < 0 else "clock_jump"
            detail = (
                f"a step of {step * 1e-9:.6g} s" if step else "no row after it shares its clock"
            )
            self.problems.append(Problem(kind, int(row.line[0]), detail))
        self.held = []

    def _believe(self) -> None:
        """The held rows are right: a pause, or a clock that was set."""
        first = self.held[0]
        step = 0 if self.last is None else first.t + self.shift - self.last
        if 0 < step <= _MONTH:
            detail = f"{step * 1e-9:.6g} s without a row"
            self.problems.append(Problem("gap", int(first.line[0]), detail))
        elif self.last is not None:
            self.shift = self.last + GAP + 1 - first.t
            detail = f"the clock was set by {step * 1e-9:.6g} s: moved to follow behind a gap"
            self.problems.append(Problem("clock_set", int(first.line[0]), detail))
        held, self.held = self.held, []
        for row in held:
            self._pass(*row)

    def _out(self, width: int) -> Guarded:
        passed, self.passed = self.passed, []
        problems, self.problems = tuple(self.problems), []
        if not passed:
            none = np.zeros(0, dtype=np.int64)
            return Guarded(none, none, np.zeros((0, width)), problems)
        if len(passed) == 1:
            return Guarded(*passed[0], problems)
        line, t, v = (np.concatenate(parts) for parts in zip(*passed, strict=True))
        return Guarded(line, t, v, problems)
