"""The memory of residuals: how far rows that follow each other agree.

One `Correlation` holds what several statistics of the same residuals need, computed once: sums over
short lags directly, over long ones by way of the spectrum.

>>> noise = np.random.default_rng(0).normal(size=(2000, 1))
>>> slow = np.convolve(noise[:, 0], np.ones(20) / 20)[:2000, None]
>>> both = Correlation.of(np.concatenate([noise, slow], axis=1))
>>> [len(rho) for rho in both.memory], round(effective(2000.0, both.memory[1]))
([1, 34], 136)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from evertwin.tuning.residuals.statistics_loop import LAGS, LONG, MOST, Memory, remember
from evertwin.types import Float64, Int64, Outputs, PerOutput

DIRECT = 64
"""Lags up to which sums are taken one by one; beyond, the spectrum is faster."""

Series = Float64[np.ndarray, " n"]
Lags = Float64[np.ndarray, " _"]


def products(values: Series, lags: int) -> Lags:
    """Σ_t v(t) v(t + h) for h = 0 … lags by way of the spectrum, (lags + 1,).

    >>> products(np.array([1.0, 2.0, 3.0]), 2).round(9).tolist()
    [14.0, 8.0, 3.0]
    """
    size = scipy.fft.next_fast_len(len(values) + lags, real=True)
    power = np.abs(scipy.fft.rfft(values, size)) ** 2
    return np.asarray(scipy.fft.irfft(power, size)[: lags + 1])


@dataclass(frozen=True)
class Correlation:
    """Residuals, centred, and their autocorrelation. See the module for an example."""

    centred: Float64[np.ndarray, "lanes more"]
    """Less the mean, an output a row; 0 where unknown, behind the rows, and up to whole `LANES`."""
    known: Float64[np.ndarray, "some more"]
    """1 where known, else 0; nothing where all are."""
    rows: PerOutput
    """Rows that are known."""
    square: PerOutput
    """Sum of squares about the mean."""
    short: Float64[np.ndarray, "ny lags"]
    """ρ(0) … ρ(LAGS) of every output."""
    reach: Int64[np.ndarray, " ny"]
    """The last lag before ρ is lost in its own scatter, 2/√n; `LONG` beyond `LAGS`."""
    statistic: PerOutput
    """Of the whiteness test (Ljung and Box 1978)."""

    @classmethod
    def of(cls, r: Outputs) -> Correlation:
        """From residuals (n, ny); NaN is left out."""
        return cls(*remember(r))

    @property
    def parts(self) -> Memory:
        """All of it, for the compiled loops."""
        return Memory(
            self.centred, self.known, self.rows, self.square, self.short, self.reach,
            self.statistic,
        )  # fmt: skip

    @property
    def n(self) -> int:
        """Rows."""
        return int(self.centred.shape[1]) - LAGS

    def rho(self, k: int, lags: int) -> Lags:
        """ρ(0) … ρ(lags) of output ``k``, (lags + 1,)."""
        if lags <= LAGS:
            return self.short[k, : lags + 1]
        n = self.n
        found = products(self.centred[k, :n], lags)
        if not found[0] > 0:
            return np.eye(1, lags + 1).reshape(-1)
        pairs = n - np.arange(lags + 1.0)
        if self.rows[k] < n:
            pairs = np.round(products(self.known[k, :n], lags))
        mean = found / np.maximum(pairs, 1.0)
        return np.asarray(mean / mean[0])

    @cached_property
    def memory(self) -> tuple[Lags, ...]:
        """Per output ρ(0), ρ(1), … up to the last lag before it is lost."""
        reach = enumerate(self.reach.tolist())
        return tuple(self._long(k) if h == LONG else self.short[k, : h + 1] for k, h in reach)

    def _long(self, k: int) -> Lags:
        """The same of an output that remembers longer than `LAGS`."""
        border = 2.0 / np.sqrt(max(float(self.rows[k]), 1.0))
        lags, most = LAGS, min(self.n // 4, MOST)
        while lags < most:
            lags = min(lags * 16, most)
            rho = self.rho(k, lags)
            lost = 1 + np.flatnonzero(np.abs(rho[1:]) < border)
            if len(lost):
                return rho[: int(lost[0])]
        return rho


def effective(rows: float, rho: Lags) -> float:
    """Effective number of rows for a variance: n / (1 + 2 Σ ρ²)."""
    return rows / (1.0 + 2.0 * float(rho[1:] @ rho[1:]))
