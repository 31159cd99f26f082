"""The fused loop: simulate, judge and observe, row by row, in compiled code.

An adopted measurement changes the state that the next row starts from, so these three cannot be
passes over a block. See `evertwin.sync.track`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.compiled.memory import borrowed
from evertwin.fold import Mark
from evertwin.models.kernel import RAISED
from evertwin.sync import places as at
from evertwin.sync.arbiter_loop import RESET, forget, judge
from evertwin.sync.beside_loop import CREPT, JUMPED, STARTED, begin, is_doubtful, outcome, turn_back
from evertwin.sync.free_loop import begins_free, moves_free, starts_free
from evertwin.sync.horizon_loop import NEVER, is_known, wrapped
from evertwin.sync.input_loop import (
    believe,
    count_usual,
    doubt,
    explains,
    is_any_beyond,
    is_factor_held,
    refuse_impossible,
    usual_instead,
)
from evertwin.sync.input_unit_loop import REACH, SELDOM, ask, name_units, weigh_scale, weigh_units
from evertwin.sync.options import HOT
from evertwin.sync.places import Finding
from evertwin.sync.plausible_loop import grown, has_moved, variance_of
from evertwin.sync.run_loop import goes, keep_start
from evertwin.sync.vote_loop import note

TASK, BEGUN, ASKED, FAILED, FIRST_FAILED = range(5)
ABSENT, OVERRULED, ERROR = int(Mark.ABSENT), int(Mark.OVERRULED), int(Mark.ERROR)
FIRST = 4
PAUSES, LEAST, REMEMBERS, GROWS = 5, 10**9, 512, 4
"""Without a time-out, a group is missed after so many of its longest usual pauses, and so long [ns]
at least; samples that a pause is remembered for; times it that a single longer one counts."""
FOUND_STALE = int(Finding.STALE)


@njit(**HOT)
def phase_of(u: Any, i: int, column: int, edges: Any) -> int:
    """Number of edges that the phase's input reaches."""
    phase = 0
    if column >= 0:
        for k in range(edges.shape[0]):
            phase += u[i, column] >= edges[k]
    return phase


@njit(**HOT)
def is_row_known(u: Any, i: int) -> bool:
    """True if every input of the row is finite."""
    for k in range(u.shape[1]):  # noqa: SIM110 - generators do not compile
        if not np.isfinite(u[i, k]):
            return False
    return True


@njit(**HOT)
def proceed(limits: Any, values: Any, predicted: Any, u: Any, i: int, moves: Any) -> None:
    """Adds the predicted motion of this row to path and way. At rest a force is what friction
    holds, so what is predicted of it is no motion that a frozen sensor would miss."""
    for j in range(values.shape[0]):
        moves[j] = np.nan
        moved = wrapped(predicted[j] - values[j, at.AFTER], limits[j, at.ANGLE] > 0)
        if moved == moved:
            values[j, at.PATH] += abs(moved)
            values[j, at.WAY] += moved
            by = int(limits[j, at.BESIDE])
            if by < 0 or abs(u[i, by]) > limits[j, at.ABOVE]:
                moves[j] = moved
                goes(limits, values, j, moved, 0.0)


@njit(**HOT)
def present(members: Any, g: int, measured: Any, marked: Any, room: Any) -> int:
    """Fills ``room`` with the group's samples of this row: how many, or −1 if one is broken."""
    size = 0
    for c in range(members.shape[1]):
        j = members[g, c]
        if j < 0:
            break
        if marked[j] == ERROR:
            return -1
        if np.isfinite(measured[j]) and (marked[j] == 0 or marked[j] == OVERRULED):
            room[size] = j
            size += 1
    return size


@njit(cache=True, error_model="numpy")
def refuse(members: Any, g: int, marks: Any, i: int) -> None:
    """One value of the group was refused by its source, so none of this row is believed."""
    for k in range(members.shape[1]):
        j = members[g, k]
        if j >= 0 and marks[i, j] != ABSENT:
            marks[i, j] = ERROR


