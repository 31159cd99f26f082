"""What is probably wrong with a clock, told from its first stamps and from what was lost.

Nanoseconds read as seconds leave most rows beyond the year 2262; a recording that was written
backward leaves one; stamps rounded to seconds repeat. Each has a sentence, with the factor.

>>> import numpy as np
>>> from evertwin.sources.time_unit import guess
>>> unit_of_time(guess("t", np.array([0, 50_000_000, 100_000_000])), "s", lost=True)
"the stamps look like ns (whole numbers that advance by 5e+07 a row), read as s, 10^9 times too \
long: set time = { unit = 'ns' }"
>>> order_of_rows(np.array([3, 2, 1, 0]) * 10**9)
'the stamps fall in 3 of 3 steps: sort the rows by time'
"""

from __future__ import annotations

import numpy as np

from evertwin.signals import compatible, conversion
from evertwin.sources.names import unit_problem
from evertwin.sources.stamps import NO_STAMP, UNITS
from evertwin.sources.time_unit import TimeGuess
from evertwin.types import Stamps


def unit_of_time(found: TimeGuess, unit: str, *, lost: bool) -> str:
    """The sentence where stamps look like another unit than they are read in.

    Args:
        found: what they look like.
        unit: what they are read in.
        lost: rows fell away, so that a guess is worth its sentence; else only what is evident.
    """
    if not {found.unit, unit} <= UNITS.keys():
        return ""
    power = UNITS[unit] - UNITS[found.unit]
    if power == 0 or not (found.evident or (lost and power > 0)):
        return ""
    size = f"10^{abs(power)} times too {'long' if power > 0 else 'short'}"
    return (
        f"the stamps look like {found.unit} ({found.reason}), read as {unit}, {size}: set "
        f"time = {{ unit = '{found.unit}' }}"
    )


def order_of_rows(t: Stamps) -> str:
    """The sentence where most of the stamps [ns] fall, or stand still."""
    steps = np.diff(t[t != NO_STAMP])
    fall, stand = int((steps < 0).sum()), int((steps == 0).sum())
    if 2 * fall > len(steps):
        return f"the stamps fall in {fall} of {len(steps)} steps: sort the rows by time"
    if 2 * stand > len(steps):
        return (
            f"{stand} of {len(steps)} stamps repeat the one before: they are rounded, or several "
            "rows belong together"
        )
    return ""


def unit_of_channel(channel: str, stated: str, used: str) -> str:
    """The sentence where the file states another unit of the same kind than it is read in.

    >>> unit_of_channel("x", "mm", "m")
    "x: the file says 'mm', the twin file 'm': a factor of 0.001"
    >>> unit_of_channel("x", "mm", "mm"), unit_of_channel("x", "ticks", "m")
    ('', '')
    """
    if not stated or unit_problem(stated) or not compatible(stated, used):
        return ""
    factor = conversion(stated)[0] / conversion(used)[0]
    if conversion(stated) == conversion(used):
        return ""
    return f"{channel}: the file says {stated!r}, the twin file {used!r}: a factor of {factor:g}"
