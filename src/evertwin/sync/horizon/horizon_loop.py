"""The compiled loops of `evertwin.sync.horizon.horizon`: the plan of restarts, and the stream.

Plain loops over rows; the model comes in as addresses (see `evertwin.models.kernels.kernel`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.compiled.memory import borrowed
from evertwin.models.kernels.kernel import ADOPT, ANEW
from evertwin.sync.options import HOT

NEVER = np.iinfo(np.int64).min
"""Stamp of an output that was not adopted since the state started anew."""
SLACK = 1_000
"""Stamps are rounded: a horizon counts as reached this many nanoseconds early."""
OK, HELD, OVERRULED = 0, 2, 5
TASK, BEGUN, END, LAST, SEGMENTS, SHORT = range(6)
"""Places in a stream's ``clock``: task of the last row, has a row come?, stamp at which the segment
began, stamp of the last row; segments since the state started anew; how often in a row there were
too few of them."""
PATIENT = 20
"""So many times too few segments: rows come in such pieces, which count then."""


@njit(cache=True, error_model="numpy", inline="always")
def wrapped(residual: float, angle: bool) -> float:
    """An angle's residual in (−π, π], any other as it is."""
    return np.pi - (np.pi - residual) % (2 * np.pi) if angle else residual


@njit(cache=True, error_model="numpy", inline="always")
def is_known(values: Any) -> bool:
    """True if every value of a row is finite."""
    for k in range(values.shape[0]):  # noqa: SIM110 - generators do not compile
        if not np.isfinite(values[k]):
            return False
    return True


@njit(**HOT)
def is_row_known(values: Any, i: int) -> bool:
    """True if every value of a row of several is finite; a view of it costs more."""
    for k in range(values.shape[1]):  # noqa: SIM110 - generators do not compile
        if not np.isfinite(values[i, k]):
            return False
    return True


@njit(cache=True, error_model="numpy", inline="always")
def is_due(stamp: int, adopted: int, horizon: int) -> bool:
    """Has an output that was adopted at ``adopted`` to be adopted again?"""
    return adopted == NEVER or stamp - adopted >= horizon - SLACK


@njit(cache=True, error_model="numpy")
def plan(t: Any, anew: Any, y: Any, moved: Any, horizon: int, code: Any, adopts: Any) -> None:
    """Fills ``code`` (n,) and ``adopts`` (n, ny), the outputs that each restart takes over."""
    n, ny = y.shape
    adopted = np.full(ny, NEVER)
    for i in range(n):
        if anew[i]:
            code[i] = ANEW
            for j in range(ny):
                adopted[j] = t[i] if y[i, j] == y[i, j] else NEVER
                adopts[i, j] = y[i, j]
            continue
        for j in range(ny):
            due = moved[i, j] or is_due(t[i], adopted[j], horizon)
            if y[i, j] == y[i, j] and due:
                adopted[j] = t[i]
                adopts[i, j] = y[i, j]
                if i + 1 < n:
                    code[i + 1] = ADOPT


@njit(cache=True, error_model="numpy")
def counted(u: Any, y: Any, mark: Any) -> Any:
    """Where an output was measured and is trusted, at a row whose inputs are too, (n, ny)."""
    (n, ny), nu = y.shape, u.shape[1]
    out = np.empty((n, ny), dtype=np.bool_)
    for i in range(n):
        fed, worst = True, 0
        for k in range(nu):  # without a branch, so that it becomes wide
            fed &= u[i, k] - u[i, k] == 0.0
        for k in range(nu + ny):
            worst |= mark[i, k]
        if worst > 0:
            for k in range(nu):
                fed &= mark[i, k] <= HELD or mark[i, k] == OVERRULED
        for k in range(ny):
            out[i, k] = fed and y[i, k] == y[i, k] and (worst == 0 or mark[i, nu + k] <= HELD)
    return out


@njit(cache=True, error_model="numpy")
def began(anew: Any, known: Any) -> Any:
    """True where an output was known at an earlier row since the state started anew, (n, ny)."""
    out = np.empty_like(known)
    seen = np.zeros(known.shape[1], dtype=np.bool_)
    for i in range(known.shape[0]):
        for j in range(known.shape[1]):
            out[i, j] = seen[j] and not anew[i]
            seen[j] = known[i, j] or out[i, j]
    return out


@njit(**HOT)
def end_segment(rows: Any, state: Any, i: int, t: int) -> None:
    """A segment ends at a row, and the next one begins; −1: it counts for nothing."""
    for j in range(state.square.shape[0]):
        if i >= 0:
            rows.square[i, j], rows.samples[i, j] = state.square[j], state.samples[j]
        state.square[j], state.samples[j] = 0.0, 0
    if i >= 0:
        rows.end[i] = True
    state.clock[END] = t


