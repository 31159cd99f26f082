"""What the fused loop goes by, keeps and gives: tuples of arrays.

>>> TrackRows._fields[:3], Notes._fields
(('y', 'residual', 'mark'), ('found', 'detail', 'extent'))
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block, Event, Record
from evertwin.models.functions.failures import Failed
from evertwin.sync import places as at
from evertwin.types import (
    Bools,
    Float64,
    Inputs,
    Int64,
    Outputs,
    ParameterVector,
    StateVector,
    UInt8,
)

FAILING, UNKNOWN = "model_failed", "the model's step raised something"
"""Kind of event, and what is said where nobody knows what."""
MOST = 256
"""Findings per group that one pass may note before they are read."""
TASK, BEGUN, ASKED, FAILED, FIRST_FAILED = range(5)
"""Places of the clock."""


class TrackSettings(NamedTuple):
    """What `Track` goes by.

    >>> TrackSettings._fields[:3]
    ('limits', 'rules', 'sentinels')
    """

    limits: Float64[np.ndarray, "ny limits"]
    """Per output, see `evertwin.sync.places`."""
    rules: Float64[np.ndarray, "ng rules"]
    """Per group."""
    sentinels: Float64[np.ndarray, " codes"]
    """Values that say that nothing was measured."""
    members: Int64[np.ndarray, "ng most"]
    """Outputs of each group, −1 where it has fewer."""
    column: int
    """Input whose size says the phase; −1: there is one alone."""
    edges: Float64[np.ndarray, " edges"]
    """Where a phase begins."""
    possible: Float64[np.ndarray, "nu possible"]
    """Of each input: what it may be, and which factors divide two of its units."""
    keeps: bool
    """Does the model's state last over a gap?"""


class Notes(NamedTuple):
    """Findings of one pass, see `evertwin.sync.arbiter.arbiter.describe`.

    >>> Notes.room(rows=1, groups=1, inputs=1, outputs=1).found.shape
    (19, 8)
    """

    found: Int64[np.ndarray, "notes 8"]
    detail: Float64[np.ndarray, "notes details"]
    extent: Int64[np.ndarray, " one"]
    """How many there are."""

    @classmethod
    def room(cls, rows: int, groups: int, inputs: int, outputs: int) -> Notes:
        """For so many rows, if they tell little."""
        most = min(8 * rows, MOST) * groups + 8 * groups + 2 * inputs + 1
        found, detail = np.empty((most, 8), dtype=np.int64), np.empty((most, 3 + 2 * outputs))
        return cls(found, detail, np.zeros(1, dtype=np.int64))


class OffByFactor(NamedTuple):
    """Groups of outputs that are taken for off by a factor.

    >>> OffByFactor(np.array([0]), 300).since
    300
    """

    groups: Int64[np.ndarray, " k"]
    since: int
    """The first row of it."""


