"""The stepper of Modelica models: one compiled loop that runs any model's tape.

A model is a *tape*: five integers per operation (what, where to, three arguments), over a row of
registers that begin with constants, parameters, inputs and states. So no code is made or executed
for a model, every model starts at once, and what a tape can do is what is written here.

The tape comes in three parts: what depends on parameters and inputs alone runs once a row, what
depends on states at each stage of the integration, outputs at its end. Integration is Dormand and
Prince's fifth order (1980), in equal sub-steps or in sub-steps that their fourth-order partner
calls for; inputs are held over the row.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.compiled.memory import carray, copied

WORDS = 5
"""Integers per operation."""
BINARY = (
    "add", "subtract", "multiply", "divide", "power", "atan2", "min", "max", "less", "less_equal",
    "greater", "greater_equal", "equal", "not_equal", "and", "or",
)  # fmt: skip
UNARY = (
    "negate", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log",
    "log10", "sqrt", "abs", "sign", "floor", "ceil", "not", "copy",
)  # fmt: skip
OPS = (*BINARY, *UNARY, "select", "linear", "newton")
"""Operations; their place is their code."""
SELECT, LINEAR, NEWTON = len(OPS) - 3, len(OPS) - 2, len(OPS) - 1
HEAD = 19
(NC, NP, NU, NX, NY, REGISTERS, ROW, STAGE, OUT, END, BITS, SLOPES, SHOWN, ADOPTS, ADOPTED, FIXED,
 SIZE, TOLERANCE, PARTS) = range(HEAD)  # fmt: skip
"""What the first integers of a context say; ``ROW`` … ``END`` are where the tape's parts begin."""

_A = np.array([
    [0, 0, 0, 0, 0, 0],
    [1 / 5, 0, 0, 0, 0, 0],
    [3 / 40, 9 / 40, 0, 0, 0, 0],
    [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
])  # fmt: skip
_E = np.array(
    [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]
)  # fifth minus fourth order
ROUNDS = 50
"""Most rounds of a nonlinear solution."""


@njit(cache=True, error_model="numpy")
def one(op: int, a: Any, b: Any, c: Any) -> Any:
    """A plain operation; the order of cases is that of `OPS`."""
    if op < 16:
        return _arithmetic(op, a, b) if op < 8 else _compared(op, a, b)
    return _function(op, a) if op < SELECT else (b if a != 0.0 else c)


@njit(cache=True, error_model="numpy")
def _arithmetic(op: int, a: Any, b: Any) -> Any:
    if op == 0:
        return a + b
    if op == 1:
        return a - b
    if op == 2:
        return a * b
    if op == 3:
        return a / b
    if op == 4:
        return math.pow(a, b)
    if op == 5:
        return math.atan2(a, b)
    return min(a, b) if op == 6 else max(a, b)


@njit(cache=True, error_model="numpy")
def _compared(op: int, a: Any, b: Any) -> Any:
    if op == 8:
        return 1.0 * (a < b)
    if op == 9:
        return 1.0 * (a <= b)
    if op == 10:
        return 1.0 * (a > b)
    if op == 11:
        return 1.0 * (a >= b)
    if op == 12:
        return 1.0 * (a == b)
    if op == 13:
        return 1.0 * (a != b)
    return 1.0 * (a != 0.0 and b != 0.0) if op == 14 else 1.0 * (a != 0.0 or b != 0.0)


@njit(cache=True, error_model="numpy")
def _function(op: int, a: Any) -> Any:
    if op == 16:
        return -a
    if op == 17:
        return math.sin(a)
    if op == 18:
        return math.cos(a)
    if op == 19:
        return math.tan(a)
    if op == 20:
        return math.asin(a)
    if op == 21:
        return math.acos(a)
    if op == 22:
        return math.atan(a)
    if op == 23:
        return math.sinh(a)
    if op == 24:
        return math.cosh(a)
    if op == 25:
        return math.tanh(a)
    if op == 26:
        return math.exp(a)
    if op == 27:
        return math.log(a)
    if op == 28:
        return math.log10(a)
    if op == 29:
        return np.sqrt(a)
    if op == 30:
        return abs(a)
    if op == 31:
        return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else 0.0 * a)
    if op == 32:
        return np.floor(a)
    if op == 33:
        return np.ceil(a)
    return 1.0 * (a == 0.0) if op == 34 else a


@njit(cache=True, error_model="numpy")
def _plain(tape: Any, first: int, last: int, r: Any) -> None:
    """Operations that only compute."""
    for i in range(first, last, 5):
        r[tape[i + 1]] = one(tape[i], r[tape[i + 2]], r[tape[i + 3]], r[tape[i + 4]])


