"""Rows of a run as they are shown: measured, predicted, band, mark, version."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from evertwin.models import Model
from evertwin.types import Inputs, Marks, Outputs, Stamps


class View(NamedTuple):
    """The newest rows of a run.

    >>> View._fields[:3]
    ('row', 't', 'measured')
    """

    row: np.ndarray
    """Numbers, int64 (n,)."""
    t: Stamps
    measured: Outputs
    predicted: Outputs
    band: Outputs
    """Standard deviation of what is measured around the prediction, (n, ny)."""
    mark: Marks
    """`Mark` of each output, (n, ny)."""
    version: np.ndarray
    """Version that predicted the row, int64 (n,)."""
    inputs: Inputs
    task: np.ndarray
    """Number of the task, int64 (n,)."""
    first: Outputs
    """What the first version predicts, beside the live one."""
    update: np.ndarray
    """What became of the measurement, per group of outputs, uint8 (n, ng): 0 not adopted, 1
    position update, 2 blended in, 3 overruled the simulation, 4 first sample."""
    off: Outputs
    """What predictions were off by when they reached the horizon, as the figures have it; NaN
    elsewhere."""

    @classmethod
    def of(cls, columns: Mapping[str, np.ndarray], model: Model) -> View:
        """A copy of the observer's columns; without any, no row."""
        if columns:
            kept = {name: column.copy() for name, column in columns.items()}
            return cls(
                kept["row"], kept["t"], kept["measured"], kept["predicted"], kept["sigma"],
                kept["mark"], kept["version"], kept["input"], kept["task"], kept["first"],
                kept["update"], kept["off"],
            )  # fmt: skip
        none, stamps = np.zeros((0, len(model.outputs))), np.zeros(0, dtype=np.int64)
        marks, inputs = none.astype(np.uint8), np.zeros((0, len(model.inputs)))
        update = np.zeros((0, len(model.outputs.groups)), dtype=np.uint8)
        return cls(
            stamps, stamps, none, none, none, marks, stamps, inputs, stamps, none, update, none
        )
