"""A live version that does worse than one before it, where neither is within what is asked.

What was tuned while a machine did little of what it can do predicts the rest badly, long after its
probation. The first champion predicts every segment beside it; once that has been much nearer, the
nearest of those that were live before is live again.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.follow import Follow
from evertwin.loop.decisions.former import former, without_newest
from evertwin.loop.decisions.going_live import goes_back
from evertwin.rows.ring import called
from evertwin.setup.evaluation import left
from evertwin.setup.twin_state import TRIAL, WATCH, TwinState
from evertwin.types import PerOutput

ALIKE = 0.05
"""Share by which two versions differ at most in what they miss of an output that tells nothing of
which is nearer."""


def outdone(decision: Decision, follow: Follow) -> None:
    """The nearest version goes live again where the first champion has done better by much than
    the live one, which is off by more than is asked: in its probation, or once a fit to such rows
    has brought nothing, for the machine may have changed."""
    state, agenda, recovery = decision.state, decision.state.agenda, follow.recovery
    free = agenda.told and not (agenda.pinned or agenda.doubt or agenda.phase == TRIAL)
    if state.first.version < 0 or not (free and recovery.outdone(state.recovery)):
        return
    evidence = recovery.verdict(state.recovery)[1]
    fitted = not agenda.open and agenda.stop >= evidence["since"] + follow.setup.enough
    if agenda.phase == WATCH and not fitted:
        return
    old, share = _nearest(follow, state, evidence["since"])
    if old < 0 or not share <= 1.0 - recovery.worse:
        anew = recovery.init()
        anew.harm[0] = recovery.before
        decision.state = state._replace(recovery=anew)
        return
    found = {"since": evidence["since"], "segments": evidence["segments"], "left": share}
    why = (
        f"from {called(found['since'])} on it leaves {100 * (1 - share):.0f} % less deviation, "
        f"over {found['segments']} segments, though not within what is asked"
    )
    lives, since = without_newest(state.lives), agenda.since
    goes_back(decision, follow, old, why, found)
    decision.state = decision.state._replace(lives=lives)
    decision.remember(since=since)  # the machine need not have changed


@unmeasured()
def _nearest(follow: Follow, state: TwinState, since: int) -> tuple[int, float]:
    """Of the first champion and those that were live after it the one that is nearest on the rows
    from ``since`` on, and what it leaves of what the live one does; −1: there are no rows."""
    setup, versions, live = follow.setup, follow.versions, state.live.version
    windows = setup.ring.between(state.ring, since, state.row)
    if not windows:
        return -1, 1.0
    past = setup.ring.between(state.ring, 0, since)
    once = [state.first.version, *(one.number for one in former(versions, state, live))]
    off = {
        k: left(setup, versions.model(k), versions[k].p, windows, past)[setup.watched]
        for k in dict.fromkeys([live, *once])
    }
    share = shares(off, live)
    best = min(share, key=lambda k: share[k] if np.isfinite(share[k]) else np.inf)
    return (best, share[best]) if best != live else (-1, 1.0)


def shares(off: Mapping[int, PerOutput], live: int) -> dict[int, float]:
    """What each version leaves of what the live one does, over outputs; one that all of them
    predict alike tells for none.

    >>> off = {0: np.array([0.1, 1.0, 1.0, 1.0]), 1: np.array([1.0, 1.0, 1.0, 1.0])}
    >>> {k: round(share, 2) for k, share in shares(off, 1).items()}
    {0: 0.1, 1: 1.0}
    """
    ratio = {k: one / off[live] for k, one in off.items()}
    apart = np.abs(np.array(list(ratio.values())) - 1.0).max(axis=0) > ALIKE
    apart |= ~apart.any()
    return {k: float(np.sqrt(np.nanmean(np.square(one[apart])))) for k, one in ratio.items()}