@njit(cache=True, error_model="numpy")
def solve_linear(m: Any, b: Any) -> bool:
    """Solves m·x = b in place (x in ``b``), with pivots; False where m is singular."""
    n = b.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(m[i, k]) > abs(m[best, k]):
                best = i
        if not abs(m[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(n):
                m[k, j], m[best, j] = m[best, j], m[k, j]
            b[k], b[best] = b[best], b[k]
        for i in range(k + 1, n):
            f = m[i, k] / m[k, k]
            for j in range(k, n):
                m[i, j] -= f * m[k, j]
            b[i] -= f * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= m[k, j] * b[j]
        b[k] /= m[k, k]
    return True


@njit(cache=True, error_model="numpy")
def _linear(tape: Any, at: int, n: int, r: Any) -> bool:
    """List at ``at``: n unknowns, n right sides, n·n coefficients row by row."""
    m, b = np.empty((n, n)), np.empty(n)
    for i in range(n):
        b[i] = r[tape[at + n + i]]
        for j in range(n):
            m[i, j] = r[tape[at + 2 * n + i * n + j]]
    if not solve_linear(m, b):
        return False
    for i in range(n):
        r[tape[at + i]] = b[i]
    return True


@njit(cache=True, error_model="numpy")
def _newton(tape: Any, at: int, n: int, r: Any) -> bool:
    """List at ``at``: first and last operation of the inner part, then as for `_linear`."""
    m, b = np.empty((n, n)), np.empty(n)
    for _ in range(ROUNDS):
        _plain(tape, tape[at], tape[at + 1], r)
        for i in range(n):
            b[i] = -r[tape[at + 2 + n + i]]
            for j in range(n):
                m[i, j] = r[tape[at + 2 + 2 * n + i * n + j]]
        if not solve_linear(m, b):
            return False
        done = True
        for i in range(n):
            k = tape[at + 2 + i]
            r[k] += b[i]
            if not abs(b[i]) <= 1e-13 * (1.0 + abs(r[k])):
                done = False
        if done:
            return True
    return False


@njit(cache=True, error_model="numpy")
def run(tape: Any, first: int, last: int, r: Any) -> bool:
    """Runs a part of the tape; False where an inner system has no solution."""
    i = first
    while i < last:
        op = tape[i]
        if op == LINEAR:
            if not _linear(tape, tape[i + 2], tape[i + 3], r):
                return False
        elif op == NEWTON:
            if not _newton(tape, tape[i + 2], tape[i + 3], r):
                return False
            i = tape[tape[i + 2] + 1] - 5  # the inner part lies behind its operation
        else:
            r[tape[i + 1]] = one(op, r[tape[i + 2]], r[tape[i + 3]], r[tape[i + 4]])
        i += 5
    return True


@njit(cache=True, error_model="numpy")
def _stages(tape: Any, r: Any, x: Any, h: float, k: Any) -> bool:
    """The seven slopes ``k`` of a sub-step from ``x``; afterwards the registers hold its end."""
    nx = x.shape[0]
    at = tape[NC] + tape[NP] + tape[NU]
    for s in range(7):
        for i in range(nx):
            total = 0.0
            for j in range(s):
                total += _A[s, j] * k[j, i]
            r[at + i] = x[i] + h * total
        if not run(tape, tape[STAGE], tape[OUT], r):
            return False
        for i in range(nx):
            k[s, i] = r[tape[tape[SLOPES] + i]]
    return True


@njit(cache=True, error_model="numpy")
def _error(tape: Any, r: Any, x: Any, h: float, k: Any, tolerance: float) -> float:
    """Largest error of a sub-step, in tolerances."""
    worst = 0.0
    at = tape[NC] + tape[NP] + tape[NU]
    for i in range(x.shape[0]):
        total = 0.0
        for j in range(7):
            total += _E[j] * k[j, i]
        size = 1.0 + max(abs(x[i]), abs(r[at + i]))
        share = abs(h * total) / (tolerance * size)
        if not share <= worst:
            worst = share
    return worst


@njit(cache=True, error_model="numpy")
def _integrate(tape: Any, r: Any, x: Any, dt: float) -> bool:
    """``x`` over one row; False where it cannot be done in the allowed number of sub-steps."""
    at, nx = tape[NC] + tape[NP] + tape[NU], x.shape[0]
    k = np.empty((7, nx))
    bits = tape[SIZE : TOLERANCE + 1].view(np.float64)
    size, tolerance = bits[0], bits[1]
    if tape[FIXED] == 1:
        parts = math.ceil(dt / size - 1e-9)
        if not parts <= tape[PARTS]:
            return False
        parts = max(parts, 1)
        for _ in range(parts):
            if not _stages(tape, r, x, dt / parts, k):
                return False
            copied(x, r[at : at + nx])
        return True
    done, h = 0.0, dt
    for _ in range(tape[PARTS]):
        h = min(h, dt - done)
        fine = _stages(tape, r, x, h, k)
        error = _error(tape, r, x, h, k, tolerance) if fine else np.inf
        if error <= 1.0:
            done += h
            copied(x, r[at : at + nx])
            if done >= dt * (1.0 - 1e-14):
                return True
        factor = 0.9 * math.pow(error, -0.2) if error > 0.0 else 5.0
        h *= min(5.0, max(0.1, factor)) if math.isfinite(error) else 0.1
        if not h > 1e-12 * dt:
            return False
    return False


@cfunc(STEP, error_model="numpy")
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row of a model."""
    tape = carray(context, context[END])
    r = np.zeros(tape[REGISTERS])
    nc, n_p, nu, nx = tape[NC], tape[NP], tape[NU], tape[NX]
    at = nc + n_p + nu
    copied(r, tape[tape[BITS] : tape[BITS] + nc].view(np.float64))
    copied(r[nc:], carray(p, (n_p,)))
    copied(r[nc + n_p :], carray(u, (nu,)))
    state, out = carray(x, (nx,)).copy(), carray(ahead, (nx,))
    if not run(tape, tape[ROW], tape[STAGE], r):
        return 1
    if nx > 0 and dt > 0.0 and not _integrate(tape, r, state, dt):
        return 1
    copied(r[at:], state)
    copied(out, state)
    if not run(tape, tape[STAGE], tape[BITS], r):
        return 1
    for i in range(tape[NY]):
        y[i] = r[tape[tape[SHOWN] + i]]
    return 0


@cfunc(OBSERVE)
def observe(context: Any, x: Any, y: Any) -> int:
    """Outputs that are states, up to a sign, adopt their measurements."""
    at = context[ADOPTS]
    for i in range(context[ADOPTED]):
        value = y[context[at + 3 * i]]
        if not math.isnan(value):
            x[context[at + 3 * i + 1]] = value * context[at + 3 * i + 2]
    return 0
