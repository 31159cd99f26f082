"""How far predictions are off after a lead time: the part of a band that recordings tell.

A version is started from the measured state at many places of the recordings and runs open loop
over the horizon. What is off then holds the noise of the start, of the sensor and of the process,
and what the form does not know. Its size over the lead time h follows

    σ²(h) = a + b·h + c·h²        a noise, b random walk, c a rate that is off;  a, b, c ≥ 0

per output, fitted to robust sizes in bins of h. How many σ hold 80 or 95 % is counted on the same
residuals, so that heavy tails widen a band that the bell curve would make too narrow. What is
counted in-sample is some stretches short, hence Student's t where there are few.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.optimize import nnls
from scipy.stats import t as student

from evertwin.errors import DataError
from evertwin.fold import Block, take
from evertwin.models import Model, Restart, roll
from evertwin.models.function import python_kernel
from evertwin.sync.horizon import residuals, restarts
from evertwin.types import Outputs, ParameterVector, Vector

__all__ = ["LEVELS", "Spread", "spread"]

LEVELS = (0.8, 0.95)
"""Shares of future values that a band holds."""
BINS = 12
LEAST = 4
"""Fewest stretches of recorded data that a band may rest on."""
FEWEST = 8
"""Fewest rows with a residual."""
ENOUGH = 40
"""Stretches from which on the counted quantile stands alone."""


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

    def sigma(self, lead: Vector) -> Outputs:
        """Standard deviation at lead times [s], (n, ny)."""
        basis = np.stack([np.ones_like(lead), lead, lead**2], axis=1)
        return np.asarray(np.sqrt(basis @ self.law.T))


def spread(model: Model, p: ParameterVector, windows: Sequence[Block], horizon: float) -> Spread:
    """The residual's size by lead time up to ``horizon`` [s], from open-loop runs.

    Raises:
        DataError: too few stretches; names how much data would be enough.
    """
    span = sum(float(w.t[-1] - w.t[0]) * 1e-9 for w in windows)
    length = min(horizon, span / (2 * LEAST))
    leads, found, stretches = _pairs(model, p, windows, length)
    known = int(np.isfinite(found).any(axis=1).sum())
    if stretches < LEAST or known < FEWEST:
        raise DataError(
            f"forecast: expected at least {LEAST} stretches of {length:.3g} s with measurements to "
            f"learn the band from, got {stretches} with {known} rows: give longer recordings"
        )
    static = len(model.states) == 0
    rows = [_law(leads[:, k], found[:, k], static) for k in range(found.shape[1])]
    law = np.array(rows)
    basis = np.stack([np.ones_like(leads), leads, leads**2], axis=2)
    scaled = np.abs(found) / np.sqrt(np.maximum(np.einsum("nkb,kb->nk", basis, law), 1e-300))
    factor = np.array([_factors(scaled[:, k], stretches) for k in range(found.shape[1])])
    return Spread(law, factor, stretches)


def _pairs(
    model: Model, p: ParameterVector, windows: Sequence[Block], length: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Lead times and residuals, both (n, ny), and the number of stretches."""
    kernel = model.kernel() if hasattr(model, "kernel") else python_kernel(model)
    x0 = model.initial(p)
    leads, found, stretches = [], [], 0.0
    for window in windows:
        for share in (0.0, 0.5) if len(x0) else (0.0,):
            start = int(np.searchsorted(window.t, window.t[0] + share * length * 1e9))
            if len(window.t) - start < 3:
                continue
            part = take(window, start, len(window.t))
            plan = restarts(part, length, x0)
            _, y = roll(kernel, x0, part.u, part.dt, p, plan)
            found.append(residuals(model, part, y))
            leads.append(_lead(part, plan))
            if share == 0.0:
                stretches += float(part.t[-1] - part.t[0]) * 1e-9 / length
    if not found:
        return np.zeros((0, len(model.outputs))), np.zeros((0, len(model.outputs))), 0
    return np.concatenate(leads), np.concatenate(found), int(stretches)


def _lead(part: Block, plan: Restart) -> Outputs:
    """Time since each output was last adopted [s], (n, ny)."""
    t = (part.t - part.t[0]) * 1e-9
    adopted = np.isfinite(plan.y) & (plan.code > 0)[:, None]
    adopted[plan.code == 2] = True
    since = np.where(adopted, t[:, None], -np.inf)
    before = np.maximum.accumulate(since, axis=0)
    before = np.concatenate([before[:1], before[:-1]])
    return np.where(np.isfinite(before), t[:, None] - before, 0.0)


def _law(lead: Vector, residual: Vector, static: bool) -> np.ndarray:
    """a, b, c from robust sizes in bins of the lead time."""
    known = np.isfinite(residual)
    h, r = lead[known], np.abs(residual[known])
    if len(r) == 0:
        return np.zeros(3)
    if static or float(h.max()) <= 0.0:
        return np.array([_size(r) ** 2, 0.0, 0.0])
    edges = np.unique(np.quantile(h, np.linspace(0.0, 1.0, BINS + 1)))
    places = np.clip(np.searchsorted(edges, h, side="right") - 1, 0, max(len(edges) - 2, 0))
    size = [(float(h[places == b].mean()), _size(r[places == b]), int((places == b).sum()))
            for b in np.unique(places)]  # fmt: skip
    at, sigma, count = (np.array(column) for column in zip(*size, strict=True))
    if not sigma.max() > 0.0:
        return np.zeros(3)  # the simulation repeats the recording
    floor = float(sigma.max()) * 1e-3
    # the variance of a squared size grows with its square: weigh relative errors
    weight = np.sqrt(count) / np.maximum(sigma, floor) ** 2
    basis = np.stack([np.ones_like(at), at, at**2], axis=1)
    unit = np.array([1.0, 1.0 / at.max(), 1.0 / at.max() ** 2])
    found, _ = nnls(weight[:, None] * basis * unit, weight * sigma**2)
    return np.asarray(found * unit)


def _size(r: Vector) -> float:
    """Standard deviation that outliers do not move; the plain one where half of it is zero."""
    robust = float(np.median(r)) / 0.6745
    return robust if robust > 0.0 else float(np.sqrt(np.mean(r**2)))


def _factors(scaled: Vector, stretches: int) -> tuple[float, float]:
    """How many σ hold 80 and 95 %."""
    known = scaled[np.isfinite(scaled)]
    found = []
    for level in LEVELS:
        bell = float(student.ppf(0.5 + level / 2.0, max(stretches - 1, 1)))
        if len(known) < 10:
            found.append(bell)
            continue
        rank = min(level * (1.0 + 1.0 / stretches), 1.0)
        counted = float(np.quantile(known, rank))
        share = min(stretches / ENOUGH, 1.0)
        found.append(max(counted, share * counted + (1.0 - share) * bell))
    low, high = found
    return low, max(high, low, math.ulp(0.0))