@njit(**HOT)
def age(rules: Any, memory: Any, notes: Any, g: int, now: Any) -> float:
    """Seconds since the last trusted sample, NaN before the first; tells when that is too long."""
    numbers = memory[1]
    if numbers[g, at.VALID] == 0:
        return np.nan
    seconds = (now[1] - numbers[g, at.GOOD_AT]) * 1e-9
    absent, usual = now[1] - numbers[g, at.HEARD], numbers[g, at.PAUSE]
    late = seconds > rules[g, at.TIMEOUT]
    if rules[g, at.TIMEOUT] == 0.0:
        late = numbers[g, at.SAMPLES] >= at.LEARN and absent > max(PAUSES * usual, LEAST)
    if late and numbers[g, at.VALID] == 1:
        numbers[g, at.VALID] = 2
        known = absent // 1_000_000 if rules[g, at.TIMEOUT] == 0.0 else 0
        note(notes, memory, now, FOUND_STALE, g, 0, (now[0], now[0], known))
    return float(seconds)


@njit(**HOT)
def hear(numbers: Any, g: int, stamp: int) -> None:
    """A sample of the group came: how long its pauses usually are."""
    passed, usual = stamp - numbers[g, at.HEARD], numbers[g, at.PAUSE]
    if numbers[g, at.HEARD] != NEVER and passed > 0:
        # what it fails for once is no usual pause
        passed = min(passed, GROWS * usual) if usual > 0 else passed
        numbers[g, at.PAUSE] = max(usual - usual // REMEMBERS, passed)
    numbers[g, at.HEARD] = stamp


@njit(cache=True, error_model="numpy")
def run(
    step: int, observe: int, context: Any, first: int, start: int, t: Any, dt: Any, u: Any, y: Any,
    mark: Any, task: Any, gap: Any, limits: Any, rules: Any, sentinels: Any, members: Any,
    column: int, edges: Any, possible: Any, keeps: bool, x: Any, p: Any, x0: Any, values: Any,
    numbers: Any, figures: Any,
    variance: Any, counts: Any, warm: Any, ring: Any, paths: Any, times: Any, rows: Any,
    expected: Any, ranges: Any, beliefs: Any, clock: Any, beside: Any, account: Any,
    matter: Any, free: Any, out: Any, residual: Any, marks: Any,
    update: Any, sigma: Any, ages: Any, used: Any, doubts: Any, found: Any, detail: Any,
    extent: Any,
) -> int:  # fmt: skip
    """Rows from ``start`` on, until the notes are full; gives the next row."""
    # longer than the budget: one row is one thought, and cutting it costs a third of the speed
    n, nu, ny, nx, ng = u.shape[0], u.shape[1], y.shape[1], x.shape[0], rules.shape[0]
    # The row's own arrays: views into the block would cost a reference count each.
    ahead, measured, predicted, take = np.empty_like(x), np.empty(ny), np.empty(ny), np.empty(ny)
    marked, room = np.empty(ny, dtype=np.uint8), np.empty(ny, dtype=np.uint64)
    settings = borrowed(limits), borrowed(rules), borrowed(sentinels)
    memory = borrowed(values), borrowed(numbers), borrowed(figures)
    statistics = borrowed(variance), borrowed(counts), borrowed(warm)
    board = borrowed(ring), borrowed(paths), borrowed(times), borrowed(rows), borrowed(expected)
    groups, seen, next_x = borrowed(members), borrowed(marked), borrowed(ahead)
    inputs, borders, doubted = borrowed(used), borrowed(edges), borrowed(doubts)
    known, ranges_of = (borrowed(ranges), borrowed(beliefs)), borrowed(possible)
    other, beyond, expects = np.empty(nu), np.empty_like(x), np.empty(ny)
    moves, from_here = np.empty(ny), np.empty_like(x)
    tried, alike = borrowed(expects), borrowed(other)
    notes = borrowed(found), borrowed(detail), borrowed(extent)
    sample = borrowed(room), borrowed(measured), borrowed(predicted), borrowed(take)
    space = found.shape[0] - 8 * ng - 2 * nu
    other_x, told = borrowed(beside), (borrowed(account), borrowed(matter))
    own_x = borrowed(x)
    u_at, out_at, take_at = used.ctypes.data, predicted.ctypes.data, take.ctypes.data
    c, a, b, parameters = context.ctypes.data, x.ctypes.data, ahead.ctypes.data, p.ctypes.data
    for i in range(start, n):
        if extent[0] > space:
            return int(i)
        now = (first + i, t[i])
        refuse_impossible(ranges_of, known[0], known[1], notes, inputs, doubted, i, now, nx > 0)
        phase = phase_of(inputs, i, column, borders)
        anew = clock[BEGUN] == 0 or task[i] != clock[TASK] or not is_row_known(inputs, i)
        lasts = keeps and gap[i] and not anew
        anew = anew or gap[i]
        for g in range(ng if clock[BEGUN] == 0 or gap[i] or task[i] != clock[TASK] else 0):
            numbers[g, at.HEARD] = t[i]
        clock[BEGUN], clock[TASK] = 1, task[i]
        failed, raised = anew and nx > 0, False
        if not failed:
            code = call(step, c, a, u_at + 8 * i * nu, dt[i], parameters, b, out_at)
            asked = is_row_known(inputs, i)
            raised = asked and (code & RAISED) != 0
            clock[ASKED] += asked
            failed = code != 0 or not is_known(next_x) or (anew and not is_known(sample[2]))
        for j in range(ny):
            measured[j], marked[j], take[j] = y[i, j], mark[i, nu + j], np.nan
        moved = has_moved(memory[0])
        usual = count_usual(known[0], known[1], inputs, i, moved)
        follows = not anew or nx == 0
        # what no state keeps spoils its own row alone
        judged, asked_of = not anew and nx > 0, False
        machine = step, observe, c, own_x, dt[i], parameters
        row = groups, sample[1], seen, now, phase, np.int64(np.rint(1e9 * dt[i]))
        judging, spare = (settings, memory, statistics), (other, beyond, expects, from_here)
        if judged and usual and moved and now[0] % SELDOM == 0:
            weigh_scale(machine, judging, known[0], inputs, i, row, spare)
        if judged and not usual and is_any_beyond(known[0], known[1], inputs, i, 0.0):
            asked_of = ask(ranges_of, known[0], known[1], inputs, i, now[0])
            if asked_of:
                weigh_units(machine, judging, known, ranges_of, inputs, i, row, spare)
                name_units(known[0], known[1], inputs, i)
            by_factor = usual_instead(known[0], known[1], inputs, i, alike)
            code = call(
                step, c, a, other.ctypes.data, dt[i], parameters, beyond.ctypes.data,
                expects.ctypes.data,
            )  # fmt: skip
            follows = code != 0 or not is_known(beyond) or not explains(
                settings, memory, statistics, row, tried, sample[2], failed
            )  # fmt: skip
            held = is_factor_held(
                settings, memory, statistics, known, inputs, i, row, tried, sample[2], failed,
                alike,
            )  # fmt: skip
            far = by_factor or is_any_beyond(known[0], known[1], inputs, i, REACH)
            follows = follows and not held
            if held or (not follows and far):
                doubt(known[0], known[1], notes, inputs, doubted, i, now, alike)
                failed, raised, phase = False, False, phase_of(inputs, i, column, borders)
                for k in range(nx):
                    ahead[k] = beyond[k]
                for j in range(ny):
                    predicted[j] = expects[j]
        if not usual:
            believe(known[0], known[1], notes, inputs, doubted, i, now, follows, moved)
        if raised:  # no more is known of it than of a row without inputs
            clock[FIRST_FAILED] = clock[FIRST_FAILED] if clock[FAILED] > 0 else first + i
            clock[FAILED] += 1
            used[i, :] = np.nan
        for k in range(nx):
            x[k] = (x[k] if lasts else x0[k]) if failed else ahead[k]
        for j in range(ny):
            if failed:
                predicted[j] = np.nan
            out[i, j], marks[i, j], residual[i, j] = predicted[j], marked[j], np.nan
        if failed or anew:
            for g in range(ng):
                forget(settings[1], memory, board[3], notes, g, now)
            matter[at.OWNER] = 0
        proceed(settings[0], memory[0], sample[2], inputs, i, moves)
        for g in range(ng if nx > 0 else 0):
            if numbers[g, at.FREE] == 0:
                continue
            f = free.ctypes.data + 8 * g * nx
            code = call(
                step, c, f, u_at + 8 * i * nu, dt[i], parameters, beyond.ctypes.data,
                expects.ctypes.data,
            )  # fmt: skip
            if code != 0 or not is_known(beyond):
                numbers[g, at.FREE] = 0
                continue
            for k in range(nx):
                free[g, k] = beyond[k]
            moves_free(settings[0], memory[0], groups, g, tried, moves)
        if matter[at.OWNER] > 0:
            code = call(
                step, c, beside.ctypes.data, u_at + 8 * i * nu, dt[i], parameters,
                beyond.ctypes.data, expects.ctypes.data,
            )  # fmt: skip
            if code != 0 or not is_known(beyond):
                matter[at.OWNER] = 0
            for k in range(nx):
                beside[k] = beyond[k]
        for g in range(ng):
            size = present(groups, g, sample[1], seen, sample[0])
            if size == 0:
                continue
            hear(memory[1], g, now[1])
            returned, account_of = 0.0, matter[at.OWNER] == g + 1
            if account_of and size > 0:
                returned = outcome(settings, memory, told, sample, tried, g, size, now[1])
                if returned != 0.0:
                    turn_back(
                        settings, memory, statistics, told, board[3], notes, sample, tried, own_x,
                        other_x, g, size, now, returned,
                    )  # fmt: skip
            verdict, done = judge(
                settings,
                memory,
                statistics,
                board,
                notes,
                sample,
                g,
                size,
                now,
                phase,
                not asked_of,
            )
            if returned == 1.0 and verdict == 0:
                verdict, done = OVERRULED, RESET
            elif (
                nx > 0
                and returned == 0.0
                and size > 0
                and is_doubtful(settings, memory, sample, g, size, verdict, done == FIRST)
            ):
                begin(
                    settings[0], memory, told, sample, own_x, other_x, g, size, now,
                    STARTED if done == FIRST else JUMPED if verdict == OVERRULED else CREPT,
                    done > 0,
                )  # fmt: skip
            update[i, g] = done
            if size < 0:
                refuse(members, g, marks, i)
            for k in range(size):
                j = room[k]
                marks[i, j] = verdict
                if verdict == 0 and (done != FIRST or nx == 0):
                    residual[i, j] = wrapped(measured[j] - predicted[j], limits[j, at.ANGLE] > 0)
        taken = False
        for j in range(ny):
            values[j, at.AFTER] = take[j] if take[j] == take[j] else predicted[j]
            taken = taken or take[j] == take[j]
        for g in range(ng if nx > 0 else 0):
            if numbers[g, at.FREE] > 0 and taken:
                for j in range(ny):
                    expects[j] = take[j]
                for k in range(members.shape[1]):
                    if members[g, k] >= 0:
                        expects[members[g, k]] = np.nan
                call(observe, c, free.ctypes.data + 8 * g * nx, expects.ctypes.data)
        if taken and nx > 0:
            call(observe, c, a, take_at)
            if matter[at.OWNER] > 0:
                # where a base starts, which way it goes is no question of a factor
                begins = matter[at.HOW] == STARTED and matter[at.SINCE] == now[0]
                for k in range(members.shape[1]):
                    j = members[matter[at.OWNER] - 1, k]
                    if j >= 0 and not (begins and settings[0][j, at.ANGLE] > 0):
                        take[j] = np.nan
                call(observe, c, beside.ctypes.data, take_at)
        for g in range(ng if nx > 0 else 0):
            if numbers[g, at.FREE] == 0 and begins_free(settings[1], memory, groups, g):
                for k in range(nx):
                    free[g, k] = x[k]
                starts_free(memory[0], groups, g)
        for g in range(ng):
            ages[i, g] = age(settings[1], memory, notes, g, now)
            growth = (
                grown(settings[1], memory[1], memory[2], g, now[1]) if ages[i, g] >= 0 else np.inf
            )
            for k in range(members.shape[1]):
                j = members[g, k]
                if j < 0:
                    break
                keep_start(memory[0], memory[1], g, j, now[0])
                spread = variance_of(statistics[0], statistics[1], phase, j) * growth
                spread += values[j, at.OFFSET] * values[j, at.OFFSET]
                if rules[g, at.USE] == at.MIX and limits[j, at.ADOPTS] > 0:
                    spread = values[j, at.SQUARE] * growth
                if values[j, at.POWER] > 0:
                    # The model's own error goes on while nothing is measured.
                    drift = values[j, at.CROSS] / values[j, at.POWER] * values[j, at.PATH]
                    spread += drift * drift
                sigma[i, j] = np.sqrt(spread)
    # The scratch arrays are used here once more, so that they outlive their borrowed forms.
    return int(
        n
        + 0 * (room.size + measured.size + predicted.size + take.size + ahead.size + marked.size)
        + 0 * (other.size + beyond.size + expects.size)
    )
