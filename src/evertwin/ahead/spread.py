"""How far predictions are off after a lead time: the part of a band that recordings tell.

A version is started from the measured state at many places of the recordings and runs open loop
over the horizon. What is off then holds the noise of the start, of the sensor and of the process,
and what the form does not know. Its size over the lead time h follows

    σ²(h) = a + b·h + c·h²        a noise, b random walk, c a rate that is off;  a, b, c ≥ 0

per output, fitted to mean squares in bins of h, each weighed by what the law says there. Weights
from the bins themselves would believe most in those that came out small by chance.

How many σ hold 80 or 95 % is counted on the same residuals, so that heavy tails widen a band that
the bell curve would make too narrow. Rows of one stretch share their noise; where stretches are few
Student's t stands in for what cannot be counted yet, with as many degrees of freedom as the scatter
from stretch to stretch says (Satterthwaite, Biometrics Bulletin 2(6), 1946).

A static map knows no lead time. What its form does not know follows what it predicts instead of
averaging out as noise does: a share s of it, found stretch by stretch by least squares.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.random import Generator

from evertwin.errors import DataError
from evertwin.fold import Block, take
from evertwin.models import Model, Restart, hidden_of, observed, roll
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.kernel import ADOPT
from evertwin.sync.horizon.horizon import openings, residuals, restarts
from evertwin.types import Float64, Int64, Intervals, Outputs, ParameterVector, StateVector, Vector

LEVELS = (0.8, 0.95)
"""Shares of future values that a band holds."""
BELL = 1.96
"""σ that hold 95 % of a bell curve."""
BINS = 12
LEAST = 4
"""Fewest stretches of recorded data that a band may rest on."""
FEWEST = 8
"""Fewest rows with a residual."""
ENOUGH = 40
"""Stretches from which on the counted quantile stands alone."""
ROUNDS = 20
"""Rounds in which the law's weights follow the law."""
FAR = 4.0
"""Size in σ from which on a residual adds no more to the law; the counted shares know it."""


@dataclass(frozen=True)
class Spread:
    """Size of the residual by lead time, per output.

    >>> grown = Spread(np.array([[0.0, 0.0, 1.0]]), np.array([[1.28, 1.96]]), 50)
    >>> grown.sigma(np.array([2.0])).tolist()
    [[2.0]]
    """

    law: Float64[np.ndarray, "ny 3"]
    """a, b, c of each output."""
    factor: Float64[np.ndarray, "ny 2"]
    """How many σ hold the share of each of `LEVELS`."""
    stretches: int
    """Open-loop stretches that it rests on."""
    length: float = math.inf
    """How long they are [s]; beyond it the law is extrapolated."""
    share: Float64[np.ndarray, " ny"] | float = 0.0
    """Of a static map: by what share of the prediction a whole stretch is off, rms."""

    def sigma(self, lead: Vector) -> Outputs:
        """Standard deviation at lead times [s], (n, ny)."""
        basis = np.stack([np.ones_like(lead), lead, lead**2], axis=1)
        return np.asarray(np.sqrt(basis @ self.law.T))

    def paths(
        self, y: Outputs, dt: Intervals, count: int, rng: Generator
    ) -> Float64[np.ndarray, "k n ny"]:
        """Courses that may be measured where ``y`` is predicted: with noise, random walk, rate and
        share, (count, n, ny).

        Tails as heavy as those counted: 95 % are held as by the band.
        """
        a, b, c = np.sqrt(self.law.T)
        size = (count, len(dt), len(a))
        found = a * rng.standard_normal(size)
        if b.any():
            walk = np.sqrt(dt)[:, None] * rng.standard_normal(size)
            found += b * np.cumsum(walk, axis=1)
        if c.any():
            found += c * np.cumsum(dt)[:, None] * rng.standard_normal((count, 1, len(a)))
        off = self.share * rng.standard_t(max(self.stretches, 1), (count, 1, len(a)))
        return np.asarray(y * (1.0 + off) + found * self.factor[:, 1] / BELL)


