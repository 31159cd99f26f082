"""The transport lag that all measured axes share: found first, then removed.

A twin that ignores a lag learns a false correction from a perfectly linear machine. Each output's
lag after its free-running prediction is estimated (`evertwin.signals.delay`); where they agree, one
lag is stated, with its figures. `evertwin.sync.Feed.offset` removes it. Lags of single axes are the
machine's own and stay in its model.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> t = np.arange(0, 20, 0.02)
>>> def motion(t): return np.stack([np.sin(t) + np.sin(2.7 * t), np.cos(1.3 * t)], axis=1)
>>> noise = np.random.default_rng(0).normal(0, 1e-3, (len(t), 2))
>>> rows = make_block(np.rint(t * 1e9), np.zeros((len(t), 1)), motion(t - 0.13) + noise)
>>> found = shared_lag(rows, motion(t), Layout.of(x="m", y="m"), longest=0.5)
>>> round(found.seconds, 2), found.agree
(0.13, True)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from evertwin.errors import DataError
from evertwin.fold import Block
from evertwin.signals import Layout
from evertwin.signals.delay import Lag, lag
from evertwin.sync.horizon.horizon import trusted
from evertwin.types import Outputs

SURE = 0.01
"""Chance of calling equal lags different."""


@dataclass(frozen=True)
class SharedLag:
    """One lag of all outputs, or the reason why there is none.

    >>> SharedLag(math.nan, math.inf, False, "no motion", {}).agree
    False
    """

    seconds: float
    """How much later the measurements are than the prediction [s]; NaN where none is stated."""
    sigma: float
    """Its standard error [s]."""
    agree: bool
    """Do the outputs' lags agree?"""
    reason: str
    lags: Mapping[str, Lag]
    """Of each output, with correlation and gain; a negative gain is a flipped sign."""

    @property
    def interval95(self) -> tuple[float, float]:
        """95 % interval [s]; NaN where no lag is stated."""
        return (self.seconds - 1.96 * self.sigma, self.seconds + 1.96 * self.sigma)


def shared_lag(block: Block, y: Outputs, outputs: Layout, longest: float = 0.5) -> SharedLag:
    """The lag of what was measured after its prediction.

    Args:
        block: rows of one task.
        y: predicted outputs of these rows, simulated without adopting anything, (n, ny).
        outputs: the outputs' layout; angles are unwrapped.
        longest: lags from −longest to +longest are looked at [s].
    """
    measured, lags = trusted(block), {}
    for j, channel in enumerate(outputs):
        one, other = y[:, j], measured[:, j]
        if channel.kind == "angle":
            one, other = _unwrapped(one), _unwrapped(other)
        try:
            lags[channel.name] = lag(block.t, one, block.t, other, longest)
        except DataError as error:
            lags[channel.name] = Lag(math.nan, math.inf, math.nan, math.nan, "not", str(error))
    return agreement(lags, float(np.median(block.dt[1:])) if len(block.dt) > 1 else 0.0)


def agreement(lags: Mapping[str, Lag], step: float) -> SharedLag:
    """What the outputs' lags have in common: their weighted mean, where they do not differ.

    Args:
        lags: of each output.
        step: interval of the rows [s].
    """
    sure = [found for found in lags.values() if found.verdict == "identified"]
    if not sure:
        return SharedLag(math.nan, math.inf, False, "no output shows a lag for certain", lags)
    # A standard error below a hundredth of the interval is better than the stamps are.
    floor = 0.01 * step
    sigma = np.array([max(found.sigma, floor) for found in sure])
    seconds = np.array([found.seconds for found in sure])
    weight = sigma**-2
    mean = float((weight * seconds).sum() / weight.sum())
    spread = float((((seconds - mean) / sigma) ** 2).sum())
    if len(sure) > 1 and scipy.special.chdtrc(len(sure) - 1, spread) < SURE:
        shown = ", ".join(f"{name} {found.seconds:.3g} s" for name, found in lags.items())
        return SharedLag(math.nan, math.inf, False, f"the outputs' lags differ: {shown}", lags)
    reason = f"{len(sure)} of {len(lags)} outputs agree"
    return SharedLag(mean, float(weight.sum() ** -0.5), True, reason, lags)


def _unwrapped(angle: np.ndarray) -> np.ndarray:
    out = angle.copy()
    known = np.isfinite(angle)
    out[known] = np.unwrap(angle[known])
    return out
