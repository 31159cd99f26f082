"""Calibration of a detector on calm data, and the honest answer "not calibrated yet".

Per output: mean and spread of each phase, the autoregression of the standardised residual, and
the limit of a two-sided CUSUM

    up ← max(0, up + e − k),    down ← max(0, down − e − k),    alarm above the limit

of the innovations ``e``, cut at ± ``clip`` so that no single sample decides, with ``k`` half the
shift that matters. The limit gives the false alarms per month that are allowed for all outputs
together (`evertwin.anomaly.run_length`).

Whitening serves a residual that persists: its sums vary more than those of independent samples.
Where they vary less (sensor noise that a prediction started from returns with the other sign at the
next sample) whitening would amplify slow errors of the model, and the residual is taken as it is.

A calibration has to pass three tests: enough independent samples, each phase seen several times,
and limits set on its first half must be silent on its second half. The last one is what tells half
an hour from several cycles of the machine.

>>> rng = np.random.default_rng(0)
>>> calm = Residuals.of(rng.normal(size=(3000, 1)), interval=3.0)
>>> found = calibrate(calm, Calm())
>>> found.calibration.ready, found.reason
(True, '')
>>> calibrate(calm.take(0, 200), Calm()).reason
'output 0: 200 calm samples, at least 1000 are needed'

Whitening: what of a residual is new at each sample.

Residuals of real machines remember: their own past predicts part of them, and a limit set for
independent samples is then wrong by orders of magnitude. An autoregression

    z[i] = Σ_j a[j]·z[i − 1 − j] + e[i]

is fitted to calm data (least squares, order by Bayes' information criterion) and the innovation
``e`` is what detectors see.

>>> rng = np.random.default_rng(0)
>>> z = np.zeros(4000)
>>> for i in range(1, 4000): z[i] = 0.8 * z[i - 1] + rng.normal()
>>> a = autoregression(z, orders=4)
>>> a.round(1).tolist(), innovations(z, a).std().round(1)
([0.8, 0.0, 0.0, 0.0], np.float64(1.0))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evertwin.anomaly.residuals import Residuals
from evertwin.anomaly.run_length import alarms, limit_for, run_length, steepness
from evertwin.compiled.functions import njit
from evertwin.errors import UsageError
from evertwin.types import Float64, Tasks, Vector

Series: TypeAlias = Float64[np.ndarray, " n"]
Coefficients: TypeAlias = Float64[np.ndarray, " orders"]
"""Latest lag first."""


def autoregression(z: Series, orders: int) -> Coefficients:
    """Coefficients, zero beyond the order that was chosen.

    Args:
        z: a calm series with mean zero, more than ``4·orders`` samples.
        orders: the highest order tried.
    """
    if orders == 0:
        return np.zeros(0)
    y, lags = z[orders:], sliding_window_view(z, orders)[:-1, ::-1]
    gram, cross, power = lags.T @ lags, lags.T @ y, float(y @ y)
    best = (len(y) * np.log(power / len(y) + 1e-300), np.zeros(orders))
    for order in range(1, orders + 1):
        a = np.linalg.lstsq(gram[:order, :order], cross[:order], rcond=None)[0]
        spread = max(power - float(a @ cross[:order]), 0.0) / len(y) + 1e-300
        cost = len(y) * np.log(spread) + order * np.log(len(y))
        if cost < best[0]:
            best = (cost, np.append(a, np.zeros(orders - order)))
    return best[1]


def innovations(z: Series, a: Coefficients) -> np.ndarray:
    """``e`` of all samples but the first ``len(a)``, (n − orders,)."""
    if len(a) == 0:
        return z.copy()
    lags = sliding_window_view(z, len(a))[:-1, ::-1]
    e: np.ndarray = z[len(a) :] - np.einsum("ij,j->i", lags, a)
    return e


def effective(z: Series, a: Coefficients) -> float:
    """Independent samples that would fix the mean of ``z`` as well.

    More than ``len(z)`` where neighbours cancel each other. The variance of a long mean is
    ``σe² / (n·(1 − Σa)²)``.
    """
    spread = float(np.var(innovations(z, a)))
    if spread == 0.0:
        return 0.0
    return len(z) * float(np.var(z)) * (1.0 - float(a.sum())) ** 2 / spread


ENOUGH = 30
"""Samples that a phase's own statistics need; else those of all phases together serve."""


@dataclass(frozen=True)
class Calm:
    """What counts as calibrated, and how often a false alarm is allowed.

    >>> Calm(false_alarms_per_month=0.5).shift
    3.0
    """

    false_alarms_per_month: float = 1.0
    """Over all outputs of all twins together."""
    twins: int = 1
    shift: float = 3.0
    """Shift that matters, in standard deviations of what is new in a sample; ``k`` is half."""
    clip: float = 8.0
    """Where a sample is cut, in the same unit."""
    least: int = 1000
    """Samples that a calibration needs."""
    independent: float = 50.0
    """Independent samples that they must be worth."""
    visits: int = 3
    """Times that each phase must have been entered, where there are several."""
    orders: int = 8
    """Highest order of the autoregression."""
    seed: int = 0

    def __post_init__(self) -> None:
        positive = (
            self.false_alarms_per_month, self.shift, self.clip, self.twins, self.visits
        )  # fmt: skip
        if min(positive) <= 0 or self.orders < 0 or self.least < 8 * (self.orders + 1):
            raise UsageError(
                "calm: expected false alarms, shift, clip, twins and visits above 0, and at least "
                f"{8 * (self.orders + 1)} samples for {self.orders} orders, got {self}"
            )


