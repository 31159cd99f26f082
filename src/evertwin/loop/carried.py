"""What a run hands on to the next one of its store: short recordings accumulate.

A machine does not begin anew with each recording of it. What was learned in the stream, calm rows
and the calibration that they gave, how large measurements usually are, and a challenger that is
still on trial (or the replaced champion of a probation) go on where the run before ended. What
belongs to rows ends with them: the machine's followed state, open faults, contacts, requests.
"""

from __future__ import annotations

import logging
from typing import Any, NamedTuple

import numpy as np

from evertwin.anomaly import Rise
from evertwin.errors import StoreError
from evertwin.loop.decisions.follow import EMPTY
from evertwin.loop.driver import Driver
from evertwin.rows.ring import Rows
from evertwin.setup.detectors import Alarm
from evertwin.setup.deviation import Sums, Usual
from evertwin.setup.twin_state import TRIAL, WATCH, Agenda, Lane, Saved, TwinState
from evertwin.store import Store
from evertwin.sync import places as at

log = logging.getLogger("evertwin")


class _Lanes(NamedTuple):
    """Which versions there were, before the shape of their states is known."""

    row: int
    live: Lane
    other: Lane


class _Scores(NamedTuple):
    watch: Sums
    seen: np.ndarray
    past: np.ndarray
    usual: Usual
    scale: np.ndarray


ARBITER = ("variance", "counts", "warm", "ranges", "beliefs")
"""What the arbiter knows of noise and ranges."""


class _HandedOn(NamedTuple):
    """The fields of a state that go on."""

    elapsed: int
    live: Lane
    stream: Any
    lives: np.ndarray
    detect: Any
    kinematics: Any
    recurrence: Any
    trial: Any
    scores: _Scores
    agenda: Agenda
    watched: np.ndarray
    ring: Rows


def carried(driver: Driver, store: Store, run: int, state: TwinState) -> TwinState | None:
    """The state before the first row, with what a run that has ended hands on; None: nothing.

    Args:
        driver: of the new run.
        store: where the newest checkpoint is that of ``run``.
        run: number of the run before.
        state: as it would begin without; consumed.
    """
    live, setup = state.live.version, driver.setup
    try:
        known = store.restore(Saved(_Lanes(0, EMPTY, EMPTY)), run)
        if known is None or known.state.twin.live.version != live:
            return None
        like_scores = _Scores(*(getattr(state.scores, name) for name in _Scores._fields))
        like = _HandedOn(
            0, driver.follow.lane(live, tracked=True), driver.follow.opens(live),
            state.lives, setup.detect.init(), setup.kinematics.init(), setup.recurrence.init(),
            setup.trial.init(), like_scores, Agenda(), state.watched, setup.ring.init(),
        )  # fmt: skip
        found = store.restore(Saved(like), run)
    except StoreError as error:
        log.warning("run %d hands nothing on: %s", run, error)
        return None
    if found is None:
        return None
    left: _HandedOn = found.state.twin
    rows, before = known.state.twin.row, left.agenda
    left.detect.cusum.calm.row[: left.detect.cusum.collected] -= rows
    detect = left.detect._replace(
        told=left.detect.told - rows, pending=Alarm(), risen=Rise(),
        level=setup.detect.level.handed_on(left.detect.level, rows),
    )  # fmt: skip
    agenda = state.agenda._replace(
        commissioned=before.commissioned, held=before.held,
        fitted=before.fitted - left.elapsed, since=before.since - rows, told=before.told,
        followed=before.followed - left.elapsed, pace=before.pace,
        hold=max(before.hold - rows, 0), look=max(before.look - rows, 0), cause=before.cause,
        doubt=before.doubt, doubted=before.doubted, doubted_at=before.doubted_at - rows,
    )  # fmt: skip
    old: Any = left.live.track
    doubts = np.delete(np.arange(old.beliefs.shape[1]), (at.SEEN, at.CHANGES))
    old.beliefs[:, doubts] = 0  # they are of rows
    track = state.live.track._replace(**{name: getattr(old, name) for name in ARBITER})
    state = state._replace(
        live=state.live._replace(track=track), stream=left.stream,
        lives=left.lives - np.where(left.lives[:, :1] < 0, 0, (0, rows)), detect=detect,
        kinematics=setup.kinematics.handed_on(left.kinematics), recurrence=left.recurrence,
        scores=state.scores._replace(**left.scores._asdict()), agenda=agenda,
        watched=left.watched, ring=setup.ring.handed_on(left.ring),
    )  # fmt: skip
    number = known.state.twin.other.version
    if before.phase != WATCH and number >= 0 and before.brief < 0.0 and not agenda.pinned:
        tried = before.tried - left.elapsed if before.phase == TRIAL else 0
        state = state._replace(
            other=driver.follow.beside(state.live, number), trial=left.trial,
            agenda=agenda._replace(phase=before.phase, tried=tried),
        )  # fmt: skip
    return driver.follow.predicting(state)
