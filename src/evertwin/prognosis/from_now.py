"""Lives from one moment: an indicator that has not been seen for a while is looked at from now.

A quality figure may end eight runs before the newest run, and a parameter may not have been told
apart lately. Life is counted from now all the same: the laws are followed up to it, on condition
that the component still works.
"""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.laws import Indicator, Life, NotEnough


def seen(indicator: Indicator, now: float) -> Indicator:
    """The indicator as it is looked at from ``now``, with a note where its newest value is older.

    >>> from evertwin.prognosis.laws import Limit
    >>> weld = Indicator.of("weld", "mm", Limit(3.0), [0, 8], [1.0, 1.1])
    >>> seen(weld, 14.0).notes
    ('weld: its newest value is 6 run old',)
    """
    last = newest(indicator)
    if last is None or now <= last:
        return indicator
    old = f"{indicator.name}: its newest value is {now - last:.4g} {indicator.clock} old"
    return indicator.seen_at(now).with_(notes=(*indicator.notes, old))


def unless_overdue(indicator: Indicator, life: Life | NotEnough) -> Life | NotEnough:
    """The life; a newer value is needed where only the laws say that the limit was passed since."""
    last = newest(indicator)
    if isinstance(life, NotEnough) or life.passed is None or last is None or life.passed <= last:
        return life
    needs = f"a newer value than that of {last:.4g} {indicator.clock}"
    return NotEnough(needs, "by its laws the limit has been passed since", laws=life.laws)


def newest(indicator: Indicator) -> float | None:
    """When the newest value was taken; None without any."""
    known = np.flatnonzero(np.isfinite(indicator.value))
    return float(indicator.at[known[-1]]) if len(known) else None
