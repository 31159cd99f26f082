"""Changes since a prediction started, measured and predicted: how unlike they are, of any size.

Whatever unit they are in, `Changes.mismatch` is 0 where both are equal and 1 where they have
nothing in common; so units, signs and columns can be compared that a recording may have.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evertwin.fold import Block
from evertwin.models import Model
from evertwin.models.batch import Batch
from evertwin.signals import wrap
from evertwin.sync.horizon.horizon import restarts
from evertwin.types import Bool, Outputs, ParameterVector, Vector


@dataclass(frozen=True)
class Changes:
    """Changes since the last restart from the measurement, measured and predicted.

    >>> Changes(np.ones((1, 1)), np.ones((1, 1))).mismatch.tolist()
    [0.0]
    """

    measured: Outputs
    """(n, ny); NaN where unknown."""
    predicted: Outputs

    @cached_property
    def known(self) -> Bool[np.ndarray, "n ny"]:
        """Rows at which an output is measured and predicted, (n, ny)."""
        return np.asarray(np.isfinite(self.measured) & np.isfinite(self.predicted))

    @cached_property
    def mismatch(self) -> Vector:
        """Rms of the difference over the larger rms, per output: 0 equal, 1 unrelated, (ny,)."""
        a = np.where(self.known, self.measured, 0.0)
        b = np.where(self.known, self.predicted, 0.0)
        size = np.sqrt(np.maximum((a**2).sum(axis=0), (b**2).sum(axis=0)))
        left = np.sqrt(((a - b) ** 2).sum(axis=0))
        return np.asarray(np.divide(left, size, out=np.zeros(len(size)), where=size > 0))


def changes(model: Model, p: ParameterVector, window: Block, horizon: float) -> Changes:
    """Measured and predicted changes over a horizon; of a static map those from what is measured
    on average: a constant, such as a weight that is held, would hide how all else is mistaken."""
    x0 = model.initial(p)
    plan = restarts(window, horizon, x0)
    (y,) = Batch(model).run(window.u, window.dt, p[None], plan)
    base = _held(plan.y) if len(x0) else _average(window.y)
    angles = model.outputs.angles
    return Changes(wrap(window.y - base, angles), wrap(y - base, angles))


def _average(y: Outputs) -> Outputs:
    """Of each output, at all rows; zero where nothing is measured, (n, ny)."""
    count = np.count_nonzero(np.isfinite(y), axis=0)
    return np.broadcast_to(np.nansum(y, axis=0) / np.maximum(count, 1), y.shape)


def _held(adopted: Outputs) -> Outputs:
    """What the prediction of every row started from: adopted at an earlier row, (n, ny)."""
    out = np.empty_like(adopted)
    for k in range(adopted.shape[1]):
        places = np.flatnonzero(~np.isnan(adopted[:, k]))
        lengths = np.diff(np.concatenate([[0], places + 1, [len(adopted)]]))
        out[:, k] = np.repeat(np.append(np.nan, adopted[places, k]), lengths)
    return out
