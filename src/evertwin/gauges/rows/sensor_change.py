"""What a channel has become, and since when."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from evertwin.signals.sizes import rms
from evertwin.types import Outputs

LEAST = 16
"""Rows on either side of a change."""


@contextmanager
def unmeasured() -> Iterator[None]:
    """A column that nobody measured, or that has no row, is no warning."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        yield


class Refused(NamedTuple):
    """Kept rows of outputs from which nothing is learned.

    >>> Refused(("tau",), 10, 20).last
    20
    """

    channels: tuple[str, ...]
    first: int
    last: int


class SensorChange(NamedTuple):
    """What a channel has become, as one number.

    >>> SensorChange("tau", -1.0, "tau is …").number
    -1.0
    """

    channel: str
    number: float
    """Recorded over what fits the model; 0: it does not answer."""
    said: str
    refused: Refused | None = None
    """Rows that are left out from now on; None: they are asked about again."""
    since: int | None = None
    """Row since which it goes on, which only rows from before can tell; None: any rows tell it."""


def since_change(deviation: Outputs) -> int:
    """Row from which the deviation is most clearly of another size than before; 0: too few rows."""
    size = rms(deviation)
    square = np.nansum(np.square(deviation / np.where(size > 0, size, 1.0)), axis=1) + 1e-12
    n, total = len(square), np.cumsum(square)
    if n < 2 * LEAST:
        return 0
    rows = np.arange(LEAST, n - LEAST + 1)
    before, after = total[rows - 1], np.maximum(total[-1] - total[rows - 1], 1e-12)
    cost = rows * np.log(before / rows) + (n - rows) * np.log(after / (n - rows))
    return int(rows[int(np.argmin(cost))])
