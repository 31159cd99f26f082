"""Inputs that contradict each other: their rows are not judged, and nothing is learned from them.

A static map predicts from positions and speeds that were measured. Where the two contradict each
other (`evertwin.anomaly.kinematics`), it is not the machine that is off.
"""

from __future__ import annotations

import numpy as np

from evertwin.anomaly import KinematicsState
from evertwin.fold import Block, Mark
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.disturbances import forget
from evertwin.rows.ring import Rows, kept
from evertwin.setup.setup import Setup
from evertwin.types import Inputs


def compared(
    setup: Setup, state: KinematicsState, rows: Block, u: Inputs
) -> tuple[KinematicsState, Block]:
    """The rows, marked where their inputs ``u`` contradict each other, as they were recorded: one
    in another unit may be beyond what is possible. Consumes ``state``; writes the marks of
    ``rows``."""
    state, marked = setup.kinematics.step(state, rows.row, rows.dt, u)
    if marked.any():
        _contest(rows.mark[:, rows.u.shape[1] :], marked)
    return state, rows


def told(decision: Decision, setup: Setup) -> bool:
    """Tells of contradictions that opened or closed. True: one is open, or an input is not known:
    nothing is asked for."""
    state = decision.state
    kinematics, found = setup.kinematics.beat(state.kinematics)
    decision.state = state._replace(kinematics=kinematics)
    for one in found:
        kind = "measurement_error" if one.open else "measurement_restored"
        evidence = one._asdict() | {"cause": "kinematics"}
        decision.say(kind, one.signal, one.reason, evidence)
    first = setup.kinematics.since(kinematics)
    if first < 0:
        return setup.static and _unknown(state.ring)
    _remembered(state.ring, first)
    forget(decision)
    decision.remember(open=0, since=state.row)
    return True


def _unknown(rows: Rows) -> bool:
    newest = rows.u[(rows.end - 1) % len(rows.t)]
    return rows.end > 0 and not bool(np.isfinite(newest).all())


def _remembered(rows: Rows, first: int) -> None:
    """Marks the kept rows from ``first`` on. Writes into ``rows``."""
    places = kept(rows, first)
    marks = rows.mark[places, rows.u.shape[1] :]
    _contest(marks, np.ones(len(places), dtype=np.bool_))
    rows.mark[places, rows.u.shape[1] :] = marks


def _contest(marks: np.ndarray, which: np.ndarray) -> None:
    counts = (marks != Mark.ABSENT) & (marks < Mark.CONTESTED) & which[:, None]
    marks[counts] = Mark.CONTESTED
