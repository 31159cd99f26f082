"""Intervals of a correction's numbers where the slope of the cost does not tell them.

A start threshold acts between two commands that occur, a delay between two samples, a cap only on
what reaches it. For these the *profile* of the cost counts: the number is moved away from its
value, the other numbers of the terms follow to their best, and the interval ends where

    (S(θ) − S(θ̂)) / c  =  t²,    c = Σₛ mₛᵀ·R·mₛ / Σ m²,    m = e(θ) − e(θ̂)

with S the sum of squared residuals e at θ, each output in units of its own scatter, over segments s
of one horizon each. R is the covariance of the residuals within a segment, pooled over segments, so
that c is their variance in the direction of the change; it is never below the mean square of e. t
is Student's 97.5 % quantile for as many segments as there are. A bound that the profile reaches is
the interval's end; a number that nothing holds is unbounded.

Nodes of a surface or a table are known by what scatters about them: the same sum over segments,
with the node's own effect as the direction and its neighbours as they are.

>>> import numpy as np
>>> from evertwin.correction.evidence import gather
>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> from evertwin.models.corrected.corrected import Corrected
>>> from evertwin.models.form import Term
>>> rng = np.random.default_rng(0)
>>> u = np.repeat(rng.choice([0.02, 0.05, 0.08, 0.12], 60), 5)
>>> y = np.where(u < 0.06, 0.0, u).cumsum() + 1e-3 * rng.normal(size=300)
>>> rows = make_block(t=np.arange(300) * 10**9, u=u[:, None], y=y[:, None])
>>> model = Corrected(Robot1D(), (Term("law", "v", variant="dead zone"),))
>>> p = model.parameters.with_values({"law.v.threshold": 0.06}).values
>>> found = profiled(model, p, ("law.v.threshold",), (), gather(Robot1D(), (rows,), 5.0))
>>> [round(end, 3) for end in found["law.v.threshold"].interval95]
[0.05, 0.08]
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.correction.evidence import Evidence
from evertwin.models import Model
from evertwin.models.corrected.corrected import Corrected
from evertwin.tuning.intervals.identifiability import grade
from evertwin.types import Float64, ParameterVector, Vector

Residual = Float64[np.ndarray, "m ny"]
Rows = Float64[np.ndarray, "segments k"]
REACH = tuple(np.geomspace(1e-4, 100.0, 19).tolist())
"""How far a number is moved, in sizes; from the first that is too far the way is halved."""
HALVINGS = 50
NARROW = 1e-3
"""Width, as a share of the end, from which on it is halved no more."""
FOLLOWED = 2
"""Steps that the other numbers follow."""
FEW = 3.0
"""Fewest segments, counted by their weight, that a node may be known from."""


@dataclass(frozen=True)
class Known:
    """What is known of one number.

    >>> Known((0.05, 0.08), "identifiable", "").verdict
    'identifiable'
    """

    interval95: tuple[float, float]
    verdict: str
    """identifiable, weak or not."""
    reason: str


class _Others(NamedTuple):
    """The numbers that follow: places, bounds, effect on the residual."""

    places: np.ndarray
    low: Vector
    high: Vector
    effect: Float64[np.ndarray, "r k"]


def profiled(
    model: Model, p: ParameterVector, names: Sequence[str], others: Sequence[str],
    evidence: Evidence,
) -> dict[str, Known]:  # fmt: skip
    """Intervals by the profile of the cost.

    Args:
        model: corrected model.
        p: its parameters, as they were fitted.
        names: numbers that an interval is asked for.
        others: numbers that follow.
        evidence: the rows, as they were learned from.
    """
    evidence = _weighed(evidence, model, p)
    base, found = evidence.residual(model, p), {}
    scatter = _scatter(base, evidence)
    for name in names:
        place = model.parameters.index(name)
        free = [model.parameters.index(other) for other in others if other != name]
        following = _others(model, p, free, base, evidence)
        size = _size(model, p, place, evidence)
        walk = _Walk(model, p, place, following, base, scatter)
        low, high = walk.end(-size), walk.end(size)
        found[name] = _graded(low, high, float(p[place]), size)
    return found


def scattered(
    model: Model, p: ParameterVector, names: Sequence[str], evidence: Evidence
) -> dict[str, Known]:
    """Intervals of nodes from the scatter of the rows that each of them acts on."""
    evidence = _weighed(evidence, model, p)
    e, found = evidence.residual(model, p), {}
    scatter = _scatter(e, evidence)
    for name in names:
        place = model.parameters.index(name)
        size = _size(model, p, place, evidence)
        moved = p.copy()
        moved[place] += 0.01 * size
        effect = (evidence.residual(model, moved) - e) / (0.01 * size)
        weight = float((effect**2).sum())
        weights = np.bincount(evidence.segment, (effect**2).sum(axis=1), evidence.segments)
        if weight <= 0.0 or weight**2 / float((weights**2).sum()) < FEW:
            open_ = (-math.inf, math.inf)
            found[name] = Known(open_, "not", "too few rows come near this node")
            continue
        half = scatter.quantile * math.sqrt(scatter.along(effect) / weight)
        value = float(p[place])
        found[name] = _graded(value - half, value + half, value, size)
    return found


def _weighed(evidence: Evidence, model: Model, p: ParameterVector) -> Evidence:
    """The evidence with each output in units of its own residual: what scatters less says more."""
    e = evidence.residual(model, p)
    rms = np.sqrt((e**2).sum(axis=0) / np.maximum(evidence.known.sum(axis=0), 1.0))
    return replace(evidence, scale=evidence.scale * np.where(rms > 0.0, rms, 1.0))


def _graded(low: float, high: float, value: float, size: float) -> Known:
    half = max(high - value, value - low)
    refused = "" if math.isfinite(half) else "no row holds it on one side"
    (verdict,), (reason,) = grade([refused], np.array([half / max(abs(value), 0.1 * size)]))
    return Known((low, high), verdict, reason)


def _size(model: Model, p: ParameterVector, place: int, evidence: Evidence) -> float:
    """A large change of a number: the range of its channel, the horizon, or its own value."""
    item = model.parameters[model.parameters.names[place]]
    if item.unit == "s":
        return evidence.horizon
    own = model.owner(item.name) if isinstance(model, Corrected) else None
    if own is not None and own.kind.by_channel(own.local):
        column = np.abs(evidence.u[:, model.inputs.index(own.term.channel)])
        return max(float(column[np.isfinite(column)].max()), abs(float(p[place])), 1e-12)
    return max(abs(float(p[place])), 1.0)


def _others(
    model: Model, p: ParameterVector, free: list[int], base: Residual, evidence: Evidence
) -> _Others:
    columns, kept = [], []
    for place in free:
        step = 1e-3 * max(abs(float(p[place])), 1e-3 * _size(model, p, place, evidence))
        moved = p.copy()
        moved[place] += step
        effect = ((evidence.residual(model, moved) - base) / step).ravel()
        if np.any(effect != 0.0):
            columns.append(effect)
            kept.append(place)
    where = np.array(kept, dtype=np.int64)
    low, high = model.parameters.low[where], model.parameters.high[where]
    stacked = np.stack(columns, axis=1) if columns else np.zeros((base.size, 0))
    return _Others(where, low, high, stacked)


class _Scatter(NamedTuple):
    """How the residuals scatter within a segment."""

    evidence: Evidence
    place: np.ndarray
    """Place of each row within its segment."""
    covariance: Float64[np.ndarray, "k k"]
    white: float

    def along(self, m: Residual) -> float:
        """Variance of the residual in the direction ``m``."""
        total = float((m**2).sum())
        if total <= 0.0:
            return self.white
        moved = _by_segment(m, self.place, self.evidence)
        return max(float(((moved @ self.covariance) * moved).sum()) / total, self.white)

    @property
    def quantile(self) -> float:
        """Student's 97.5 % quantile."""
        return float(scipy.special.stdtrit(max(self.evidence.segments - 1, 1), 0.975))


