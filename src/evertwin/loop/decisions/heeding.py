"""What a label changes at the beat that heeds it; an event says so (`evertwin.ledger.label`).

Rows that are faulty, or that a false alarm was raised on, leave the windows that fits look at. What
was asked of them, or learned from them and is still on trial, begins anew without them.
"""

from __future__ import annotations

from typing import Any

from evertwin.fold import Event
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.follow import EMPTY, Follow
from evertwin.rows.ring import called
from evertwin.setup.detectors import Alarm
from evertwin.setup.scores import judged_anew
from evertwin.setup.twin_state import TRIAL, WATCH, TwinState


def heed(follow: Follow, state: TwinState, said: Event) -> tuple[TwinState, tuple[Event, ...]]:
    """The state after what a person said, and the event of what it changed; none: nothing. Consumes
    ``state``."""
    told: Any = said.evidence
    decision, changed = Decision(state, [], []), list[str]()
    if told["verdict"] == "cause":
        decision.remember(cause=told["cause"], hold=min(state.agenda.hold, state.row))
        changed.append(f"{told['cause']} is tried first at the next tuning")
        changed += _anew(decision, state.row, again=True)
    elif told["verdict"] == "faulty":
        changed += _left_out(follow, decision, told["rows"])
        changed += _forgotten(follow, decision, told["rows"])
        changed += _anew(decision, told["rows"][0], again=True)
    elif told["verdict"] == "false alarm" and told["kind"] in ("suspected", "drift", "abnormal"):
        changed += _mistaken(follow, decision, told)
    if state.agenda.doubt and told["verdict"] in ("cause", "faulty", "false alarm"):
        decision.remember(doubt="")
        changed.append(f"{state.agenda.doubt} is in doubt no longer")
    if not changed:
        return decision.state, ()
    evidence = {key: told[key] for key in ("event", "verdict", "rows", "cause") if key in told}
    decision.say("heeded", told.get("signal", ""), "; ".join(changed), evidence)
    return decision.state, tuple(decision.events)


def _mistaken(follow: Follow, decision: Decision, told: Any) -> list[str]:
    """A false alarm of a detector counts in its rate; one of the requirement was of its rows."""
    changed, state = list[str](), decision.state
    if told.get("alarm", {}).get("detector") == "snr":
        changed.append("its limit is one of the twin file: [anomaly] snr")
    elif "alarm" in told and told["signal"] in follow.setup.detect.cusum.names:
        detect = follow.setup.detect
        found, sentence = detect.mistaken(state.detect, told["signal"], told["alarm"])
        decision.state = state._replace(detect=found)
        changed.append(sentence)
    elif "rows" in told:
        changed += _left_out(follow, decision, told["rows"])
        changed += _forgotten(follow, decision, told["rows"])
    if decision.state.detect.pending.signal == told["signal"]:
        detect = decision.state.detect._replace(pending=Alarm())
        decision.state = decision.state._replace(detect=detect)
    changed += _anew(decision, told["rows"][0] if "rows" in told else state.row, again=False)
    decision.remember(told=False)
    return changed


def _left_out(follow: Follow, decision: Decision, rows: tuple[int, int]) -> list[str]:
    count = follow.setup.ring.leave_out(decision.state.ring, *rows)
    decision.state = decision.state._replace(scores=judged_anew(decision.state.scores))
    span = f"{called(rows[0])} to {called(rows[1])}"
    if not count:
        return [f"{span} are kept no longer: no fit looks at them"]
    return [f"{count} rows leave the window of fits ({span})"]


def _forgotten(follow: Follow, decision: Decision, rows: tuple[int, int]) -> list[str]:
    """A challenger that was learned from such rows."""
    agenda, number = decision.state.agenda, decision.state.other.version
    if agenda.phase != TRIAL:
        return []
    learned = follow.versions[number].row
    if not learned - follow.setup.window("fit") <= rows[1] or learned <= rows[0]:
        return []
    decision.state = decision.state._replace(other=EMPTY)
    decision.remember(phase=WATCH)
    return [f"version {number}, which was on trial, was learned from them and is dropped"]


def _anew(decision: Decision, first: int, *, again: bool) -> list[str]:
    """What was asked of rows from ``first`` on is not answered any more; it is asked again, or
    nothing is to be explained."""
    agenda, row = decision.state.agenda, decision.state.row
    asked = agenda.open > 0 and agenda.stop > first
    if again and (asked or agenda.again):
        decision.remember(again=row, hold=min(agenda.hold, row))
    elif not again:
        decision.remember(again=0)
    if not asked:
        return []
    decision.remember(open=0)
    return ["the fit under way begins anew" if again else "the fit that it asked for ends"]
