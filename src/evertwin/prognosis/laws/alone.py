"""What a life told from one series alone is worth: measured on wear that no law here is like.

The laws are sure of themselves where one of them fits, and the next load, crack or plateau is in
none of them. So the answer keeps their middle, moved `NEWEST` of the way (on the logarithm) to
where the newest stretch would go as a line, and its width is never less than `STRANGE`: the
logarithm of the remaining life is normal. Narrow answers are earned with a fleet.

Both figures come from drawn wear that follows no law of the bank (`python -m proofs.believed`):
they are those at which four in five of such lives lie inside what is told for four in five.

>>> from evertwin.prognosis.laws.life import LEVELS
>>> told = widened(50.0 * np.exp(0.01 * (LEVELS - 0.5)), 50.0)
>>> round(float(np.interp(0.9, LEVELS, told) / np.interp(0.1, LEVELS, told)), 1)
5.4
"""

from __future__ import annotations

import numpy as np
import scipy

from evertwin.prognosis.laws.life import LEVELS
from evertwin.prognosis.laws.scaled import Problem
from evertwin.types import Float64

STRANGE = 0.66
"""Standard deviation of the logarithm of a life by laws that do not hold."""
NEWEST = 0.3
STRETCH = 0.3
"""Share of the values that is the newest stretch."""
FARTHEST = 1.5
"""Most by which the newest stretch counts, as a logarithm."""
VACUOUS = 20.0
"""Upper over lower end of the 80 % interval from which it says nothing."""

_SCORES = scipy.special.ndtri(LEVELS)


def widened(
    remaining: Float64[np.ndarray, " k"], newest: float
) -> Float64[np.ndarray, " k"] | None:
    """Quantiles of the life as it is told; None where they would say nothing.

    Args:
        remaining: by the laws, at `LEVELS`.
        newest: time to the limit along the newest stretch.
    """
    low, half, high = (float(np.interp(p, LEVELS, remaining)) for p in (0.1, 0.5, 0.9))
    if not low > 0.0 or not np.isfinite(half):
        return None
    own = np.log(high / low) / 2.56 if np.isfinite(high) else np.log(half / low) / 1.28
    moved = np.clip(np.log(newest / half), -FARTHEST, FARTHEST)
    spread = float(np.hypot(STRANGE, own))
    out: Float64[np.ndarray, " k"] = half * np.exp(NEWEST * moved + spread * _SCORES)
    return out if np.interp(0.9, LEVELS, out) <= VACUOUS * np.interp(0.1, LEVELS, out) else None


def along(problem: Problem) -> float:
    """Time to the limit, in ages, along a line through the newest stretch; never below 0.001."""
    count = max(int(STRETCH * len(problem.y)), 6)
    s, y = problem.s[-count:], problem.y[-count:]
    centred = s - s.mean()
    slope = float(centred @ y) / max(float(centred @ centred), 1e-300)
    now = float(y.mean()) + slope * (1.0 - float(s.mean()))
    left = max(problem.limit - now, 0.0)
    return max(left / slope, 1e-3) if slope * 1e3 > left else 1e3
