"""Compiled: values that stay where all values end.

A sensor at its full scale, and a machine at a stop, stay at the largest or the least value there
is, whatever the model predicts beyond. One that froze there by chance misses the way back, too; of
what only ever goes on, as a way does, the newest value is always the largest, which tells nothing.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

from evertwin.compiled.functions import njit
from evertwin.sync import places as at
from evertwin.sync.options import COLD

BACK, BESIDE = 0.1, 2.0
"""Part of all that an output ever spanned that it may be predicted back from an end while it stays
there, and that it came back before if it does not only ever go on; and so many times what its model
moves beside it anyway."""


@njit(**COLD)
def is_at_end(limits: Any, memory: Any, room: Any, g: int, size: int) -> bool:
    """Is each output that equal values came from where all its values end, and predicted beyond, or
    hardly back from there?"""
    values, numbers, _ = memory
    for k in range(size):
        j = room[k]
        held, way = values[j, at.HELD], values[j, at.BEYOND]
        span = values[j, at.TOP] - values[j, at.BOTTOM]
        came = values[j, at.FELL]
        if held < values[j, at.TOP]:
            if held > values[j, at.BOTTOM]:
                return False
            way, came = -way, values[j, at.ROSE]
        if limits[j, at.ANGLE] > 0 or not came > BACK * span:
            return False
        beside = BESIDE * values[j, at.LEANT] * numbers[g, at.RUN]
        if way < -max(BACK * span, beside):
            return False
    return True
