"""Compiled: how often a source sends, and whether samples of it were lost.

>>> import numpy as np
>>> usual = 0
>>> for step in (10, 10, 20, 10, 10, 50, 10, 10, 10):
...     usual = paced(usual, step)
>>> usual, is_hole(usual, 20), is_over(50, 99, True, np.array([usual, 0]))
(10, True, True)
>>> pace = np.zeros(FIRST + KNOWN, dtype=np.int64)
>>> is_steady(pace, np.array([100, 250] * 5)), is_unusual(pace, 1000), is_unusual(pace, 1001)
(True, False, True)
"""

from __future__ import annotations

from typing import Any

from evertwin.compiled.functions import njit

HOLE, CUT = 1.5, 4.0
"""Usual intervals beyond which a value on the line between two samples is no measurement; beyond
which, with no sample of any source, a grid that is differentiated or filtered starts anew."""
KNOWN, FEW, SHARE = 64, 8, 32
"""Newest intervals between samples that tell what is usual, how many must be known, and one in how
many may be a hole: pauses that come more often are the way of what sends only changes."""
COUNT, TAKEN, TOLD, TOLD_AT, FIRST = 0, 1, 2, 3, 4
"""Places in a ``pace``: intervals so far, stamp of the newest sample taken, the hole that was told
last and the stamp behind it, the first interval."""
AGAIN = 3_600_000_000_000
"""Time [ns] after which a hole is told again that is not twice as long as the last one told."""
DRIFT = 32
"""An interval moves the usual one by this part of it: up where it is longer, down where shorter, so
that it comes to rest at the median."""


@njit(cache=True, error_model="numpy")
def paced(usual: int, step: int) -> int:
    """The usual interval [ns] after another one, ``step``; 0: none is known yet."""
    if step <= 0 or step == usual:
        return usual
    if usual == 0:
        return step
    return usual + max(usual // DRIFT, 1) * (1 if step > usual else -1)


@njit(cache=True, error_model="numpy")
def is_hole(usual: int, width: int) -> bool:
    """Were samples lost between two that lie ``width`` apart?"""
    return bool(usual > 0 and width > HOLE * usual)


@njit(cache=True, error_model="numpy")
def is_over(passed: int, gap: int, cut: bool, usual: Any) -> bool:
    """Is the time ``passed`` without any sample longer than a ``gap``, or, where rows are ``cut``
    at holes, long for the source that sends most often? ``usual``: intervals of the sources."""
    least = 0
    for one in usual:
        if one > 0 and (least == 0 or one < least):
            least = one
    return bool(passed > gap or (cut and least > 0 and passed > CUT * least))


@njit(cache=True, error_model="numpy")
def is_unusual(pace: Any, passed: int) -> bool:
    """Is the time ``passed`` without any sample over `CUT` times all usual intervals?"""
    n = min(pace[COUNT], KNOWN)
    rest = n // SHARE
    for k in range(n):
        if CUT * pace[FIRST + k] >= passed:
            rest -= 1
            if rest < 0:
                return False
    return bool(n >= FEW)


@njit(cache=True, error_model="numpy")
def learn(pace: Any, passed: int) -> None:
    """One more interval between samples."""
    pace[FIRST + pace[COUNT] % KNOWN] = passed
    pace[COUNT] += 1


@njit(cache=True, error_model="numpy")
def is_told(pace: Any, passed: int, stamp: int) -> bool:
    """Is a hole worth an event: the first one, one far longer, or one after a long while?"""
    told = pace[TOLD]
    if told > 0 and passed <= 2 * told and stamp - pace[TOLD_AT] < AGAIN:
        return False
    pace[TOLD], pace[TOLD_AT] = passed, stamp
    return True


@njit(cache=True, error_model="numpy")
def is_steady(pace: Any, steps: Any) -> bool:
    """Learns the intervals ``steps``, up to the first unusual one; is there none?"""
    for i in range(steps.shape[0]):
        if is_unusual(pace, steps[i]):
            return False
        learn(pace, steps[i])
    return True
