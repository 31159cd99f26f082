"""States of a machine: what comes and goes within seconds, such as a load, and is told by a number.

A state is a cause of its own (``[tuning.causes]``), and its few numbers alone are tuned, whatever
else is editable. It is looked for on rows of the machine as it is now: from the place on from which
the state's numbers predict better than the version does. It is there if numbers learned on one half
of these rows predict the other half, and leave much less there than any other cause so learned.
A version that never held may be wrong from the first row on: beside it a state has to have
come, and what no machine has less of than nothing is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from evertwin.anomaly.verdict import Rule
from evertwin.fold import Mark, Windows
from evertwin.gauges.changes.change import split
from evertwin.models.form import Version
from evertwin.refit.numbers.physical import PASSIVE
from evertwin.refit.rows.state_rows import while_there
from evertwin.rows.ring import called
from evertwin.setup.setup import Setup
from evertwin.signals.units import compatible
from evertwin.tuning import Fit, Problem, solve
from evertwin.types import Float64, Outputs, PerOutput, Vector

ROWS, SECONDS = 5, 1.0
"""Rows for each number, and time [s], that a state is looked for on at least."""
PARTS = (2, 8, 32)
"""Parts of the rows, the newest of which are tried as those of the machine as it is now."""
LEFT = 0.5
"""Part of what the next best cause leaves that a state leaves at most."""
ALL = 0.9
"""Share that a state explains at least which is less than was described."""
BRIEF, SEGMENTS = 3.0, 3
"""Unseen time [s] and segments at least that a state is tried on: it was expected to come."""
PATIENCE = 3
"""Such times after which a state that does not hold is dropped."""
Pose = Callable[[tuple[str, ...], Windows], Problem]
"""The problem of tuning these numbers on these rows, from the version as it is."""


class Stated(NamedTuple):
    """A state that was found.

    >>> Stated._fields
    ('name', 'said', 'values', 'problem', 'fit', 'row')
    """

    name: str
    said: str
    """In a person's words."""
    values: dict[str, float]
    problem: Problem
    """Its numbers on the rows of the machine as it is now."""
    fit: Fit
    row: int
    """First of these rows."""


