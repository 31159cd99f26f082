"""A ladder of terms: parameters join the fit, output by output, while held-out error falls.

Where a term that is not tuned is a zero, the variants of a law are subsets of one model's
parameters. All windows but a fold are solved, the fold is scored, in turn; of a linear model the
rows are summed once per window, and every candidate is a small system. A term stays if the
held-out error of its own output falls by more than `GAIN` and the others' together do not
rise; else it is left out for good. So is one whose number resists, but is tuned to zero or
below, or is told to be ``wrong``: it takes up another effect than the one that its term is called
by. Terms are tried in the
order given. At the end a term whose place a later one has taken, since without it the error rises
by less, leaves again.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.models import Parameters
>>> from evertwin.signals import Layout
>>> class Law:
...     inputs, outputs, states = Layout.of(v="m/s"), Layout.of(force="N"), Layout()
...     parameters = Parameters.of(a=(0.0, "1"), b=(0.0, "1"), c=(0.0, "1"))
...     columns = np.array([[0, 1, 2]])
...     def initial(self, p): return np.zeros(0)
...     def observe(self, x, y): return x
...     def simulate(self, x, u, dt, p): return x, p[0] * u + p[1] * u**2 + p[2] * u**3
...     def regressor(self, x, u, dt, p):
...         return np.zeros((len(u), 1)), np.stack([u, u**2, u**3], axis=2)
>>> rng = np.random.default_rng(0)
>>> def window():
...     v = rng.uniform(-1, 1, (60, 1))
...     return make_block(t=np.arange(60), u=v, y=v + v**2 + rng.normal(0, 0.1, (60, 1)))
>>> problem = Problem(Law(), (window(), window(), window()))
>>> climb_terms(problem, [("square", ("b",), 0), ("cube", ("c",), 0)]).taken
(('square',),)
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from evertwin.errors import UsageError
from evertwin.models import LinearModel
from evertwin.tuning.form.unseen import held_out
from evertwin.tuning.linear.closed import ClosedForm, Sums, summed
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.solver import solve
from evertwin.types import Float64, Vector

Term: TypeAlias = (
    tuple[str, tuple[str, ...], int]
    | tuple[str, tuple[str, ...], int, str, tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]
)
"""(name, parameters that join, output that they are for[, what else its law says of it])."""
Score: TypeAlias = Float64[np.ndarray, " ny"]
Wrong: TypeAlias = Callable[[Mapping[str, float]], Collection[str]]
"""Which of these numbers no machine has."""
GAIN = 0.02
"""Least relative fall of an output's held-out error that counts."""
WORSE = 1.001
"""What the other outputs together may lose."""


@dataclass(frozen=True)
class Step:
    """One term that was tried.

    >>> Step("load", "tau2", 3.4, 1.5, True).taken
    True
    """

    term: str
    output: str
    before: float
    """Held-out rms residual of the output without the term."""
    after: float
    """The same with it; infinite where it cannot be solved for."""
    taken: bool


@dataclass(frozen=True)
class Ascent:
    """Which terms pay.

    >>> Ascent(("Fc1",), ((),), ()).names
    ('Fc1',)
    """

    names: tuple[str, ...]
    """Parameters to tune."""
    taken: tuple[tuple[str, ...], ...]
    """Terms taken, per output."""
    steps: tuple[Step, ...]


class _Folds:
    """Sums of each fold, and of all rows but the fold."""

    def __init__(self, problem: Problem) -> None:
        model = problem.model
        assert isinstance(model, LinearModel)
        self.problem, self.model = problem, model
        _, phi = problem.parts
        r = problem.first
        edges = np.cumsum([0, *(len(window.t) for window in problem.windows)]).tolist()
        folds = [summed(r[a:b], phi[a:b]) for a, b in itertools.pairwise(edges)]
        self.folds = folds
        self.rest = [_added([*folds[:i], *folds[i + 1 :]]) for i in range(len(folds))]

    def score(self, names: tuple[str, ...]) -> Score:
        """Held-out rms residual of each output with only ``names`` tuned, (ny,)."""
        problem, ny = self.problem, len(self.model.columns)
        plan = ClosedForm.of(self.model, names, problem.parameters)
        if problem.scale is not None:
            plan = replace(plan, noise=problem.scale)
        at, start = plan.at, plan.start
        total, count = np.zeros(ny), np.zeros(ny)
        for rest, fold in zip(self.rest, self.folds, strict=True):
            solution = plan.solve_sums(rest)
            if not solution.solved:
                return np.full(ny, np.inf)
            delta = np.where(at < 0, 0.0, (solution.values - start)[at])
            total += _squares(fold, delta)
            count += fold.rows
        return np.asarray(np.sqrt(np.maximum(total, 0.0) / np.maximum(count, 1.0)))

    def values(self, names: tuple[str, ...]) -> Vector:
        """What all rows tune ``names`` to, (k,)."""
        plan = ClosedForm.of(self.model, names, self.problem.parameters)
        return plan.solve_sums(_added(self.folds)).values


