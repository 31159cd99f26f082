"""Prognosis: how long a component lasts, from the history of what tells its wear.

`Indicator` is that history with its limit, `predict_life` answers with a `Life` (a distribution) or
with `NotEnough` (and what would be enough).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.prognosis.laws.fleet import Fleet
    from evertwin.prognosis.laws.fleet_prior import learn
    from evertwin.prognosis.laws.indicator import Indicator, Limit, Maintenance
    from evertwin.prognosis.laws.life import Life, NotEnough, Onset, first_of
    from evertwin.prognosis.laws.onset import find_onset
    from evertwin.prognosis.laws.predict import predict_life
    from evertwin.prognosis.laws.workload import Workload

__all__ = [
    "Fleet",
    "Indicator",
    "Life",
    "Limit",
    "Maintenance",
    "NotEnough",
    "Onset",
    "Workload",
    "find_onset",
    "first_of",
    "learn",
    "predict_life",
]

__getattr__ = surface(__name__)
