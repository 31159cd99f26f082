"""Names of the columns in the arrays that the arbiter's compiled loops share.

What is fixed and what is remembered lies in a few arrays of fixed shape, so that a state is small,
can be saved, and passes to compiled code in a few arguments.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from evertwin.signals import mistaken

LOW, HIGH, RATE, TOLERANCE, ANGLE, ADOPTS, BESIDE, ABOVE, MOVED_BY, TRIED = range(10)
"""Settings per output: possible range and rate, tolerance, is it an angle, can it be adopted? The
input that says whether it moves, −1 for none, and from which size on; are inputs its rate, or the
same quantity? Then, of each of `FACTORS`, `NEVER`, `ANY` or `OWN`."""
NEVER, ANY, OWN = range(3)
"""Is a factor tried, and does it divide two units of the output's own quantity?"""
GATE, VOTE, USE, BLEND, SHARE, GROWTH, FROZEN, TIMEOUT = range(8)
"""Settings per group."""
NONE, UPDATE, MIX = range(3)
"""Values of ``USE``."""

(
    OFFSET, LAST, GOOD, PATH, WAY, AFTER, NU, BASE, WRONG, USUAL, SLOPE, PROVEN, SQUARE, MOVE,
    CROSS, POWER, NU_BEFORE, NOISE, OTHER, DRIFT,
) = range(20)  # fmt: skip
"""Memory per output: what the last trusted sample was off the state after it; last sample; last
trusted value; path and way that were predicted since; output after the row; innovation of this
sample (its change of the offset) and its regular variance; innovation of the last doubted sample;
usual path from sample to sample; how fast the contested samples move beside the prediction [per
sample], and how fast agreeing ones did; mean square of measured − predicted; way that was predicted
for this sample, its mean product with the innovation and its mean square; innovation of the trusted
sample before; variance of the sensor's noise; second value of a run of equal ones; how far the
prediction is off while a factor holds, as measured/factor says."""
HELD, GONE, ORIGIN, BEFORE = range(20, 28, 2)
"""Memory per output and kind of run (equal, near): its value; way that was predicted since it
began; output after the row at which it began, and offset then."""
ALIKE, EXPECTED = 28, 29
"""Memory per output that no state adopts, of its newest trusted samples: mean product of measured
and expected, mean square of what was expected."""
STEP, CHANGED = 30, 31
"""Memory per output: the smallest change from sample to sample, by which a coarse sensor counts,
and how many changes were about as small."""
FARTHEST, SOUND = 32, 34
"""And per kind of run: how far the prediction went while values stayed that went on, at most, and
at most but for once."""
LEAN, LEANS = 36, 37
"""And the newest mean innovation; its largest size lately: how fast a model moves beside."""
LEANT = 38
"""And per kind of run: the same where it began."""
RUNS = 40
"""And per kind of run: how many of them."""
WENT = 42
"""And per kind of run: farthest way that was predicted at a sample of it."""
FREE_AFTER = 44
"""And output after the row of the state that runs free, where its group has one."""
OVERDUE, LATE = 45, 47
"""And per kind of run: samples of it by which a sound sensor would have answered; how many passed
until one did, at most."""
VARIED = 49
"""And samples that were another than the one before."""
BEYOND, CREEP = 50, 52
"""And per kind of run: way that was predicted since it began beyond a creep; how fast one was
predicted to move that stood [per sample]."""
ANEW = 54
"""And is the sample another than the one before?"""
CHANGE, LINE, AWAY_AT, AWAY_FROM = 55, 56, 57, 58
"""And, model aside, of trusted samples: the newest change, and the mean square by which one lies
off the straight line through the two before; first doubted sample, and where that line is then."""
CARRIES = 59
"""And the first row + 1 of the last fault by a factor that it is known to be off by."""
NET, LEAST, MOST = 60, 61, 62
"""And how far trusted samples have come by now, net, and how far at least and at most."""
TOP, BOTTOM, FELL, ROSE = 63, 64, 65, 66
"""And the largest and the least of the trusted samples; how far they came back from either."""
RESTS = 67
"""And does it stand at this row?"""
VALUES = 68
(
    STARTED, VALID, GOOD_AT, LAST_AT, CAUSE, ONSET, UNTIL, FAULTS, TOLD, CONTEST, BATCH, BATCH_ROW,
    LEFT, SAMPLES, UPDATES, RESETS, CONTESTED, ERRORS, TURNS, HELD_BY, QUIET,
) = range(21)  # fmt: skip
"""Memory per group, integers: started? valid? stamps of the last trusted and the last sample; the
open fault: cause, first and last row, samples, told?; the open contest: samples, those without
verdict, the first of them, the last that left the vote; counters;
turns to the second value of a run; kind of run that
showed the sensor frozen; were there equal values that were none?"""
RUN, RUN_ROW, RUN_AT, AWAY, STOOD = range(21, 31, 2)
"""Memory per group and kind of run: samples, first row and stamp; samples away from it by now, and
whether the first of them told of a machine that stood still. 31 and 32 are of former versions."""
HEARD, PAUSE, WIDENED = 33, 34, 35
"""And per group: stamp of the last row with a sample, whatever it is worth, or at which the state
started anew; the longest of its newest pauses [ns], slowly forgotten; trusted samples before the
variance was widened."""
FREE = 36
"""And per group: kind of run + 1 for which a state runs free, 0: none."""
AT_END = 37
"""And per group: does what stays, as a frozen sensor does, stay where its values end?"""
NUMBERS = 38
SPREAD, INTERVAL, OUTSIDE, FACTOR, SOUND_BY, LOUDEST = range(6)
"""Memory per group, numbers: variance of the state over that of the measurement; mean interval of
trusted samples [ns]; share of contested samples; suspected factor; how much likelier it is that it
is over; largest test ratio of the contested samples without verdict."""
FIGURES = 6
(
    LOWEST, HIGHEST, BELIEVED, BY, OVER, WAS, LATEST, AHEAD, LEVEL, OVERDONE, BEYOND_FROM,
    BEYOND_AT, BEYOND_AGAIN, SCORES,
) = range(14)  # fmt: skip
"""Memory per input: range of its believed values; the last one; suspected factor, 0: none, and
how much likelier it is that it is over; while its unit is in question, what it was before, the
newest value that differs from those before, how far a factor was ahead where that began, the level
that it is at; how much likelier usual rows are if it does nothing; and how
unlikely each hypothesis is so far."""
(
    SEEN, DOUBTED, DOUBT_ROW, TO, SAID, CHANGES, ASKED, VALUES_OF, LEAPT, NEITHER, OPENED,
    PROVEN_BY, MOVING,
) = range(13)  # fmt: skip
"""Memory per input, integers: believed values; doubted ones since then, the first and last row; are
they told?; levels among believed values; newest row at which its unit was in question;
values that differ since then, 0: it is not; by which factor it leapt there, or was off by before;
rows lately that follow it neither as recorded nor divided; the row since when it is in question;
values that told for a factor; believed values since an output moved."""
BELIEFS = 13

