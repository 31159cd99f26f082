"""Tuning by rounds, axis by axis: relaxed steps until every axis is inside its limit.

The mode of Aivaliotis, Arkouli, Georgoulias, Makris (2023), kept beside the direct solve. Each
round simulates the axes that are not yet inside the limit, one by one, the others acting as given
loads. An axis outside takes a part of its least-squares step: the step grows with the deviation,
and the part grows where an axis lingers around its limit (`near`), to avoid needless rounds. An
axis inside is frozen. Weights decide which axes are tried in which round.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.models import Parameters
>>> from evertwin.signals import Layout
>>> class Gains:
...     inputs, outputs, states = Layout.of(a="1", b="1"), Layout.of(y="1", z="1"), Layout()
...     parameters = Parameters.of(p=(1.0, "1"), q=(1.0, "1"))
...     columns = np.array([[0], [1]])
...     def initial(self, p): return np.zeros(0)
...     def observe(self, x, y): return x
...     def simulate(self, x, u, dt, p): return x, p * u
...     def regressor(self, x, u, dt, p): return np.zeros_like(u), u[:, :, None]
>>> u = np.ones((9, 2))
>>> rows = make_block(t=np.arange(9), u=u, y=u * [2.0, 1.02])
>>> done = Iteration().run(Problem(Gains(), (rows,)))
>>> [round(r.deviation[0], 3) for r in done.rounds], done.simulations
([0.5, 0.3, 0.18, 0.108, 0.065, 0.013], 7)
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.tuning.intervals.assemble import Outcome, assemble, squares
from evertwin.tuning.intervals.fit import Fit
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.schedule import Schedule
from evertwin.types import Float64, Outputs, PerOutput, Vector


class Round(NamedTuple):
    """One round as the figures show it.

    >>> Round((0.5,), (), (), np.ones(1)).deviation
    (0.5,)
    """

    deviation: tuple[float, ...]
    """Relative deviation of each output (moving rows where the problem says so)."""
    tried: tuple[str, ...]
    """Outputs whose parameters were changed after this round."""
    frozen: tuple[str, ...]
    """Outputs inside their limit."""
    values: Vector
    """Parameters that were simulated, (k,)."""


@dataclass(frozen=True)
class Iterated:
    """What the rounds led to.

    >>> Iterated.__name__
    'Iterated'
    """

    fit: Fit
    rounds: tuple[Round, ...]
    """The first is the start, the last the end."""
    simulations: int
    """Single-axis simulations."""


@dataclass(frozen=True)
class Iteration:
    """Settings of the rounds. See the module for an example."""

    limit: float = 0.05
    """Requirement on the relative deviation of every axis."""
    relaxation: float = 0.4
    """Part of the least-squares step that is taken."""
    near: float = 0.8
    """… by an axis within ``band`` times its limit."""
    band: float = 1.5
    rounds: int = 30
    """Most rounds."""
    weights: Mapping[str, float] = field(default_factory=dict)
    """How often each output is tried, above 0 to 1; absent: in every round."""

    def __post_init__(self) -> None:
        if not (0 < self.relaxation <= 1 and 0 < self.near <= 2 and self.rounds >= 1):
            raise UsageError(
                "iteration: expected 0 < relaxation ≤ 1, 0 < near ≤ 2 and rounds ≥ 1, got "
                f"{self.relaxation}, {self.near}, {self.rounds}"
            )

    def run(self, problem: Problem, due: tuple[str, ...] | None = None) -> Iterated:
        """Rounds until every axis that is ``due`` (default: all) is inside its limit.

        Raises:
            UsageError: a parameter acts on two outputs: axes cannot be tuned one by one.
        """
        began = time.perf_counter()
        names = problem.model.outputs.names
        j = problem.jacobian(problem.start)
        own = _own(problem, j)
        schedule = Schedule({n: self.weights.get(n, 1.0) for n in names})
        wanted = [k for k, n in enumerate(names) if len(own[k]) and (due is None or n in due)]
        values, history, simulations = problem.start.copy(), [], 0
        inside = np.zeros(len(names), dtype=np.bool_)
        for number in range(self.rounds + 1):
            r = problem.residuals(values)
            deviation = relative(problem, r)
            turn = schedule.due(number)
            axes = [k for k in wanted if not inside[k] and (number == 0 or names[k] in turn)]
            simulations += len(axes)
            inside |= deviation < self.limit
            tried = [k for k in axes if not inside[k]] if number < self.rounds else []
            frozen = tuple(n for n, on in zip(names, inside, strict=True) if on)
            history.append(Round(tuple(deviation.tolist()), tuple(names[k] for k in tried), frozen,
                                 values.copy()))  # fmt: skip
            if all(inside[k] for k in wanted):
                break
            if not problem.linear:
                j = problem.jacobian(values)
            for k in tried:
                part = self.near if deviation[k] < self.band * self.limit else self.relaxation
                values[own[k]] += part * _step(j[:, k, own[k]], r[:, k])
            values = np.clip(values, *problem.bounds)
        outcome = self._outcome(names, inside, wanted, values, (len(history) - 1, simulations))
        return Iterated(
            assemble(problem, outcome, problem.sensitivity(values), began),
            tuple(history),
            simulations,
        )

    def _outcome(
        self, names: tuple[str, ...], inside: Any, wanted: list[int], values: Vector,
        counts: tuple[int, int],
    ) -> Outcome:  # fmt: skip
        left = [names[k] for k in wanted if not inside[k]]
        message = f"every axis inside {100 * self.limit:g} % after {counts[0]} rounds"
        if left:
            message = (
                f"{', '.join(left)} still outside {100 * self.limit:g} % after {counts[0]} rounds: "
                "allow more rounds, or the model's form does not reach the limit"
            )
        return Outcome(values, counts[0], counts[1], not left, message, method="iteration")


def relative(problem: Problem, r: Outputs) -> PerOutput:
    """rms(residual) / rms(measured) per output, over moving rows where the problem says so."""
    return np.array(squares(problem, r).relative_moving)


def _own(problem: Problem, j: Float64[np.ndarray, "n ny k"]) -> list[np.ndarray]:
    """Parameters of each output; every parameter must act on one output only."""
    acts = np.abs(np.where(problem.rows.used[:, :, None], j, 0.0)).sum(axis=0) > 0
    shared = np.flatnonzero(acts.sum(axis=0) > 1)
    if len(shared):
        raise UsageError(
            f"{problem.names[shared[0]]} acts on several outputs: axes cannot be tuned one by one; "
            "use `solve`"
        )
    return [np.flatnonzero(row) for row in acts]


def _step(columns: Any, r: Any) -> Vector:
    """The least-squares step of one axis."""
    known = np.isfinite(r)
    size = np.sqrt(np.square(columns[known]).sum(axis=0))
    return np.asarray(np.linalg.lstsq(columns[known] / size, r[known], rcond=1e-6)[0] / size)
