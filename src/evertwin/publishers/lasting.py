"""How long a component lasts, as every publisher tells it: the 80 % interval and the median."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def lasting(life: Mapping[str, Any]) -> dict[str, float]:
    """Of the part ``life`` of ``evertwin.life/1``, in its unit; NaN: cannot be told.

    >>> lasting({"median": 60.0, "interval80": [40.0, None]})
    {'low': 40.0, 'median': 60.0, 'high': inf}
    >>> lasting({"verdict": "not enough data", "needs": "3 values"})["median"]
    nan
    """
    low, high = life.get("interval80", (math.nan, math.nan))
    told = {"low": low, "median": life.get("median", math.nan), "high": high}
    return {name: math.inf if value is None else float(value) for name, value in told.items()}
