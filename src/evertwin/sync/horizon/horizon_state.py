"""What the stream of predictions over one horizon goes by, keeps and gives: tuples of arrays.

>>> HorizonSettings._fields
('angle', 'horizon', 'settles')
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Bools, Int64, Outputs, ParameterVector, StateVector, Vector


class HorizonSettings(NamedTuple):
    """What `evertwin.sync.horizon.horizon.Horizon` goes by."""

    angle: Bools
    """Which outputs are angles, (ny,)."""
    horizon: int
    """Length of a prediction [ns]."""
    settles: int
    """Segments in the first horizon after a new start, which do not count."""


class HorizonState(NamedTuple):
    """State of `Horizon`: the model's, its parameters, and the segment so far.

    >>> HorizonState._fields[:2]
    ('x', 'p')
    """

    x: StateVector
    p: ParameterVector
    x0: StateVector
    """State that a new start begins with."""
    scale: Vector
    """What one unit of loss is, per output, (ny,)."""
    square: Vector
    """Sum of (residual / scale)² of the segment so far, (ny,)."""
    samples: Int64[np.ndarray, " ny"]
    """Residuals in it, (ny,)."""
    adopted: Int64[np.ndarray, " ny"]
    """Stamp of each output's last adoption [ns]."""
    clock: Int64[np.ndarray, " six"]
    """Task of the last row, has a row come, start of the segment and stamp of the last row [ns],
    segments since the state started anew, how often in a row they were too few."""


class HorizonRows(NamedTuple):
    """One row out per row in.

    >>> HorizonRows._fields
    ('y', 'residual', 'end', 'square', 'samples')
    """

    y: Outputs
    """Predicted outputs, (n, ny); NaN where the state starts anew."""
    residual: Outputs
    """Measured − predicted, angles wrapped, (n, ny); NaN where not measured, trusted or started."""
    end: Bools
    """True where a segment ends, (n,). A segment that a gap cuts ends at the row after the gap, if
    it was half a horizon long."""
    square: Outputs
    """At such a row: the segment's sum of (residual / scale)² per output, (n, ny), else 0."""
    samples: Int64[np.ndarray, "n ny"]
    """At such a row: how many residuals the sum holds."""

    @property
    def losses(self) -> Vector:
        """Mean of (residual / scale)² of each segment that ended, (segments,); NaN if empty."""
        samples = self.samples[self.end].sum(axis=1)
        mean: Vector = self.square[self.end].sum(axis=1) / np.where(samples, samples, np.nan)
        return mean
