"""One residual a prediction: the newest that is known when it has reached its horizon.

Along a prediction the residual grows, so its mean over all lead times would be another one at
another rate of the rows. What a twin is judged by is how far it is off after one horizon. Of an
output that is measured more rarely the newest residual of the prediction counts. The limit, the
trial and the report go by it, so a twin that is sampled more often is not judged otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from evertwin.loop.released import Released
from evertwin.types import Bools, Float64


class Newest(NamedTuple):
    """What the present prediction is known to be off by.

    >>> Newest._fields
    ('values',)
    """

    values: Float64[np.ndarray, " columns"]
    """measured, live, first, other side by side."""


@njit(cache=True)
def carried(
    columns: Float64[np.ndarray, "n columns"], end: Bools, newest: Float64[np.ndarray, " columns"]
) -> None:
    """Values stay where a prediction ends, the newest of each column; elsewhere they are NaN."""
    for i in range(columns.shape[0]):
        for c in range(columns.shape[1]):
            value = columns[i, c]
            if value == value:
                newest[c] = value
            columns[i, c] = newest[c] if end[i] else np.nan
        if end[i]:
            newest[:] = np.nan


@dataclass(frozen=True)
class AtHorizon:
    """The stage; ``wanted`` is false where each row is a prediction of its own.

    >>> AtHorizon(False, 1).init().values.tolist()
    [nan, nan, nan, nan]
    """

    wanted: bool
    outputs: int

    def init(self) -> Newest:
        """Nothing is known."""
        return Newest(np.full(4 * self.outputs, np.nan))

    def step(self, state: Newest, rows: Released) -> tuple[Newest, Released]:
        """The rows, with values where a prediction has ended. Consumes ``state``."""
        if not self.wanted:
            return state, rows
        columns = np.concatenate(rows[3:7], axis=1)
        carried(columns, rows.end, state.values)
        measured, live, first, other = (
            np.ascontiguousarray(part) for part in np.split(columns, 4, axis=1)
        )
        return state, rows._replace(measured=measured, live=live, first=first, other=other)
