"""Which friction law: terms join the fit, output by output, while held-out error falls.

A model with a ladder has ``rungs()`` (terms that start at zero) and names the law that an output
stands on. The twin file says in which order terms are tried (``[tuning] ladder``).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np

from evertwin.config import TwinSpec
from evertwin.errors import ConfigError, nearest
from evertwin.fold import Block, take
from evertwin.machines.friction import Rung
from evertwin.machines.friction.resisting import Resisting, pushes
from evertwin.models import Model
from evertwin.setup.setup import Setup
from evertwin.setup.windows import apart
from evertwin.tuning import Fit, Problem
from evertwin.tuning.form.unseen import held_out, on
from evertwin.tuning.tangent import Inside, searched
from evertwin.tuning.terms import GAIN, climb_terms, folded
from evertwin.types import PerOutput

ENOUGH = 1000
"""Rows of a task that are asked whether friction resists."""
FASTEST = 0.99
"""Quantile of a drive's speeds that stands for its fastest."""
SHARES = np.geomspace(0.01, 0.5, 12)
"""Of the fastest speed, at which what is within a term may fall."""
CREEPS = 10.0
"""Widths of a switch (that stands where nobody says it) below which a drive's fastest speed is a
creep."""
PARTS = 4
"""Parts that a single task is cut into."""
MOST = 2 / 3
"""Share of the rows from which on a task is cut as if it were the only one."""


@runtime_checkable
class Laddered(Protocol):
    """A model whose law has terms that may stay out.

    >>> from evertwin.machines.drive import DriveForce
    >>> isinstance(DriveForce("sign+direction"), Laddered)
    True
    """

    def rungs(self) -> tuple[Rung, ...]:
        """Terms that may join, each for one output."""
        ...

    def law_name(self, output: int, terms: Sequence[str]) -> str:
        """The law of an output that has these of its terms."""
        ...


Speeds: TypeAlias = tuple[tuple[str, float], ...]
"""Names of speeds inside of a law, each with what it is where nobody says."""


class Chosen(NamedTuple):
    """What the ladder has found, by joint (or output, without joints).

    >>> dict(Chosen().laws)
    {}
    """

    laws: Mapping[str, str] = MappingProxyType({})
    """The friction law."""
    causes: Mapping[str, str] = MappingProxyType({})
    """What its terms mean; without those that have none."""
    taken: tuple[tuple[str, ...], ...] = ()
    """Terms that joined, per output."""

    @property
    def said(self) -> str:
        """The causes, to be put behind a sentence."""
        return "".join(f"; {name} {cause}" for name, cause in self.causes.items())


def check_ladder(spec: TwinSpec, model: Model) -> None:
    """Has the model's law each term that the twin file's ladder names?

    Raises:
        ConfigError: one is not there; with the nearest that is.
    """
    there = dict.fromkeys(rung.name for rung in _rungs(model))
    for name in spec.tuning.ladder:
        if name in there:
            continue
        raise ConfigError(
            f"[tuning] ladder: the model's law has no term {name!r}: "
            + (nearest(name, there) if there else "it has none that may stay out")
        )


def _rungs(model: Model) -> tuple[Rung, ...]:
    return model.rungs() if isinstance(model, Laddered) else ()


def joined(problem: Problem) -> Mapping[str, tuple[str, ...]]:
    """Parameters of each term of the law that is tuned, by what it is called."""
    model = problem.model
    several = len(model.outputs.names) > 1
    return {
        f"{rung.name} of {model.outputs.names[rung.output]}" if several else rung.name: (
            *rung.add, *(name for name, _ in rung.shape)
        )
        for rung in _rungs(model)
        if set(rung.add) <= set(problem.names)
    }  # fmt: skip


def nested(setup: Setup, problem: Problem) -> tuple[tuple[str, ...], ...]:
    """What may be tuned without a new term: numbers of no term that may stay out of a law (the
    others stay as they are), then all of the law as it is. None where the ladder tries none."""
    tried = _tried(setup, problem)
    without = (_rungs(problem.model), tried) if tried else ()
    found = []
    for rungs in without:
        out = {name for rung in rungs for name in rung.add}
        found.append(tuple(name for name in problem.names if name not in out))
    return tuple(dict.fromkeys(names for names in found if names))


def unseen(problem: Problem) -> PerOutput:
    """The error on held-out tasks, or parts of the only one, as the ladder is climbed by."""
    return held_out(on(problem, _folds(apart(problem.windows))))


def _tried(setup: Setup, problem: Problem) -> list[Rung]:
    """Terms of the ladder that have no value yet, in its order."""
    rungs = _rungs(problem.model)
    start = dict(zip(problem.names, problem.start.tolist(), strict=True))
    return [
        rung
        for name in setup.spec.tuning.ladder or ()
        for rung in rungs
        if rung.name == name and not any(start.get(added) for added in rung.add)
    ]


