"""The arithmetic of `evertwin.models.observing.observing`, compiled.

Everything lies in the state, behind the inner model's: one run of the model per hidden state, each
begun a little apart from the others in that one (`Place`), and per output what the innovations
since then have told. So a stage that restarts, stores or forks such a model needs to know nothing.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.compiled.memory import carray, room

# Plan: length, inner step, inner observe, inner context, nu, nx inner, np, ny, hidden; then each
# hidden state's place, then of each output whether it is an angle.
HEADER = 9
LITTLE, LEAST = 1e-6, 1e-3
"""Share of its size, or of `LEAST`, that a run begins apart in its hidden state."""
GONE = 1e-3
"""Share of that which is left of it when a run tells nothing any more."""
GROWN = 1e3
"""Times that by which a run may go away from the model: further, it is no derivative any more."""
FLAT = 1e-10
"""Share of a state's own information that the others do not give."""


class Place(NamedTuple):
    """Where things stand in the state.

    >>> place(2, 1, 1).runs, place(2, 1, 1).end
    (4, 12)
    """

    begun: int
    apart: int
    """What each run began apart, 0 once it tells nothing, (hidden,)."""
    runs: int
    """The runs' states, (hidden, nx)."""
    expected: int
    """Outputs of the newest row, NaN once compared, (ny,)."""
    slope: int
    """Their derivatives by what the hidden states began with, (ny, hidden)."""
    told: int
    """Sum of the slopes' products over the innovations, (ny, hidden, hidden)."""
    pull: int
    """Sum of slope · innovation, (ny, hidden)."""
    square: int
    """Sum of innovations², (ny,)."""
    counts: int
    """How many they are, (ny,); −1 before an output was adopted first."""
    end: int


@njit(cache=True)
def place(nx: int, ny: int, hidden: int) -> Place:
    """The places of a model with ``nx`` states, ``ny`` outputs and ``hidden`` states."""
    apart = nx + 1
    runs = apart + hidden
    expected = runs + hidden * nx
    slope = expected + ny
    told = slope + ny * hidden
    pull = told + ny * hidden * hidden
    square = pull + ny * hidden
    return Place(nx, apart, runs, expected, slope, told, pull, square, square + ny, square + 2 * ny)


@njit(cache=True)
def _begin(plan: Any, x: Any, at: Place) -> None:
    """A run per hidden state, from where the model is."""
    nx = plan[5]
    x[at.begun] = 1.0
    for k in range(plan[8]):
        h, first = plan[HEADER + k], at.runs + k * nx
        x[at.apart + k] = LITTLE * max(abs(x[h]), LEAST)
        for i in range(nx):
            x[first + i] = x[i]
        x[first + h] += x[at.apart + k]


@njit(cache=True)
def _nearer(x: Any, at: Place, k: int, sizes: Any, share: float) -> None:
    """A run that went away from the model comes nearer, by ``share``: what it tells is of a start
    in units so much larger. What was told before counts the less."""
    nx, ny, m = sizes
    first = at.runs + k * nx
    for i in range(nx):
        x[first + i] = x[i] + share * (x[first + i] - x[i])
    for j in range(ny):
        x[at.slope + j * m + k] *= share
        x[at.pull + j * m + k] *= share
        for i in range(m):
            x[at.told + (j * m + k) * m + i] *= share
            x[at.told + (j * m + i) * m + k] *= share


@njit(cache=True)
def _solve(a: Any, b: Any, out: Any, m: int) -> None:
    """``a``·out = ``b`` by Cholesky, in place; what the others tell as well stays 0."""
    for k in range(m):
        own, out[k] = a[k * m + k], 0.0
        for j in range(k):
            a[k * m + k] -= a[k * m + j] * a[k * m + j]
        pivot = math.sqrt(a[k * m + k]) if a[k * m + k] > FLAT * own else 0.0
        a[k * m + k] = pivot
        for i in range(k + 1, m):
            for j in range(k):
                a[i * m + k] -= a[i * m + j] * a[k * m + j]
            a[i * m + k] = a[i * m + k] / pivot if pivot > 0.0 else 0.0
    for k in range(m):
        found = b[k]
        for j in range(k):
            found -= a[k * m + j] * out[j]
        out[k] = found / a[k * m + k] if a[k * m + k] > 0.0 else 0.0
    for k in range(m - 1, -1, -1):
        for j in range(k + 1, m):
            out[k] -= a[j * m + k] * out[j]
        out[k] = out[k] / a[k * m + k] if a[k * m + k] > 0.0 else 0.0


