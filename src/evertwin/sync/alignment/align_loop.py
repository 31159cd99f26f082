"""Compiled: samples of several sources into rows on one clock, see `evertwin.sync.alignment`.

Each source has a sorted ring of the samples that wait. Everything is decided sample by sample, so
that it cannot matter how the samples were cut into chunks.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import borrowed
from evertwin.fold.block import LARGEST
from evertwin.sync.alignment.lost_loop import TIMES, given, missing
from evertwin.sync.alignment.lost_loop import is_told as is_loss_told
from evertwin.sync.alignment.on_row_loop import (
    ABSENT,
    COLUMN,
    COUNT,
    ERROR,
    HEAD,
    HELD,
    HOW,
    LATE,
    LOSES,
    NEWEST,
    OFFSET,
    OK,
    PACE,
    QUIET,
    REPEATED,
    RUN,
    RUN_COUNT,
    RUN_FIRST,
    RUN_LAST,
    RUN_OTHERS,
    SOURCE,
    TIMELY,
    acted,
    between,
    borders,
    take_frame,
)  # fmt: skip
from evertwin.sync.alignment.pace_loop import TAKEN, is_over, is_told, is_unusual, learn, paced
from evertwin.sync.horizon.horizon_loop import NEVER
from evertwin.sync.options import HOT

SLACK, TIMEOUT = 0, 1
"""Settings per source [ns]."""
HOLD, LINE, MEASURED = range(3)
ROW, LAST, TASK, BEGUN, ANEW, SHIFT, NOW, GRID, STEP, PENDING, FORCED = range(11)
"""Memory of the clock: next row's number, last row's stamp, task, has a row left?, does the next
one start anew?, shift of this task, newest tick, first stamp and number of the grid's next row, is
a sample accepted but its rows not yet released?, was the last row forced out?"""
(
    FINE, IS_LATE, IS_REPEATED, IS_FUTURE, JUMPED, IS_QUIET, BACK, OVERFLOW, SHIFTED, HOLE, LOST,
) = range(11)  # fmt: skip
"""What is noted about a source; the last about a channel."""
MOVE = 10 * 10**9
"""Distance that a task keeps whose stamps had to be shifted [ns]."""
RESYNC = 8
"""Samples in a row off by more than the longest jump, after which a clock is set anew."""
TICK, FINISH = -1, -2


@njit(cache=True, error_model="numpy")
def tell(notes: Any, clock: Any, s: int, kind: int, span: Any) -> None:
    """Notes ``kind`` about source ``s``: first and last stamp, samples."""
    found, extent = notes
    k = extent[1]
    found[k, 0], found[k, 1], found[k, 2] = clock[ROW], s, kind
    found[k, 3], found[k, 4], found[k, 5] = span
    extent[1] = k + 1


@njit(cache=True, error_model="numpy")
def end_run(notes: Any, clock: Any, sources: Any, s: int) -> None:
    """The run of samples that were not folded is over: one record for all of them."""
    if sources[s, RUN] != FINE:
        span = (sources[s, RUN_FIRST], sources[s, RUN_LAST], sources[s, RUN_COUNT])
        tell(notes, clock, s, sources[s, RUN], span)
    sources[s, RUN], sources[s, RUN_COUNT] = FINE, 0


@njit(cache=True, error_model="numpy")
def refuse(notes: Any, clock: Any, sources: Any, s: int, kind: int, stamp: int) -> None:
    """A sample that is not folded."""
    if sources[s, RUN] != kind:
        end_run(notes, clock, sources, s)
        sources[s, RUN], sources[s, RUN_FIRST] = kind, stamp
        sources[s, RUN_OTHERS] = sources[:, TIMELY].sum() - sources[s, TIMELY]
    sources[s, RUN_LAST] = stamp
    sources[s, RUN_COUNT] += 1
    sources[s, REPEATED if kind == IS_REPEATED else LATE] += 1


@njit(**HOT)
def insert(state: Any, s: int, stamp: int, sample: Any) -> bool:
    """Puts a sample into the sorted ring; False if its stamp is there already."""
    sources, times, values = state.sources, state.times, state.values
    depth, k = times.shape[1], sources[s, COUNT]
    head = sources[s, HEAD]
    while k > 0 and times[s, (head + k - 1) % depth] > stamp:
        k -= 1
    if k > 0 and times[s, (head + k - 1) % depth] == stamp:
        return False
    for m in range(sources[s, COUNT], k, -1):
        times[s, (head + m) % depth] = times[s, (head + m - 1) % depth]
        values[s, (head + m) % depth] = values[s, (head + m - 1) % depth]
    times[s, (head + k) % depth] = stamp
    for c in range(sample.shape[0]):
        absurd = abs(sample[c]) > LARGEST
        values[s, (head + k) % depth, c] = np.inf if absurd else sample[c]
    sources[s, COUNT] += 1
    return True


@njit(cache=True, error_model="numpy")
def newest(sources: Any) -> int:
    """Newest stamp of all sources."""
    return int(sources[:, NEWEST].max())


@njit(cache=True, error_model="numpy")
def jumped(notes: Any, clock: Any, sources: Any, s: int, kind: int, stamp: int) -> int:
    """The corrected stamp if a run of samples far off shows that the source's clock was set anew.

    Set back: it goes on from the newest stamp of all. Set forward: the same where other sources
    kept their time meanwhile, else everything paused and the new stamp holds.
    """
    if sources[s, RUN] != kind or sources[s, RUN_COUNT] < RESYNC or stamp <= sources[s, RUN_LAST]:
        return NEVER
    others = sources[:, TIMELY].sum() - sources[s, TIMELY]
    right = stamp
    if kind == IS_LATE or others > sources[s, RUN_OTHERS]:
        right = max(newest(sources), clock[LAST]) + 1
    sources[s, OFFSET] += right - stamp
    end_run(notes, clock, sources, s)
    tell(notes, clock, s, JUMPED, (stamp, right, right - stamp))
    clock[ANEW] = 1
    return int(right)


@njit(**HOT)
def accept(state: Any, notes: Any, s: int, stamp: int, sample: Any, jump: int) -> None:
    """One sample: waiting, late, repeated, or from a clock that was set anew."""
    clock, sources = state.clock, state.sources
    late = clock[ROW] > 0 and stamp <= clock[LAST]
    ahead = newest(sources)
    far = (late and clock[LAST] - stamp > jump) or (ahead != NEVER and stamp - ahead > jump)
    kind = IS_LATE if late else IS_FUTURE
    if far:
        right = jumped(notes, clock, sources, s, kind, stamp)
        if right != NEVER:
            stamp, late, far = right, False, False
    if far or late:
        same = late and not far and stamp == sources[s, NEWEST]
        refuse(notes, clock, sources, s, IS_REPEATED if same else kind, stamp)
        return
    if not insert(state, s, stamp, sample):
        refuse(notes, clock, sources, s, IS_REPEATED, stamp)
        return
    end_run(notes, clock, sources, s)
    if sources[s, QUIET]:
        sources[s, QUIET] = 0
        tell(notes, clock, s, BACK, (stamp, stamp, 1))
    sources[s, NEWEST] = max(sources[s, NEWEST], stamp)
    sources[s, TIMELY] += 1


@njit(cache=True, error_model="numpy")
def edge(plan: Any, clock: Any, sources: Any) -> int:
    """Stamp that every source has passed."""
    lowest = np.iinfo(np.int64).max
    for s in range(sources.shape[0]):
        mine = sources[s, NEWEST] - plan[s, SLACK] if sources[s, NEWEST] != NEVER else NEVER
        if clock[NOW] != NEVER and plan[s, TIMEOUT] < np.iinfo(np.int64).max:
            mine = max(mine, clock[NOW] - plan[s, TIMEOUT])
        lowest = min(lowest, mine)
    return int(lowest)


@njit(cache=True, error_model="numpy")
def oldest(sources: Any, times: Any) -> int:
    """Stamp of the oldest sample that waits; the largest number if none does."""
    first = np.iinfo(np.int64).max
    for s in range(sources.shape[0]):
        if sources[s, COUNT] > 0:
            first = min(first, times[s, sources[s, HEAD]])
    return int(first)


@njit(cache=True, error_model="numpy")
def consume(channels: Any, state: Any, notes: Any, until: int) -> None:
    """Takes the samples up to ``until`` out of the rings and remembers them per channel."""
    clock, sources, times, values = state.clock, state.sources, state.times, state.values
    known_t, known_v, habit, depth = state.known_t, state.known_v, state.habits, times.shape[1]
    pace = state.pace
    for s in range(sources.shape[0]):
        while sources[s, COUNT] > 0 and times[s, sources[s, HEAD]] <= until:
            head = sources[s, HEAD]
            take_frame(sources, values, s, head)
            pace[TAKEN] = max(pace[TAKEN], times[s, head])
            for k in range(channels.shape[0]):
                if channels[k, SOURCE] == s:
                    value, loses = values[s, head, channels[k, COLUMN]], channels[k, LOSES]
                    if np.isfinite(value):
                        known_t[k], known_v[k] = times[s, head], value
                        if loses:
                            given(habit, values[s, head], k, channels[k, COLUMN])
                        continue
                    if np.isinf(value):
                        state.broken_t[k] = times[s, head]
                    lost = missing(habit, values[s, head], k) if loses else 0
                    if lost:
                        known_v[k] = np.nan
                        if is_loss_told(lost):
                            tell(notes, clock, k, LOST, (times[s, head], times[s, head], lost))
            sources[s, HEAD] = (head + 1) % depth
            sources[s, COUNT] -= 1


@njit(**HOT)
def emit(fixed: Any, state: Any, rows: Any, notes: Any, stamp: int) -> None:
    """The next row, with stamp ``stamp``."""
    channels, gap, usual, grid = fixed.channels, fixed.gap, fixed.usual, fixed.period > 0
    clock, known_t, known_v, pace = state.clock, state.known_t, state.known_v, state.pace
    u, y, mark, new, at = rows.u, rows.y, rows.mark, rows.gap, notes.extent[0]
    nu, came = u.shape[1], oldest(state.sources, state.times)
    first = clock[BEGUN] == 0 or clock[ANEW] == 1
    rows.number[at], rows.t[at], rows.task[at] = clock[ROW], stamp, clock[TASK]
    rows.dt[at] = 0.0 if clock[BEGUN] == 0 else (stamp - clock[LAST]) * 1e-9
    new[at] = first or stamp - clock[LAST] > gap
    if (usual or gap < np.iinfo(np.int64).max) and clock[BEGUN] == 1 and came <= stamp:
        passed = came - pace[TAKEN]
        if is_unusual(pace, passed):
            new[at] |= usual
            if new[at] and is_told(pace, passed, came):
                tell(notes, clock, 0, HOLE, (came - passed, came, 0))
        learn(pace, passed)
    for k in range(nu):
        u[at, k] = acted(channels, state, k, (clock[LAST], stamp))
        mark[at, k] = OK if known_t[k] == clock[LAST] else HELD
    consume(channels, state, notes, stamp)
    for k in range(channels.shape[0]):
        how = channels[k, HOW]
        if how == HOLD and clock[BEGUN] == 1:
            if u[at, k] != u[at, k]:
                mark[at, k] = ABSENT
            continue
        value, level = np.nan, ABSENT
        if known_t[k] == stamp:
            value, level = known_v[k], OK
        elif state.broken_t[k] == stamp:
            level = ERROR
        elif known_t[k] != NEVER and (how == LINE or (how == MEASURED and grid)):
            value, level = between(channels, state, k, stamp, gap)
            level = level if how == LINE else OK
        if how != MEASURED and value != value and known_t[k] != NEVER:
            value, level = known_v[k], max(HELD, level if level == ERROR else HELD)
        if value != value and level != ERROR:
            level = ABSENT
        mark[at, k] = level
        if how == MEASURED:
            y[at, k - nu] = value
        else:
            u[at, k] = value
    clock[ROW] += 1
    clock[LAST], clock[BEGUN], clock[ANEW] = stamp, 1, 0


@njit(cache=True, error_model="numpy")
def quiet(plan: Any, clock: Any, sources: Any, notes: Any) -> None:
    """Tells which sources the clock no longer waits for."""
    for s in range(sources.shape[0]):
        if clock[NOW] == NEVER or plan[s, TIMEOUT] == np.iinfo(np.int64).max:
            continue
        limit = clock[NOW] - plan[s, TIMEOUT]
        if limit > sources[s, NEWEST] and not sources[s, QUIET]:
            sources[s, QUIET] = 1
            tell(notes, clock, s, IS_QUIET, (sources[s, NEWEST], clock[NOW], 0))


@njit(cache=True, error_model="numpy")
def release(fixed: Any, state: Any, rows: Any, notes: Any, everything: bool) -> bool:
    """Lets rows leave; False if the output is full."""
    clock, sources, times, pace = state.clock, state.sources, state.times, state.pace
    channels, period, extent, depth = fixed.channels, fixed.period, notes.extent, times.shape[1]
    spare = notes.found.shape[0] - 4 - sources.shape[0] - channels.shape[0]
    while True:
        stamp = following = oldest(sources, times)
        if stamp == np.iinfo(np.int64).max:
            return True
        full = sources[:, COUNT].max() >= depth
        if period > 0:
            if clock[BEGUN] == 0 or clock[ANEW] == 1:
                clock[GRID], clock[STEP] = stamp, 0
            elif is_over(stamp - clock[LAST], fixed.gap, fixed.cut, sources[:, PACE]):
                # Nothing was measured: no rows; the grid starts again behind the gap.
                clock[GRID], clock[STEP], clock[ANEW] = stamp, 0, 1
            following = clock[GRID] + int(np.rint(clock[STEP] * period))
            if everything and following > newest(sources):
                consume(channels, state, notes, newest(sources))
                return True
        if not (everything or full or edge(fixed.sources, clock, sources) >= following):
            return True
        resumed = clock[BEGUN] == 0 or clock[ANEW] == 1
        unusual = fixed.usual and period > 0 and is_unusual(pace, stamp - pace[TAKEN])
        if not resumed and (unusual or borders(sources, times, state.values, following)):
            clock[ANEW] = 1
            continue
        stamp = following
        if extent[0] >= rows.t.shape[0] or extent[1] > spare:
            return False
        forced = full and not everything and edge(fixed.sources, clock, sources) < stamp
        if forced and not clock[FORCED]:
            tell(notes, clock, 0, OVERFLOW, (stamp, stamp, sources[:, COUNT].max()))
        clock[FORCED] = forced
        emit(fixed, state, rows, notes, stamp)
        extent[0] += 1
        clock[STEP] += 1


@njit(cache=True, error_model="numpy")
def open_task(state: Any, notes: Any, task: int, stamp: int) -> None:
    """Another task: nothing is held over from the one before, and stamps lie behind it."""
    clock, sources = state.clock, state.sources
    state.known_t[:], state.known_v[:], state.broken_t[:] = NEVER, np.nan, NEVER
    state.habits[:, :TIMES] = 0
    sources[:, NEWEST], clock[SHIFT], clock[NOW] = NEVER, 0, NEVER
    if clock[ROW] > 0 and stamp <= clock[LAST]:
        clock[SHIFT] = clock[LAST] + MOVE - stamp
        tell(notes, clock, 0, SHIFTED, (stamp, stamp + clock[SHIFT], clock[SHIFT]))
    clock[TASK], clock[BEGUN], clock[ANEW] = task, 0, 1


@njit("samples", cache=True, error_model="numpy")
def push(s: int, start: int, samples: Any, given: Any, kept: Any, out: Any, told: Any) -> int:
    """Samples from ``start`` on, until the output is full; gives the next one.

    Args:
        s: a source, TICK, or FINISH: then everything leaves, and 1 says that it has.
        samples: stamps, values and task.
        given: `AlignSettings`.
        kept: `AlignState`.
        out: `Rows`, filled from the front.
        told: `AlignNotes`.
    """
    (t, v, task), state, rows = borrowed(samples), borrowed(kept), borrowed(out)
    fixed, notes = borrowed(given), borrowed(told)
    clock, sources, extent = state.clock, state.sources, notes.extent
    room = notes.found.shape[0] - 8 - sources.shape[0] - fixed.channels.shape[0]
    if s == FINISH:
        done = release(fixed, state, rows, notes, True)
        for k in range(sources.shape[0] if done else 0):
            end_run(notes, clock, sources, k)
        return int(done)
    for i in range(start, t.shape[0]):
        if extent[1] > room:
            return int(i)
        if clock[PENDING] == 0:
            if s < 0:
                clock[NOW] = max(clock[NOW], t[i] + clock[SHIFT])
                quiet(fixed.sources, clock, sources, notes)
            elif task < clock[TASK]:
                refuse(notes, clock, sources, s, IS_LATE, t[i])
            else:
                if task > clock[TASK]:
                    if not release(fixed, state, rows, notes, True):
                        return int(i)
                    open_task(state, notes, task, t[i])
                stamp = t[i] + sources[s, OFFSET] + clock[SHIFT]
                if fixed.cut and sources[s, NEWEST] != NEVER:
                    sources[s, PACE] = paced(sources[s, PACE], stamp - sources[s, NEWEST])
                accept(state, notes, s, stamp, v[i], fixed.jump)
        clock[PENDING] = 1
        if not release(fixed, state, rows, notes, False) or extent[1] > room:
            return int(i)
        clock[PENDING] = 0
    return int(t.shape[0])
