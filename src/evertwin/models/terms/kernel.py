"""The arithmetic of correction terms, compiled: from the commanded input to the effective one.

Everything a kernel needs about the terms lies in one int64 array, the *plan*: a header, then one
record a term with the addresses of its functions (`evertwin.models.terms.contract`), its place in
the parameters, its `Place` and its grids (as the bits of floats). The plan is written by
`evertwin.models.corrected.corrected`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from inspect import unwrap
from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import OBSERVE, STEP, CFunction, cfunc, njit
from evertwin.compiled.memory import carray, copied, room
from evertwin.models.kernels.kernel import ANEW
from evertwin.models.terms.contract import CorrectionTerm, Place
from evertwin.models.terms.registry import KINDS, kind

# Header: length, inner step, inner observe, inner context, nu, nx inner, nx, np, ny, terms.
HEADER = 10
LENGTH, BEFORE, AFTER, ADOPTED, PARAMETER = range(5)
PLACE = 5
RECORD = PLACE + len(Place._fields)
"""Record: its length, three addresses (0: none), first parameter, then its `Place` and grids."""
MEMORY = PLACE + Place._fields.index("memory")

_SIGNATURES = {
    "before": "int64(CPointer(int64), CPointer(float64), CPointer(float64), float64, "
    "CPointer(float64), CPointer(float64))",
    "after": "int64(CPointer(int64), float64, CPointer(float64), CPointer(float64), "
    "CPointer(float64), CPointer(float64))",
    "adopted": "int64(CPointer(int64), CPointer(float64), CPointer(float64))",
}


@njit(cache=True)
def placed(at: Any) -> Place:
    """The term's place, from what its function is given."""
    return Place(at[0], at[1], at[2], at[3], at[4], at[5], at[6], at[7])


@njit(cache=True)
def cell(v: float, grid: Any, first: int, n: int) -> tuple[int, float]:
    """Cell of a grid and the share of its upper edge; values outside sit on the border."""
    v = min(max(v, grid[first]), grid[first + n - 1])
    k, above = 0, n - 1
    while above - k > 1:
        middle = (k + above) // 2
        if grid[first + middle] < v:
            k = middle
        else:
            above = middle
    return k, (v - grid[first + k]) / (grid[first + k + 1] - grid[first + k])


def resolve(plan: np.ndarray, names: Sequence[str]) -> None:
    """Puts the addresses of this process into a plan; ``names``: the kind of each term."""
    address(plan, [kind(name) for name in names])


def address(plan: np.ndarray, kinds: Sequence[CorrectionTerm]) -> None:
    """The same, for kinds."""
    at = HEADER
    for own in kinds:
        found = [(role, getattr(own.functions, role)) for role in _SIGNATURES]
        plan[at + BEFORE : at + ADOPTED + 1] = [
            0 if function is None else int(_compiled(own.kind, role, function).address)
            for role, function in found
        ]
        at += int(plan[at])


def ready() -> None:
    """Every kind of the package, and what applies it, as machine code: no first correction waits
    for a compiler."""
    for own in map(kind, KINDS):
        for role in _SIGNATURES:
            function = getattr(own.functions, role)
            if function is not None:
                _compiled(own.kind, role, function).__index__()
    for function in (step, adopt):
        function.__index__()


@cache
def _compiled(name: str, role: str, function: Callable[..., Any]) -> CFunction:
    """The C function; the cache keeps it alive."""
    what = f"correction term {name!r}: its function {role!r}"
    return CFunction(unwrap(function), _SIGNATURES[role], {}, what)


