"""Is the live version off by more than the requirement?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from evertwin.anomaly import Rise
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.follow import NONE, early, proven
from evertwin.rows.ring import kept
from evertwin.setup.detectors import Alarm
from evertwin.setup.deviation import Sums, judged_deviation, limits
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TwinState

DOUBLED = 2.0
"""So many times what it was off by before an output is off for that to be told before it is known
why: a motion that is harder to foretell does less."""
FAR = 3.0
"""So many times the farthest that it was off by before an output is off for that to be told though
it is within what is asked."""
WORTH = 0.25
"""Part of the requirement that it has to be off by for that: nearer nobody would heed it."""
WIDER = 1.5
"""So many times as far as before inputs may go for a deviation not to come of that."""
LITTLE = 0.5
"""Part of the requirement that a deviation has to grow by for a detector's alarm to count: that a
residual is no longer what it was is no trouble while the twin is as true as is asked."""


def heard(setup: Setup, state: TwinState, *, whole: bool) -> tuple[Alarm, TwinState]:
    """The detectors' alarm if it matters, and the state without it; it is dropped, too, if it did
    not matter in a ``whole`` window behind it."""
    alarm, begins = state.detect.pending, state.row - int(state.scores.seen[0])
    parts = setup.steps.parts if alarm.step else 1
    matters = bool(alarm.kind) and _matters(setup, state, alarm.signal, 1.0 / parts)
    if matters or (whole and alarm.row <= begins):
        state = state._replace(detect=state.detect._replace(pending=Alarm()))
    return alarm if matters else Alarm(), state


def rises(decision: Decision, setup: Setup, *, whole: bool) -> TwinState:
    """A deviation that was told of has become a larger one, by enough: it is asked about at once,
    but for open work, of which the rows are older; and told where it has doubled. One that began
    with the change that is known already, or the doubt about a channel, is explained."""
    state = decision.state
    rise, begins = state.detect.risen, state.row - int(state.scores.seen[0])
    if not rise.name or state.agenda.open:
        return state
    since, doubted = state.agenda.since, bool(state.agenda.doubt)
    known = since > 0 and rise.first - since <= state.row - rise.first
    known |= doubted and rise.first <= state.agenda.doubted_at
    if whole and rise.row <= begins and not (known or state.agenda.told):
        _tell_within(decision, setup, rise)
    matters = state.agenda.told and not known and _matters(setup, state, rise.name)
    if known or matters or (whole and rise.row <= begins):
        decision.state = state._replace(detect=state.detect._replace(risen=Rise()))
    if matters:
        row, hold = state.row, min(state.agenda.hold, state.row)
        decision.remember(risen=row, rose=rise.first, again=row, hold=hold, vain=0)
    if matters and rise.times >= DOUBLED:
        reason = f"{rise.name} is off by {rise.times:.2g} times what it was before row {rise.first}"
        evidence = {"first": rise.first, "rows": state.row - rise.first, "times": rise.times}
        decision.say("suspected", rise.name, reason, evidence)
    return decision.state


def _tell_within(decision: Decision, setup: Setup, rise: Rise) -> None:
    """An output is off by far more than it ever was, and no input goes farther than it did: that is
    told though it is within what is asked, and nothing is asked for it."""
    state, ring = decision.state, decision.state.ring
    if not (rise.beyond >= FAR and np.isfinite(setup.requirement)):
        return
    before, now = (
        ring.u[kept(ring, *span)] for span in ((ring.first, rise.first), (rise.first, state.row))
    )
    with unmeasured():
        goes_farther = np.nanstd(now, axis=0) > WIDER * np.nanstd(before, axis=0)
    if not len(before) or goes_farther.any():
        return
    k, watch, usual = setup.model.outputs.index(rise.name), state.scores.watch, state.scores.usual
    asked = limits(setup.requirement, watch, setup.relative, usual)[k]
    if not judged_deviation(watch, setup.relative, usual)[k] >= WORTH * asked:
        return
    reason = (
        f"{rise.name} is off by {rise.times:.2g} times what it was, from row {rise.first} on or "
        "later, though within what is asked: nothing is tuned for it"
    )
    evidence = {"first": rise.first, "rows": state.row - rise.first, "times": rise.times}
    decision.say("drift", rise.name, reason, evidence)


def unexplained(decision: Decision, setup: Setup, content: Mapping[str, Any]) -> None:
    """An answer does not tell that the machine changed where the deviation rose: it is asked again
    of twice the rows since then, as long as a deviation is judged on."""
    agenda, row = decision.state.agenda, decision.state.row
    more = row - agenda.rose
    if agenda.risen and ("since" in content or more >= setup.enough):
        decision.remember(risen=0)
    elif agenda.risen:
        decision.remember(again=row, hold=agenda.hold if "waits" in content else row + more)


def _matters(setup: Setup, state: TwinState, signal: str, part: float = 1.0) -> bool:
    """Has the deviation over a ``part`` of a window, a step of a task that repeats, grown by
    enough, were the rows as before that have not come yet? Squares are compared."""
    if not np.isfinite(setup.requirement):
        return True
    scores, k = state.scores, setup.model.outputs.index(signal)
    if scores.watch.samples[k] == 0:  # nothing moved: it cannot be told yet
        return False
    past = Sums(*(a - b for a, b in zip(scores.live_moving, scores.watch, strict=True)))
    now, before = (
        judged_deviation(sums, setup.relative, scores.usual)[k] for sums in (scores.watch, past)
    )
    grown = now**2 - (before**2 if past.samples[k] else 0.0)
    rows = setup.watch(NONE, state.agenda.held).rows
    whole = max(1.0, rows / int(scores.seen[0]))
    asked = limits(setup.requirement, scores.watch, setup.relative, scores.usual)[k]
    return bool(grown >= whole * part * (LITTLE * asked) ** 2)


def deviates(
    setup: Setup, state: TwinState, task_end: bool
) -> tuple[str | None, str, dict[str, Any]]:
    """Reason, output, evidence; (None, …) when it is too early to say, ("", …) when it is not."""
    samples = max(state.scores.watch.samples.tolist(), default=0)
    rule = setup.watch(NONE, proven(state))
    enough = samples >= setup.least if task_end else rule.enough(state.scores)
    if not np.isfinite(setup.requirement) or not enough:
        return None, "", {}
    return _off(setup, state)


def foreseen(setup: Setup, state: TwinState) -> tuple[str, str, dict[str, Any]]:
    """The same where it is too early to say, but what is left of the window cannot help any more:
    it is told, and nothing is asked yet."""
    rule = setup.watch(NONE, early(setup, state))
    return _off(setup, state) if rule.held and rule.enough(state.scores) else ("", "", {})


def _off(setup: Setup, state: TwinState) -> tuple[str, str, dict[str, Any]]:
    watch = state.scores.watch
    values = judged_deviation(watch, setup.relative, state.scores.usual)
    values = np.where(setup.watched, values, np.nan)
    allowed = limits(setup.requirement, watch, setup.relative, state.scores.usual)
    beyond = np.where(values > allowed, values, np.nan)
    if np.isnan(beyond).all():
        return "", "", {}
    worst = int(np.nanargmax(beyond))
    name = setup.model.outputs.names[worst]
    shown = [setup.shown(k, values[k]) for k in range(len(values))]
    limit = setup.shown(worst, allowed[worst])
    first = state.row - int(state.scores.seen[0])
    evidence = {
        "deviation": values, "limit": allowed[worst], "rows": max(watch.samples.tolist()),
        "first": first,
    }  # fmt: skip
    return f"{name} is off by {shown[worst]} (limit {limit})", name, evidence
