"""What the tuned residual still says: its autocorrelation, whiteness and dependence on inputs.

If the tuned residual is white and independent of the inputs, the parameters had moved; if it still
depends on the inputs, the form is wrong. Both tests count *effective* rows: neighbours that agree
are not independent witnesses (Bartlett 1946).

>>> import numpy as np
>>> noise = np.random.default_rng(0).normal(size=2000)
>>> walk = np.convolve(noise, np.ones(20) / 20)[:2000]
>>> ljung_box(noise) > 0.05, ljung_box(walk) < 1e-6
(True, True)
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
import scipy

from evertwin.types import Float64, Inputs, Outputs, Vector

Series: TypeAlias = Float64[np.ndarray, " n"]
Lags: TypeAlias = Float64[np.ndarray, " lags"]

__all__ = ["Dependence", "autocorrelation", "dependences", "effective", "ljung_box", "spread"]

BINS = 8
"""Classes of each input, of about equal size."""
LAGS = 20
"""Lags that the whiteness test looks at."""
DIRECT = 16
"""Lags up to which sums are taken one by one; beyond, the spectrum is faster."""
MOST = 4000
"""Largest lag that an autocorrelation is followed to."""


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
    """ρ(0) … ρ(lags) of a residual; NaN is left out, (lags + 1,)."""
    known = ~np.isnan(r)
    centred = np.where(known, r - (np.mean(r[known]) if known.any() else 0.0), 0.0)
    if lags > DIRECT:
        products, pairs = _products(centred, lags), _products(known.astype(np.float64), lags)
    else:
        # Sums without BLAS, whose threads cost more than these short sums.
        steps = range(1, lags + 1)
        shifted = [np.einsum("i,i->", centred[h:], centred[: len(r) - h]) for h in steps]
        products = np.array([np.einsum("i,i->", centred, centred), *shifted])
        whole = known.all()
        counts = [len(r) - h if whole else np.sum(known[h:] & known[: len(r) - h]) for h in steps]
        pairs = np.array([known.sum(), *counts], dtype=np.float64)
    if not products[0] > 0:
        return np.eye(1, lags + 1).reshape(-1)
    mean = products / np.maximum(np.round(pairs), 1.0)
    return np.asarray(mean / mean[0])


def _products(values: Series, lags: int) -> Lags:
    """Σ_t v(t) v(t + h) for h = 0 … lags, by way of the spectrum."""
    size = 1 << int(2 * len(values) - 1).bit_length()
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(values, size)) ** 2, size)[: lags + 1])


def memory(r: Series) -> Lags:
    """ρ(0), ρ(1), … up to the last lag before it is lost in its own scatter (2/√n)."""
    n = int(np.count_nonzero(~np.isnan(r)))
    most = max(1, min(len(r) // 4, MOST))
    border = 2.0 / np.sqrt(max(n, 1))
    rho, lags = np.ones(1), min(4, most)
    while True:
        rho = autocorrelation(r, lags)
        lost = np.flatnonzero(np.abs(rho) < border)
        if len(lost) or lags == most:
            return np.asarray(rho[: int(lost[0]) if len(lost) else lags + 1])
        lags = min(lags * 16, most)


def effective(r: Series) -> float:
    """Effective number of rows for a variance: n / (1 + 2 Σ ρ²)."""
    rho = memory(r)
    return float(np.count_nonzero(~np.isnan(r)) / (1.0 + 2.0 * np.square(rho[1:]).sum()))


def spread(influence: Float64[np.ndarray, "n k"], r: Series) -> Vector:
    """Variance of Σ_t c_t e_t for noise e with the autocorrelation of ``r``, over its variance.

    Args:
        influence: c, (n, k); what each row contributes to k estimates.
        r: residual, (n,), whose autocorrelation the noise has.

    Never below the value for independent noise.
    """
    rho = memory(r)
    white = np.square(influence).sum(axis=0)
    total = white.copy()
    if len(rho) > 64:
        size = 1 << int(2 * len(influence) - 1).bit_length()
        power = np.abs(np.fft.rfft(influence, size, axis=0)) ** 2
        products = np.fft.irfft(power, size, axis=0)[1 : len(rho)]
        total += 2.0 * rho[1:] @ products
    else:
        for lag in range(1, len(rho)):
            total += 2.0 * rho[lag] * (influence[lag:] * influence[:-lag]).sum(axis=0)
    return np.asarray(np.maximum(total, white))


def ljung_box(r: Series) -> float:
    """Probability that a white residual shows so much autocorrelation (Ljung and Box 1978)."""
    n = int(np.count_nonzero(~np.isnan(r)))
    lags = min(LAGS, n // 5)
    if lags < 1:
        return 1.0
    rho = autocorrelation(r, lags)[1:]
    statistic = n * (n + 2) * float((np.square(rho) / (n - np.arange(1, lags + 1))).sum())
    return float(scipy.special.chdtrc(lags, statistic))


def dependences(
    r: Outputs, u: Inputs, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> tuple[Dependence, ...]:
    """Per output the input that explains most of its residual, by class means and an F test."""
    classes = [_classes(u[:, j]) for j in range(u.shape[1])]
    found = []
    for k, output in enumerate(outputs):
        rho = memory(r[:, k])
        tests = [
            (*_explained(r[:, k], classes[j], rho), name)
            for j, name in enumerate(inputs)
            if classes[j].max(initial=0) > 0
        ]
        if tests:
            p, share, name = min(tests, key=lambda t: (t[0], -t[1]))
            found.append(Dependence(output, name, share, min(1.0, p * len(tests))))
    return tuple(found)


def _classes(values: Series) -> np.ndarray:
    """Class of each row, 0 … at most BINS − 1, of about equal size."""
    edges = np.unique(np.nanquantile(values, np.linspace(0, 1, BINS + 1)))[1:-1]
    few = np.unique(values[np.isfinite(values)][:: max(1, len(values) // 2000)])
    if len(few) <= BINS:
        edges = (few[1:] + few[:-1]) / 2
    return np.searchsorted(edges, values, side="right")


def _explained(r: Series, classes: np.ndarray, rho: Lags) -> tuple[float, float]:
    """(p, share) of an analysis of variance over classes, with effective rows."""
    known = ~np.isnan(r)
    e, c = r[known], classes[known]
    count = np.bincount(c)
    full = count > 0
    groups = int(full.sum())
    total = float(np.square(e - e.mean()).sum()) if len(e) else 0.0
    if groups < 2 or not total > 0:
        return 1.0, 0.0
    means = np.bincount(c, e)[full] / count[full]
    between = float((count[full] * np.square(means - e.mean())).sum())
    share = between / total
    n = _independent(len(e), classes, rho)
    if n <= groups + 1 or share >= 1:
        return 1.0, share
    f = share / (groups - 1) / ((1 - share) / (n - groups))
    return float(scipy.special.fdtrc(groups - 1, n - groups, f)), share


def _independent(rows: int, classes: np.ndarray, rho: Lags) -> float:
    """Effective rows for a correlation of two series: n / (1 + 2 Σ ρ_r ρ_c)."""
    if len(rho) == 1:
        return float(rows)
    other = autocorrelation(classes.astype(np.float64), len(rho) - 1)
    return rows / max(1.0, 1.0 + 2.0 * float((rho[1:] * other[1:]).sum()))