def climb_laws(setup: Setup, problem: Problem) -> tuple[Problem, Chosen]:
    """The problem with the terms that pay, and the law of each joint (or output, without joints).

    A term that already has a value stays. Without ``[tuning] ladder`` every term of the model takes
    part, and so does a term that the ladder does not name. A single task is cut into parts, so that
    there is something to hold out.
    """
    model, tried = problem.model, _tried(setup, problem)
    if not tried:
        return problem, Chosen()
    fastest = _fastest(problem)
    plain = _switched(problem, tried, fastest)
    problem = _shaped(plain, tried, fastest)
    few = tuple(_thinned(window) for window in problem.windows)

    def pushing(values: Mapping[str, float]) -> Collection[str]:
        # of rows that hardly tell it, a number may lie where none is allowed
        p = np.array([values.get(item.name, item.value) for item in problem.parameters])
        p = p[: len(model.parameters)]
        return {name for push in pushes(model, p, few) for name in push.negative}

    parts = on(problem, _folds(apart(problem.windows)))
    ascent = climb_terms(parts, tried, wrong=pushing)
    out = [r for r in tried if r.name not in ascent.taken[r.output]]
    kept = {name for r in tried if r not in out for name, _ in (*r.shape, *r.switch)}
    within = {name for r in out for name, _ in (*r.shape, *r.switch)} - kept
    stay = {name: plain.parameters[name].value for name in within}
    problem = replace(problem, prior=problem.parameters.with_values(stay)) if stay else problem
    untried = {(rung.output, rung.name) for rung in _rungs(model) if rung not in tried}
    return problem.tuning(ascent.names), _chosen(problem, ascent.taken, untried)


def acting(chosen: Chosen, problem: Problem, fit: Fit) -> Chosen:
    """What is left of it once its numbers are tuned: a term whose numbers the rows do not tell, so
    that they stay at zero, is none of the law; one that may as well be zero by its interval, or is
    weak, is no cause that can be told."""
    if not chosen.taken:
        return chosen
    values = dict(zip(problem.model.parameters.names, fit.p.tolist(), strict=False))
    acts = {(r.output, r.name) for r in _rungs(problem.model) if any(values[n] for n in r.add)}
    kept = (tuple(n for n in some if (k, n) in acts) for k, some in enumerate(chosen.taken))
    tuned = set(fit.names)
    sure = {n for n in fit.identifiable if not fit.interval(n)[0] <= 0.0 <= fit.interval(n)[1]}
    vague = {(r.output, r.name) for r in _rungs(problem.model)
             if tuned.issuperset(r.add) and sure.isdisjoint(r.add)}  # fmt: skip
    return _chosen(problem, tuple(kept), acts, vague)


def _chosen(
    problem: Problem, taken: tuple[tuple[str, ...], ...], others: Collection[tuple[int, str]],
    vague: Collection[tuple[int, str]] = (),
) -> Chosen:  # fmt: skip
    """The terms that were taken, and the law of these and of the ``others`` (output, term) that no
    ladder tries; those that are ``vague`` are no causes."""
    model = problem.model
    assert isinstance(model, Laddered)
    joints = getattr(model, "joints", model.outputs.names)
    whole = [(*some, *(name for o, name in others if o == k)) for k, some in enumerate(taken)]
    laws = {joint: model.law_name(k, whole[k]) for k, joint in enumerate(joints)}
    told = [[n for n in some if (k, n) not in vague] for k, some in enumerate(whole)]
    causes = {joint: _causes(problem, k, told[k]) for k, joint in enumerate(joints)}
    return Chosen(laws, {joint: cause for joint, cause in causes.items() if cause}, taken)


def _switched(problem: Problem, tried: Sequence[Rung], fastest: Sequence[float]) -> Problem:
    """The problem with the widths of smooth switches, of drives that creep and where nobody has
    said them, that leave clearly less on unseen rows. Faster ones hardly show them, and where a
    term of the law could stand for it a width would trade with that."""
    names = _without(problem, tried)
    open_ = {
        r.output: r.width
        for r in tried
        if fastest and _creeps(r, fastest) and _unsaid(problem, r.width)
    }
    if not (open_ and names):
        return problem
    plain = replace(problem, editable=names, windows=_folds(apart(problem.windows)))
    best = _best(plain, [*open_.items()], fastest, (1.0 - GAIN) * folded(plain))
    if not best:
        return problem
    near = replace(problem.tuning(names), prior=problem.parameters.with_values(best))
    own = [[n for n, _ in open_.get(k, ()) if n in best] for k in range(len(fastest))]
    return replace(problem, prior=searched(near, own).parameters)


