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

from evertwin.compiled.functions import njit
from evertwin.setup.released import Released
from evertwin.types import Bools, Float64, Outputs


class Newest(NamedTuple):
    """What the present prediction is known to be off by.

    >>> Newest._fields
    ('values',)
    """

    values: Float64[np.ndarray, " columns"]
    """measured, live, first, other side by side."""


@njit(cache=True)
def carried(
    sides: tuple[Outputs, Outputs, Outputs, Outputs], end: Bools,
    newest: Float64[np.ndarray, " columns"], kept: Float64[np.ndarray, "four n ny"],
) -> None:  # fmt: skip
    """Values stay where a prediction ends, the newest of each column; elsewhere they are NaN."""
    ny = kept.shape[2]
    for i in range(len(end)):
        for s in range(4):
            for k in range(ny):
                value = sides[s][i, k]
                if value == value:
                    newest[s * ny + k] = value
                kept[s, i, k] = newest[s * ny + k] if end[i] else np.nan
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
        kept = np.empty((4, *rows.live.shape))
        carried(rows[3:7], rows.end, state.values, kept)
        measured, live, first, other = kept
        return state, rows._replace(measured=measured, live=live, first=first, other=other)