@njit(cache=True)
def _correct(plan: Any, x: Any, at: Place, a: Any, b: Any, shift: Any) -> None:
    """Least squares of what the hidden states began with, outputs in units of what is left of them;
    shrunk as far as chance may have done it (James and Stein)."""
    nx, ny, m = plan[5], plan[7], plan[8]
    rows = 0.0
    a[:], b[:] = 0.0, 0.0
    for j in range(ny):
        square, count = x[at.square + j], x[at.counts + j]
        if square <= 0.0:
            continue
        rows += count
        for k in range(m):
            b[k] += x[at.pull + j * m + k] * count / square
            for i in range(m):
                a[k * m + i] += x[at.told + (j * m + k) * m + i] * count / square
    _solve(a, b, shift, m)
    gain = 0.0
    for k in range(m):
        gain += shift[k] * b[k]
    if rows <= m or gain <= 0.0:
        return
    left = max(rows - gain, 0.0) / (rows - m)
    share = 1.0 - left * m / gain
    if share <= 0.0:
        return
    for k in range(m):
        shift[k] *= share
    for j in range(ny):
        for k in range(m):
            moved = 0.0
            for i in range(m):
                moved += x[at.told + (j * m + k) * m + i] * shift[i]
            x[at.square + j] -= shift[k] * (2.0 * x[at.pull + j * m + k] - moved)
            b[k] = moved
        for k in range(m):
            x[at.pull + j * m + k] -= b[k]
        x[at.square + j] = max(x[at.square + j], 0.0)
    for i in range(nx):
        moved = 0.0
        for k in range(m):
            if x[at.apart + k] > 0.0:
                moved += (x[at.runs + k * nx + i] - x[i]) / x[at.apart + k] * shift[k]
        x[i] += moved
        for k in range(m):
            x[at.runs + k * nx + i] += moved


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, x_next: Any, y: Any) -> Any:
    """One row of the model, and of each run that still tells something."""
    plan = carray(context, (carray(context, (1,))[0],))
    nx, ny, m = plan[5], plan[7], plan[8]
    at = place(nx, ny, m)
    now, ahead, out = carray(x, (at.end,)), carray(x_next, (at.end,)), carray(y, (ny,))
    other, begun = carray(room(ny), (ny,)), carray(room(nx), (nx,))
    inputs, given = carray(u, (plan[4],)).ctypes.data, carray(p, (plan[6],)).ctypes.data
    from_at, to_at = now.ctypes.data, ahead.ctypes.data
    for i in range(nx, at.end):
        ahead[i] = now[i]
    if ahead[at.begun] == 0.0:
        for i in range(nx):
            ahead[i] = now[i]
        _begin(plan, ahead, at)
    failed = call(plan[1], plan[3], from_at, inputs, dt, given, to_at, out.ctypes.data)
    for k in range(m):
        apart, first = ahead[at.apart + k], at.runs + k * nx
        if apart > 0.0 and failed == 0:
            for i in range(nx):
                begun[i] = ahead[first + i]
            lost = call(
                plan[1], plan[3], begun.ctypes.data, inputs, dt, given, to_at + 8 * first,
                other.ctypes.data,
            )  # fmt: skip
            h = plan[HEADER + k]
            left = abs(ahead[first + h] - ahead[h])
            if lost != 0 or not GONE * apart < left < math.inf:
                ahead[at.apart + k] = apart = 0.0
        for j in range(ny):
            ahead[at.slope + j * m + k] = (other[j] - out[j]) / apart if apart > 0.0 else 0.0
        if apart > 0.0 and left > GROWN * apart:
            _nearer(ahead, at, k, (nx, ny, m), apart / left)
    for j in range(ny):
        ahead[at.expected + j] = out[j]
    return failed


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> Any:
    """What was expected of the outputs is compared, the hidden states follow, the model adopts."""
    plan = carray(context, (carray(context, (1,))[0],))
    nx, ny, m = plan[5], plan[7], plan[8]
    at = place(nx, ny, m)
    now, out = carray(x, (at.end,)), carray(y, (ny,))
    compared, told = 0, False
    for j in range(ny):
        told |= out[j] == out[j]
    if not told:  # rows are missing: what the innovations told is of before
        for i in range(nx, at.end):
            now[i] = 0.0
        for j in range(ny):
            now[at.expected + j], now[at.counts + j] = np.nan, -1.0
        return 0
    for j in range(ny):
        off, first = out[j] - now[at.expected + j], at.slope + j * m
        now[at.expected + j] = np.nan
        if out[j] == out[j] and now[at.counts + j] < 0.0:
            now[at.counts + j] = 0.0  # the first of an output is where it begins
            continue
        if off != off:
            continue
        if plan[HEADER + m + j] != 0:
            off = math.pi - (math.pi - off) % (2.0 * math.pi)
        for k in range(m):
            now[at.pull + j * m + k] += now[first + k] * off
            for i in range(m):
                now[at.told + (j * m + k) * m + i] += now[first + k] * now[first + i]
            compared += now[at.apart + k] > 0.0
        now[at.square + j] += off * off
        now[at.counts + j] += 1.0
    if compared > 0:
        a, b, shift = carray(room(m * m), (m * m,)), carray(room(m), (m,)), carray(room(m), (m,))
        _correct(plan, now, at, a, b, shift)
    told_at = out.ctypes.data
    call(plan[2], plan[3], now.ctypes.data, told_at)
    for k in range(m):
        if now[at.apart + k] > 0.0:
            call(plan[2], plan[3], now.ctypes.data + 8 * (at.runs + k * nx), told_at)
    return 0