(
    BESIDE_OFF, BESIDE_NOISE, BESIDE_FROM, BESIDE_AFTER, BESIDE_PATH, BESIDE_LAG, MEAN_X,
    MEAN_Y, XX, XY, YY, SCATTER, LEAPT_TO, LEAPT_FROM,
) = range(14)  # fmt: skip
"""Account per output in which a believed sample was an error: what measurements were off the state
beside, variance of the noise, output at which it began, output now, way between,
how far the state had followed before; means and products
of expected (X) and measured (Y); half the squares of the innovations since; the samples between
which it began."""
ACCOUNT = 14
OWNER, SINCE, SINCE_AT, WEIGHED, HOW, TRUSTED = range(6)
"""The account, integers: its group + 1, 0: none; first row and stamp; rows weighed since; how it
began; samples of the group that were trusted before it."""

ROW, STAMP, KIND, GROUP, WHY, FIRST, FINAL, NUMBER = range(8)
"""Integers of a finding."""

LEARN = 16
"""Innovations from which the first variance is taken, robustly, where none is given."""
FEW = 5
"""Innovations after which a provisional one is used."""
STEPS = 6
"""Such changes by which a sensor is known to be coarse: a spike is two."""
VARIES = 16
"""Samples that vary from which on a channel is known to tell anything: one that has stayed where it
was since it began may be of a sensor that was not there yet."""
KNOWN, AGAIN = 64, 16
"""Innovations after which the noise is known well enough to tell a factor by it; and trusted ones
after its variance was widened."""
FAR = 2.0
"""Measured over expected from which, or from whose inverse, a model is out of scale."""
SCALE = 256
"""Trusted samples that a model's scale is told from."""
PHASE = 30
"""Innovations of a phase before its own variance is used."""
MEMORY = 10_000
"""Innovations that a variance remembers."""
PUSHED = 6.0
"""Factor of a force alone below which a push from outside makes it as many times as large."""
FACTORS = np.array([
    one.number for one in mistaken.FACTORS
    if not 0.0 < one.number < (PUSHED if {"N", "Nm"} & {*one.units} else mistaken.PURE)
])  # fmt: skip
"""Suspected factors, those that no machine changes by from one row to the next; their inverses are
tried too; the last is a turned sign."""
TURN = FACTORS.tolist().index(mistaken.TURN)
"""Place of 180/π, the only factor of an angle."""
RANGES = SCORES + 4 + len(FACTORS) - 1
"""Of an input: as recorded, as it was, none, unknown, and divided by each but a turned sign."""


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
    AWAY = 8
    END = 9


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
    INPUT = 6
    SOUND = 7


class Outside(IntEnum):
    """Why an input is not believed.

    >>> Outside.USUAL.name
    'USUAL'
    """

    USUAL = 0
    POSSIBLE = 1
    UNNAMED = 2
