"""Refinement: a learned table becomes a continuous law with a lag.

The table brings the deviation "below the anomaly level", model tuning then takes out the
quantisation (Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent Digital Twin",
section 3). The law is

    v = min(gain·|u| + offset, cap), with the sign of u, then a first-order lag τ

in three variants: as it stands; with a dead zone (v = 0 up to a threshold); with a clamp (v never
below a threshold). All numbers of a variant are fitted together, the lag among them, since a law
fitted without it takes the lag's transients for its own. A dead zone's end cannot be found by
slopes, so commands that were seen near the table's own edge are tried; the largest one at which
the machine stood still wins. The variants have different numbers of parameters: the Bayesian
information criterion, n·ln(Σr²/n) + k·ln n, decides between them. All of them race: after a step or
a few, one that leaves many times as much as the best is fitted no further.

>>> from evertwin.correction.translation.sarsa import learn_table
>>> from evertwin.correction.translation.sarsa_settings import SarsaSettings
>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> command = np.repeat(np.arange(1, 21) * 0.01, 5)
>>> effect = np.where(command <= 0.06, 0.0, np.minimum(0.97 * command + 0.002, 0.16))
>>> noise = np.random.default_rng(0).normal(0.0, 0.001, 100)
>>> rows = make_block(t=np.arange(100) * 10**9, u=command[:, None],
...     y=(np.cumsum(effect) + noise)[:, None])
>>> robot = Robot1D()
>>> p = robot.parameters.values
>>> found = refine_law(robot, p, (rows,), learn_table(robot, p, (rows,), SarsaSettings("v")), 1.0)
>>> found.variant, round(found.threshold, 3), round(found.cap, 2)
('dead zone', 0.06, 0.16)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
import scipy

from evertwin.correction.evidence import FAILED
from evertwin.correction.translation.table import Table
from evertwin.errors import DataError
from evertwin.fold import Block
from evertwin.models import Kernel, Model, Restart, roll
from evertwin.models.corrected.corrected import Corrected, Term
from evertwin.models.terms.rows import inputs_of, quiet_level
from evertwin.sync import residuals, restarts
from evertwin.types import Bools, Float64, ParameterVector, Vector

TRIED = 8
"""Most dead-zone thresholds that all numbers are fitted with."""
LEAST = 12
"""Fewest residuals to fit on."""
RACE = ((2, 10.0), (4, 2.0), (8, 1.1))
"""Evaluations of each fit, and times the least squared residual beyond which it then drops out."""
BRACKET = 16
"""Commands among which a dead zone's end is sought one by one."""
VARIANTS = ("", "dead zone", "clamp")
Numbers: TypeAlias = Float64[np.ndarray, " _numbers"]
"""[threshold,] gain, offset, cap, tau."""


@dataclass(frozen=True)
class Refined:
    """A law with a lag in the place of a table.

    >>> Refined((), {}, "", 0.0, 1.0, 0.1, {}, 0.0, 0).tau
    0.1
    """

    terms: tuple[Term, ...]
    """The law and the lag, to be put on the original model in this order."""
    values: Mapping[str, float]
    """Parameters of both, by name."""
    variant: str
    """``dead zone``, ``clamp``, or empty for neither."""
    threshold: float
    """Start threshold in the channel's unit; 0 without one."""
    cap: float
    """Saturation in the channel's unit; infinite if the commands do not reach it."""
    tau: float
    """Time constant of the lag [s]."""
    criterion: Mapping[str, float]
    """Bayesian information criterion of the best fit per variant; the least won. Of a variant that
    dropped out: as it stood then."""
    rms: float
    """Rms of the residuals over one horizon, in the outputs' unit."""
    evaluations: int


class _Fit(NamedTuple):
    """One fitted variant."""

    criterion: float
    variant: str
    q: Numbers
    evaluations: int
    squares: float
    """Mean squared residual."""
    ended: bool
    """Did it come to its end?"""