@njit(cache=True)
def effective(plan: Any, u: int, dt: float, p: int, x: int) -> int:
    """Applies the terms in order to the inputs at ``u`` and to their memory, in place.

    Args:
        u, p, x: addresses of a row's inputs, of the parameters and of the states.

    Returns:
        0, or 1 where an input is not finite.
    """
    at, here = HEADER, plan.ctypes.data
    for _ in range(plan[9]):
        if plan[at + BEFORE] != 0:
            failed = call(
                plan[at + BEFORE], here + 8 * (at + PLACE), here + 8 * (at + RECORD), u, dt,
                p + 8 * plan[at + PARAMETER], x + 8 * plan[at + MEMORY],
            )  # fmt: skip
            if failed != 0:
                return 1
        at += plan[at]
    return 0


@njit(cache=True)
def effective_rows(plan: Any, u: Any, p: Any) -> None:
    """Terms without memory over many rows, in place."""
    none = np.zeros(1)
    for i in range(u.shape[0]):
        effective(plan, u[i].ctypes.data, 0.0, p.ctypes.data, none.ctypes.data)


@njit(cache=True, nogil=True)
def effective_run(plan: Any, x: Any, u: Any, dt: Any, p: Any, code: Any) -> Any:
    """What the terms make of the inputs of a whole roll-out from ``x``, (n, nu).

    NaN where `step` would fail; ``code`` is that of `evertwin.models.kernels.kernel.Restart`.
    """
    out, now, ahead = u.copy(), x.copy(), x.copy()
    for i in range(u.shape[0]):
        if code[i] == ANEW:
            copied(now, x)
            continue
        copied(ahead, now)
        if effective(plan, out[i].ctypes.data, dt[i], p.ctypes.data, ahead.ctypes.data) != 0:
            out[i, :] = np.nan
        else:
            copied(now, ahead)
    return out


@njit(cache=True)
def _behind(plan: Any, dt: float, p: int, x: int, ahead: int, y: int) -> int:
    """What terms do behind the inner model's step; 0: fine."""
    at, here, failed = HEADER, plan.ctypes.data, 0
    for _ in range(plan[9]):
        if plan[at + AFTER] != 0:
            failed |= call(
                plan[at + AFTER], here + 8 * (at + PLACE), dt, p + 8 * plan[at + PARAMETER], x,
                ahead, y,
            )  # fmt: skip
        at += plan[at]
    return failed


@njit(cache=True)
def _adopted(plan: Any, before: int, x: int) -> None:
    """What terms do once the inner model has adopted a measurement."""
    at, here = HEADER, plan.ctypes.data
    for _ in range(plan[9]):
        if plan[at + ADOPTED] != 0:
            call(plan[at + ADOPTED], here + 8 * (at + PLACE), before, x)
        at += plan[at]


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, x_next: Any, y: Any) -> Any:
    """One row: terms, inner step, what terms do behind it."""
    plan = carray(context, (carray(context, (1,))[0],))
    now, ahead = carray(x, (plan[6],)), carray(x_next, (plan[6],))
    numbers, out = carray(p, (plan[7],)), carray(y, (plan[8],))
    inputs = carray(room(plan[4]), (plan[4],))
    copied(inputs, carray(u, (plan[4],)))
    first = plan[5]
    for i in range(first, plan[6]):
        ahead[i] = now[i]
    at, given = ahead.ctypes.data, numbers.ctypes.data
    if effective(plan, inputs.ctypes.data, dt, given, at) != 0:
        copied(ahead, now)
        out[:] = np.nan
        return 1
    failed = call(
        plan[1], plan[3], now.ctypes.data, inputs.ctypes.data, dt, given, at, out.ctypes.data
    )
    return failed | _behind(plan, dt, given, now.ctypes.data, at, out.ctypes.data)


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> Any:
    """The inner model adopts; terms keep what they have to keep."""
    plan = carray(context, (carray(context, (1,))[0],))
    now = carray(x, (plan[6],))
    before = carray(room(plan[5]), (plan[5],))
    copied(before, now[: plan[5]])
    call(plan[2], plan[3], now.ctypes.data, carray(y, (plan[8],)).ctypes.data)
    _adopted(plan, before.ctypes.data, now.ctypes.data)
    return 0
