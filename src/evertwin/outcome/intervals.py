"""How sure a share and a count are: 95 % intervals of what a run has counted.

A share of rows is that of a binomial count, but rows that follow each other are alike. So it has
the interval of Wilson (1927) with the effective number of rows n / (1 + 2 Σ ρ): ρ is the
autocorrelation of "inside", up to where it is lost in its scatter; or the square of that of the
residual, where this makes fewer (of a Gaussian residual "inside" cannot have more, and where every
row is inside nothing else tells). A count over time has the exact interval of Poisson counts.

>>> Rate.of(0, 2 * MONTH).interval95[1].__round__(2)
1.5
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from evertwin.tuning.residuals.autocorrelation import Correlation, effective
from evertwin.types import Float64

NORMAL = 1.959964
"""Half width of 95 % of a normal distribution, in standard deviations."""
MONTH = 30 * 86400.0
"""[s]"""
Interval = tuple[float, float]


@dataclass(frozen=True)
class Coverage:
    """Share of the measured rows inside the predicted 95 % band.

    >>> z = np.random.default_rng(0).normal(size=4000)
    >>> told = Coverage.of(z)
    >>> told.interval95[0] < 0.95 < told.interval95[1]
    True
    """

    rows: int
    effective: float
    """Rows that are as much evidence, were they independent."""
    share: float
    interval95: Interval
    ahead: float | None = None
    """How far ahead the band was foretold [s]: from sample to sample; None: the longer, the longer
    ago the last update was."""

    @classmethod
    def of(cls, z: Float64[np.ndarray, " n"]) -> Coverage:
        """Of residuals in standard deviations; NaN where nothing was measured or foretold."""
        inside = np.where(np.isnan(z), np.nan, np.abs(z) <= NORMAL)
        rows, hits = int(np.sum(~np.isnan(z))), float(np.nansum(inside))
        if not rows:
            return cls(0, 0.0, math.nan, (0.0, 1.0))
        of_z, of_inside = Correlation.of(np.stack([z, inside], axis=1)).memory
        alike = rows / (1.0 + 2.0 * max(float(of_inside[1:].sum()), 0.0))
        n = max(min(alike, effective(float(rows), of_z)), 1.0)
        return cls(rows, n, hits / rows, _wilson(hits / rows, n))

    def __str__(self) -> str:
        """The share with its interval."""
        low, high = (100 * end for end in self.interval95)
        return (
            f"{100 * self.share:.1f} % ({low:.1f} … {high:.1f} %) of {self.rows} rows, as good as "
            f"{self.effective:.0f} independent ones"
        )


def _wilson(share: float, n: float) -> Interval:
    middle, z2 = share + NORMAL**2 / (2 * n), NORMAL**2 / n
    half = NORMAL * math.sqrt(share * (1 - share) / n + z2 / (4 * n))
    return max((middle - half) / (1 + z2), 0.0), min((middle + half) / (1 + z2), 1.0)


@dataclass(frozen=True)
class Rate:
    """A count per month of data.

    >>> print(Rate.of(3, MONTH))
    3 (0.619 … 8.77 per month)
    """

    count: int
    per_month: float
    interval95: Interval
    """Of the count that is expected per month; where none was seen, [0, 3 / months]."""

    @classmethod
    def of(cls, count: int, seconds: float) -> Rate:
        """``count`` within so much data [s]."""
        per = MONTH / seconds if seconds > 0 else math.inf
        low = float(scipy.special.gammaincinv(count, 0.025)) if count else 0.0
        high = float(scipy.special.gammaincinv(count + 1, 0.975 if count else 0.95))
        return cls(count, count * per if count else 0.0, (low * per if count else 0.0, high * per))

    def __str__(self) -> str:
        """The count, and what that says of a month."""
        low, high = self.interval95
        if not self.count:
            return f"0 (fewer than {high:.3g} per month)"
        return f"{self.count} ({low:.3g} … {high:.3g} per month)"
