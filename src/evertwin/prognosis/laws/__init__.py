"""Prognosis: how long a component lasts, from the history of what tells its wear.

`Indicator` is that history with its limit, `predict_life` answers with a `Life` (a distribution) or
with `NotEnough` (and what would be enough).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.prognosis.laws.likes.fleet import Fleet as Fleet
    from evertwin.prognosis.laws.predict import learn as learn
    from evertwin.prognosis.laws.series.indicator import (
        Indicator as Indicator,
        Limit as Limit,
        Maintenance as Maintenance,
    )
    from evertwin.prognosis.laws.series.life import (
        Life as Life,
        NotEnough as NotEnough,
        Onset as Onset,
        first_of as first_of,
    )
    from evertwin.prognosis.laws.growth.onset import find_onset as find_onset
    from evertwin.prognosis.laws.predict import predict_life as predict_life
    from evertwin.prognosis.laws.series.life import Workload as Workload

__getattr__ = surface(__name__)
