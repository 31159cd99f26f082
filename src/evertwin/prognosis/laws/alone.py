"""What a life told from one series alone is worth: measured on wear that no law here is like.

The laws are sure of themselves where one of them fits, and the next load, crack or plateau is in
none of them. So they are asked of the newest `NEWEST` of the values, which say how wear goes now,
and the width of their answer is never less than `STRANGE`: the logarithm of the remaining life is
normal. Narrow answers are earned with a fleet.

Both figures come from drawn wear that follows no law of the bank (`python -m proofs.believed
--laws seen`): of the shares and widths that were tried they lose least, and four in five of such
lives lie inside what is told for four in five.

>>> from evertwin.prognosis.laws.life import LEVELS
>>> told = widened(50.0 * np.exp(0.01 * (LEVELS - 0.5)))
>>> round(float(np.interp(0.9, LEVELS, told) / np.interp(0.1, LEVELS, told)), 1)
3.6
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from evertwin.prognosis.laws.indicator import Indicator
from evertwin.prognosis.laws.life import LEVELS
from evertwin.types import Float64

STRANGE = 0.5
"""Standard deviation of the logarithm of a life by laws that do not hold."""
NEWEST = 0.5
"""Share of the values that the laws are asked of."""
FEWEST = 20
"""Values that are asked at least, where there are as many."""
VACUOUS = 20.0
"""Upper over lower end of the 80 % interval from which it says nothing."""

_SCORES = scipy.special.ndtri(LEVELS)


def newest(indicator: Indicator) -> Indicator:
    """The newest values of the current life, as if it had begun with them."""
    life = indicator.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    count = max(int(NEWEST * len(good)), FEWEST)
    first = int(good[-count]) if count < len(good) else 0
    return replace(life.rows(np.arange(first, len(life.at))), origin=None)


def widened(remaining: Float64[np.ndarray, " k"]) -> Float64[np.ndarray, " k"] | None:
    """Quantiles of the life as it is told; None where they would say nothing.

    Args:
        remaining: by the laws, at `LEVELS`.
    """
    low, half, high = (float(np.interp(p, LEVELS, remaining)) for p in (0.1, 0.5, 0.9))
    if not low > 0.0 or not np.isfinite(half):
        return None
    own = np.log(high / low) / 2.56 if np.isfinite(high) else np.log(half / low) / 1.28
    spread = float(np.hypot(STRANGE, own))
    out: Float64[np.ndarray, " k"] = half * np.exp(spread * _SCORES)
    return out if np.interp(0.9, LEVELS, out) <= VACUOUS * np.interp(0.1, LEVELS, out) else None
