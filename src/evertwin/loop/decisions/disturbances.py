"""What a beat says of what acts on the machine from outside, or seems to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.anomaly import Contact, Rise
from evertwin.anomaly.external import Own
from evertwin.anomaly.external_loop import SQUARE
from evertwin.gauges.rows.sensor_change import SensorChange
from evertwin.gauges.units.unit_change import of_sensor
from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.contacts import (
    in_words,
    kept_out,
    place_in_words,
    recurring,
    remembered,
)
from evertwin.loop.decisions.decision import Decision
from evertwin.models.batch import mapped
from evertwin.setup.detectors import Alarm
from evertwin.setup.scores import judged_anew
from evertwin.setup.setup import Setup
from evertwin.types import Float64, Inputs, Stamps, Vector

ENOUGH = 50
"""Rows in motion that tell a sensor from a push."""
VARIES = 0.3
"""Spread of what is predicted, at least [of its size]: a constant is a constant times anything."""
ALIKE = 0.8
"""Correlation of what is measured with what is predicted, at least."""
USUAL, CLEARLY = 2.0, 2.0
"""So many times the usual mean square a share of what is predicted leaves at most; so many times
that a push leaves at least."""


class _Beside(NamedTuple):
    a: Vector
    """Measured."""
    b: Vector
    """Predicted."""
    u: Inputs
    row: Stamps
    own: Float64[np.ndarray, "n three"]
    """How fast the predicted changes from row to row, speed, and how fast that changes."""


def disturbed(decision: Decision, setup: Setup, versions: Versions) -> bool:
    """Tells of what acts from outside. True: it may be at work now, so nothing is asked for."""
    state = decision.state
    external, told = setup.external.beat(state.external)
    on = setup.external.on(external)
    decision.state = state._replace(external=external)
    since = setup.external.since(external) if on else -1
    doubted = setup.kinematics.doubted(state.kinematics)
    if state.still.said.any():
        doubted = 0
    if told.own is not None and doubted < 0 and kept_out(state.ring, told.own.first):
        name, first = told.own
        said = (
            f"what seemed to act on {name} from outside since row {first} comes with one motion "
            "after the other: it is the machine's own; its rows count"
        )
        decision.say("recurring", name, said, told.own._asdict())
    if told.contact is not None and _in_proportion(decision, setup, versions, told.contact):
        its = Own(told.contact.outputs[0], told.contact.first)
        told = told._replace(contact=None, own=its)  # its rows count: tuning asks what it is
    remembered(state.ring, told, since)
    contact = told.contact
    first = since if contact is None or contact.last < 0 else contact.first
    own = state.agenda.kind != "state"
    if state.agenda.open and own and 0 <= first < state.agenda.stop:
        decision.remember(open=0)  # it was asked about rows that are not the machine's own
    if contact is not None:
        forget(decision)
        if not 0 <= doubted <= max(contact.last, first):
            sensor = _sensor(decision, setup, versions, contact)
            if sensor is None:
                _tell(decision, setup, contact, new=told.new)
            else:
                decision.say("abnormal", sensor.channel, sensor.said, {"number": sensor.number})
    if told.blind:
        said = (
            "what pushes what stands cannot be told: no friction of it is known, or the model is "
            "off at rest by more than that"
        )
        decision.say("not_judged", "", said, {})
    return on


def _sensor(
    decision: Decision, setup: Setup, versions: Versions, contact: Contact
) -> SensorChange | None:
    """An output that goes with what is predicted, a known number times as large, in place of what
    a push would add: from the motion since the contact began."""
    rows = _beside(decision, setup, versions, contact, goes_on=False)
    if rows is None:
        return None
    channel = setup.model.outputs.channels[setup.model.outputs.index(contact.outputs[0])]
    found = of_sensor(setup, channel, rows.a, rows.b, rows.u)
    alike = found is not None and abs(np.corrcoef(rows.a, rows.b)[0, 1]) > ALIKE
    return found if alike else None


def _in_proportion(decision: Decision, setup: Setup, versions: Versions, contact: Contact) -> bool:
    """Is an output off by a share of what is predicted, of how that changes, of its speed and
    acceleration, before the contact, since it began and after it? A push adds the same whatever the
    machine does, and ends."""
    rows = _beside(decision, setup, versions, contact, goes_on=True)
    if rows is None or contact.last < 0:
        return False
    k = setup.model.outputs.index(contact.outputs[0])
    usual = float(decision.state.external.figures[k, SQUARE])
    off, pushed = rows.a - rows.b, (contact.first <= rows.row) & (rows.row <= contact.last)
    if not pushed.any():
        return False
    own = np.column_stack([rows.b, rows.own])
    share = off - own @ np.linalg.lstsq(own, off, rcond=1e-9)[0]
    push = off - np.where(pushed, np.mean(off[pushed]), 0.0)
    left = float(np.mean(np.square(share)))
    return left <= USUAL * usual and float(np.mean(np.square(push))) >= CLEARLY * left


def _beside(
    decision: Decision, setup: Setup, versions: Versions, contact: Contact, *, goes_on: bool
) -> _Beside | None:
    """The only output of a contact and what is predicted of it, where it moves and that varies:
    within the contact, or as long before it, and since it began too. None: such rows are few."""
    state = decision.state
    end = state.ring.end if contact.last < 0 else contact.last + 1
    first, stop = contact.first, state.ring.end if goes_on else end
    first = max(first - (end - first), state.ring.first, 0) if goes_on else first
    windows = setup.ring.between(state.ring, first, stop)
    model, p = versions.model(state.live.version), versions[state.live.version].p
    if len(model.states) or len(contact.outputs) != 1 or not windows:
        return None
    k = model.outputs.index(contact.outputs[0])
    u, dt, y = (
        np.concatenate([getattr(one, name) for one in windows]) for name in ("u", "dt", "y")
    )
    row = np.concatenate([one.row + np.arange(len(one.t)) for one in windows])
    expected, speed = mapped(model, u, dt, p)[:, k], u[:, setup.judged_by[0][k]]
    own = np.column_stack([np.gradient(expected), speed, np.gradient(speed)])
    rows = setup.moving(u)[:, k] & np.isfinite(own).all(axis=1) & np.isfinite(y[:, k])
    a, b = y[rows, k], expected[rows]
    if len(a) < ENOUGH or np.std(b) < VARIES * np.sqrt(np.mean(np.square(b))):
        return None
    return _Beside(a, b, u[rows], row[rows], own[rows])


def forget(decision: Decision) -> None:
    """The deviation since it was last judged, and what waits to be told of it, are of rows that do
    not count."""
    decision.state = decision.state._replace(
        scores=judged_anew(decision.state.scores),
        detect=decision.state.detect._replace(pending=Alarm(), risen=Rise()),
    )


def unlearn(decision: Decision, setup: Setup) -> None:
    """The same, of outputs alone whose fault was found out some rows late. Writes into the sums."""
    scores, detect = decision.state.scores, decision.state.detect
    if not scores.spoiled.any():
        return
    for column in scores.watch:
        column[scores.spoiled] = 0
    scores.past[..., scores.spoiled] *= 0.0
    decision.state.newest.values.reshape(4, -1)[:, scores.spoiled] = np.nan
    names = [name for name, off in zip(setup.model.outputs.names, scores.spoiled) if off]
    if detect.pending.signal in names:
        detect = detect._replace(pending=Alarm())
    if detect.risen.name in names:
        detect = detect._replace(risen=Rise())
    scores.spoiled[:] = False
    decision.state = decision.state._replace(detect=detect)


def _tell(decision: Decision, setup: Setup, contact: Contact, *, new: bool) -> None:
    """A contact, or the place where contacts come again and again."""
    place, known = None, False
    if contact.last >= 0:
        decision.state, place, known = recurring(setup, decision.state, contact)
    if place is not None:
        said = place_in_words(setup, contact, place)
        decision.say("recurring", contact.outputs[0], said, place._asdict())
    elif new and not known:
        said = in_words(setup, contact)
        decision.say("external", contact.outputs[0], said, contact._asdict())
