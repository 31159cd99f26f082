"""Classes of inputs: each input's rows in up to eight classes of about equal size.

Whether a residual depends on an input is asked class by class
(`evertwin.tuning.residuals.statistics`), so that no form of the dependence has to be guessed.
Classes follow from the inputs alone: they are found once, however often the rows are tuned on.

>>> found = Classes.of(np.array([[1.0], [1.0], [2.0], [5.0]]))
>>> found.number.ravel().tolist(), found.count[0, :4].tolist()
([0, 0, 1, 2], [2.0, 1.0, 1.0, 0.0])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.tuning.residuals.autocorrelation import products
from evertwin.tuning.residuals.classes_loop import BINS, classify
from evertwin.types import Float64, Inputs, UInt8


@dataclass(frozen=True, eq=False)
class Classes:
    """The class of each input at each row. See the module for an example."""

    number: UInt8[np.ndarray, "nu n"]
    """0, 1, …; 0 too for what is not a number."""
    count: Float64[np.ndarray, "nu bins"]
    """Rows of each class."""

    @classmethod
    def of(cls, u: Inputs) -> Classes:
        """From inputs, (n, nu)."""
        n, nu = u.shape
        made = cls(np.empty((nu, n), dtype=np.uint8), np.zeros((nu, BINS)))
        classify(u, made.number, made.count)
        return made

    def beside(self, other: Classes) -> Classes:
        """These inputs, then others at the same rows."""
        pairs = (self.number, other.number), (self.count, other.count)
        return Classes(*(np.concatenate(pair) for pair in pairs))

    def correlation(self, lags: int) -> Float64[np.ndarray, "nu lags"]:
        """Autocorrelation of each input's classes at lags 1 … ``lags``; 0 where constant."""
        n = self.number.shape[1]
        centred = self.number - (self.count @ np.arange(BINS) / n)[:, None]
        found = np.array([products(one, lags) for one in centred])
        mean = found / np.maximum(n - np.arange(lags + 1), 1)
        whole = np.where(mean[:, :1] > 0, mean[:, :1], np.inf)
        return np.asarray(mean[:, 1:] / whole)
