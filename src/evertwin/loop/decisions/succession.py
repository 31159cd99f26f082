"""Who is on trial, or in probation, when the machine goes on changing or a channel is in doubt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.ledger.caveats import SAME, SENSOR, caveats_of, in_doubt_of
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.follow import EMPTY, Follow
from evertwin.rows.ring import Rows, called, kept
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import PROBATION, TRIAL, WATCH, TwinState
from evertwin.trial.gate import GateState
from evertwin.types import Vector

VARIES = 0.3
"""Spread of an input by which the machine is driven, at least [of its usual one]."""


class Opening(NamedTuple):
    """How the trial of a candidate begins.

    >>> Opening._fields
    ('trial', 'scale', 'tried', 'said', 'evidence', 'reason')
    """

    trial: GateState
    scale: Vector
    """Residual size that counts as 1 in a loss, (ny,)."""
    tried: int
    """Elapsed time at which it began [ns]."""
    said: str
    """Of the challenger that makes room; empty: there was none."""
    evidence: Mapping[str, Any]
    reason: str
    """Of the candidate; what would look the same as the challenger looks the same as it."""


def opening(follow: Follow, state: TwinState, candidate: Mapping[str, Any]) -> Opening:
    """The trial of a candidate: its own, or that of the challenger whose place it takes.

    A machine that goes on changing brings a better candidate before the one on trial has been
    tried to the end. Were each trial to begin anew, none would ever end.
    """
    gate, agenda, reason = follow.setup.trial, state.agenda, str(candidate["reason"])
    scale = np.array(candidate["scale"], dtype=np.float64)
    if agenda.phase != TRIAL:
        return Opening(gate.init(), scale, state.elapsed, "", {}, reason)
    evidence = gate.verdict(state.trial)[1]
    said = f"version {state.other.version} makes room for a better candidate"
    states = agenda.brief >= 0.0 or "brief" in candidate  # these have a short test of their own
    trial = gate.init() if states else gate.passed_on(state.trial)
    if not states:
        old, new = follow.versions[state.other.version].reason, caveats_of(reason)
        kept = [said for said in in_doubt_of(old) if not new.keys() & caveats_of(said).keys()]
        reason = "; ".join(dict.fromkeys([reason, *kept]))
    if not trial.tally[1]:
        return Opening(trial, scale, state.elapsed, said, evidence, reason)
    said += f", which goes on with its trial: {evidence['sentence']}"
    return Opening(trial, state.scores.scale, agenda.tried, said, evidence, reason)


def in_doubt(decision: Decision, setup: Setup, content: Mapping[str, Any]) -> Mapping[str, Any]:
    """The content of an answer, without what was learned while a channel is in doubt.

    What tells a sensor from the machine are rows from before; once no window has them any more,
    the rows alone would have the machine learn what its sensor says. The doubt lasts until the
    live version fits again, later rows refute it, or a person says what it was.
    """
    agenda, number = decision.state.agenda, decision.state.other.version
    channel = content.get("sensor", "")
    over = content.get("refused") is not None
    if agenda.doubt and not (over and channel == agenda.doubt):
        if content.get("cleared") and driven(setup, decision.state.ring):
            _cleared(decision, setup)
        return {"events": []}  # what was said first was said by most rows from before
    before = agenda.accused
    again, accused = channel and channel == agenda.accused, "" if over else channel
    decision.remember(accused=accused if "fit" in content or channel else agenda.accused)
    if not channel:  # divided by a number of units it may still be off by a little
        return {"events": []} if decision.state.live.track.divides else _with(content, before)
    if agenda.phase == TRIAL and not agenda.pinned and agenda.brief < 0.0:
        said = f"version {number} was learned from rows in which {channel} is in doubt"
        decision.say("rejected", "", said, {"version": number})
        decision.state = decision.state._replace(other=EMPTY)
        decision.remember(phase=WATCH)
    decision.remember(doubt=channel if content["lasts"] and not over else "")
    by = float(content["events"][-1]["evidence"]["number"])
    decision.remember(doubted=by, doubted_at=agenda.stop)
    return {**content, "events": []} if again and not (over or content["lasts"]) else content


def _with(content: Mapping[str, Any], channel: str) -> Mapping[str, Any]:
    """The content, whose candidate goes on to say that ``channel`` was in doubt."""
    found = content.get("candidate")
    if not channel or found is None or channel in caveats_of(found["reason"]):
        return content
    said = f"{SENSOR}{channel} that is off, as was told before, {SAME}"
    return {**content, "candidate": {**found, "reason": f"{found['reason']}; {said}"}}


def _cleared(decision: Decision, setup: Setup) -> None:
    """Later rows refute what was said of a channel: what is off on them may be learned."""
    agenda = decision.state.agenda
    since = max(agenda.since, agenda.doubted_at, decision.state.row - setup.enough)
    clears(decision, f"rows from {called(since)} on refute what was said")
    decision.remember(since=since)


def clears(decision: Decision, why: str) -> None:
    """The channel in doubt is so no longer, and nothing that is learned goes on to say it was."""
    channel = decision.state.agenda.doubt
    decision.say("normal", channel, f"{channel} is in doubt no longer: {why}", {"doubt": channel})
    decision.remember(doubt="", accused="")


def driven(setup: Setup, rows: Rows) -> bool:
    """Do inputs vary on the newest rows as they usually do? At rest a fault does not show."""
    u = rows.u[kept(rows, rows.first)]
    with unmeasured():
        usual, now = np.nanstd(u, axis=0), np.nanstd(u[-setup.enough :], axis=0)
    return bool((now >= VARIES * usual)[usual > 0.0].any())


def makes_room(setup: Setup, decision: Decision) -> None:
    """What goes on ends where the live version deviates: the trial of a challenger that has long
    gained next to nothing; the probation of a version that has been better than the one before, or
    of which nothing tells it apart: to go back would not help."""
    state, gate = decision.state, setup.trial
    phase, pinned = state.agenda.phase, state.agenda.pinned
    if phase == TRIAL and not pinned:
        verdict, evidence = gate.verdict(state.trial)
        hopeless = evidence["gain"] < 0.5 * gate.margin
        if verdict is None and hopeless and evidence["segments"] >= 2 * gate.least:
            number = state.other.version
            reason = f"version {number} gains too little, superseded: {evidence['sentence']}"
            decision.say("rejected", "", reason, {**evidence, "version": number})
            decision.state = state._replace(other=EMPTY)
            decision.remember(phase=WATCH)
    elif phase == PROBATION:
        kept, evidence = setup.probation.verdict(state.trial)
        stays = evidence["deviation_live"] < (1.0 - gate.margin) * evidence["deviation_other"]
        stays |= abs(evidence["gain"]) < gate.margin
        if kept is None and stays and evidence["segments"] >= setup.probation.segments:
            decision.state = state._replace(other=EMPTY)
            decision.remember(phase=WATCH)


def to_blame(decision: Decision, content: Mapping[str, Any]) -> Mapping[str, Any]:
    """The content of an answer to a deviation in probation: a version is not to blame for what the
    machine has changed since, and stays; else nothing, for the probation tells whether it does."""
    agenda = decision.state.agenda
    if agenda.phase != PROBATION or not agenda.again or agenda.kind != "fit":
        return content
    if "since" not in content:
        return {"events": []} | {k: content[k] for k in ("waits", "changed") if k in content}
    decision.state = decision.state._replace(other=EMPTY)
    decision.remember(phase=WATCH)
    return content