def refine_law(
    model: Model, p: ParameterVector, windows: Sequence[Block], table: Table, horizon: float
) -> Refined:
    """The law and lag that predict best over one horizon from the measured state.

    Args:
        model: the original model, whose input ``table.channel`` is translated.
        p: its parameters, (np,).
        windows: recorded rows.
        table: what SARSA found: where the search starts.
        horizon: length of a prediction [s].

    Raises:
        DataError: fewer than 12 residuals.
    """
    trials = {v: _Trial(model, p, tuple(windows), table, horizon, v) for v in VARIANTS}
    rows, edge = trials[""].residual(trials[""].start(0.0)).size, _edge(table)
    if rows < LEAST:
        raise DataError(
            f"refinement: expected at least {LEAST} predicted rows, got {rows}: record more"
        )
    near = _near(inputs_of(windows, model.inputs.index(table.channel)), table)
    zone = trials["dead zone"]
    starts = [zone.start(float(threshold)) for threshold in _spread(near, TRIED)]
    pairs = [(trials[""], trials[""].start(0.0)), (trials["clamp"], trials["clamp"].start(edge))]
    fits = _raced([*pairs, *((zone, start) for start in starts)])
    fits += zone.between(near, [fit for fit in fits if fit.variant == zone.variant])
    best = min(fits, key=lambda fit: fit.criterion)
    least = {v: min(f.criterion for f in fits if f.variant == v) for v in {f.variant for f in fits}}
    evaluations = sum(fit.evaluations for fit in fits)
    return trials[best.variant].outcome(best, least, evaluations)


def _raced(field: Sequence[tuple[_Trial, Numbers]]) -> list[_Fit]:
    """A fit from each start, of which those that fall back are not finished."""
    fits = [trial.fit(start, RACE[0][0]) for trial, start in field]
    running = list(range(len(fits)))
    for (_, times), (most, _) in zip(RACE, (*RACE[1:], (None, 0.0)), strict=True):
        least = min(fit.squares for fit in fits)
        running = [k for k in running if not fits[k].ended and fits[k].squares <= times * least]
        for k in running:  # the same way once more, and on
            fits[k] = field[k][0].fit(field[k][1], most)
    return fits


def _spread(values: Vector, count: int) -> Float64[np.ndarray, " some"]:
    """At most so many of them, evenly spread, the first and the last among them."""
    places = np.linspace(0, len(values) - 1, min(len(values), count)).round().astype(int)
    return np.asarray(values[np.unique(places)])


def _edge(table: Table) -> float:
    """The largest level that the table sends to less than half of itself, or more than one and a
    half times; else the smallest level above 0.
    """
    size, value = np.abs(table.levels), np.abs(table.values)
    off = table.learned & (size > 0) & (size < 0.7 * size.max())
    off &= (value < 0.5 * size) | (value > 1.5 * size)
    if off.any():
        return float(size[off].max())
    return float(size[size > 0].min())


def _near(u: Vector, table: Table) -> Float64[np.ndarray, " near"]:
    """Commands near the table's edge, rising; they include the largest below the edge."""
    edge, step = _edge(table), float(table.levels[1] - table.levels[0])
    seen = np.unique(np.abs(u))
    seen = seen[np.diff(seen, append=np.inf) > 1e-9]  # not below the command that it stands for
    return np.asarray(seen[(seen > 0) & (np.abs(seen - edge) <= 2.0 * step + 1e-9)])