class TrackState(NamedTuple):
    """State of `Track`.

    >>> TrackState._fields[:3]
    ('x', 'p', 'x0')
    """

    x: StateVector
    p: ParameterVector
    x0: StateVector
    """State that a new start begins with."""
    values: Float64[np.ndarray, "ny 60"]
    """Memory per output, see `evertwin.sync.places`."""
    numbers: Int64[np.ndarray, "ng 33"]
    """Memory per group: flags, stamps, the open fault and contest, counters."""
    figures: Float64[np.ndarray, "ng 5"]
    """Memory per group: growth, interval, share of contested samples, suspected factor."""
    variance: Float64[np.ndarray, "phases ny"]
    """Variance of the innovation per phase, and over all of them in the last row."""
    counts: Int64[np.ndarray, "phases ny"]
    """Innovations in them."""
    warm: Float64[np.ndarray, "learn ny"]
    """The first innovations."""
    ring: Float64[np.ndarray, "vote ny"]
    """Innovations of the contested samples."""
    paths: Float64[np.ndarray, "vote ny"]
    times: Int64[np.ndarray, "vote ng"]
    rows: Int64[np.ndarray, "vote ng"]
    expected: Float64[np.ndarray, "vote ny"]
    """What was expected of the contested samples."""
    ranges: Float64[np.ndarray, "nu ranges"]
    """Range of each input's believed values, the last of them, its suspected factor."""
    beliefs: Int64[np.ndarray, "nu beliefs"]
    """How many they are; the open doubt."""
    clock: Int64[np.ndarray, " five"]
    """Task of the last row, has a row come? Rows that the model was asked for, those of them at
    which its step raised something, the first of these."""
    beside: StateVector
    """State without what was believed last, see `evertwin.sync.arbiter.beside_loop`."""
    account: Float64[np.ndarray, "ny 14"]
    matter: Int64[np.ndarray, " six"]
    free: Float64[np.ndarray, "ng nx"]
    """State that runs free of each group, see `evertwin.sync.arbiter.free_loop`."""

    def failed(self, events: Iterable[Record]) -> Failed | None:
        """The rows that the model could not compute, with the reason that the stage told of the
        first among its ``events``; None: there are none."""
        asked, rows, first = self.clock[ASKED:].tolist()
        why = [e.reason for e in events if isinstance(e, Event) and e.kind == FAILING]
        return Failed(rows, asked, first, [*why, UNKNOWN][0]) if rows else None

    @property
    def updates(self) -> Int64[np.ndarray, " ng"]:
        """Tolerance updates per group."""
        return self.numbers[:, at.UPDATES]

    @property
    def divides(self) -> bool:
        """Is an input taken divided by a factor that was told of?"""
        told = (self.ranges[:, at.BY] != 0.0) & (self.beliefs[:, at.SAID] == 1)
        return bool((told & (self.beliefs[:, at.DOUBTED] > 0)).any())

    @property
    def scaled(self) -> bool:
        """Is an output taken for off by a factor that was told of?"""
        return len(self.off_by_factor().groups) > 0

    def off_by_factor(self) -> OffByFactor:
        """Groups whose open fault is a factor that was told of, and the first row of it."""
        now = (self.numbers[:, at.CAUSE] == at.Cause.FACTOR) & (self.numbers[:, at.TOLD] > 0)
        groups = np.flatnonzero(now)
        return OffByFactor(groups, int(self.numbers[groups, at.ONSET].min(initial=2**62)))

    def begin_anew(self, groups: Int64[np.ndarray, " k"]) -> None:
        """Nothing is open of these groups: their next sample is adopted as it is. In place."""
        places = (
            at.STARTED,
            at.CAUSE,
            at.FAULTS,
            at.TOLD,
            at.CONTEST,
            at.BATCH,
            at.FREE,
            at.AT_END,
        )
        self.numbers[groups[:, None], places] = 0

    @property
    def resets(self) -> Int64[np.ndarray, " ng"]:
        """Overrulings per group."""
        return self.numbers[:, at.RESETS]

    @property
    def valid(self) -> Bools:
        """Has the group had a trusted sample within the time-out?"""
        fresh: Bools = self.numbers[:, at.VALID] == 1
        return fresh


class TrackRows(NamedTuple):
    """One row out per row in.

    >>> TrackRows._fields
    ('y', 'residual', 'mark', 'update', 'sigma', 'age', 'u', 'doubt')
    """

    y: Outputs
    """Predicted outputs, before anything of this row is adopted, (n, ny); NaN at a new start."""
    residual: Outputs
    """Measured − predicted of trusted samples, angles wrapped, (n, ny); else NaN."""
    mark: UInt8[np.ndarray, "n ny"]
    """`Mark` of each output after judging."""
    update: UInt8[np.ndarray, "n ng"]
    """Per group: 0 nothing adopted, 1 tolerance update, 2 blend, 3 overruled, 4 first sample."""
    sigma: Outputs
    """Standard deviation that the arbiter expects of measured − predicted, (n, ny); inf while it is
    not known."""
    age: Float64[np.ndarray, "n ng"]
    """Seconds since the group's last trusted sample; NaN before the first."""
    u: Inputs
    """Believed inputs, (n, nu)."""
    doubt: UInt8[np.ndarray, "n nu"]
    """`Mark` of each input after judging."""

    def judged(self, block: Block) -> Block:
        """The rows that were judged, with believed inputs and the marks of all channels."""
        return block._replace(u=self.u, mark=np.concatenate([self.doubt, self.mark], axis=1))
