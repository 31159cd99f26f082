"""Compiled: how often a source sends, and whether samples of it were lost.

>>> import numpy as np
>>> usual = 0
>>> for step in (10, 10, 20, 10, 10, 50, 10, 10, 10):
...     usual = paced(usual, step)
>>> usual, is_hole(usual, 20), is_over(50, 99, True, np.array([usual, 0]))
(10, True, True)
"""

from __future__ import annotations

from typing import Any

from evertwin.compiled.functions import njit

HOLE, CUT = 1.5, 4.0
"""Usual intervals beyond which a value on the line between two samples is no measurement; beyond
which, with no sample of any source, a grid that is differentiated or filtered starts anew."""
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