@njit(**HOT)
def start_anew(fixed: Any, state: Any, rows: Any, i: int, t: int) -> None:
    """The state starts anew. What a gap cuts counts if it is half a horizon long."""
    clock, settles, samples = state.clock, fixed.settles, 0
    for j in range(state.samples.shape[0]):
        samples += state.samples[j]
    enough = clock[LAST] - clock[END] >= fixed.horizon // 2 - SLACK
    counts = (enough or fixed.horizon == np.iinfo(np.int64).max) and samples > 0
    end_segment(rows, state, i if counts else -1, t)
    few = clock[BEGUN] != 0 and (clock[SEGMENTS] < settles or clock[SHORT] > PATIENT)
    clock[SHORT] = clock[SHORT] + 1 if few else 0
    clock[SEGMENTS] = settles if clock[SHORT] > PATIENT else 0


@njit(**HOT)
def compare(
    fixed: Any, block: Any, state: Any, rows: Any, i: int, span: int, take: Any
) -> bool:  # fmt: skip
    """Measured against predicted; fills ``take`` with what is adopted. Is there any?"""
    taken, nu, stateful = False, block.u.shape[1], state.x.shape[0] > 0
    y, out, adopted = block.y, rows.y, state.adopted
    for j in range(y.shape[1]):
        level = block.mark[i, nu + j]
        known = y[i, j] == y[i, j] and level <= HELD
        started = adopted[j] != NEVER and state.clock[SEGMENTS] >= fixed.settles
        rows.residual[i, j] = take[j] = np.nan
        if known and (started or not stateful) and out[i, j] == out[i, j]:
            rows.residual[i, j] = wrapped(y[i, j] - out[i, j], fixed.angle[j])
            scaled = rows.residual[i, j] / state.scale[j]
            state.square[j] += scaled * scaled
            state.samples[j] += 1
        # What overruled the simulation is adopted at once, and no measure of the model.
        moved = y[i, j] == y[i, j] and level == OVERRULED
        fresh = known and level == OK and is_due(block.t[i], adopted[j], span)
        if stateful and (moved or fresh):
            taken, take[j], adopted[j] = True, y[i, j], block.t[i]
    return taken


@njit(cache=True, error_model="numpy")
def run(
    step: int, observe: int, context: Any, given: bool, lent: Any, fixed: Any, kept: Any, out: Any
) -> None:
    """Rows through the model, adopting each output anew once the horizon has passed.

    Args:
        given: ``out`` holds the predictions of a model without state already.
        lent: `Block` with arrays in C order.
        fixed: `HorizonSettings`. Segments in the first horizon do not count, unless rows come in
            pieces that are shorter.
        kept: `HorizonState`.
        out: `HorizonRows`.
    """
    (n, ny), nu, nx = lent.y.shape, lent.u.shape[1], len(kept.x)
    ahead, take = np.empty(nx), np.empty(ny)
    block, state, rows = borrowed(lent), borrowed(kept), borrowed(out)
    x, clock, adopted, task = state.x, state.clock, state.adopted, block.task
    c, a, b, taking = context.ctypes.data, x.ctypes.data, ahead.ctypes.data, take.ctypes.data
    for i in range(n):
        now, first = block.t[i], block.u.ctypes.data + 8 * i * nu
        anew = clock[BEGUN] == 0 or task[i] != clock[TASK] or not is_row_known(block.u, i)
        lasts = block.gap[i] and not anew and fixed.settles > 0
        anew = anew or block.gap[i]
        if anew:
            start_anew(fixed, state, rows, i, now)
        clock[BEGUN], clock[TASK], clock[LAST] = 1, task[i], now
        failed = anew and nx > 0
        if not failed and not given:
            at = rows.y.ctypes.data + 8 * i * ny
            code = call(step, c, a, first, block.dt[i], state.p.ctypes.data, b, at)
            failed = code != 0 or not is_known(ahead)
        for j in range(ny if failed else 0):
            rows.y[i, j], take[j], adopted[j] = np.nan, np.nan, NEVER
        if failed and lasts:
            call(observe, c, a, taking)  # nothing: what was expected is void
        else:
            for k in range(nx):
                x[k] = state.x0[k] if failed else ahead[k]
        settling = clock[SEGMENTS] < fixed.settles
        span = fixed.horizon // fixed.settles if settling else fixed.horizon
        taken = compare(fixed, block, state, rows, i, span, take)
        if taken:
            call(observe, c, a, taking)
        if (taken or nx == 0) and now - clock[END] >= span - SLACK:
            end_segment(rows, state, i, now)
            clock[SEGMENTS] += 1
