"""What a beat says of what acts on the machine from outside, or seems to."""

from __future__ import annotations

import numpy as np

from evertwin.anomaly import Contact
from evertwin.loop.contacts import in_words, kept_out, place_in_words, recurring, remembered
from evertwin.loop.decision import Decision
from evertwin.loop.detectors import Alarm
from evertwin.loop.deviation import new_sums
from evertwin.loop.setup import Setup


def disturbed(decision: Decision, setup: Setup) -> bool:
    """Tells of what acts from outside. True: it may be at work now, so nothing is asked for."""
    state = decision.state
    external, told = setup.external.beat(state.external)
    on = setup.external.on(external)
    decision.state = state._replace(external=external)
    since = setup.external.since(external) if on else -1
    doubted = setup.kinematics.doubted(state.kinematics)
    if told.own is not None and doubted < 0 and kept_out(state.ring, told.own.first):
        name, first = told.own
        said = (
            f"what seemed to act on {name} from outside since row {first} comes with one motion "
            "after the other: it is the machine's own; its rows count"
        )
        decision.say("recurring", name, said, told.own._asdict())
    remembered(state.ring, told, since)
    contact = told.contact
    first = since if contact is None or contact.last < 0 else contact.first
    own = state.agenda.kind != "state"
    if state.agenda.open and own and 0 <= first < state.agenda.stop:
        decision.remember(open=0)  # it was asked about rows that are not the machine's own
    if contact is not None:
        forget(decision)
        if not 0 <= doubted <= max(contact.last, first):
            _tell(decision, setup, contact, new=told.new)
    if told.blind:
        said = "the model has no friction for what stands: what pushes it then cannot be told"
        decision.say("not_judged", "", said, {})
    return on


def forget(decision: Decision) -> None:
    """The deviation since it was last judged, and what waits to be told of it, are of rows that do
    not count."""
    scores = decision.state.scores
    watch, seen = new_sums(len(scores.watch.samples)), np.zeros(1, dtype=np.int64)
    decision.state = decision.state._replace(
        scores=scores._replace(watch=watch, seen=seen),
        detect=decision.state.detect._replace(pending=Alarm()),
    )


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
