"""What `evertwin.sync.alignment.align` goes by, keeps and gives: tuples of arrays.

>>> Rows._fields[:2], AlignNotes._fields
(('number', 't'), ('found', 'extent'))
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.fold import Block
from evertwin.types import Bools, Float64, Inputs, Int64, Intervals, Marks, Outputs, Stamps, Tasks


class AlignSettings(NamedTuple):
    """What no sample changes.

    >>> AlignSettings._fields[:2]
    ('sources', 'channels')
    """

    sources: Int64[np.ndarray, "sources two"]
    """Slack and time-out of each [ns]."""
    channels: Int64[np.ndarray, "channels five"]
    """Where each comes from, and how (`evertwin.sync.alignment.on_row_loop`)."""
    gap: int
    """Longest interval that is simulated over [ns]."""
    period: float
    """Of the grid [ns]; 0: the union of the stamps."""
    jump: int
    """Stamps further away are kept out [ns]."""
    cut: bool
    """Does a grid start anew behind a hole?"""
    usual: bool
    """Does the state, where nothing came for far longer than usual?"""


class AlignNotes(NamedTuple):
    """What is told of sources. `Rows` and notes are filled from the front.

    >>> AlignNotes(np.zeros((0, 6), np.int64), np.zeros(2, np.int64)).extent.tolist()
    [0, 0]
    """

    found: Int64[np.ndarray, "notes six"]
    extent: Int64[np.ndarray, " two"]
    """How many rows and notes there are."""


class AlignState(NamedTuple):
    """State of `Align`.

    >>> AlignState._fields[0]
    'clock'
    """

    clock: Int64[np.ndarray, " clock"]
    sources: Int64[np.ndarray, "sources memory"]
    times: Int64[np.ndarray, "sources depth"]
    """Stamps that wait, per source, a sorted ring."""
    values: Float64[np.ndarray, "sources depth width"]
    known_t: Int64[np.ndarray, " channels"]
    """Stamp of each channel's newest finite value at or before the last row."""
    known_v: Float64[np.ndarray, " channels"]
    broken_t: Int64[np.ndarray, " channels"]
    """Stamp of its newest infinite one."""
    habits: Int64[np.ndarray, "channels memory"]
    """With what a command comes (`evertwin.sync.alignment.lost_loop`)."""
    pace: Int64[np.ndarray, " memory"]
    """Newest intervals between samples, whichever source they are of
    (`evertwin.sync.alignment.pace_loop`)."""


class Rows(NamedTuple):
    """Rows that left; `block` gives them as a `Block`.

    >>> Rows._fields[:2]
    ('number', 't')
    """

    number: Int64[np.ndarray, " n"]
    t: Stamps
    dt: Intervals
    u: Inputs
    y: Outputs
    mark: Marks
    task: Tasks
    gap: Bools

    @property
    def block(self) -> Block:
        """The rows as a block."""
        return Block(int(self.number[0]), *self[1:])
