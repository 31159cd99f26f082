"""Compiled: channels computed from others, row by row; see `evertwin.sync.alignment.derive`.

A stretch is what lies between two gaps. Row j of a channel is computed as soon as the rows that it
is computed from are there, in the order of the rows, so that it cannot matter how they were cut.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.sync.alignment.running_loop import lagging, unwrapped
from evertwin.sync.alignment.smooth_loop import filtered, slope
from evertwin.sync.alignment.steady_loop import (
    BACK,
    LEAPT,
    NUMBER,
    OTHER,
    RESCALED,
    WRONG,
    steadily,
)
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.types import (
    Bools,
    Float64,
    Inputs,
    Int64,
    Intervals,
    Marks,
    Outputs,
    Stamps,
    Tasks,
    UInt8,
    Vector,
)

FILTER, DERIVATIVE, SLOPE, MIDDLE, ALONG, WAY, SUM, MEAN, DIFFERENCE = range(9)
PRODUCT, SCALE, NORM, MAX, PATH, UNWRAP, STEADY, LAG = range(9, 17)
ROW, TASK, ORIGIN, COUNT, LEFT, BASE, LAST, BEGUN = range(8)
"""Counters: next row's number, task, stamp of its first row, rows of the stretch, rows of it that
have left, rows before it, stamp of the last row that left, has one of this task left?"""
HELD_INPUT, LINE_INPUT, STEP_INPUT, OUTPUT = range(4)
"""How a column becomes a channel of the model: as it is and held already, measured at the row, the
newest before the interval, an output."""
OK, ABSENT, HELD, UNSEEN, ERROR = 0, 1, 2, 3, 6
BEGINS, ENDS, LEAPS, THAWS, SCALED = 1, 2, 3, 4, 5
"""The first row that was wrong; that is right again; up to which it leapt; behind frozen ones; in
another unit."""

Counters = Int64[np.ndarray, " counters"]


class Program(NamedTuple):
    """What is computed, and what leaves.

    >>> Program._fields[0]
    'code'
    """

    code: Int64[np.ndarray, " ops"]
    """Operation of each computed column."""
    sources: Int64[np.ndarray, "ops most"]
    """Columns that it is computed from, then −1."""
    value: Vector
    """Factor of ``scale``, seconds of ``lag``."""
    ahead: Int64[np.ndarray, " ops"]
    """Rows behind its own that it looks at."""
    start: Int64[np.ndarray, " ops"]
    """Where its weights begin."""
    weights: Vector
    table: Int64[np.ndarray, "channels two"]
    """Column of each input, then each output (−1: nothing measures it), and how it comes there."""
    limits: Int64[np.ndarray, " four"]
    """First and last stamp from a task's start [ns]; rows at an end of a stretch that no output may
    be compared at; 1: an input in another unit is not known, else it is taken as what it may be."""


class Lines(NamedTuple):
    """Rows of all columns: those that wait, in a ring, or those that come.

    >>> Lines._fields[:2]
    ('t', 'dt')
    """

    t: Stamps
    dt: Intervals
    v: Float64[np.ndarray, "n columns"]
    mark: UInt8[np.ndarray, "n columns"]


class Memory(NamedTuple):
    """What is carried on.

    >>> Memory._fields
    ('done', 'sums', 'newest')
    """

    done: Int64[np.ndarray, " columns"]
    """Rows of the stretch that each column is known at."""
    sums: Float64[np.ndarray, "ops six"]
    """Of a way: is a pose known?, x, y, heading, way so far, way along the heading. Of an angle
    without wraps: is it known?, the newest. Of what goes steadily: rows at which it moved, its
    highest speed, rows that are wrong still, what it has leapt by, how long it stood [s],
    how many times it is what it was (0: once)."""
    newest: Float64[np.ndarray, " channels"]
    """Newest known value of each channel."""


class Room(NamedTuple):
    """Rows that leave.

    >>> Room._fields[0]
    'number'
    """

    number: Int64[np.ndarray, " n"]
    t: Stamps
    dt: Intervals
    u: Inputs
    y: Outputs
    mark: Marks
    task: Tasks
    gap: Bools
    wrong: UInt8[np.ndarray, "n ops"]
    """Of what goes steadily: `BEGINS`, or one of its likes."""
    times: Float64[np.ndarray, "n ops"]  # it is what it was, where that begins


@njit(cache=True, error_model="numpy")
def difference(ring: Lines, base: int, c: int, j: int, n: int) -> float:
    """Central difference at row j, one-sided at the ends, and where it was frozen before."""
    depth = ring.t.shape[0]
    if n < 2:
        return np.nan
    at = (base + j) % depth
    before, after = (base + max(j - 1, 0)) % depth, (base + min(j + 1, n - 1)) % depth
    before = at if BACK <= ring.mark[at, c] <= RESCALED else before
    after = at if BACK <= ring.mark[after, c] <= RESCALED else after
    left, right = (ring.t[at] - ring.t[before]) * 1e-9, (ring.t[after] - ring.t[at]) * 1e-9
    low, here, high = ring.v[before, c], ring.v[at, c], ring.v[after, c]
    if left == 0.0:
        return float((high - here) / right)
    if right == 0.0:
        return float((here - low) / left)
    rise, fall = left * left * high, right * right * low
    middle = (right * right - left * left) * here
    return float((rise - fall + middle) / (left * right * (left + right)))


@njit(cache=True, error_model="numpy")
def travelled(ring: Lines, at: int, sources: Int64[np.ndarray, " most"], sums: Vector,
              code: int) -> float:  # fmt: skip
    """Way so far from x, y and heading, by `ALONG`, `WAY` or `PATH`; NaN where the pose is not
    known."""
    x, y, heading = ring.v[at, sources[0]], ring.v[at, sources[1]], ring.v[at, sources[2]]
    if not (x == x and y == y and heading == heading):
        return np.nan
    if sums[0] == 0.0:
        sums[0], sums[1], sums[2], sums[3] = 1.0, x, y, heading
        return 0.0
    turn = wrapped(heading - sums[3], True)
    middle = sums[3] + 0.5 * turn
    dx, dy = x - sums[1], y - sums[2]
    along = dx * math.cos(middle) + dy * math.sin(middle)
    step = along
    if code != ALONG:
        length = np.sqrt(dx * dx + dy * dy)
        step = length if code == PATH or along >= 0.0 else -length
    sums[1], sums[2], sums[3] = x, y, sums[3] + turn
    sums[4] += step
    sums[5] += along
    return float(-sums[4] if code == PATH and sums[5] < 0.0 else sums[4])


@njit(cache=True, error_model="numpy")
def pointwise(ring: Lines, at: int, code: int, sources: Int64[np.ndarray, " most"],
              value: float) -> float:  # fmt: skip
    """What takes the row alone."""
    first = ring.v[at, sources[0]]
    if code == SCALE:
        return float(first * value)
    if code == DIFFERENCE:
        return float(first - ring.v[at, sources[1]])
    total = 1.0 if code == PRODUCT else 0.0
    count = 0
    for c in sources:
        if c < 0:
            break
        x = ring.v[at, c]
        count += 1
        if code == PRODUCT:
            total *= x
        elif code == NORM:
            total += x * x
        elif code == MAX:
            total = x if x != x else max(total, abs(x))
        else:
            total += x
    if code == MEAN:
        return total / count
    return np.sqrt(total) if code == NORM else total


@njit(cache=True, error_model="numpy")
def compute(program: Program, ring: Lines, memory: Memory, base: int, n: int, closed: bool) -> int:
    """Every column as far as it can be; gives the rows at which all are known."""
    depth, raw = ring.t.shape[0], ring.v.shape[1] - program.code.shape[0]
    least = n
    for c in range(raw):
        memory.done[c] = n
    for k in range(program.code.shape[0]):
        code, sources, h = program.code[k], program.sources[k], program.ahead[k]
        weights = program.weights[program.start[k] :]
        there = n
        for c in sources:
            if c >= 0:
                there = min(there, memory.done[c])
        j = memory.done[raw + k]
        while j < there:
            need = max(j + h, 2 * h) if code == SLOPE else j + h
            if need >= there and not closed:
                break
            at, level = (base + j) % depth, OK
            count = n if closed else there
            if code == STEADY:
                only, sums = program.value[k] == 0.0, memory.sums[k]
                value, level = steadily(ring, base, sources[0], raw + k, j, count, sums, only)
            elif code == DERIVATIVE:
                value = difference(ring, base, sources[0], j, count)
            elif code == SLOPE:
                value = slope(ring, base, sources[0], j, count, weights, h)
            elif code == FILTER:
                value = filtered(ring, base, sources[0], j, count, weights, h)
            elif code == MIDDLE:
                before = ring.v[(base + max(j - 1, 0)) % depth, sources[0]]
                value = 0.5 * (before + ring.v[at, sources[0]])
            elif code in (ALONG, WAY, PATH):
                value = travelled(ring, at, sources, memory.sums[k], code)
            elif code == UNWRAP:
                value = unwrapped(ring.v[at, sources[0]], memory.sums[k])
            elif code == LAG:
                passed = ring.dt[at] / program.value[k] if j > 0 else np.inf
                value = lagging(ring.v[at, sources[0]], passed, memory.sums[k])
            else:
                value = pointwise(ring, at, code, sources, program.value[k])
            for c in sources:
                if c >= 0:
                    mark = ring.mark[at, c]
                    level = max(level, OTHER if mark >= RESCALED else min(mark, ERROR))
            if code == FILTER and level == UNSEEN:
                level = HELD  # it was measured around the hole
            elif code in (DERIVATIVE, SLOPE):
                first = max(j - h, 0) if code == DERIVATIVE else min(max(j - h, 0), n - 2 * h - 1)
                last = min(j + h, n - 1) if code == DERIVATIVE else first + 2 * h
                for i in range(max(first, 0), last + 1):
                    if ring.mark[(base + i) % depth, sources[0]] >= UNSEEN:
                        level = max(level, UNSEEN)
            ring.v[at, raw + k] = value
            if value == value:
                ring.mark[at, raw + k] = OK if level == ABSENT else level
            else:
                ring.mark[at, raw + k] = max(level, ABSENT)
            j += 1
        memory.done[raw + k] = j
        least = min(least, j)
    return least


@njit(cache=True, error_model="numpy")
def emit(program: Program, ring: Lines, memory: Memory, counters: Counters, room: Room, at: int,
         place: int, before: int, compared: bool) -> None:  # fmt: skip
    """One row as the model takes it. ``before``: place of the row before, −1 without one."""
    nu, raw = room.u.shape[1], ring.v.shape[1] - program.code.shape[0]
    for k in range(program.table.shape[0]):
        c, how = program.table[k, 0], program.table[k, 1]
        source = before if how == STEP_INPUT and before >= 0 else place
        value, level = np.nan, ABSENT
        if c >= 0:
            value, level = ring.v[source, c], ring.mark[source, c]
        if k >= nu:
            if level != ERROR and not np.isfinite(value):
                level = ERROR if np.isinf(value) else ABSENT
            if level == ERROR or not compared:
                value, level = np.nan, max(level, ABSENT)
            room.y[at, k - nu], room.mark[at, k] = value, level
            continue
        if level >= RESCALED and program.limits[3] != 0:
            room.u[at, k], room.mark[at, k] = np.nan, ERROR
            continue
        if level == UNSEEN and c < raw:
            level = HELD  # a value on a line will do, a slope of it will not
        if value != value and memory.newest[k] == memory.newest[k]:
            value, level = memory.newest[k], max(level, HELD)
        memory.newest[k] = value
        room.u[at, k], room.mark[at, k] = value, min(level, ERROR)
    for k in range(program.code.shape[0]):
        room.wrong[at, k] = 0
        if program.code[k] == STEADY:
            now = ring.mark[place, raw + k]
            was = before >= 0 and ring.mark[before, raw + k] == ERROR
            if LEAPT <= now <= RESCALED:
                room.wrong[at, k] = LEAPS + now - LEAPT
                own, source = ring.v[place, raw + k], ring.v[place, program.sources[k, 0]]
                undone = source / own if now == RESCALED else 1.0
                room.times[at, k] = undone if undone != 1.0 else own / ring.v[before, raw + k]
            elif was != (now == ERROR):
                room.wrong[at, k] = ENDS if was else BEGINS
    stamp = ring.t[place]
    room.number[at], room.t[at], room.task[at] = counters[ROW], stamp, counters[TASK]
    if counters[BEGUN] == 0:
        room.dt[at], room.gap[at] = 0.0, True
    else:
        room.dt[at] = (stamp - counters[LAST]) * 1e-9
        room.gap[at] = before < 0
    counters[ROW] += 1
    counters[LAST], counters[BEGUN] = stamp, 1


@njit(cache=True, error_model="numpy")
def leave(program: Program, ring: Lines, memory: Memory, counters: Counters, room: Room,
          at: int, closed: bool) -> int:  # fmt: skip
    """Rows of the stretch that are ready leave; gives the next place in the room."""
    n, base, edge = counters[COUNT], counters[BASE], program.limits[2]
    depth = ring.t.shape[0]
    ready = compute(program, ring, memory, base, n, closed)
    while counters[LEFT] < ready and (closed or n - 1 - counters[LEFT] >= edge):
        j = counters[LEFT]
        place = (base + j) % depth
        since = ring.t[place] - counters[ORIGIN]
        if since >= program.limits[0] and since <= program.limits[1]:
            compared = j >= edge and n - 1 - j >= edge
            before = (base + j - 1) % depth if j > 0 else -1
            emit(program, ring, memory, counters, room, at, place, before, compared)
            at += 1
        counters[LEFT] += 1
    return at


@njit(cache=True, error_model="numpy")
def close(program: Program, ring: Lines, memory: Memory, counters: Counters, room: Room,
          at: int) -> int:  # fmt: skip
    """The stretch has ended: all of it leaves."""
    at = leave(program, ring, memory, counters, room, at, True)
    counters[BASE] += counters[COUNT]
    counters[COUNT], counters[LEFT] = 0, 0
    memory.done[:] = 0
    return at


@njit("lines", cache=True, error_model="numpy")
def advance(
    program: Program, ring: Lines, memory: Memory, counters: Counters, lines: Lines, task: Tasks,
    gap: Bools, room: Room, ends: bool,
) -> int:  # fmt: skip
    """More rows, or the end of them; gives the rows that left."""
    at, depth, raw = 0, ring.t.shape[0], lines.v.shape[1]
    for i in range(lines.t.shape[0]):
        if gap[i]:
            at = close(program, ring, memory, counters, room, at)
        if task[i] != counters[TASK]:
            counters[TASK], counters[ORIGIN], counters[BEGUN] = task[i], lines.t[i], 0
            memory.newest[:] = np.nan
            for k in range(program.code.shape[0]):
                if program.code[k] == STEADY:  # how fast it goes, it does in any task
                    memory.sums[k, WRONG : NUMBER + 1] = 0.0
                else:
                    memory.sums[k] = 0.0
        place = (counters[BASE] + counters[COUNT]) % depth
        ring.t[place], ring.dt[place] = lines.t[i], lines.dt[i]
        for c in range(raw):
            ring.v[place, c], ring.mark[place, c] = lines.v[i, c], lines.mark[i, c]
        counters[COUNT] += 1
        at = leave(program, ring, memory, counters, room, at, False)
    if ends:
        at = close(program, ring, memory, counters, room, at)
    return at