def _shaped(problem: Problem, tried: Sequence[Rung], fastest: Sequence[float]) -> Problem:
    """The problem with the speeds inside of its terms, where nobody has said them, at those shares
    of a drive's fastest with which the term leaves least on unseen rows: what creeps for one drive
    is fast for another."""
    open_ = [r for r in tried if fastest and r.shape and _unsaid(problem, r.shape)]
    if not open_:
        return problem
    names = _without(problem, [rung for rung in tried if rung not in open_])
    shaped = replace(problem, editable=names, windows=_folds(apart(problem.windows)))
    there, least = [(r.output, r.shape) for r in open_], np.full(len(fastest), np.inf)
    # of a drive that stands any speed leaves as much
    best = _at(problem, there, fastest) | _best(shaped, there, fastest, least)
    near = replace(problem.tuning(names), prior=problem.parameters.with_values(best))
    found = searched(near, inside(near)).parameters
    return replace(problem, prior=found)


def _best(
    problem: Problem,
    inside: Sequence[tuple[int, Speeds]],
    fastest: Sequence[float],
    least: PerOutput,
) -> dict[str, float]:
    """At which share of its output's fastest speed each of these leaves less than ``least``."""
    items, best, least = problem.parameters, dict[str, float](), least.copy()
    for share in SHARES.tolist():
        speeds = _at(problem, inside, [share * speed for speed in fastest])
        left = folded(replace(problem, prior=items.with_values(speeds)))
        for output, named in inside:
            if left[output] < least[output]:
                best |= {name: speeds[name] for name, _ in named}
        least = np.fmin(least, left)
    return best


def _at(
    problem: Problem, inside: Sequence[tuple[int, Speeds]], speeds: Sequence[float]
) -> dict[str, float]:
    """Each of these at the speed of its output, within its bounds."""
    items = problem.parameters
    return {
        name: float(np.clip(speeds[output], items[name].low, items[name].high))
        for output, named in inside
        for name, _ in named
    }


def _fastest(problem: Problem) -> list[float]:
    """Of the drive of each output; none where that is not known."""
    model = problem.model
    if not (problem.linear and isinstance(model, Resisting)):
        return []
    u, y = (np.concatenate([getattr(w, name) for w in problem.windows]) for name in ("u", "y"))
    drives = model.rubbed(u, y, problem.parameters.values)
    if len(drives) != len(model.outputs.names):
        return []
    return [float(np.nanquantile(np.abs(drive.speed), FASTEST)) for drive in drives]


def _creeps(rung: Rung, fastest: Sequence[float]) -> bool:
    """Does the drive stay near the width that stands where nobody says it?"""
    return any(0.0 < fastest[rung.output] < CREEPS * width for _, width in rung.width)


def _unsaid(problem: Problem, speeds: Speeds) -> bool:
    """Does each stand where it does when nobody says it?"""
    return all(problem.parameters[name].value == value for name, value in speeds)


def _without(problem: Problem, rungs: Sequence[Rung]) -> tuple[str, ...]:
    out = {name for rung in rungs for name in rung.add}
    return tuple(name for name in problem.names if name not in out)


def inside(problem: Problem) -> Inside:
    """Of each output the speeds inside of its law's terms that nobody has said."""
    if not problem.linear:
        return ()
    model, items = problem.model, problem.model.parameters
    found: list[dict[str, None]] = [{} for _ in model.outputs]
    fastest = _fastest(problem) or [math.inf] * len(found)
    for rung in _rungs(model):
        tuned = set(rung.add) <= set(problem.names)
        names = (*rung.shape, *rung.switch) if tuned else ()
        names += rung.width if _creeps(rung, fastest) else ()
        found[rung.output] |= {name: None for name, value in names if items[name].value == value}
    return tuple(map(tuple, found)) if any(found) else ()


def _thinned(window: Block) -> Block:
    """About `ENOUGH` of its rows."""
    every = max(len(window.t) // ENOUGH, 1)
    return Block(window.row, *(column[::every] for column in window[1:]))


def _causes(problem: Problem, output: int, taken: Sequence[str]) -> str:
    """What the terms of an output mean, each with the speeds that are chosen for it."""
    found = []
    for rung in _rungs(problem.model):
        if rung.output == output and rung.name in taken and rung.cause:
            items = [problem.parameters[name] for name, _ in rung.shape]
            speeds = ", ".join(f"{item.name} {item.value:.3g} {item.unit}" for item in items)
            found.append(f"{rung.cause} ({speeds})" if speeds else rung.cause)
    return "; ".join(found)


def _folds(windows: tuple[Block, ...]) -> tuple[Block, ...]:
    """The tasks; where one holds most of the rows, what the others tell alone is too little to try
    it on: it is cut into parts."""
    rows = sum(len(window.t) for window in windows)
    if max(len(window.t) for window in windows) <= MOST * rows:
        return windows
    found = list[Block]()
    for window in windows:
        n, parts = len(window.t), max(1, round(PARTS * len(window.t) / rows))
        edges = [n * k // parts for k in range(parts + 1)]
        found += [take(window, a, b) for a, b in pairwise(edges) if b > a]
    return tuple(found)
