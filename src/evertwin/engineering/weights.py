"""How often each parameter is tuned: proposed from effect and drift, then measured by tuning.

A parameter is proposed the smallest weight that keeps every output it acts on inside the
requirement until its next turn: the deviation that the output starts with after a tuning, and what
the drift of all its parameters adds from one tuning to the next, decide. An override goes first.

What the schedule saves and costs is then measured: successive recordings are made of the real ones
by adding what the drifted parameters change (real motion, real noise, known drift), and tuned twice
over, everything at every turn and by the schedule. A tuner that solves at once takes as long for
one parameter as for six, and saves only the turns in which nothing is due; one that goes by rounds,
output by output, pays for each.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evertwin.engineering.choice import Question
from evertwin.engineering.criticality import YEAR
from evertwin.engineering.parts import Requirements
from evertwin.engineering.sensitivity import counted
from evertwin.fold import Block
from evertwin.tuning import Fit, Iteration, Problem, Schedule, solve, weights_from_growth
from evertwin.tuning.iteration import relative
from evertwin.types import ParameterVector, Vector

FEWEST, MOST = 24, 120
"""Tunings that the schedule is measured over: twice its longest period."""
BUDGET = 50_000
"""Rows that all these tunings may see, about; with long recordings the count is lower."""
REPEATS, QUICK = 3, 0.03
"""A tuning that is quicker [s] is timed so often: other work disturbs a clock upwards."""


@dataclass(frozen=True)
class Weighed:
    """The proposed schedule.

    >>> Weighed({"Fc1": 0.5}, {"Fc1": "…"}, {"tau1": 0.001}).weights
    {'Fc1': 0.5}
    """

    weights: Mapping[str, float]
    """How often each parameter is tuned: 1 at every tuning."""
    reasons: Mapping[str, str]
    growth: Mapping[str, float]
    """Relative deviation that drift adds to each output from one tuning to the next."""


@dataclass(frozen=True)
class Measured:
    """What the schedule saves and costs, measured. See `measure`.

    >>> Measured(24, 0.4, 0.2, 144, 90, {}, {}).saved
    0.5
    """

    tunings: int
    seconds_all: float
    """Run time with everything tuned at every turn."""
    seconds: float
    """Run time by the schedule."""
    count_all: int
    """Parameters tuned, over all turns."""
    count: int
    deviation_all: Mapping[str, float]
    """Largest relative deviation of each output right after a turn."""
    deviation: Mapping[str, float]
    """The same by the schedule."""
    simulations_all: int = 0
    """Simulations of single outputs that tuning by rounds takes with everything at every turn; 0
    where a parameter acts on several outputs, so that there are no such rounds."""
    simulations: int = 0
    """The same by the schedule."""

    @property
    def saved(self) -> float:
        """Share of the run time."""
        return 1.0 - self.seconds / self.seconds_all

    @property
    def saved_simulations(self) -> float | None:
        """Share of the simulations of single outputs, by rounds; None: there are none."""
        return 1.0 - self.simulations / self.simulations_all if self.simulations_all else None

    @property
    def lost(self) -> float:
        """Largest loss of accuracy of an output: deviation by the schedule less without it."""
        pairs = ((self.deviation[name], at) for name, at in self.deviation_all.items())
        return max((ours - at for ours, at in pairs), default=0.0)


def weigh(problem: Problem, fit: Fit, asked: Sequence[Question], needs: Requirements) -> Weighed:
    """Weights of the fit's parameters.

    Args:
        problem: on exactly the parameters of ``fit``.
        fit: the tuning that successive ones start from.
    """
    outputs = problem.model.outputs.names
    adds = _growth(problem, fit, asked, needs)
    growth = dict(zip(outputs, adds.sum(axis=1).tolist(), strict=True))
    after = {name: float(value) for name, value in zip(outputs, fit.moving_after, strict=True)}
    steps = {name: step for name, step in growth.items() if step > 0.0}
    by_output = weights_from_growth(steps, {name: after[name] for name in steps}, needs.accuracy)
    weights, reasons = {}, {}
    said = {one.name: one.said for one in asked}
    for k, name in enumerate(fit.names):
        own = [outputs[o] for o in np.flatnonzero(adds[:, k] > 0.0)]
        worst = max(own, key=lambda output: by_output[output], default="")
        weights[name] = by_output[worst] if worst else 0.01
        reasons[name] = (
            f"{worst} is {after[worst]:.1%} off after a tuning and drifts by "
            f"{growth[worst]:.2%} from one to the next; the limit is {needs.accuracy:.0%}"
            if worst
            else "it does not drift"
        )
        override = said[name].override
        if override is not None and override.weight is not None:
            weights[name] = override.weight
            reasons[name] += f"; overridden to {override.weight:g}: {override.reason}"
    return Weighed(weights, reasons, growth)


def measure(
    problem: Problem, fit: Fit, asked: Sequence[Question], weighed: Weighed, needs: Requirements
) -> Measured:
    """Tunes successive recordings, everything at every turn and by the schedule.

    Args:
        problem: on exactly the parameters of ``fit``.
        fit: values that drift starts from.
        needs: interval from one tuning to the next, and the accuracy that rounds stop at.
    """
    schedule = Schedule(weighed.weights)
    everything = Schedule(dict.fromkeys(weighed.weights, 1.0))
    longest = 1.0 / min(weighed.weights.values())
    rows = np.mean([len(window.t) for window in problem.windows])
    most = int(np.clip(BUDGET / rows, FEWEST, MOST))
    turns = int(np.clip(round(2 * longest), FEWEST, most))
    drift = np.array([{q.name: q.drift for q in asked}[n] for n in fit.names])
    drift *= needs.interval / YEAR
    cycles = [_drifted(problem, fit, drift * turn, turn) for turn in range(turns)]
    first = _successive(problem, fit, cycles, everything)
    second = _successive(problem, fit, cycles, schedule)
    names = problem.model.outputs.names
    before, after = (
        {n: float(d) for n, d in zip(names, run[1], strict=True)} for run in (first, second)
    )
    return Measured(
        turns, first[0], second[0], everything.count(turns), schedule.count(turns), before, after,
        _by_rounds(problem, fit, cycles, everything, needs),
        _by_rounds(problem, fit, cycles, schedule, needs),
    )  # fmt: skip


def _growth(
    problem: Problem, fit: Fit, asked: Sequence[Question], needs: Requirements
) -> np.ndarray:
    """Relative deviation that the drift of each parameter adds to each output, (ny, k)."""
    drift = {one.name: one.drift * needs.interval / YEAR for one in asked}
    j, on = problem.jacobian(fit.values), counted(problem)
    moves = np.abs(fit.values) * np.array([drift[name] for name in fit.names])
    changed = np.square(np.where(on[:, :, None], j * moves, 0.0)).sum(axis=0)
    measured = np.square(np.where(on, np.nan_to_num(problem.rows.y), 0.0)).sum(axis=0)
    return np.asarray(np.sqrt(changed / np.where(measured > 0, measured, 1.0)[:, None]))


def _drifted(problem: Problem, fit: Fit, moved: Vector, turn: int) -> Block:
    """A real recording with what the drift changes added to its outputs."""
    block = problem.windows[turn % len(problem.windows)]
    places = problem.parameters.indices(fit.names)
    after = fit.p.copy()
    after[places] *= 1.0 + moved
    change = _simulated(problem, block, after) - _simulated(problem, block, fit.p)
    return block._replace(y=block.y + change)


def _simulated(problem: Problem, block: Block, p: ParameterVector) -> np.ndarray:
    _, y = problem.model.simulate(problem.model.initial(p), block.u, block.dt, p)
    return y


def _successive(
    problem: Problem, fit: Fit, cycles: Sequence[Block], schedule: Schedule
) -> tuple[float, np.ndarray]:
    """(run time of the tunings, largest deviation of each output after a turn)."""
    prior = problem.parameters.with_values(fit.p)
    seconds, worst = 0.0, np.zeros(len(problem.model.outputs))
    for turn, block in enumerate(cycles):
        due = schedule.due(turn)
        now = replace(problem, windows=(block,), prior=prior)
        if due:
            tuned, took = _timed(replace(now, editable=due))
            seconds += took
            prior = prior.with_values(tuned.p)
        r = now.residuals(prior.values[now.places])
        worst = np.fmax(worst, relative(now, r))
    return seconds, worst


def _by_rounds(
    problem: Problem, fit: Fit, cycles: Sequence[Block], schedule: Schedule, needs: Requirements
) -> int:
    """Simulations of single outputs if every turn is tuned by rounds, output by output."""
    j = problem.jacobian(fit.values)
    acts = np.abs(np.where(problem.rows.used[:, :, None], j, 0.0)).sum(axis=0) > 0.0
    if (acts.sum(axis=0) > 1).any():
        return 0
    own = {
        n: problem.model.outputs.names[int(acts[:, k].argmax())] for k, n in enumerate(fit.names)
    }
    rounds = Iteration(limit=needs.accuracy, relaxation=1.0, near=1.0)
    prior, simulations = problem.parameters.with_values(fit.p), 0
    for turn, block in enumerate(cycles):
        now = replace(problem, windows=(block,), prior=prior)
        due = tuple(dict.fromkeys(own[name] for name in schedule.due(turn)))
        if due:
            done = rounds.run(now, due=due)
            simulations += done.simulations
            prior = prior.with_values(done.fit.p)
    return simulations


def _timed(problem: Problem) -> tuple[Fit, float]:
    """The fit and its run time: of a quick one the best of a few."""
    best = np.inf
    for _ in range(REPEATS):
        fresh = replace(problem)  # nothing that an earlier fit prepared
        began = time.perf_counter()
        fit = solve(fresh)
        best = min(best, time.perf_counter() - began)
        if best > QUICK:
            break
    return fit, best
