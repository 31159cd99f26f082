"""What the tuned residual still says: its whiteness and its dependence on inputs.

If the tuned residual is white and independent of the inputs, the parameters had moved; if it still
depends on the inputs, the form is wrong. Both tests count *effective* rows: neighbours that agree
are not independent witnesses (Bartlett 1946).

>>> noise = np.random.default_rng(0).normal(size=2000)
>>> walk = np.convolve(noise, np.ones(20) / 20)[:2000]
>>> ljung_box(noise) > 0.05, ljung_box(walk) < 1e-6
(True, True)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.tuning.residuals.autocorrelation import DIRECT, Correlation, Lags, Series
from evertwin.tuning.residuals.classes import Classes
from evertwin.tuning.residuals.statistics_loop import LAGS, LONG, analysed, shifted
from evertwin.types import Float64, Inputs, Outputs, PerOutput

PerInput = Float64[np.ndarray, "ny nu"]


class Dependence(NamedTuple):
    """How much of one output's residual an input explains.

    >>> Dependence("torque", "speed", 0.3, 1e-9).share
    0.3
    """

    output: str
    input: str
    share: float
    """Share of the residual's variance that the mean over classes of the input explains."""
    p: float
    """Probability of such a share by chance, corrected for the number of inputs looked at."""


def autocorrelation(r: Series, lags: int) -> Lags:
    """ρ(0) … ρ(lags) of one residual; NaN is left out, (lags + 1,)."""
    return Correlation.of(r[:, None]).rho(0, lags)


def ljung_box(r: Series) -> float:
    """Probability that a white residual shows so much autocorrelation (Ljung and Box 1978)."""
    return float(whiteness(Correlation.of(r[:, None]))[0])


def whiteness(correlation: Correlation) -> PerOutput:
    """The same of every output, (ny,); 1 where there are too few rows to tell."""
    lags = np.maximum(np.minimum(LAGS, correlation.rows // 5), 1.0)
    return np.asarray(scipy.special.chdtrc(lags, correlation.statistic))


def spread(
    columns: Float64[np.ndarray, "n m"], used: np.ndarray, gain: Float64[np.ndarray, "m k"],
    rho: Lags,
) -> Float64[np.ndarray, " k"]:  # fmt: skip
    """What memory adds to the variance of Σ_t c_t e_t, with c = columns · gain, over that of e.

    Args:
        columns: regressor of one output, (n, m).
        used: rows that count, (n,).
        gain: what a row's columns contribute to k estimates, (m, k).
        rho: the noise's autocorrelation, from lag 0.

    That is 2 Σ_h ρ(h) Σ_t c_t c_{t+h}, summed over the few columns before it is spread over k.
    """
    n, m = columns.shape
    found = np.zeros((m, m))
    if len(rho) > DIRECT:
        columns = np.where(used[:, None], columns, 0.0)
        size = scipy.fft.next_fast_len(n + len(rho), real=True)
        kernel = np.conj(scipy.fft.rfft(np.concatenate([[0.0], rho[1:]]), size))[:, None]
        later = scipy.fft.irfft(scipy.fft.rfft(columns, size, axis=0) * kernel, size, axis=0)[:n]
        found = columns.T @ later
    else:
        shifted(columns, used, rho, found)
    return np.asarray(2.0 * (gain * (found @ gain)).sum(axis=0))


def dependences(
    r: Outputs, u: Inputs, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> tuple[Dependence, ...]:
    """Per output the input that explains most of its residual, by class means and an F test."""
    return depends(Correlation.of(r), Classes.of(u), outputs, inputs)


def depends(
    correlation: Correlation, classes: Classes, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> tuple[Dependence, ...]:
    """`dependences` of residuals and inputs whose parts are known already."""
    overlap = _overlap(correlation, classes)
    tests, told = analysed(classes.number, classes.count, correlation.parts, overlap)
    p = scipy.special.fdtrc(told[:, 4], told[:, 5], told[:, 3])
    best: dict[float, tuple[float, float, float]] = {}
    for chance, (k, j, part, *_) in zip(p.tolist(), told.tolist(), strict=True):
        # the least probable; of equals the one that explains most
        one = (1.0 if math.isnan(chance) else chance, -part, j)
        best[k] = min(best.get(k, one), one)
    return tuple(
        Dependence(outputs[int(k)], inputs[int(j)], -less, min(1.0, tests * chance))
        for k, (chance, less, j) in best.items()
    )


def _overlap(correlation: Correlation, classes: Classes) -> PerInput:
    """How many rows count as one for the correlation of two series: 1 + 2 Σ ρ_r ρ_c, at least 1.

    Nothing where no residual has a long memory: that is summed on the way."""
    if LONG not in correlation.reach:
        return np.empty((0, 0))
    memory = correlation.memory
    found = np.ones((len(memory), len(classes.number)))
    other = classes.correlation(max(len(rho) for rho in memory) - 1)
    for k, rho in enumerate(memory):
        found[k] += 2.0 * other[:, : len(rho) - 1] @ rho[1:]
    return np.maximum(found, 1.0)
