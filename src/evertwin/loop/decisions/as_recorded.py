"""A sensor that is off by a factor of what the live version expects, and by none of what a version
expects that was live before.

A version may have been learned from a sensor in another unit, where no leap told it. Once the
sensor is right again, it is off by one over that factor for the live version, and told so. Read as
they are recorded, the same rows are within what is asked of an earlier version: that one is the
machine, and what was learned in between was the sensor.
"""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block, Mark
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.follow import Follow
from evertwin.loop.decisions.former import former
from evertwin.loop.decisions.going_live import goes_back, within
from evertwin.rows.ring import called
from evertwin.setup.evaluation import left
from evertwin.setup.twin_state import TwinState

BETTER = 0.5
"""Share of what the live version leaves of them that an earlier one leaves at most."""


def taken_as_recorded(decision: Decision, follow: Follow) -> None:
    """The earlier version goes live again; its sensors begin anew. Asked once, when a deviation
    would be judged on the rows of the fault."""
    state, setup, agenda = decision.state, follow.setup, decision.state.agenda
    found = state.live.track.off_by_factor()
    asked = found.since + setup.enough
    may = len(found.groups) and not agenda.pinned and agenda.brief < 0.0
    if not may or not asked <= state.row < asked + setup.beat.every:
        return
    old, off = _nearest(follow, state, found.since)
    if old < 0:
        return
    outputs, newest = setup.model.outputs, setup.ring.between(state.ring, found.since, state.row)
    names = [outputs.groups[g] for g in found.groups]
    why = f"{', '.join(names)} is within what is asked of version {old} as recorded"
    why = f"from {called(found.since)} on {why}: what was learned in between was the sensor"
    goes_back(decision, follow, old, why, {"since": found.since, "left": off})
    for name in names:
        told = {"onset": found.since, "end": state.row - 1, "cause": "factor"}
        decision.say("measurement_restored", name, f"not off by a factor: {why}", told)
    track = decision.state.live.track
    track.begin_anew(found.groups)
    read = np.where(np.isin(outputs.group_of, found.groups), newest[-1].y[-1], np.nan)
    track.x[:] = follow.stages(old)[0].model.observe(track.x, read)


@unmeasured()
def _nearest(follow: Follow, state: TwinState, since: int) -> tuple[int, float]:
    """The version that was live before and is within what is asked on the rows from ``since`` on,
    as they are recorded, and what it leaves of what the live one does; −1: there is none."""
    setup, versions, live = follow.setup, follow.versions, state.live.version
    windows = tuple(map(_unmarked, setup.ring.between(state.ring, since, state.row)))
    if not windows:
        return -1, 0.0
    past = setup.ring.between(state.ring, 0, since)
    numbers = dict.fromkeys([live, *(one.number for one in former(versions, state, live))])
    off = {k: left(setup, versions.model(k), versions[k].p, windows, past) for k in numbers}
    share = {k: float(np.nanmax((one / off[live])[setup.watched])) for k, one in off.items()}
    fits = [k for k in off if share[k] <= BETTER and within(setup, off[k], windows)]
    best = min(fits, key=share.__getitem__, default=-1)
    return best, share.get(best, 0.0)


def _unmarked(window: Block) -> Block:
    """The rows, with what was refused of them."""
    mark = window.mark
    return window._replace(mark=np.where(mark == int(Mark.ERROR), int(Mark.OK), mark))
