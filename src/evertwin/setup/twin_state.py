"""The state of a whole twin: everything that changes while it runs, as plain arrays and scalars.

A checkpoint is this state and its row. Versions are kept beside it, append-only, and named here by
number; a shadow is a second state of the same stage.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evertwin.anomaly import ExternalState, KinematicsState, RecurrenceState, StillState
from evertwin.rows.ring import Rows
from evertwin.setup.at_horizon import Newest
from evertwin.setup.deviation import Sums, Usual
from evertwin.setup.released import Waiting

WATCH, TRIAL, PROBATION = range(3)
"""What the twin is busy with: nothing, a fit, a correction, a challenger, a fresh champion."""


class Lane(NamedTuple):
    """One version running along: its followed state and its predictions over one horizon.

    >>> Lane(0, (), ()).version
    0
    """

    version: int
    """Number of the version; −1: the lane is empty."""
    track: Any
    horizon: Any


class Scores(NamedTuple):
    """Sums over released rows.

    >>> Scores._fields[0]
    'watch'
    """

    watch: Sums
    """Champion, moving rows, since the deviation was last judged."""
    live: Sums
    """Champion, since it went live."""
    first: Sums
    """First champion over the same rows."""
    live_moving: Sums
    first_moving: Sums
    updates: np.ndarray
    """Position updates (live, first) before the champion went live, int64."""
    rows: int
    """Row since which ``live`` and ``first`` count."""
    seen: np.ndarray
    """Rows since the deviation was last judged, int64 (1,)."""
    past: np.ndarray
    """Of parts of these rows what those up to each come to, as ``watch`` has it, NaN: it has not
    ended; and of those judged last what those behind each came to; (2, parts, 3, ny)."""
    spoiled: np.ndarray
    """Outputs with rows among these of a fault that was found out later, bool (ny,)."""
    pair: np.ndarray
    """Running segment: Σ loss of champion and of the other, rows; (3,). NaN: it does not count."""
    back: np.ndarray
    """As ``pair``, of champion and first champion."""
    scale: np.ndarray
    """Residual size that counts as 1 in a loss, (ny,)."""
    usual: Usual


class Agenda(NamedTuple):
    """What decisions remember between beats.

    >>> Agenda().phase == WATCH
    True
    """

    phase: int = WATCH
    open: int = 0
    """Id of the open request; 0: none."""
    due: int = 0
    """Row before which a file run waits for its answer."""
    start: int = 0
    """First row of its window."""
    stop: int = 0
    """Row after its window."""
    asked: int = 0
    """Requests so far."""
    hold: int = 0
    """Row before which no further candidate is sought."""
    since: int = 0
    """Row from which on data may be learned from."""
    fitted: int = 0
    """Elapsed time at the last fit [ns]."""
    tunings: int = 0
    """Tunings so far: the schedule's position."""
    retrain: int = 0
    """Row from which a new training sequence has enough rows; 0: none is going on."""
    again: int = 0
    """Row of a suspicion that rows were too few to explain; 0: there is none."""
    risen: int = 0
    """Row at which its deviation was found to be a larger one; 0: not since the last fit."""
    rose: int = 0
    """Row from which on it is."""
    retell: int = 0
    """Row from which on a window tells anew what few rows told of a change; 0: nothing
    waits; −1: that was asked, and what comes of it is not told again."""
    held: bool = False
    """Has the live version been found within the requirement?"""
    told: bool = False
    """Was a deviation told of that goes on? One while nothing can be sought is told of once."""
    kind: str = "fit"
    """What the open request asks for."""
    commissioned: bool = False
    """Has any version been found within the requirement?"""
    brief: float = -1.0
    """Gain that a challenger which is a state has to show in its short test; −1: it is none."""
    begins: int = 0
    """First row of that state."""
    refine: int = 0
    """Row before which the state that is live is told anew, from twice its rows; 0: none is."""
    look: int = 0
    """Row before which no state is looked for again."""
    pace: int = 0
    """Rows from the newest look in vain to the next."""
    vain: int = 0
    """Answers in a row that the form is wrong, of which nothing came."""
    rival: int = 0
    """Version that its candidate has to surpass; 0: none."""
    lacking: int = 0
    """Levels that the correction had not seen when last learned; 0 too where no more come."""
    tried: int = 0
    """Elapsed time at which the trial began [ns]; not above 0: in a run before."""
    followed: int = 0
    """Elapsed time at which it was last said what is followed in the stream [ns]."""
    doubt: str = ""
    """Channel in doubt by rows from before, which newer ones do not tell of; empty: none."""
    doubted: float = 1.0
    """Recorded over what it was said to be."""
    doubted_at: int = 0
    """Row after those that said so."""
    accused: str = ""
    """Channel that was told last not to be what it was, by a doubt that each window tells anew."""
    undetermined: str = ""
    """Parameters, one a line, of which it was said last that the rows do not determine them."""
    abnormal: str = ""
    """What was said last that nothing explains, without its figures."""
    cause: str = ""
    """Cause that a person named: it is tried first at the next tuning."""
    pinned: bool = False
    versions: int = 1
    """Versions so far."""


class TwinState(NamedTuple):
    """Everything that changes while a twin runs.

    >>> TwinState._fields[:3]
    ('row', 'task', 'time')
    """

    row: int
    """Number of the next row."""
    task: int
    """Task of the last row."""
    time: int
    """Stamp of the last row [ns]."""
    began: int
    """Stamp of the first row of the task [ns]."""
    elapsed: int
    """Time within tasks so far [ns]; stamps may start again with each task."""
    live: Lane
    stream: Any
    """What the live version's parameters have learned in the stream; (): they stay."""
    lives: np.ndarray
    """Versions that were live and the row since which, the newest last; int64 (k, 2), −1: none."""
    first: Lane
    """The first champion, while another one is live."""
    other: Lane
    """The challenger on trial, or the last champion during probation."""
    newest: Newest
    """What the present predictions are off by."""
    waiting: Waiting
    """Rows that the residual filter holds back."""
    detect: Any
    external: ExternalState
    kinematics: KinematicsState
    still: StillState
    recurrence: RecurrenceState
    trial: Any
    recovery: Any
    """Bets on the first champion, while another one is live."""
    scores: Scores
    agenda: Agenda
    watched: np.ndarray
    """Range of the watched inputs that the live correction was learned on, (k, 2)."""
    ring: Rows


class Saved(NamedTuple):
    """What a checkpoint holds.

    >>> Saved(()).feed
    ()
    """

    twin: Any
    """`TwinState`, or some of its fields."""
    feed: Any = ()
    """State of what a run of pushed samples makes its rows of."""