class Calibration(NamedTuple):
    """What the detectors know about calm. Part of their state.

    >>> blank(phases=2, outputs=1, orders=3).mean.shape
    (3, 1)
    """

    mean: Float64[np.ndarray, "phases1 ny"]
    """Mean per phase; last: of all phases together."""
    scale: Float64[np.ndarray, "phases1 ny"]
    """Standard deviation, likewise."""
    ar: Float64[np.ndarray, "ny orders"]
    sigma: Vector
    """Standard deviation of the innovations of the standardised residual, (ny,)."""
    limit: Vector
    """Limit of the CUSUM in standard deviations, (ny,)."""
    steep: Vector
    """θ: by how much the logarithm of its run length grows with the limit, (ny,)."""
    interval: float
    """Median interval from sample to sample [s]."""
    ready: bool
    """False: not calibrated yet."""


class Calibrated(NamedTuple):
    """A calibration and, where it is not ready, the reason.

    >>> Calibrated(blank(1, 1, 0), "too short").calibration.ready
    False
    """

    calibration: Calibration
    reason: str


@njit(cache=True, forceinline=True)
def whitened(known: Calibration, past: Any, j: int, z: float) -> float:
    """What the autoregression did not foresee of a standardised residual, which joins the past."""
    orders, left = known.ar.shape[1], z
    for m in range(orders):
        left -= known.ar[j, m] * past[j, m]
    for m in range(orders - 1, 0, -1):
        past[j, m] = past[j, m - 1]
    if orders > 0:
        past[j, 0] = z
    return left


def blank(phases: int, outputs: int, orders: int) -> Calibration:
    """Not calibrated yet."""
    shape = (phases + 1, outputs)
    return Calibration(
        np.zeros(shape), np.ones(shape), np.zeros((outputs, orders)), np.ones(outputs),
        np.full(outputs, np.inf), np.ones(outputs), 0.0, False,
    )  # fmt: skip


def calibrate(rows: Residuals, calm: Calm, phases: int = 1) -> Calibrated:
    """A calibration from calm ``rows``.

    Not ready is a value: see `Calibrated.reason`. The half test costs two thirds of the time.
    """
    found, reason = _fit(rows, calm, phases)
    if not reason:
        half = len(rows.r) // 2
        first, _ = _fit(rows.take(0, half), calm, phases)
        reason = _silent(first, rows.take(half, len(rows.r)), calm)
    return Calibrated(found._replace(ready=not reason), reason)


def _fit(rows: Residuals, calm: Calm, phases: int) -> tuple[Calibration, str]:
    ny = rows.r.shape[1]
    found = blank(phases, ny, calm.orders)
    reason = ""
    intervals = []
    for j in range(ny):
        known = np.isfinite(rows.r[:, j])
        r, phase = rows.r[known, j], rows.phase[known]
        reason = reason or _short(len(r), phase, calm, j)
        if len(r) <= 8 * (calm.orders + 1):
            continue
        intervals.append(float(np.median(np.diff(rows.t[known]))) * 1e-9)
        for k in range(phases + 1):
            part = r[phase == k] if k < phases else r
            part = part if len(part) >= ENOUGH else r
            found.mean[k, j], found.scale[k, j] = part.mean(), max(float(part.std()), 1e-300)
        z = (r - found.mean[phase, j]) / found.scale[phase, j]
        found.ar[j] = autoregression(z, calm.orders)
        worth = effective(z, found.ar[j])
        if worth >= len(z):
            found.ar[j] = 0.0
        if worth < calm.independent and not reason:
            reason = (
                f"output {j}: {len(r)} samples that are worth {worth:.0f} independent ones, at "
                f"least {calm.independent:.0f} are needed"
            )
        e = innovations(z, found.ar[j])
        found.sigma[j] = max(float(e.std()), 1e-300)
        target = run_length(calm.false_alarms_per_month, intervals[-1], ny * calm.twins)
        cut = np.clip(e / found.sigma[j], -calm.clip, calm.clip)
        rng = np.random.default_rng(calm.seed)
        found.limit[j] = limit_for(cut, 0.5 * calm.shift, target, rng)
        found.steep[j] = steepness(cut, 0.5 * calm.shift)[1]
    return found._replace(interval=min(intervals, default=0.0)), reason


def _short(samples: int, phase: Tasks, calm: Calm, output: int) -> str:
    if samples < calm.least:
        return f"output {output}: {samples} calm samples, at least {calm.least} are needed"
    entered = phase[np.flatnonzero(np.diff(phase, prepend=phase[0] - 1))]
    names, visits = np.unique(entered, return_counts=True)
    if len(names) > 1 and visits.min() < calm.visits:
        rare = int(names[np.argmin(visits)])
        return (
            f"output {output}: phase {rare} was entered {visits.min()} times, at least "
            f"{calm.visits} are needed"
        )
    return ""


def _silent(found: Calibration, rows: Residuals, calm: Calm) -> str:
    """Empty if ``found`` raises no alarm on ``rows``."""
    for j in range(rows.r.shape[1]):
        known = np.isfinite(rows.r[:, j])
        phase = rows.phase[known]
        z = (rows.r[known, j] - found.mean[phase, j]) / found.scale[phase, j]
        e = innovations(z, found.ar[j]) / found.sigma[j]
        counts = np.zeros(1, dtype=np.int64)
        cut = np.clip(e, -calm.clip, calm.clip)
        alarms(cut, 0.5 * calm.shift, found.limit[j : j + 1], counts)
        if counts[0]:
            return (
                f"output {j}: limits from the first half of the calm data give {counts[0]} alarms "
                "in its second half; more cycles of the machine are needed"
            )
    return ""
