"""Prognosis: how long a component lasts, from the history of what tells its wear.

`Indicator` is that history with its limit, `predict_life` answers with a `Life` (a distribution) or
with `NotEnough` (and what would be enough).
"""

from evertwin.prognosis.fleet import Fleet
from evertwin.prognosis.indicator import Indicator, Limit, Maintenance
from evertwin.prognosis.learn import learn
from evertwin.prognosis.life import Life, NotEnough, Onset, first_of
from evertwin.prognosis.predict import predict_life

__all__ = [
    "Fleet",
    "Indicator",
    "Life",
    "Limit",
    "Maintenance",
    "NotEnough",
    "Onset",
    "first_of",
    "learn",
    "predict_life",
]
