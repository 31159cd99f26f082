"""The fused loop: simulate, judge and observe, row by row, in compiled code.

An adopted measurement changes the state that the next row starts from, so these three cannot be
passes over a block. See `evertwin.sync.track.track`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import borrowed
from evertwin.sync import places as at
from evertwin.sync.arbiter.arbiter_loop import RESET, judge
from evertwin.sync.arbiter.free_loop import moves_free
from evertwin.sync.arbiter.judge_loop import (
    OVERRULED,
    adopt,
    expect,
    hear,
    keep_beside,
    mark,
    present,
    review,
)
from evertwin.sync.arbiter.run_loop import goes
from evertwin.sync.horizon.horizon_loop import is_known, wrapped
from evertwin.sync.options import HOT
from evertwin.sync.track.predict_loop import predict_row
from evertwin.sync.workspace import Workspace, advance, case_of, fill


@njit(**HOT)
def proceed(work: Workspace, i: int) -> None:
    """Adds the predicted motion of this row to path and way. At rest a force is what friction
    holds, so what is predicted of it is no motion that a frozen sensor would miss by then; it is
    gone again, or is one, at the next row of motion."""
    limits, values, predicted = work.case.settings[0], work.case.memory[0], work.case.sample[2]
    u, moves = work.out.u, work.moves
    for j in range(values.shape[0]):
        moves[j] = np.nan
        moved = wrapped(predicted[j] - values[j, at.AFTER], limits[j, at.ANGLE] > 0)
        if moved == moved:
            values[j, at.PATH] += abs(moved)
            values[j, at.WAY] += moved
            moves[j], by = moved, int(limits[j, at.BESIDE])
            values[j, at.RESTS] = by >= 0 and not abs(u[i, by]) > limits[j, at.ABOVE]
            goes(limits, values, j, moved, 0.0)


@njit(**HOT)
def run_free(work: Workspace, i: int, dt: float) -> None:
    """The states that run free of a group, and the one beside, go on by a row."""
    (_, x, y, _), inputs, numbers = work.spare, work.out.u, work.case.memory[1]
    u = inputs.ctypes.data + 8 * i * inputs.shape[1]
    for g in range(numbers.shape[0] if x.shape[0] > 0 else 0):
        if numbers[g, at.FREE] == 0:
            continue
        if advance(work, work.free[g], u, dt, x, y) != 0 or not is_known(x):
            numbers[g, at.FREE] = 0
            continue
        fill(work.free[g], x)
        moves_free(work.case.settings[0], work.case.memory[0], work.members, g, y, work.moves)
    matter = work.case.told[1]
    if matter[at.OWNER] > 0:
        if advance(work, work.case.beside, u, dt, x, y) != 0 or not is_known(x):
            matter[at.OWNER] = 0
        fill(work.case.beside, x)


@njit(cache=True, error_model="numpy")
def run(
    step: int, observe: int, context: Any, start: int, lent: Any, given: Any, kept: Any, told: Any,
    said: Any,
) -> int:  # fmt: skip
    """Rows from ``start`` on, until the notes are full; gives the next row.

    Args:
        lent, given, kept, told, said: `Block` with arrays in C order, `TrackSettings`,
            `TrackState`, `TrackRows` and `Notes`.
    """
    block, settings, state = borrowed(lent), borrowed(given), borrowed(kept)
    out, notes = borrowed(told), borrowed(said)
    (n, ny), nu, nx, ng = block.y.shape, block.u.shape[1], len(state.x), len(settings.rules)
    # The row's own arrays: views into the block would cost a reference count each.
    room, marked = np.empty(ny, dtype=np.uint64), np.empty(ny, dtype=np.uint8)
    outputs, inputs, states = np.empty((5, ny)), np.empty(nu), np.empty((3, nx))
    measured, predicted, take, expects, moves = (
        borrowed(outputs[0]), borrowed(outputs[1]), borrowed(outputs[2]), borrowed(outputs[3]),
        borrowed(outputs[4]),
    )  # fmt: skip
    ahead, beyond, from_here = borrowed(states[0]), borrowed(states[1]), borrowed(states[2])
    case = case_of(settings, state, notes, (borrowed(room), measured, predicted, take), expects)
    work = Workspace(
        case, block, out, step, observe, context.ctypes.data, state.p.ctypes.data,
        settings.members, settings.column, settings.edges, settings.possible, settings.keeps,
        state.x0, state.free, state.clock, (state.ranges, state.beliefs), borrowed(marked), ahead,
        (borrowed(inputs), beyond, expects, from_here), moves,
    )  # fmt: skip
    space = len(notes.found) - 8 * ng - 2 * nu
    for i in range(start, n):
        if notes.extent[0] > space:
            return int(i)
        now = (block.row + i, work.block.t[i])
        teaches, phase = predict_row(work, i, now)
        proceed(work, i)
        run_free(work, i, work.block.dt[i])
        for g in range(ng):
            size = present(work.members, g, case.sample[1], work.marked, case.sample[0])
            if size == 0:
                continue
            hear(case.memory[1], g, now[1])
            believed = size > 0 and case.told[1][at.OWNER] == g + 1
            returned = review(case, g, size, now) if believed else 0.0
            verdict, done = judge(case, g, size, now, phase, teaches)
            if returned == 1.0 and verdict == 0:
                verdict, done = OVERRULED, RESET
            elif nx > 0 and returned == 0.0 and size > 0:
                keep_beside(case, g, size, now, verdict, done)
            mark(work, i, g, size, verdict, done)
        adopt(work, now[0])
        expect(work, i, now, phase)
    # The scratch arrays are used here once more, so that they outlive their borrowed forms.
    return int(n + 0 * (room.size + marked.size + outputs.size + inputs.size + states.size))
