"""The compiled loops of `evertwin.sync.horizon`: the plan of restarts, and the stream.

Plain loops over rows; the model comes in as addresses (see `evertwin.models.kernel`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.models.kernel import ADOPT, ANEW

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


@njit(cache=True, error_model="numpy")
def run(
    step: int, observe: int, context: Any, given: bool, t: Any, dt: Any, u: Any, y: Any, mark: Any,
    task: Any, gap: Any, angle: Any, horizon: int, settles: int, x: Any, p: Any, x0: Any,
    scale: Any, square: Any, samples: Any, adopted: Any, clock: Any, out: Any, residual: Any,
    end: Any, sums: Any, counts: Any,
) -> None:  # fmt: skip
    """Rows through the model, adopting each output anew once the horizon has passed.

    ``given``: ``out`` holds the predictions of a model without state already. ``settles``: segments
    in the first horizon, which does not count, unless rows come in pieces that are shorter.
    """
    # longer than the budget: one row is one thought, and cutting it costs a third of the speed
    n, nu, ny, nx = u.shape[0], u.shape[1], y.shape[1], x.shape[0]
    ahead, take = np.empty_like(x), np.empty(ny)
    u_at, out_at = u.ctypes.data, out.ctypes.data
    c, a, b = context.ctypes.data, x.ctypes.data, ahead.ctypes.data
    parameters, take_at = p.ctypes.data, take.ctypes.data
    for i in range(n):
        anew = clock[BEGUN] == 0 or task[i] != clock[TASK] or not is_known(u[i])
        lasts = gap[i] and not anew and settles > 0
        anew = anew or gap[i]
        if anew:
            # A segment that a gap cuts short counts if it is half a horizon long.
            enough = clock[LAST] - clock[END] >= horizon // 2 - SLACK
            if (enough or horizon == np.iinfo(np.int64).max) and samples.sum() > 0:
                end[i], sums[i], counts[i] = True, square, samples
            square[:], samples[:], clock[END] = 0.0, 0, t[i]
            few = clock[BEGUN] != 0 and (clock[SEGMENTS] < settles or clock[SHORT] > PATIENT)
            clock[SHORT] = clock[SHORT] + 1 if few else 0
            clock[SEGMENTS] = settles if clock[SHORT] > PATIENT else 0
        clock[BEGUN], clock[TASK], clock[LAST] = 1, task[i], t[i]
        failed = anew and nx > 0
        if not failed and not given:
            at = out_at + 8 * i * ny
            code = call(step, c, a, u_at + 8 * i * nu, dt[i], parameters, b, at)
            failed = code != 0 or not is_known(ahead)
        if failed and lasts:
            out[i], take[:], adopted[:] = np.nan, np.nan, NEVER
            call(observe, c, a, take_at)  # nothing: what was expected is void
        elif failed:
            x[:], out[i] = x0, np.nan
            adopted[:] = NEVER
        else:
            x[:] = ahead
        taken, span = False, horizon // settles if clock[SEGMENTS] < settles else horizon
        for j in range(ny):
            level = mark[i, nu + j]
            known = y[i, j] == y[i, j] and level <= HELD
            started = nx == 0 or (adopted[j] != NEVER and clock[SEGMENTS] >= settles)
            residual[i, j] = np.nan
            take[j] = np.nan
            if known and started and out[i, j] == out[i, j]:
                residual[i, j] = wrapped(y[i, j] - out[i, j], angle[j])
                scaled = residual[i, j] / scale[j]
                square[j] += scaled * scaled
                samples[j] += 1
            # What overruled the simulation is adopted at once, and no measure of the model.
            moved = y[i, j] == y[i, j] and level == OVERRULED
            fresh = known and level == OK and is_due(t[i], adopted[j], span)
            if nx > 0 and (moved or fresh):
                taken, take[j], adopted[j] = True, y[i, j], t[i]
        if taken:
            call(observe, c, a, take_at)
        if (taken or nx == 0) and t[i] - clock[END] >= span - SLACK:
            end[i], sums[i], counts[i] = True, square, samples
            square[:], samples[:], clock[END] = 0.0, 0, t[i]
            clock[SEGMENTS] += 1