@dataclass(frozen=True)
class States:
    """The states of a twin, looked for from one version.

    >>> States.__name__
    'States'
    """

    setup: Setup
    version: Version
    pose: Pose
    held: bool = True
    """Has any version held? What is there less is then what was there before."""

    def find(self, windows: Windows) -> Stated | None:
        """The state that came or went, by what the newest rows say; None: there is none."""
        windows = _counting(windows)
        for name in self.setup.spec.tuning.states:
            names = self.setup.causes[name]
            now = self._now(windows, names)
            may_be = now and (self.held or self._came(windows, now, names))
            shares = self._shares(now, names) if may_be else None
            if shares is None:
                continue
            there, others, gone, read = shares
            if there < Rule().enough or 1.0 - there > LEFT * (1.0 - others):
                continue
            if read > there:  # one sensor that reads otherwise explains more: no load does that
                continue
            found = self.known(name, now, gone=gone > there - Rule().part)
            if found is not None and (there >= ALL or not self._is_less(name, found)):
                return found
        return None

    def _is_less(self, name: str, found: Stated) -> bool:
        """Is it less than the machine as it was described? Only then is it a description, a law of
        friction, that may be wrong instead: it has to leave next to nothing."""
        number = self.setup.spec.tuning.states[name].number
        at_rest = self.setup.model.parameters[number].value
        passive = any(compatible(found.problem.parameters[number].unit, one) for one in PASSIVE)
        return passive and found.values[number] < at_rest

    def known(self, name: str, windows: Windows, *, gone: bool = False) -> Stated | None:
        """A state with its numbers by these rows; None: they do not tell that it is another."""
        rule, names = self.setup.spec.tuning.states[name], self.setup.causes[name]
        row, rest = windows[0].row, rests(self.setup, name)
        problem, fit, share = while_there(lambda w: self.pose(names, w), windows, rest, self._off)
        if gone:
            before = amount(self.setup, name, self.version)
            said = f"{rule.over} at {called(row)}{_at(windows)}, after {before}"
            return Stated(name, said, rests(self.setup, name), problem, fit, row)
        (low, high), k = fit.interval(rule.number), fit.names.index(rule.number)
        known, unit = problem.start[k], fit.units[k]
        if fit.verdict[k] != "identifiable" or low <= known <= high:
            return None
        less = fit[rule.number] < 0.0 and any(compatible(unit, one) for one in PASSIVE)
        if less and not self.held:
            return None
        size = f"{abs(fit[rule.number]) if less else fit[rule.number]:.3g}"
        size += f" ± {high - fit[rule.number]:.1g} {unit}{' less than it did' if less else ''}"
        said = f"{rule.says} {size} since {called(row)}{_at(windows)}"
        if share < 1.0:
            said += f", on {100.0 * share:.0f} % of the rows: it comes and goes"
        values = dict(zip(fit.names, fit.values.tolist(), strict=True))
        return Stated(name, said, values, problem, fit, row)

    def _now(self, windows: Windows, names: tuple[str, ...]) -> Windows:
        """The rows from the place on from which the state's numbers predict best; none: too few."""
        whole = self.pose(names, windows)
        start = self._off(whole, whole.start)
        n = place = len(start)
        best = math.inf
        for part in PARTS:
            newest = split(windows, n - n // part)[1]
            if self._enough(newest, names):
                after = self._off(whole, solve(self.pose(names, newest)).values)
                left = float(after.sum()) + np.concatenate([[0.0], np.cumsum(start - after)])
                if left.min() < best:
                    best, place = float(left.min()), int(np.argmin(left))
        now = split(windows, place)[1]
        return now if self._enough(now, names) else ()

    def _came(self, windows: Windows, now: Windows, names: tuple[str, ...]) -> bool:
        """Was the version much less off before?"""
        count = sum(len(block.t) for block in windows) - sum(len(block.t) for block in now)
        before = split(windows, count)[0]
        if not self._enough(before, names):
            return False
        problems = self.pose(names, before), self.pose(names, now)
        off = [float(self._off(one, one.start).sum()) / max(one.rows.used.any(axis=1).sum(), 1)
               for one in problems]  # fmt: skip
        return bool(off[0] <= LEFT * off[1])

    def _enough(self, windows: Windows, names: tuple[str, ...]) -> bool:
        """Do enough of the rows count?"""
        if not windows:
            return False
        rows = self.pose(names, windows).rows
        counts = rows.used.any(axis=1)
        enough = counts.sum() >= ROWS * len(names)
        return bool(enough and rows.dt[counts].sum() >= SECONDS)

    def _halves(self, windows: Windows, names: tuple[str, ...]) -> tuple[Windows, Windows]:
        """As many rows that count in either half."""
        told = np.flatnonzero(self.pose(names, windows).rows.used.any(axis=1))
        return split(windows, int(told[len(told) // 2]))

    def _shares(
        self, windows: Windows, names: tuple[str, ...]
    ) -> tuple[float, float, float, float] | None:
        """Share of the unseen deviation that the state explains, the next best cause, the state as
        it rests, and one sensor; None: there is no deviation."""
        causes = {c: self._there(own) for c, own in self.setup.causes.items()}
        own = dict.fromkeys(names)
        rivals = [c for c in causes.values() if c and not own.keys() >= set(c)]
        left, total, resting = np.zeros(1 + len(rivals)), 0.0, 0.0
        read = np.zeros((2, len(self.setup.model.outputs)))
        halves = self._halves(windows, names)
        for learned, unseen in (halves, halves[::-1]):
            for k, tuned in enumerate((names, *rivals)):
                values = solve(self.pose(tuned, learned)).values
                left[k] += self._off(self.pose(tuned, unseen), values).sum()
            problem = self.pose(names, unseen)
            total += float(self._off(problem, problem.start).sum())
            read += self._read(self.pose(names, learned), problem)
            rest = np.array([self.setup.model.parameters[n].value for n in names])
            resting += float(self._off(problem, rest).sum())
        if not total > 0.0:
            return None
        others = 1.0 - float(left[1:].min()) / total if rivals else 0.0
        parts = 1.0 - np.array([left[0], resting, read.min()]) / total
        return float(parts[0]), max(others, 0.0), float(parts[1]), float(parts[2])

    def _read(self, learned: Problem, unseen: Problem) -> Float64[np.ndarray, "2 ny"]:
        """Squared residual that is left if one sensor reads so many times as much, or so much more,
        by what the learned rows say of it; of each output as that one."""
        (x, y), (x_new, y_new) = (
            (np.where(one.rows.used, one.rows.y - one.residuals(one.start), np.nan), one.rows.y)
            for one in (learned, unseen)
        )
        gain = np.nansum(x * y, axis=0) / np.maximum(np.nansum(x * x, axis=0), 1e-300)
        count = np.maximum(np.isfinite(x).sum(axis=0), 1)
        more = np.nansum(np.where(np.isfinite(x), y - x, np.nan), axis=0) / count
        size = self._size(y_new)
        alone, *read = (
            np.nansum(np.square(y_new - one), axis=0) / size
            for one in (x_new, gain * x_new, x_new + more)
        )
        on = self.setup.watched
        return np.asarray(np.where(on, np.asarray(read) - alone, 0.0) + alone[on].sum())

    def _there(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Of the numbers of a cause those that the version has; all where it has none yet."""
        own = dict(zip(self.version.names, self.version.values, strict=True))
        return tuple(n for n in names if own.get(n)) or names

    def _off(self, problem: Problem, values: Vector) -> Float64[np.ndarray, " n"]:
        """Squared residual of each row, in units of what the twin may be off, (n,)."""
        rows, residual = problem.rows, problem.residuals(values)
        squares = np.where(rows.used, np.square(residual), np.nan) / self._size(rows.y)
        return np.asarray(np.nansum(np.where(self.setup.watched, squares, np.nan), axis=1))

    def _size(self, y: Outputs) -> PerOutput:
        limit = self.setup.requirement if np.isfinite(self.setup.requirement) else 1.0
        size = self.setup.sizes(y)
        return np.asarray(np.square(limit * np.where(size > 0, size, 1.0)))


def _counting(windows: Windows) -> Windows:
    """The rows; those of what acts on the machine at their end count, as it may be the state."""
    last, mark = windows[-1], windows[-1].mark.copy()
    goes_on = np.logical_and.accumulate((mark == Mark.EXTERNAL).any(axis=1)[::-1])[::-1]
    mark[goes_on[:, None] & (mark == Mark.EXTERNAL)] = Mark.OK
    return *windows[:-1], last._replace(mark=mark)


def _at(windows: Windows) -> str:
    """The time of the first row, where stamps are those of a clock that counts from the start."""
    seconds = int(windows[0].t[0]) * 1e-9
    return f" ({seconds:.1f} s)" if 0 <= seconds < 1e8 else ""


def rests(setup: Setup, name: str) -> dict[str, float]:
    """The numbers of a state that is not there."""
    return {n: float(setup.model.parameters[n].value) for n in setup.causes[name]}


def amount(setup: Setup, name: str, version: Version) -> str:
    """The number of a state in a version, with its unit; empty where the state is not there."""
    own = dict(zip(version.names, version.values, strict=True))
    rest, number = rests(setup, name), setup.spec.tuning.states[name].number
    if all(own.get(n, value) == value for n, value in rest.items()):
        return ""
    return f"{own[number]:.3g} {setup.model.parameters[number].unit}"


def tried(
    setup: Setup, evidence: dict[str, Any], gain: float
) -> Literal["promote", "reject"] | None:
    """The verdict on a state from its short test: promote, reject, or None while it goes on.

    >>> from evertwin.config.spec import ModelSpec, TwinSpec
    >>> from evertwin.setup.configured_model import model_of
    >>> spec = TwinSpec("cart", ModelSpec("robot1d"))
    >>> setup = Setup(spec, model_of(spec, None))
    >>> [tried(setup, {"segments": n, "gain": 0.9}, 0.5) for n in (2, 3)]
    [None, 'promote']
    >>> [tried(setup, {"segments": n, "gain": gain}, 0.5) for n, gain in ((3, -0.1), (3, 0.1))]
    ['reject', None]
    """
    least = max(SEGMENTS, math.ceil(BRIEF / setup.trial.horizon - 1e-9))
    if evidence["segments"] >= least and evidence["gain"] >= gain:
        return "promote"
    patience = 1 if evidence["gain"] < 0.0 else PATIENCE  # it does harm: something else it is
    return "reject" if evidence["segments"] >= patience * least else None
