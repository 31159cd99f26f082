"""The arithmetic of correction terms, compiled: from the commanded input to the effective one.

Everything a kernel needs about the terms lies in one int64 array, the *plan*: a header, then one
record per term with its kind, its place in the inputs, parameters and states, and its grids (as the
bits of floats). `evertwin.models.corrected` writes the plan.

Every function is plain code over arrays, so the same source runs uncompiled in the tests.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, cfunc, njit

from evertwin.models.kernel import ANEW, OBSERVE, STEP, call_observe, call_step

__all__ = [
    "COUPLING",
    "HEADER",
    "LAG",
    "LAW",
    "LONG",
    "RECORD",
    "STATE",
    "SURFACE",
    "TABLE",
    "adopt",
    "effective",
    "effective_rows",
    "effective_run",
    "exchange",
    "shift",
    "step",
]

TABLE, LAW, LAG, COUPLING, SURFACE, STATE = 0, 1, 2, 3, 4, 5
# Header: length, inner step, inner observe, inner context, nu, nx inner, nx, np, ny, terms.
HEADER = 10
# Record: its length, kind, variant, channel, source, first parameter, first state, sizes of the
# grids, capacity of the history or output of the state.
RECORD = 10
LONG = 1e6
"""Seconds for which the first command is taken to have been held before it was seen."""


@njit(cache=True)
def table(u: Any, levels: Any, values: Any, variant: Any) -> Any:
    """The value of the nearest level (variant 0) or between two levels (1).

    Outside the levels the correction of the last one is kept.
    """
    n = levels.shape[0]
    if u <= levels[0]:
        return values[0] + (u - levels[0])
    if u >= levels[n - 1]:
        return values[n - 1] + (u - levels[n - 1])
    k = np.searchsorted(levels, u) - 1
    share = (u - levels[k]) / (levels[k + 1] - levels[k])
    if variant == 1:
        return values[k] + share * (values[k + 1] - values[k])
    return values[k] if share <= 0.5 else values[k + 1]


@njit(cache=True)
def law(u: Any, p: Any, variant: Any, quiet: Any) -> Any:
    """min(gain·|u| + offset, cap), odd in u, with a start threshold.

    Variant 0: none. 1, dead zone: no motion up to the threshold. 2, clamp: never slower than the
    threshold. No motion below ``quiet`` in any of them.
    """
    a = abs(u)
    first = 0 if variant == 0 else 1
    if a < quiet or a == 0.0 or (variant == 1 and a <= p[0]):
        return 0.0 * u
    v = p[first] * a + p[first + 1]
    if variant == 2:
        v = max(v, p[0])
    v = min(max(v, 0.0), p[first + 2])
    return math.copysign(v, u)


@njit(cache=True)
def coupling(u: Any, source: Any, p: Any, variant: Any) -> Any:
    """0: u − k·source. 1: |u| falls by k·|source|. 2: the limit of |u| falls with |source|."""
    if variant == 0:
        return u - p[0] * source
    if u == 0.0:
        return 0.0 * u
    if variant == 1:
        return u - math.copysign(p[0] * abs(source), u)
    slope = p[1] + p[2] * abs(source)
    return math.tanh(p[0] * u * slope) / slope if slope > 1e-12 else p[0] * u


@njit(cache=True)
def cell(v: Any, levels: Any) -> Any:
    """Cell of a grid and the share of its upper edge; values outside sit on the border."""
    n = levels.shape[0]
    v = min(max(v, levels[0]), levels[n - 1])
    k = min(max(np.searchsorted(levels, v) - 1, 0), n - 2)
    return k, (v - levels[k]) / (levels[k + 1] - levels[k])


@njit(cache=True)
def surface(u: Any, source: Any, levels: Any, levels2: Any, p: Any) -> Any:
    """u + bilinear interpolation of the nodes p[i·n2 + j]."""
    n2 = levels2.shape[0]
    i, a = cell(u, levels)
    j, b = cell(source, levels2)
    low = p[i * n2 + j] * (1.0 - b) + p[i * n2 + j + 1] * b
    high = p[(i + 1) * n2 + j] * (1.0 - b) + p[(i + 1) * n2 + j + 1] * b
    return u + low * (1.0 - a) + high * a


@njit(cache=True)
def remember(u: Any, dt: Any, x: Any, ahead: Any, capacity: Any) -> None:
    """The history with this row's input: newest first, one entry per change of the input.

    Lag state: has a row come, filtered inputs (m), durations (capacity), values (capacity · m).
    """
    m = u.shape[0]
    h, v = 1 + m, 1 + m + capacity
    if x[0] == 0.0:
        ahead[:] = 0.0
        ahead[0], ahead[h] = 1.0, LONG
        for c in range(m):
            ahead[1 + c] = u[c]
            ahead[v + c] = u[c]
        return
    ahead[:] = x
    same = True
    for c in range(m):
        same = same and u[c] == x[v + c]
    if same:
        ahead[h] += dt
        return
    for j in range(capacity - 1, 0, -1):
        ahead[h + j] = x[h + j - 1]
        for c in range(m):
            ahead[v + j * m + c] = x[v + (j - 1) * m + c]
    ahead[h] = dt
    for c in range(m):
        ahead[v + c] = u[c]


@njit(cache=True)
def lag(u: Any, dt: Any, delay: Any, tau: Any, ahead: Any, capacity: Any) -> None:
    """Delay and first-order lag over one row; ``u`` becomes the *mean* over the row.

    Exact for inputs that are constant between their changes: over a piece of length o with value a
    the lagged value f goes to a + (f − a)·exp(−o/τ) and its integral is
    a·o + (f − a)·τ·(1 − exp(−o/τ)).
    """
    m = u.shape[0]
    h, v = 1 + m, 1 + m + capacity
    oldest, edge = 0, ahead[h]
    while oldest + 1 < capacity and edge < delay + dt and ahead[h + oldest + 1] > 0.0:
        oldest += 1
        edge += ahead[h + oldest]
    for c in range(m):
        f, total, far, end = ahead[1 + c], 0.0, delay + dt, edge
        for j in range(oldest, -1, -1):
            end = end - ahead[h + j] if j > 0 else 0.0
            piece = far - max(end, delay)
            far = min(far, end)
            if piece <= 0.0:
                continue
            a = ahead[v + j * m + c]
            decay = math.exp(-piece / tau) if tau > 1e-9 else 0.0
            total += a * piece + (f - a) * tau * (1.0 - decay)
            f = a + (f - a) * decay
        ahead[1 + c] = f
        u[c] = total / dt if dt > 0.0 else f


@njit(cache=True)
def effective(plan: Any, u: Any, dt: Any, p: Any, x: Any, ahead: Any) -> Any:
    """Applies the terms in order to ``u`` in place; 0, or 1 where an input is not finite."""
    at = HEADER
    numbers = plan.view(np.float64)
    for _ in range(plan[9]):
        kind, variant, c, s = plan[at + 1], plan[at + 2], plan[at + 3], plan[at + 4]
        q, b, n1, n2 = plan[at + 5], plan[at + 6], plan[at + 7], plan[at + 8]
        levels = numbers[at + RECORD : at + RECORD + n1]
        if kind == TABLE:
            u[c] = table(u[c], levels, p[q : q + n1], variant)
        elif kind == LAW:
            u[c] = law(u[c], p[q : q + 4], variant, levels[0] if n1 > 0 else 0.0)
        elif kind == COUPLING:
            u[c] = coupling(u[c], u[s], p[q : q + 3], variant)
        elif kind == SURFACE:
            levels2 = numbers[at + RECORD + n1 : at + RECORD + n1 + n2]
            u[c] = surface(u[c], u[s], levels, levels2, p[q : q + n1 * n2])
        elif kind == LAG:
            first, last = (0, u.shape[0]) if c < 0 else (c, c + 1)
            for k in range(first, last):
                if not math.isfinite(u[k]):
                    return 1
            size = 1 + (last - first) * (1 + plan[at + 9]) + plan[at + 9]
            memory = ahead[b : b + size]
            remember(u[first:last], dt, x[b : b + size], memory, plan[at + 9])
            tau = p[q + 1] if variant == 0 else 0.0
            lag(u[first:last], dt, p[q], tau, memory, plan[at + 9])
        at += plan[at]
    return 0


@njit(cache=True)
def effective_rows(plan: Any, u: Any, p: Any) -> None:
    """Static terms over many rows, in place."""
    none = np.zeros(1)
    for i in range(u.shape[0]):
        effective(plan, u[i], 0.0, p, none, none)


@njit(cache=True, nogil=True)
def effective_run(plan: Any, x: Any, u: Any, dt: Any, p: Any, code: Any) -> Any:
    """What the terms make of the inputs of a whole roll-out from ``x``, (n, nu).

    NaN where `step` would fail; ``code`` is that of `evertwin.models.kernel.Restart`.
    """
    out, now, ahead = u.copy(), x.copy(), x.copy()
    for i in range(u.shape[0]):
        if code[i] == ANEW:
            now[:] = x
        elif effective(plan, out[i], dt[i], p, now, ahead) != 0:
            out[i, :] = np.nan
        else:
            now[:] = ahead
    return out


@njit(cache=True)
def exchange(plan: Any, dt: Any, p: Any, x: Any, ahead: Any, y: Any) -> None:
    """Extra states exchange with the states that they couple to, after the inner model's step.

    With difference d = state − extra: d' = −(a + b)·d, the state losing a·d, the extra gaining b·d,
    solved exactly over the row. State: has a row come, extra − state.
    """
    at = HEADER
    for _ in range(plan[9]):
        if plan[at + 1] == STATE:
            c, out, q, b = plan[at + 3], plan[at + 9], plan[at + 5], plan[at + 6]
            ahead[b] = 1.0
            extra = x[c] + x[b + 1]
            both = p[q] + p[q + 1]
            moved = (ahead[c] - extra) * (1.0 - math.exp(-both * dt))
            share = p[q] / both if both > 0.0 else 0.0
            ahead[c] -= share * moved
            ahead[b + 1] = extra + (1.0 - share) * moved - ahead[c]
            if out >= 0:
                y[out] = ahead[c]
        at += plan[at]


@njit(cache=True)
def shift(plan: Any, before: Any, x: Any) -> None:
    """After the inner model adopted a measurement: an extra state that has begun stays absolute.

    ``before`` holds the states before the adoption.
    """
    at = HEADER
    for _ in range(plan[9]):
        if plan[at + 1] == STATE:
            c, b = plan[at + 3], plan[at + 6]
            if x[b] != 0.0:
                x[b + 1] += before[c] - x[c]
        at += plan[at]


@cfunc(STEP, cache=True)
def step(context: Any, x: Any, u: Any, dt: Any, p: Any, x_next: Any, y: Any) -> Any:
    """One row: terms, inner step, extra states."""
    plan = carray(context, (carray(context, (1,))[0],))
    now, ahead = carray(x, (plan[6],)), carray(x_next, (plan[6],))
    numbers, out = carray(p, (plan[7],)), carray(y, (plan[8],))
    inputs = carray(u, (plan[4],)).copy()
    if effective(plan, inputs, dt, numbers, now, ahead) != 0:
        ahead[:] = now
        out[:] = np.nan
        return 1
    failed = call_step(
        plan[1], plan[3], now.ctypes.data, inputs.ctypes.data, dt, numbers.ctypes.data,
        ahead.ctypes.data, out.ctypes.data,
    )  # fmt: skip
    exchange(plan, dt, numbers, now, ahead, out)
    return failed


@cfunc(OBSERVE, cache=True)
def adopt(context: Any, x: Any, y: Any) -> Any:
    """The inner model adopts; extra states stay where they are."""
    plan = carray(context, (carray(context, (1,))[0],))
    now = carray(x, (plan[6],))
    before = now[: plan[5]].copy()
    call_observe(plan[2], plan[3], now.ctypes.data, carray(y, (plan[8],)).ctypes.data)
    shift(plan, before, now)
    return 0