def spread(model: Model, p: ParameterVector, windows: Sequence[Block], horizon: float) -> Spread:
    """The residual's size by lead time up to ``horizon`` [s], from open-loop runs.

    Raises:
        DataError: too few stretches; names how much data would be enough.
    """
    span = sum(float(w.t[-1] - w.t[0]) * 1e-9 for w in windows)
    length = min(horizon, span / (2 * LEAST))
    known = _pairs(model, p, windows, length)
    measured = int(np.isfinite(known.residual).any(axis=1).sum())
    if known.stretches < LEAST or measured < FEWEST:
        raise DataError(
            f"forecast: expected at least {LEAST} stretches of {length:.3g} s with measurements to "
            f"learn the band from, got {known.stretches} with {measured} rows: give longer "
            "recordings"
        )
    static = len(model.states) == 0
    columns = range(known.residual.shape[1])
    law = np.array([_law(known.lead[:, k], known.residual[:, k], static) for k in columns])
    basis = np.stack([np.ones_like(known.lead), known.lead, known.lead**2], axis=2)
    square = np.maximum(np.einsum("nkb,kb->nk", basis, law), 1e-300)
    scaled = np.abs(known.residual) / np.sqrt(square)
    factor = [_factors(scaled[:, k], known.piece, known.stretches) for k in columns]
    share = np.array([_share(known, k) if static else 0.0 for k in columns])
    return Spread(law, np.array(factor), known.stretches, length, share)


def _share(known: _Pairs, column: int) -> float:
    """By what share of the prediction stretches are off, as a whole, rms."""
    r, y = known.residual[:, column], known.predicted[:, column]
    here = np.isfinite(r)
    product, size = (np.bincount(known.piece[here], x[here]) for x in (r * y, y * y))
    return float(np.sqrt(np.sum(product**2 / np.maximum(size, 1e-300)) / max(size.sum(), 1e-300)))


class _Pairs(NamedTuple):
    """Residuals of open-loop stretches, one after the other."""

    lead: Outputs
    """Lead times [s], (n, ny)."""
    residual: Outputs
    predicted: Outputs
    piece: Int64[np.ndarray, " n"]
    """Which stretch a row is of."""
    stretches: int
    """Stretches that share no row."""


def _pairs(model: Model, p: ParameterVector, windows: Sequence[Block], length: float) -> _Pairs:
    model = observed(model)
    kernel, parts = kernel_of(model), len(hidden_of(model)) + 2
    x0, ny = model.initial(p), len(model.outputs)
    nothing = *(np.zeros((0, ny)),) * 3, np.zeros(0, dtype=np.int64)
    found, stretches, pieces = [nothing], 0.0, 0
    hidden = _hidden(model, x0)
    for window in windows:
        passed = (window.t - window.t[0]) * 1e-9
        # states that nothing measures come in over the first stretch of a recording
        first = 1.0 if hidden and passed[-1] >= 2.0 * length else 0.0
        for share in (0.0, 0.5) if len(x0) else (0.0,):
            start = int(np.searchsorted(passed, (first + share) * length))
            if len(passed) - start < 3:
                continue
            plan = _begun(window, start, (length, length / parts), x0)
            _, y = roll(kernel, x0, window.u, window.dt, p, plan)
            lead, off = _lead(passed, plan)[start:], residuals(model, window, y)[start:]
            since = passed[start:] - passed[start]
            piece = (since / length).astype(np.int64) + pieces
            pieces = int(piece[-1]) + 1
            off[0] = np.nan if start > 0 else off[0]  # the last row of the stretch before
            found.append((lead, off, y[start:], piece))
            if share == 0.0:
                stretches += float(since[-1]) / length
    lead, residual, y, piece = (np.concatenate(column) for column in zip(*found, strict=True))
    return _Pairs(lead, residual, y, piece, int(stretches))


def _hidden(model: Model, x0: StateVector) -> bool:
    """Has the model states that no measurement sets?"""
    moved = x0 + 1.0
    return bool(np.any(model.observe(moved, np.zeros(len(model.outputs))) == moved))


