"""Another version goes live: one that was tried, or an earlier one that fits again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evertwin.fold import Block, copy
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.loop.decisions.contacts import known_of
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.follow import EMPTY, Follow
from evertwin.loop.decisions.former import NOBODY, began, former, tell_alternates
from evertwin.loop.decisions.looking import returned
from evertwin.rows.ring import called
from evertwin.setup.deviation import Sums, judged_deviation
from evertwin.setup.evaluation import left
from evertwin.setup.scores import new_scores
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TRIAL, WATCH, TwinState
from evertwin.trial.gate_loop import OPEN
from evertwin.types import PerOutput

ALIKE = 0.5
"""Share of the rows at least whose inputs lie where they lay before."""
NEARLY = 1.2
"""So many times what the nearest version leaves another one leaves at most to be as near."""
RARE = 0.05
"""Share of the rows at either end of an input's range that tell nothing of where it lies."""


def recovered(decision: Decision, follow: Follow) -> None:
    """The first champion goes live again where it is within what is asked and has become much
    nearer to the machine than the live version, as after a repair; what is on trial was learned
    from the machine before it. Of several versions that were live the nearest one does, be it
    on trial already; none, where what is on trial was never live and is clearly nearer."""
    state, agenda = decision.state, decision.state.agenda
    found, evidence = follow.recovery.verdict(state.recovery)
    if not found:
        return
    holds = agenda.told and evidence["deviation_other"] <= _asked(follow, state)
    may = not agenda.pinned and agenda.brief < 0.0
    if not (holds and may and _seen(follow, state, evidence["since"])):
        state.recovery.tally[0] = OPEN  # the live version holds, or neither does: weighed on
        return
    old = _nearest(follow, state, evidence["since"])
    if old < 0:
        state.recovery.tally[0] = OPEN
        return
    since = evidence["since"]
    why = f"from {called(since)} on the machine is again as at version {old}"
    goes_back(decision, follow, old, f"{why}, as after a repair: {evidence['sentence']}", evidence)
    tell_alternates(decision)


def goes_back(
    decision: Decision, follow: Follow, old: int, why: str, evidence: Mapping[str, Any]
) -> None:
    """A version that was live before is so again, since the row that ``evidence`` names."""
    state, agenda, since = decision.state, decision.state.agenda, evidence["since"]
    live = state.live.version
    if agenda.phase == TRIAL and state.other.version != old:
        said = f"version {state.other.version} makes room for one that was live before"
        decision.say("superseded", "", said, {"version": state.other.version})
    reason = f"version {old} replaces {live}: {why}"
    decision.say("rolled_back", "", reason, switched(follow, evidence, old))
    returned(decision, follow.setup, follow.versions[live], follow.versions[old])
    lane = state.first if old == state.first.version else follow.beside(state.live, old)
    decision.state = goes_live(follow, state._replace(other=lane), old, EMPTY, state.first)
    hold = state.row + follow.setup.holdoff
    decision.remember(phase=WATCH, hold=hold, since=max(agenda.since, since), again=0)


@unmeasured()
def _nearest(follow: Follow, state: TwinState, since: int) -> int:
    """Of the first champion and those that were live after it, the one that is nearest to the rows
    from ``since`` on; −1: what is on trial is clearly nearer, or none is within what is asked, or
    ever was: it was no machine that comes back."""
    setup, versions, live = follow.setup, follow.versions, state.live.version
    windows, first = setup.ring.between(state.ring, since, state.row), state.first.version
    tried = {state.other.version} if state.agenda.phase == TRIAL else set()
    once = {one.number for one in former(versions, state, live)}
    again = first if first in once or NOBODY not in state.lives[:, 0] else -1
    if not windows or not once:
        return again
    past = setup.ring.between(state.ring, 0, since)
    off = {
        k: left(setup, versions.model(k), versions[k].p, windows, past)
        for k in {first, *once, *tried}
    }
    share = {k: float(np.nanmean(one / off[first])) for k, one in off.items()}
    if not np.isfinite(list(share.values())).all():  # nothing moved: the bets alone tell
        return again
    best = min(once, key=lambda k: (share[k], k != first))
    if again >= 0 and share[again] <= NEARLY * share[best]:
        best = again
    nearer = min((share[k] for k in tried - once), default=np.inf)
    if share[best] > NEARLY * nearer or not within(setup, off[best], windows):
        return -1
    return best


@unmeasured()
def _held(follow: Follow, state: TwinState) -> bool:
    """Was the challenger within what is asked, each output, on the rows of its trial?"""
    setup, version = follow.setup, follow.versions[state.other.version]
    past, windows = (
        setup.ring.between(state.ring, *span)
        for span in ((0, version.row), (version.row, state.row))
    )
    model = follow.versions.model(version.number)
    return bool(windows) and within(setup, left(setup, model, version.p, windows, past), windows)


def within(setup: Setup, off: PerOutput, windows: Sequence[Block]) -> bool:
    """Is what is left, (ny,), within what is asked of each watched output?"""
    size = setup.sizes(np.concatenate([one.y for one in windows]))
    return bool((np.nan_to_num(off / size)[setup.watched] <= setup.requirement).all())


