"""When a beat looks for a state of the machine or asks again, and what of a state it remembers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from evertwin.loop.decisions.decision import Decision
from evertwin.models.form import Version
from evertwin.refit.answers.states import amount
from evertwin.setup.deviation import judged_deviation
from evertwin.setup.setup import FEW, Setup
from evertwin.setup.twin_state import TRIAL, TwinState

OFTEN = 3
"""Looks at least in the time that a deviation is judged on."""
PATIENT = 4
"""So many pauses from one fit to the next while a channel is in doubt."""
VAIN = 2
"""So many times the pause doubles at most while the form stays wrong and nothing comes of it."""


def looks(setup: Setup, state: TwinState, *, lasts: bool = False) -> str:
    """The request that a beat makes about states; empty: none.

    A state comes at once, so a deviation is not waited for as long as where wear is asked about:
    the shorter it was judged on, the larger it has to be. ``lasts``: something acts on the machine,
    from outside or not.
    """
    agenda = state.agenda
    trying = agenda.phase == TRIAL and agenda.brief > 0.0
    if not setup.spec.tuning.states or agenda.open or agenda.pinned or trying:
        return ""
    if lasts:
        return "state"
    watch = state.scores.watch
    samples = max(watch.samples.tolist(), default=0)
    if state.row < agenda.look or samples < FEW:
        return ""
    limit = setup.requirement * math.sqrt(max(setup.enough / samples, 1.0))
    values = judged_deviation(watch, setup.relative, state.scores.usual)
    if np.nanmax(values[setup.watched], initial=0.0) > limit:
        return "state"
    again = 0 < agenda.refine <= state.row and agenda.phase != TRIAL
    return "refine" if again else ""


def in_vain(setup: Setup, state: TwinState) -> dict[str, Any]:
    """Of a look that found nothing: the next one waits twice as long, not longer than `OFTEN`."""
    pace = max(setup.latency, min(2 * state.agenda.pace, setup.enough // OFTEN))
    return {"look": state.row + pace, "pace": pace}


def nothing_came(
    setup: Setup, state: TwinState, content: Mapping[str, Any], *, waits: bool
) -> dict[str, Any]:
    """Of an answer without a candidate: when the next one is asked for. A form that is wrong, with
    none to try, stays so: it is asked about ever more rarely, until the deviation rises."""
    agenda, pause = state.agenda, setup.latency if waits else setup.holdoff
    if agenda.doubt:  # all that is asked of it is whether it is over
        pause *= PATIENT
    wrong = not waits and any(one["kind"] == "abnormal" for one in content["events"])
    if wrong:
        pause += setup.enough * (2**agenda.vain - 1)
    return {"hold": state.row + pause, "vain": min(agenda.vain + 1, VAIN) if wrong else 0}


def adopted(decision: Decision, setup: Setup, version: Version) -> None:
    """A state goes live: it is said, and told anew from twice its rows, up to a window of a fit."""
    state, agenda = decision.state, decision.state.agenda
    name, _, said = version.reason.partition(": ")
    decision.say("state", name, said, {"version": version.number, "row": agenda.begins})
    known = state.row - agenda.begins
    again = bool(amount(setup, name, version)) and known < setup.window("fit")
    decision.remember(
        brief=-1.0, since=agenda.begins, refine=state.row + known if again else 0, look=0, pace=0
    )


def returned(decision: Decision, setup: Setup, live: Version, old: Version) -> None:
    """A version is replaced by the one before: states that come or go with it are said."""
    decision.remember(refine=0)
    for name in setup.spec.tuning.states:
        was, now = amount(setup, name, live), amount(setup, name, old)
        if was != now:
            said = f"not {was or 'gone'}, as was told: back to {now or 'none'}"
            decision.say("state", name, said, {"version": old.number})