def _begun(window: Block, start: int, lengths: tuple[float, float], x0: StateVector) -> Restart:
    """Restarts from row ``start`` on; states that nothing measures come in over the rows before.
    ``lengths``: of a stretch, and from restart to restart before [s]."""
    length, brief = lengths
    plan = restarts(take(window, start, len(window.t)), length, x0)
    if start == 0 or len(x0) == 0:
        return plan
    before = restarts(take(window, 0, start), brief, x0)
    code = np.concatenate([before.code, plan.code])
    if not openings(window)[start]:
        code[start], code[start + 1] = 0, max(code[start + 1], ADOPT)
    return Restart(np.concatenate([before.y, plan.y]), code, x0)


def _lead(passed: Vector, plan: Restart) -> Outputs:
    """Time since each output was last adopted [s], (n, ny). A row's measurement is adopted after it
    was predicted, so it counts from the next row on."""
    since = np.where(np.isfinite(plan.y), passed[:, None], -np.inf)
    before = np.maximum.accumulate(since, axis=0)
    before = np.concatenate([before[:1], before[:-1]])
    return np.where(np.isfinite(before), passed[:, None] - before, 0.0)


def _law(lead: Vector, residual: Vector, static: bool) -> np.ndarray:
    """a, b, c from mean squares in bins of the lead time."""
    known = np.isfinite(residual)
    h, r = lead[known], np.abs(residual[known])
    if len(r) == 0:
        return np.zeros(3)
    if static or float(h.max()) <= 0.0:
        return np.array([_square(r), 0.0, 0.0])
    edges = np.unique(np.quantile(h, np.linspace(0.0, 1.0, BINS + 1)))
    places = np.clip(np.searchsorted(edges, h, side="right") - 1, 0, max(len(edges) - 2, 0))
    size = [(float(h[places == b].mean()), _square(r[places == b]), int((places == b).sum()))
            for b in np.unique(places)]  # fmt: skip
    at, square, count = (np.array(column) for column in zip(*size, strict=True))
    if not square.max() > 0.0:
        return np.zeros(3)  # the simulation repeats the recording
    unit = np.array([1.0, 1.0 / at.max(), 1.0 / at.max() ** 2])
    basis = np.stack([np.ones_like(at), at, at**2], axis=1) * unit
    fitted, law = np.full(len(at), square.mean()), np.zeros(3)
    for _ in range(ROUNDS):
        # the variance of a mean square grows with its square: weigh relative errors
        weight = np.sqrt(count) / np.maximum(fitted, fitted.max() * 1e-6)
        law, _ = scipy.optimize.nnls(weight[:, None] * basis, weight * square)
        fitted = basis @ law
    return np.asarray(law * unit)


def _square(r: Vector) -> float:
    """Mean square in which what is far outside counts as just outside."""
    robust = float(np.median(r)) / 0.6745
    return float(np.mean(np.minimum(r, FAR * robust if robust > 0.0 else np.inf) ** 2))


def _factors(scaled: Vector, piece: Int64[np.ndarray, " n"], stretches: int) -> tuple[float, float]:
    """How many σ hold 80 and 95 %."""
    known = np.isfinite(scaled)
    scaled, piece = scaled[known], piece[known]
    freedom = _freedom(scaled, piece, stretches)
    share = min(stretches / ENOUGH, 1.0) if len(scaled) >= 10 else 0.0
    low, high = (
        share * (float(np.quantile(scaled, level)) if share > 0.0 else 0.0)
        + (1.0 - share) * float(scipy.special.stdtrit(freedom, 0.5 + level / 2.0))
        for level in LEVELS
    )
    return low, max(high, low, math.ulp(0.0))


def _freedom(scaled: Vector, piece: Int64[np.ndarray, " n"], stretches: int) -> float:
    """Degrees of freedom of the mean square, from its scatter between stretches."""
    _, place, rows = np.unique(piece, return_inverse=True, return_counts=True)
    means = np.bincount(place, scaled**2) / rows
    if len(means) < 2 or not means.var() > 0.0:
        return float(stretches)
    found = 2.0 * stretches * float(means.mean()) ** 2 / float(means.var(ddof=1))
    return min(max(found, stretches / 2.0), 4.0 * stretches)