@dataclass(frozen=True)
class _Trial:
    """One variant on the data."""

    model: Model
    p: ParameterVector
    windows: tuple[Block, ...]
    table: Table
    horizon: float
    variant: str

    @property
    def terms(self) -> tuple[Term, ...]:
        channel = self.table.channel
        quiet = quiet_level(
            np.concatenate([self.table.levels[self.table.visits > 0], [0.0]])
        ) if self.variant == "clamp" else 0.0  # fmt: skip
        levels = (quiet,) if quiet > 0 else ()
        return (
            Term("law", channel, variant=self.variant, levels=levels),
            Term("lag", channel, levels=(4.0,)),
        )

    def start(self, threshold: float) -> Numbers:
        """Where the fit begins, from the table."""
        cap = float(np.abs(self.table.values).max())
        law = [1.0, 0.0, 0.98 * cap, 0.1 * self.horizon]
        return np.array([threshold, *law] if self.variant else law)

    def _bounds(self) -> tuple[Numbers, Numbers]:
        reach = float(np.abs(self.table.levels).max())
        low = [0.2, -0.5 * reach, 0.05 * reach, 1e-3 * self.horizon]
        high = [3.0, 0.5 * reach, 3.0 * reach, 2.0 * self.horizon]
        if self.variant == "":
            return np.array(low), np.array(high)
        return np.array([0.0, *low]), np.array([0.7 * reach, *high])

    def residual(self, q: Numbers) -> Vector:
        """Measured − predicted over the horizon, all windows and outputs, of rows with a value.

        The rows are the same whatever the numbers: where the model has no value (the root of less
        than nothing), it is as far off as the outputs spread, many times.
        """
        at = q.tobytes()
        if at not in self._known:
            self._known[at] = self._residual(q)
        return self._known[at]

    @cached_property
    def _known(self) -> dict[bytes, Vector]:
        """Residuals of all numbers that were tried."""
        return {}

    def _residual(self, q: Numbers) -> Vector:
        rows, far = self._predicted
        r = self._off(q)[rows]
        return np.where(np.isfinite(r), np.clip(r, -far, far), far)

    def _off(self, q: Numbers) -> Vector:
        full = self.full(q)
        found = []
        for block, restart in self._planned:
            _, y = roll(self._kernel, restart.x0, block.u, block.dt, full, restart)
            found.append(residuals(self._corrected, block, y).ravel())
        return np.concatenate(found)

    @cached_property
    def _predicted(self) -> tuple[Bools, float]:
        """Which rows are predicted where the fit begins, and how far off one without a value is."""
        rows = np.isfinite(self._off(self.start(_edge(self.table))))
        zeros = (residuals(self._corrected, b, np.zeros_like(b.y)) for b, _ in self._planned)
        r = np.concatenate([one.ravel() for one in zeros])[rows]
        return rows, FAILED * math.sqrt(float(np.square(r).sum()) / max(len(r), 1))

    @cached_property
    def _corrected(self) -> Corrected:
        return Corrected(self.model, self.terms)

    @cached_property
    def _kernel(self) -> Kernel:
        return self._corrected.kernel()

    @cached_property
    def _planned(self) -> tuple[tuple[Block, Restart], ...]:
        x0 = self._corrected.initial(self.full(self.start(0.0)))
        return tuple((block, restarts(block, self.horizon, x0)) for block in self.windows)

    def full(self, q: Numbers) -> ParameterVector:
        """Parameters of the corrected model: no delay, only the lag."""
        return np.concatenate([self.p, q[:-1], [0.0, q[-1]]])

    def between(self, thresholds: Vector, fits: Sequence[_Fit]) -> list[_Fit]:
        """Fits with thresholds between those tried: each with the one that the numbers of the best
        so far go best with, as long as that helps.
        """
        found = list[_Fit]()
        if len(fits) in (0, len(thresholds)):
            return found
        best = min(fits, key=lambda one: one.criterion)
        while (threshold := self._nearest(thresholds, best.q)) != best.q[0]:
            found.append(self.fit(np.r_[threshold, best.q[1:]]))
            if not found[-1].criterion < best.criterion:
                break
            best = found[-1]
        return found

    def _nearest(self, thresholds: Vector, q: Numbers) -> float:
        """The threshold that goes best with the other numbers, sought among ever fewer."""
        some: Numbers = thresholds
        while True:
            tried = some if len(some) <= BRACKET else _spread(some, TRIED)
            costs = [np.square(self.residual(np.r_[one, q[1:]])).sum() for one in tried]
            at = int(np.argmin(costs))
            if len(tried) == len(some):
                return float(tried[at])
            low, high = tried[max(at - 1, 0)], tried[min(at + 1, len(tried) - 1)]
            some = some[(some >= low) & (some <= high)]

    def fit(self, start: Numbers, most: int | None = None) -> _Fit:
        """The least-squares fit; a dead zone's threshold stays where it is.

        Args:
            start: where it begins.
            most: residuals that it may evaluate, beside those of its slopes; None: to the end.
        """
        q = start.copy()
        low, high = self._bounds()
        free = np.arange(1 if self.variant == "dead zone" else 0, len(q))
        typical = np.where(np.arange(len(q)) == len(q) - 1, 0.1 * self.horizon, 0.05 * high)

        def residual(values: Numbers) -> Vector:
            q[free] = values
            return self.residual(q)

        result = scipy.optimize.least_squares(
            residual, np.clip(q[free], low[free], high[free]), bounds=(low[free], high[free]),
            x_scale=typical[free], diff_step=np.full(len(free), 1e-4), max_nfev=most,
        )  # fmt: skip
        q[free] = result.x
        n, squares = len(result.fun), 2.0 * float(result.cost)
        criterion = n * math.log(max(squares / n, 1e-300)) + len(q) * math.log(n)
        ended = bool(result.status > 0)
        return _Fit(criterion, self.variant, q, int(result.nfev), squares / n, ended)

    def outcome(self, fit: _Fit, least: Mapping[str, float], evaluations: int) -> Refined:
        """The fit as terms and values."""
        names = self._corrected.parameters.names[len(self.p) :]
        values = dict(zip(names, self.full(fit.q)[len(self.p) :].tolist(), strict=True))
        threshold = float(fit.q[0]) if self.variant else 0.0
        gain, offset, cap, tau = (float(v) for v in fit.q[-4:])
        reached = gain * float(np.abs(self.table.levels).max()) + offset > cap
        cap = cap if reached else math.inf
        return Refined(
            self.terms, values, self.variant, threshold, cap, tau, dict(least),
            math.sqrt(fit.squares), evaluations,
        )  # fmt: skip