class _Refits:
    """The same for outputs that are not linear in their parameters: every fold is a search."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def score(self, names: tuple[str, ...]) -> Score:
        """Held-out rms residual of each output with only ``names`` tuned, (ny,)."""
        return held_out(replace(self.problem, editable=names))

    def values(self, names: tuple[str, ...]) -> Vector:
        """What all rows tune ``names`` to, (k,)."""
        found = solve(replace(self.problem, editable=names))
        known = dict(zip(found.names, found.values.tolist(), strict=True))
        return np.array([known[name] for name in names])


def _added(parts: Sequence[Sums]) -> Sums:
    return Sums(*(np.sum(columns, axis=0) for columns in zip(*parts, strict=True)))


def _squares(sums: Sums, delta: Float64[np.ndarray, "ny m"]) -> Score:
    """Sum of squared residuals of each output when its columns move by ``delta``."""
    lower = np.tril(sums.products)
    full = lower + np.transpose(np.tril(sums.products, -1), (0, 2, 1))
    bent = np.einsum("ka,kab,kb->k", delta, full, delta)
    return np.asarray(sums.squares - 2.0 * np.einsum("ka,ka->k", sums.sides, delta) + bent)


def climb_terms(problem: Problem, terms: Sequence[Term], wrong: Wrong | None = None) -> Ascent:
    """Climbs.

    Args:
        problem: windows, filter and model; its tuned parameters include those of all terms, whose
            start values are zero.
        terms: in the order in which they are tried.
        wrong: asked of the numbers of a term that would pay, with all others that are tuned.

    Raises:
        UsageError: fewer than two windows, or a parameter that does not start at zero.
    """
    for name in (name for _, add, *_ in terms for name in add):
        if problem.parameters[name].value != 0.0:
            raise UsageError(f"ladder of terms: expected {name} to start at zero: it may stay out")
    if len(problem.windows) < 2:
        raise UsageError("ladder of terms: expected at least 2 windows (tasks), got 1")
    rows = (_Folds if problem.linear else _Refits)(problem)
    unknown = partial(_wrong, rows, wrong or (lambda _: ()))
    outputs = problem.model.outputs.names
    optional = {name for _, add, *_ in terms for name in add}
    names = tuple(name for name in problem.names if name not in optional)
    here, steps = rows.score(names), []
    joined: list[Term] = []
    for one in terms:
        output, before = one[2], here
        wider, there = _joining(rows, names, one[1])
        pays = _pays(there, here, output)
        if pays and (turned := unknown(wider, [*joined, one])):
            # what it turned round leaves with it: it has to pay without
            wider = tuple(n for n in wider if not any(n in other[1] for other in turned))
            there = rows.score(wider)
            pays = one not in turned and _pays(there, here, output)
            pays = pays and not unknown(wider, [*joined, one])
            joined = [other for other in joined if not (pays and other in turned)]
        if pays:
            names, here = wider, there
            joined.append(one)
        after = float(there[output])
        steps.append(Step(one[0], outputs[output], float(before[output]), after, pays))
    for one in tuple(joined):
        add, output = one[1:3]
        less = tuple(name for name in names if name not in add)
        rest = [other for other in joined if other is not one]
        if any(other[2] == output for other in rest):
            there = rows.score(less)
            kept = unknown(less, rest)
            if here[output] >= (1.0 - GAIN) * there[output] and not kept:
                names, here, joined = less, there, rest
    taken = tuple(tuple(one[0] for one in joined if one[2] == k) for k in range(len(outputs)))
    return Ascent(names, taken, tuple(steps))


def folded(problem: Problem) -> Score:
    """Held-out rms residual of each output of a linear problem, (ny,), as the ladder counts it."""
    return _Folds(problem).score(problem.names)


def _joining(
    rows: _Folds | _Refits, names: tuple[str, ...], add: Sequence[str]
) -> tuple[tuple[str, ...], Score]:
    wider = tuple(name for name in rows.problem.names if name in names or name in add)
    return wider, rows.score(wider)


def _pays(there: Score, here: Score, output: int) -> bool:
    return bool(there[output] < (1.0 - GAIN) * here[output]) and _together(there, here)


def _wrong(
    rows: _Folds | _Refits, wrong: Wrong, names: tuple[str, ...], joined: Sequence[Term]
) -> list[Term]:
    """Terms that joined with a number below zero that physics knows above it, or one that no
    machine has: what they take up is another effect than the one that they are called by."""
    items = rows.problem.parameters
    asked = {n for _, add, *_ in joined for n in add if n in names}
    if not asked:
        return []
    known = dict(zip(names, rows.values(names).tolist(), strict=True))
    out = {n for n in asked if items[n].resists and known[n] <= 0.0} | set(wrong(known))
    return [one for one in joined if not out.isdisjoint(one[1])]


def _together(there: Score, here: Score) -> bool:
    """True if the outputs as a whole, each relative to its own error, did not get worse."""
    ratio = np.divide(there, here, out=np.ones(len(here)), where=here > 0)
    return bool(np.mean(ratio) < WORSE)
