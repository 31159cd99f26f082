"""Names of the columns in the arrays that the arbiter's compiled loops share.

What is fixed and what is remembered lies in a few arrays of fixed shape, so that a state is small,
can be saved, and passes to compiled code in a few arguments.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

LOW, HIGH, RATE, TOLERANCE, ANGLE, ADOPTS = range(6)
"""Settings per output: possible range and rate, tolerance, is it an angle, can it be adopted?"""
GATE, VOTE, USE, BLEND, SHARE, GROWTH, FROZEN, TIMEOUT = range(8)
"""Settings per group."""
NONE, UPDATE, MIX = range(3)
"""Values of ``USE``."""

(
    OFFSET, LAST, GOOD, PATH, WAY, AFTER, ORIGIN, NU, BASE, WRONG, USUAL, SLOPE, PROVEN, BEFORE,
    SQUARE, MOVE, CROSS, POWER,
) = range(18)  # fmt: skip
"""Memory per output: what the last trusted sample was off the state after it; last sample; last
trusted value; path that was predicted since; way that was predicted since the value changed; output
after the row, and when the run of equal values began; innovation of this sample (its change of the
offset) and its regular variance; innovation of the last doubted sample; usual path from sample to
sample; how fast the contested samples move beside the prediction [per sample], and how fast
agreeing ones did; offset when the run began; mean square of measured − predicted; way that was
predicted for this sample, its mean product with the innovation and its mean square."""
(
    STARTED, VALID, GOOD_AT, LAST_AT, RUN, RUN_ROW, RUN_AT, STILL, CAUSE, ONSET, UNTIL, FAULTS,
    TOLD, CONTEST, BATCH, BATCH_ROW, LEFT, SAMPLES, UPDATES, RESETS, CONTESTED, ERRORS, SOUND,
) = range(23)  # fmt: skip
"""Memory per group, integers: started? valid? stamps of the last trusted and the last sample; run
of equal values: length, first row and stamp, runs that were a standstill; the open fault: cause,
first and last row, samples, told?; the open contest: samples, those without verdict, the first of
them, the last that left the vote; counters; sound values in a row since an error by a factor."""
SPREAD, INTERVAL, OUTSIDE, FACTOR = range(4)
"""Memory per group, numbers: variance of the state over that of the measurement; mean interval of
trusted samples [ns]; share of contested samples; suspected factor."""

ROW, STAMP, KIND, GROUP, WHY, FIRST, FINAL, NUMBER = range(8)
"""Integers of a finding."""

LEARN = 16
"""Innovations from which the first variance is taken, robustly, where none is given."""
FEW = 5
"""Innovations after which a provisional one is used."""
KNOWN = 64
"""Innovations after which the noise is known well enough to tell a factor by it."""
PHASE = 30
"""Innovations of a phase before its own variance is used."""
MEMORY = 10_000
"""Innovations that a variance remembers."""
TURN = 6
"""Place of 180/π in `FACTORS`, the only factor of an angle."""
FACTORS = np.array(
    [10.0, 100.0, 1e3, 1e4, 1e6, 1e9, 180.0 / np.pi, 25.4, 1 / 0.0254, 1 / 0.3048, -1.0]
)
"""Suspected factors; their inverses are tried too; the last is a turned sign."""


class Cause(IntEnum):
    """Why a sample is a measurement error.

    >>> Cause.FROZEN.name
    'FROZEN'
    """

    NONE = 0
    SYNTAX = 1
    RANGE = 2
    RATE = 3
    FROZEN = 4
    SENTINEL = 5
    FACTOR = 6
    VOTE = 7


class Finding(IntEnum):
    """What the loop reports.

    >>> Finding.OVERRULED.name
    'OVERRULED'
    """

    ERROR = 0
    OVERRULED = 1
    RESTORED = 2
    STALE = 3
    FRESH = 4
    WIDER = 5
