"""Compiled: the prediction of a row, from the inputs that are believed."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.models.kernels.kernel import RAISED
from evertwin.sync import places as at
from evertwin.sync.arbiter.arbiter_loop import forget
from evertwin.sync.arbiter.input_loop import (
    believe,
    count_usual,
    doubt,
    explains,
    is_any_beyond,
    is_factor_held,
    refuse_impossible,
    usual_instead,
)
from evertwin.sync.arbiter.input_unit_loop import (
    REACH,
    ask,
    name_units,
    weigh_scale,
    weigh_units,
    weighed,
)
from evertwin.sync.arbiter.plausible_loop import has_moved
from evertwin.sync.horizon.horizon_loop import is_known, is_row_known
from evertwin.sync.options import COLD, HOT
from evertwin.sync.track_state import ASKED, BEGUN, FAILED, FIRST_FAILED, TASK
from evertwin.sync.workspace import Workspace, advance, fill


@njit(**HOT)
def phase_of(u: Any, i: int, column: int, edges: Any) -> int:
    """Number of edges that the phase's input reaches."""
    phase = 0
    if column >= 0:
        for k in range(edges.shape[0]):
            phase += u[i, column] >= edges[k]
    return phase


@njit(**HOT)
def opens(work: Workspace, i: int) -> tuple[bool, bool]:
    """Does the state start anew at this row? And if at a gap, does it last?"""
    clock, heard, block = work.clock, work.case.memory[1], work.block
    other = clock[BEGUN] == 0 or block.task[i] != clock[TASK]
    anew = other or not is_row_known(work.out.u, i)
    for g in range(heard.shape[0] if other or block.gap[i] else 0):
        heard[g, at.HEARD] = block.t[i]
    clock[BEGUN], clock[TASK] = 1, block.task[i]
    return bool(anew or block.gap[i]), bool(work.keeps and block.gap[i] and not anew)


@njit(**HOT)
def simulate(work: Workspace, i: int, dt: float, anew: bool) -> tuple[bool, bool]:
    """The row's prediction: is there none, and did what a user wrote raise something?"""
    if anew and work.case.x.shape[0] > 0:
        return True, False
    y, u = work.case.sample[2], work.out.u.ctypes.data + 8 * i * work.out.u.shape[1]
    code = advance(work, work.case.x, u, dt, work.ahead, y)
    asked = is_row_known(work.out.u, i)
    work.clock[ASKED] += asked
    failed = code != 0 or not is_known(work.ahead) or (anew and not is_known(y))
    return bool(failed), bool(asked and (code & RAISED) != 0)


@njit(**COLD)
def question(work: Workspace, dt: float, i: int, row: Any, failed: bool) -> tuple[bool, bool, bool]:
    """Inputs outside their range, of a row that is predicted: do the outputs follow them, are they
    doubted, and is a unit in question? A doubted row is predicted with what stands in place."""
    now, (ranges, beliefs), (other, x, y, _) = row[3], work.known, work.spare
    asked = ask(work.possible, ranges, beliefs, work.out.u, i, now[0])
    if asked:
        weigh_units(work, dt, i, row)
        name_units(ranges, beliefs, work.out.u, i)
    by_factor = usual_instead(ranges, beliefs, work.out.u, i, other)
    code, predicted = advance(work, work.case.x, other.ctypes.data, dt, x, y), work.case.sample[2]
    follows = code != 0 or not is_known(x) or not explains(work, row, failed)
    held = is_factor_held(work, i, row, failed)
    far = by_factor or is_any_beyond(ranges, beliefs, work.out.u, i, REACH)
    follows = follows and not held
    if not (held or (not follows and far)):
        return bool(follows), False, bool(asked)
    doubt(work, i, now)
    fill(work.ahead, x)
    fill(predicted, y)
    return bool(follows), True, bool(asked)


@njit(**HOT)
def predict_row(work: Workspace, i: int, now: Any) -> tuple[bool, int]:
    """Predicts the row and moves the state there: may its samples teach, and the phase."""
    (ranges, beliefs), block = work.known, work.block
    stateful, predicted, nu = work.case.x.shape[0] > 0, work.case.sample[2], work.out.u.shape[1]
    refuse_impossible(work, i, now)
    phase = phase_of(work.out.u, i, work.column, work.edges)
    anew, lasts = opens(work, i)
    failed, raised = simulate(work, i, block.dt[i], anew)
    for j in range(predicted.shape[0]):
        work.case.sample[1][j], work.case.sample[3][j] = block.y[i, j], np.nan
        work.marked[j] = block.mark[i, nu + j]
    moved = has_moved(work.case.memory[0])
    usual, follows, asked = count_usual(ranges, beliefs, work.out.u, i, moved), not anew, False
    # what no state keeps spoils its own row alone
    judged, follows = not anew and stateful, follows or not stateful
    nanoseconds = np.int64(np.rint(1e9 * block.dt[i]))
    row = work.members, work.case.sample[1], work.marked, now, phase, nanoseconds
    k = weighed(ranges, now[0]) if judged and usual and moved else -1
    if k >= 0:
        weigh_scale(work, block.dt[i], i, row, k)
    if judged and not usual and is_any_beyond(ranges, beliefs, work.out.u, i, 0.0):
        follows, doubted, asked = question(work, block.dt[i], i, row, failed)
        if doubted:
            failed, raised, phase = False, False, phase_of(work.out.u, i, work.column, work.edges)
    if not usual:
        believe(work, i, now, follows, moved)
    if raised:  # no more is known of it than of a row without inputs
        work.clock[FIRST_FAILED] = work.clock[FIRST_FAILED] if work.clock[FAILED] > 0 else now[0]
        work.clock[FAILED] += 1
        work.out.u[i, :] = np.nan
    if not failed:
        fill(work.case.x, work.ahead)
    elif not lasts:
        fill(work.case.x, work.x0)
    for j in range(predicted.shape[0]):
        predicted[j] = np.nan if failed else predicted[j]
        work.out.y[i, j], work.out.mark[i, j] = predicted[j], work.marked[j]
        work.out.residual[i, j] = np.nan
    if failed or anew:
        for g in range(work.members.shape[0]):
            forget(work.case, g, now)
        work.case.told[1][at.OWNER] = 0
    return not asked, int(phase)