def _seen(follow: Follow, state: TwinState, since: int) -> bool:
    """Do inputs go about as they went while the live version did better? At others it may be that
    one which is wrong, and the machine not as it was."""
    ring = follow.setup.ring
    learned = min(follow.versions[state.live.version].row, state.agenda.since)  # from such rows
    none = np.empty((0, state.ring.u.shape[1]))
    spans = ((learned, since), (since, state.row))
    before, now = (
        np.concatenate([none, *(one.u for one in ring.between(state.ring, *span))])
        for span in spans
    )
    if not (len(before) and len(now)):
        return False
    low, high = np.nanquantile(before, (RARE, 1.0 - RARE), axis=0)
    wide = (high - low) / 2
    inside = (now >= low - wide) & (now <= high + wide) | np.isnan(now)
    return bool(np.mean(inside.all(axis=1)) >= ALIKE)


def _asked(follow: Follow, state: TwinState) -> float:
    """Root of the loss of a version that is off by just what is asked."""
    setup, usual, scale = follow.setup, state.scores.usual, state.scores.scale
    ones = np.ones(len(scale), dtype=np.int64)
    size = Sums(scale**2, usual.measured / np.maximum(usual.samples, 1), ones)
    loss = np.square(setup.requirement / judged_deviation(size, setup.relative, usual))
    return float(np.sqrt(np.mean(loss[setup.watched & (usual.samples > 0)])))


def goes_live(follow: Follow, state: TwinState, number: int, other: Any, first: Any) -> TwinState:
    """``number``, in the lane beside the live one, goes live from the state it has run to; the
    scores begin anew."""
    stage, p = follow.stages(number)[1], follow.versions[number].p
    lane = state.other._replace(
        horizon=stage.renew(copy(state.other.horizon), p),
        track=_taken_over(follow, number, state),
    )
    if first.version == number:
        first = EMPTY
    elif first.version >= 0:
        first = copy(first)
    recovery, within = follow.recovery.init(), False
    # where nothing is asked nobody knows what was the machine
    reached = state.agenda.commissioned or not np.isfinite(follow.setup.requirement)
    if other is not EMPTY:
        within = _held(follow, state)
        other = other._replace(track=())
        recovery.harm[0] = follow.recovery.before  # its trial has told that it did better
    updates = np.array([_updates(lane), _updates(first)], dtype=np.int64)
    usual = state.scores.usual._replace(noise=np.zeros(len(state.scores.scale)))
    scores = new_scores(usual, updates, state.row, state.scores.scale)
    if state.agenda.brief < 0.0:  # what was seen until now another version was judged on
        state.ring.seen[:] = follow.setup.ring.unseen()
    return state._replace(
        live=lane, stream=follow.goes_on(state, number), first=first, other=other,
        lives=began(state.lives, number, state.row, reached=reached),
        scores=scores, agenda=state.agenda._replace(held=within, told=False, open=0, retell=0),
        trial=follow.setup.probation.init(), recovery=recovery,
        detect=follow.setup.detect.anew(state.detect),
        external=known_of(follow.setup, state, follow.versions.model(number), p),
        # what waits is of the version that goes
        newest=follow.setup.at_horizon.init(), waiting=follow.setup.residual_filter.init(),
    )  # fmt: skip


def told_anew(follow: Follow, state: TwinState) -> int:
    """Row from which on a whole window behind what the challenger was tuned on tells it anew; 0: it
    was told so itself, has another form, or more fits come anyway: by schedule, or since no version
    has held yet."""
    new, old = (follow.versions[lane.version] for lane in (state.other, state.live))
    again = state.agenda.commissioned and state.agenda.retell >= 0 and new.form == old.form
    again = again and not math.isfinite(follow.setup.spec.tuning.every)
    return new.row + follow.setup.window("retell") if again else 0


def retells(state: TwinState) -> bool:
    """Is it time for that? A deviation asks for a fit of its own."""
    agenda, row = state.agenda, state.row
    return 0 < agenda.retell <= row and row >= agenda.hold and not agenda.told


def switched(follow: Follow, evidence: Mapping[str, Any], number: int) -> dict[str, Any]:
    """The evidence of a switch, with the version that goes live."""
    return {**evidence, "version": number, "hash": follow.versions[number].hash}


def _taken_over(follow: Follow, number: int, state: TwinState) -> Any:
    """The champion's track, continued by another version with the arbiter's memory."""
    old, _ = follow.stages(state.live.version)
    new, _ = follow.stages(number)
    track = new.take_over(copy(state.live.track), old, follow.versions[number].p)
    hidden = len(old.model.states)
    if len(track.x) > hidden and state.other.version == number:
        track.x[hidden:] = state.other.horizon.x[hidden : len(track.x)]
    return track


def _updates(lane: Any) -> int:
    return 0 if lane.version < 0 else int(lane.track.updates.sum())
