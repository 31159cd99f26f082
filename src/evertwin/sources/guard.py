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
>>> pieces = [(np.arange(8), t, np.zeros((8, 1)))]
>>> out = list(guard(iter(pieces), Rules(jump=10 * 10**9)))
>>> (np.concatenate([o.t for o in out]) // 10**9).tolist()
[0, 1, 2, 3, 4, 5]
>>> [problem.kind for o in out for problem in o.problems]
['clock_jump', 'repeated']
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.sources.stamps import NO_STAMP
from evertwin.sources.table import Problem
from evertwin.types import Outputs, Stamps

__all__ = ["Guarded", "Rules", "guard"]

_MONTH = 31 * 86_400 * 10**9
_CENTURY = 100 * 366 * 86_400 * 10**9


@dataclass(frozen=True)
class Rules:
    """When a step of the clock is looked at twice, all in nanoseconds.

    >>> Rules().confirm
    3
    """

    jump: int = 0
    """Forward step that is held; 0: a hundred typical steps, at least one second."""
    gap: int = 10**9
    """Interval that a moved clock leaves behind the last good stamp."""
    confirm: int = 3
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


def guard(pieces: Iterable[Piece], rules: Rules) -> Iterator[Guarded]:
    """Pieces (line, t, v) of one source, cleaned. Where they are cut does not matter."""
    clock: _Clock | None = None
    width = 0
    for line, t, v in pieces:
        width = v.shape[1]
        if clock is None:
            clock = _Clock(rules, _typical(t))
        yield clock.take(line, t, v)
    if clock is not None and clock.held:
        yield clock.finish(width)


def _typical(t: Stamps) -> int:
    """The median forward step of the first rows [ns]."""
    steps = np.diff(t[:1000][t[:1000] != NO_STAMP])
    forward = steps[steps > 0]
    return int(np.median(forward)) if len(forward) else 10**9


class _Row(NamedTuple):
    line: int
    t: int
    v: Outputs


class _Clock:
    """The state along one stream."""

    def __init__(self, rules: Rules, step: int) -> None:
        self.jump = rules.jump or max(100 * step, 10**9)
        self.rules = rules
        self.last: int | None = None
        self.shift = 0
        self.held: list[_Row] = []
        self.problems: list[Problem] = []
        self.passed: list[_Row] = []

    def take(self, line: Stamps, t: Stamps, v: Outputs) -> Guarded:
        if self._plain(t):
            self.last = int(t[-1]) + self.shift
            return Guarded(line, t + self.shift, v, ())
        for i in range(len(t)):
            self._row(_Row(int(line[i]), int(t[i]), v[i]))
        return self._out(v.shape[1])

    def finish(self, width: int) -> Guarded:
        if self.last is None:
            self._believe()
        self._drop_held()
        return self._out(width)

    def _plain(self, t: Stamps) -> bool:
        """True when nothing is held and every step is a credible one: the fast way."""
        if self.held or len(t) == 0 or t.min() == NO_STAMP:
            return False
        if int(t.max()) - int(t.min()) > _CENTURY:
            return False
        steps = np.diff(t)
        if len(steps) and not (steps.min() > 0 and steps.max() <= self.jump):
            return False
        if self.last is None:
            return len(t) > self.rules.confirm
        return 0 < int(t[0]) + self.shift - self.last <= self.jump

    def _row(self, row: _Row) -> None:
        if row.t == NO_STAMP:
            self.problems.append(Problem("no_stamp", row.line, "the stamp is empty or absurd"))
            return
        ahead = None if self.last is None else row.t + self.shift - self.last
        if ahead is not None and 0 < ahead <= self.jump:
            self._drop_held()
            self._pass(row)
        elif self.held and 0 < row.t - self.held[-1].t <= self.jump:
            self.held.append(row)
            if len(self.held) > self.rules.confirm:
                self._believe()
        elif ahead == 0 or (self.held and row.t == self.held[-1].t):
            self.problems.append(Problem("repeated", row.line, "the stamp of the row before again"))
        else:
            self._drop_held()
            self.held = [row]

    def _pass(self, row: _Row) -> None:
        self.last = row.t + self.shift
        self.passed.append(_Row(row.line, self.last, row.v))

    def _drop_held(self) -> None:
        for row in self.held:
            step = 0 if self.last is None else row.t + self.shift - self.last
            kind = "backward" if step < 0 else "clock_jump"
            detail = (
                f"a step of {step * 1e-9:.6g} s" if step else "no row after it shares its clock"
            )
            self.problems.append(Problem(kind, row.line, detail))
        self.held = []

    def _believe(self) -> None:
        """The held rows are right: a pause, or a clock that was set."""
        first = self.held[0]
        step = 0 if self.last is None else first.t + self.shift - self.last
        if 0 < step <= _MONTH:
            self.problems.append(Problem("gap", first.line, f"{step * 1e-9:.6g} s without a row"))
        elif self.last is not None:
            self.shift = self.last + self.rules.gap + 1 - first.t
            detail = f"the clock was set by {step * 1e-9:.6g} s: moved to follow behind a gap"
            self.problems.append(Problem("clock_set", first.line, detail))
        held, self.held = self.held, []
        for row in held:
            self._pass(row)

    def _out(self, width: int) -> Guarded:
        rows, self.passed = self.passed, []
        problems, self.problems = tuple(self.problems), []
        line = np.array([row.line for row in rows], dtype=np.int64)
        t = np.array([row.t for row in rows], dtype=np.int64)
        v = np.array([row.v for row in rows], dtype=np.float64).reshape(len(rows), width)
        return Guarded(line, t, v, problems)
