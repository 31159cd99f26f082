"""Clocks of wear: a law is linear in its own clock.

With age s (now = 1) a law says that the indicator follows ``a + b·G(s)``. The clock G carries the
law's form and is scaled to ``G(1) = 1``, so that ``b`` is the growth so far:

    linear       G = s
    power        G = s^c
    exponential  G = (e^(c·s) − 1)/(e^c − 1)
    saturating   the same with c < 0: towards a level that it never passes
    cracking     G = s·(1 − c)/(1 − c·s): without bound at 1/c, as a crack by Paris' law

A bank holds many clocks at once, one per hypothesis; everything is evaluated on arrays
(hypotheses, times).

>>> clocks = Clocks("power", np.array([1.0, 2.0]))
>>> clocks.at(np.array([0.5, 1.0, 2.0]))
array([[0.5 , 1.  , 2.  ],
       [0.25, 1.  , 4.  ]])
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from evertwin.types import Float64

Form: TypeAlias = Literal["linear", "power", "exponential", "cracking"]
STRAIGHT = 1e-6
"""Below this exponent an exponential is a straight line in double precision."""
HUGE = 300.0
"""Exponents are cut here: beyond, the clock has long passed any limit."""
OPEN = 1e-9
"""Share of a crack's life before its end at which it is cut."""


class Clocks(NamedTuple):
    """One clock per hypothesis, all of one form.

    >>> Clocks("linear", np.zeros(1)).at(np.array([3.0]))
    array([[3.]])
    """

    form: Form
    shape: Float64[np.ndarray, " h"]
    """Exponent c; 0 means straight, below 0 saturating. Of a crack the c of the module, below 1."""

    def take(self, index: np.ndarray) -> Clocks:
        """Some of the hypotheses."""
        return Clocks(self.form, self.shape[index])

    def at(self, s: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, "h n"]:
        """G at ages ``s``."""
        if self.form == "power":
            out: Float64[np.ndarray, "h n"] = np.power(np.maximum(s, 0.0), self.shape[:, None])
            return out
        if self.form == "cracking":
            c = self.shape[:, None]
            return np.asarray(s * (1.0 - c) / np.maximum(1.0 - c * s, OPEN))
        return _growth(self.shape[:, None], np.maximum(s, 0.0))

    def slope(self, s: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, "h n"]:
        """G′ at ages ``s``."""
        c = self.shape[:, None]
        if self.form == "power":
            out: Float64[np.ndarray, "h n"] = c * np.power(np.maximum(s, 1e-12), c - 1.0)
            return out
        if self.form == "cracking":
            return np.asarray((1.0 - c) / np.maximum(1.0 - c * s, OPEN) ** 2)
        exponent = np.minimum(c * s, HUGE)
        straight = np.abs(c) < STRAIGHT
        safe = np.where(straight, 1.0, c)
        return np.where(straight, 1.0, safe * np.exp(exponent) / np.expm1(safe))


def _growth(c: np.ndarray, u: np.ndarray) -> Float64[np.ndarray, "h n"]:
    """(e^(c·u) − 1)/(e^c − 1), straight for small c."""
    straight = np.abs(c) < STRAIGHT
    safe = np.where(straight, 1.0, c)
    return np.where(straight, u, np.expm1(np.minimum(safe * u, HUGE)) / np.expm1(safe))