def _scatter(e: Residual, evidence: Evidence) -> _Scatter:
    first = np.searchsorted(evidence.segment, evidence.segment)
    place = np.arange(len(first)) - first
    rows = _by_segment(e, place, evidence)
    there = _by_segment(evidence.known, place, evidence)
    pairs = np.maximum(there.T @ there, 1.0)
    white = float((e**2).sum() / max(evidence.known.sum() - 1.0, 1.0))
    return _Scatter(evidence, place, rows.T @ rows / pairs, white)


def _by_segment(values: Residual, place: np.ndarray, evidence: Evidence) -> Rows:
    """One row a segment, (segments, places × outputs); 0 where a segment is shorter."""
    ny = values.shape[1]
    out = np.zeros((evidence.segments, int(place.max()) + 1, ny))
    out[evidence.segment, place] = values
    return out.reshape(len(out), -1)


class _Walk(NamedTuple):
    """One number on its way from its value."""

    model: Model
    p: ParameterVector
    place: int
    others: _Others
    base: Residual
    scatter: _Scatter

    def end(self, size: float) -> float:
        """Where the interval ends on the side of ``size``; infinite where nothing holds it."""
        value = float(self.p[self.place])
        item = self.model.parameters[self.model.parameters.names[self.place]]
        bound = item.low if size < 0 else item.high
        inside = 0.0
        for share in REACH:
            step = share * size
            at_bound = (value + step - bound) * math.copysign(1.0, size) >= 0
            step = bound - value if at_bound else step
            if self.beyond(value + step):
                return self._halved(value, inside, step)
            inside = step
            if at_bound:
                return float(bound)
        return math.copysign(math.inf, size)

    def _halved(self, value: float, inside: float, outside: float) -> float:
        for _ in range(HALVINGS):
            if abs(outside - inside) < NARROW * abs(value + outside):
                break
            middle = 0.5 * (inside + outside)
            inside, outside = (inside, middle) if self.beyond(value + middle) else (middle, outside)
        return value + outside

    def beyond(self, theta: float) -> bool:
        """Is the cost at this value too high for chance, with the others at their best?"""
        p = self.p.copy()
        p[self.place] = theta
        e = self.scatter.evidence.residual(self.model, p)
        where, effect = self.others.places, self.others.effect
        for _ in range(FOLLOWED if len(where) else 0):
            step = -np.linalg.lstsq(effect, e.ravel(), rcond=1e-9)[0]
            q = p.copy()
            q[where] = np.clip(p[where] + step, self.others.low, self.others.high)
            next_ = self.scatter.evidence.residual(self.model, q)
            if not (next_**2).sum() < (e**2).sum():
                break
            p, e = q, next_
        more = float((e**2).sum() - (self.base**2).sum())
        m = e - self.base
        return bool((m != 0.0).any()) and more > self.scatter.quantile**2 * self.scatter.along(m)


def parameters(found: dict[str, Known], model: Model, p: ParameterVector) -> dict[str, Any]:
    """As a fit tells its parameters."""
    return {
        name: {
            "value": float(p[model.parameters.index(name)]),
            "start": float(p[model.parameters.index(name)]),
            "unit": model.parameters[name].unit,
            "sigma": (known.interval95[1] - known.interval95[0]) / 3.92,
            "interval95": known.interval95, "verdict": known.verdict, "reason": known.reason,
        }
        for name, known in found.items()
    }  # fmt: skip
