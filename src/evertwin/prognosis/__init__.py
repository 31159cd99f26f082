"""Prognosis: how long a component lasts, from the history of what tells its wear.

`Indicator` is that history with its limit, `predict_life` answers with a `Life` (a distribution) or
with `NotEnough` (and what would be enough).
"""

from evertwin.prognosis.fleet import Fleet
from evertwin.prognosis.indicator import Indicator, Limit, Maintenance
from evertwin.prognosis.learn import learn
from evertwin.prognosis.life import Life, NotEnough, Onset, first_of
from evertwin.prognosis.onset import find_onset
from evertwin.prognosis.predict import predict_life
from evertwin.prognosis.workload import Workload

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
