"""Values that scatter by a share of themselves are told by their logarithms.

Insulation falls from 500 to 5 MΩ, a contact or a bearing shakes the more the worse it is: a scatter
that is told from the sound level is far too wide, or too narrow, at the limit. Asked is by which
scale the distances of values from their neighbours are more alike (the likelihood of Laplace), and
whether wear goes on there: what begins near zero and grows evenly slows down as a logarithm.

>>> from evertwin.prognosis.laws.series.indicator import Limit
>>> rng = np.random.default_rng(0)
>>> t, noise = np.arange(60.0), rng.standard_normal(60)
>>> even = Indicator.of("wear", "mm", Limit(90.0), t, 10.0 + t + 0.5 * noise)
>>> shares = Indicator.of("R", "MΩ", Limit(5.0, "below"), t, 500.0 * np.exp(0.2 * noise - 0.05 * t))
>>> by_share(even).ratio, by_share(shares).ratio
(False, True)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.scaled import REACH, neighbours, steady

FEWEST = 8
"""Values from which a scale is asked for."""
CLEAR = 3.0
"""Logarithm of the ratio of likelihoods from which logarithms tell."""
WIDE = float(np.log(1.5))
"""Least logarithm of the ratio of most values: within less either scale is as good."""
FARTHER = 10.0
"""What falls from so many times its limit is told so where neither scale is better."""
SLOWER = 0.5
"""Share of the pace of the older half, on that scale, at which the newer half goes on at least."""


def by_share(indicator: Indicator) -> Indicator:
    """The current life in logarithms where its scatter is a share of the values; else as it is."""
    life, limit = indicator.since_replaced(), indicator.limit
    known = np.isfinite(life.value)
    value = life.value[known]
    if len(value) < FEWEST or life.covariates or limit.value <= 0.0 or value.min() <= 0.0:
        return indicator
    log = np.log(value)
    plain, share = (float(np.abs(neighbours(y, REACH)).mean()) for y in (value, log))
    if not plain > 0.0 or not share > 0.0:
        return indicator
    gain = len(value) * float(np.log(plain / share)) - float(log.sum())
    at, half = life.at[known], len(value) // 2
    old, new = (limit.sign * steady(at[k], log[k])[0] for k in (slice(half), slice(half, None)))
    far = limit.sign < 0.0 and np.median(value[:FEWEST]) > FARTHER * limit.value
    wide = np.quantile(log, 0.9) - np.quantile(log, 0.1) >= WIDE
    if not wide or gain < (0.0 if far else CLEAR) or new < SLOWER * old:
        return indicator
    with np.errstate(invalid="ignore"):
        return life.with_(
            value=np.log(life.value), sigma=life.sigma / life.value, ratio=True,
            limit=replace(limit, value=float(np.log(limit.value))),
        )  # fmt: skip
