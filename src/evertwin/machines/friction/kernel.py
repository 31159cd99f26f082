"""Friction, compiled: a law as integers, and the sum of its terms.

A machine's kernel keeps a law's *record* among its own integers (`record_of`). Features and slope
bounds are plain functions (`evertwin.machines.friction.contract`); each is compiled for itself and
called at its address. A call costs as much as a whole sum of simple features, so that the oldest
terms are compiled into the sum, each behind a test of its own.

>>> import numpy as np
>>> from evertwin.machines.friction import Law
>>> law = Law()
>>> p = np.array([item.value for item in law.parameters()])
>>> bool(force(record_of(law, 0), 0, p, 2.0, 0.0, 0.0, 0.0, law.standstill) == p @ [2.0, 1.0, 1.0])
True
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from inspect import unwrap
from typing import Any

import numpy as np

from evertwin.compiled.calls import call_real
from evertwin.compiled.functions import CFunction, njit
from evertwin.compiled.memory import behind
from evertwin.machines.friction.contract import FrictionTerm
from evertwin.machines.friction.law import Law
from evertwin.machines.friction.terms import (
    coulomb,
    direction,
    load,
    offset,
    root,
    stribeck,
    viscous,
)
from evertwin.types import Int64

COUNT, WIDTH = range(2)
HEAD = 2
"""Integers of a record: number of columns called by address, place of the switch's width in ``p``
(−1: a sign); then two for every term in `_MODULES` (places of coefficient and shape, −1 where the
law lacks it), then the columns."""
FEATURE, SLOPE, PLACE, SHAPE = range(4)
COLUMN = 4
"""Integers of a column: feature and slope bound (their place in `_MODULES`, else their address),
places in ``p`` of the coefficient and of the term's first shape number."""


_FEATURE = "float64(float64, float64, float64, float64, float64, CPointer(float64))"
_SLOPE = "float64(float64, float64, float64, CPointer(float64))"

_MODULES = (viscous, direction, coulomb, offset, stribeck, root, load)
"""Terms that are compiled into the sums, in the order of `feature` and `slope`."""
_viscous, _direction, _coulomb, _offset, _stribeck, _root, _load = (
    njit(inline="always")(unwrap(module.feature)) for module in _MODULES
)
_viscous2, _direction2, _coulomb2, _offset2, _stribeck2, _root2, _load2 = (
    njit(inline="always")(unwrap(module.slope)) for module in _MODULES
)

INSIDE = len(_MODULES)


@njit(cache=True)
def switch(v: float, width: float, standstill: float) -> float:
    """``tanh(v / width)`` for a width above zero, else the sign outside the standstill."""
    if width > 0.0:
        return math.tanh(v / width)
    if v > standstill:
        return 1.0
    if v < -standstill:
        return -1.0
    return 0.0


@njit(cache=True)
def feature(code: int, v: float, s: float, load: float, T: float, q: float, k: Any) -> float:
    """What a coefficient is multiplied with; ``s``: the switch at ``v``."""
    if code == 0:
        return _viscous(v, s, load, T, q, k)  # type: ignore[no-any-return]
    if code == 1:
        return _direction(v, s, load, T, q, k)  # type: ignore[no-any-return]
    if code == 2:
        return _coulomb(v, s, load, T, q, k)  # type: ignore[no-any-return]
    if code == 3:
        return _offset(v, s, load, T, q, k)  # type: ignore[no-any-return]
    if code == 4:
        return _stribeck(v, s, load, T, q, k)  # type: ignore[no-any-return]
    if code == 5:
        return _root(v, s, load, T, q, k)  # type: ignore[no-any-return]
    if code == 6:
        return _load(v, s, load, T, q, k)  # type: ignore[no-any-return]
    return call_real(code, v, s, load, T, q, k)


@njit(cache=True)
def slope(code: int, width: float, load: float, T: float, k: Any) -> float:
    """The slope bound of a feature."""
    if code == 0:
        return _viscous2(width, load, T, k)  # type: ignore[no-any-return]
    if code == 1:
        return _direction2(width, load, T, k)  # type: ignore[no-any-return]
    if code == 2:
        return _coulomb2(width, load, T, k)  # type: ignore[no-any-return]
    if code == 3:
        return _offset2(width, load, T, k)  # type: ignore[no-any-return]
    if code == 4:
        return _stribeck2(width, load, T, k)  # type: ignore[no-any-return]
    if code == 5:
        return _root2(width, load, T, k)  # type: ignore[no-any-return]
    if code == 6:
        return _load2(width, load, T, k)  # type: ignore[no-any-return]
    return call_real(code, width, load, T, k)


@njit(cache=True)
def width_of(laws: Any, at: int, p: Any) -> float:
    """Width of the switch of the law at ``at``; 0: a sign."""
    return float(p[laws[at + WIDTH]]) if laws[at + WIDTH] >= 0 else 0.0


@njit(cache=True)
def force(
    laws: Any, at: int, p: Any, v: float, load: float, T: float, q: float, standstill: float
) -> float:
    """Friction by the law whose record starts at ``at``; positive against positive motion."""
    s = switch(v, width_of(laws, at, p), standstill)
    total = 0.0
    # Unrolled by the compiler, which leaves one test of each feature.
    for code in range(INSIDE):
        c = at + HEAD + 2 * code
        if laws[c] >= 0:
            total += p[laws[c]] * feature(code, v, s, load, T, q, behind(p, laws[c + 1]))
    for number in range(laws[at + COUNT]):
        c = at + HEAD + 2 * INSIDE + COLUMN * number
        k = behind(p, laws[c + SHAPE])
        total += p[laws[c + PLACE]] * call_real(laws[c + FEATURE], v, s, load, T, q, k)
    return total


@njit(cache=True)
def steepness(laws: Any, at: int, p: Any, load: float, T: float) -> float:
    """The largest slope of `force` over speed, at most; a sign's jump is left out."""
    width, total = width_of(laws, at, p), 0.0
    for code in range(INSIDE):
        c = at + HEAD + 2 * code
        if laws[c] >= 0:
            total += abs(p[laws[c]]) * slope(code, width, load, T, behind(p, laws[c + 1]))
    for number in range(laws[at + COUNT]):
        c = at + HEAD + 2 * INSIDE + COLUMN * number
        k = behind(p, laws[c + SHAPE])
        total += abs(p[laws[c + PLACE]]) * call_real(laws[c + SLOPE], width, load, T, k)
    return total


@njit(cache=True)
def fill(column: Any, p: Any, rows: Any, standstill: float, width: float, out: Any) -> None:
    """One feature over rows, into ``out``; ``rows``: v, load, T and q, (4, n)."""
    k = behind(p, column[SHAPE])
    for i in range(out.shape[0]):
        s = switch(rows[0, i], width, standstill)
        out[i] = feature(column[FEATURE], rows[0, i], s, rows[1, i], rows[2, i], rows[3, i], k)


def columns_of(law: Law, first: int) -> Int64[np.ndarray, "k 4"]:
    """Feature, slope bound and places in ``p`` of every coefficient of a law.

    Args:
        first: place of the law's first parameter; the others follow.
    """
    columns, place, shape = [], first, first + len(law.coefficients)
    for item in law.terms:
        for one in item.coefficients:
            codes = _code(item, one.feature, "feature"), _code(item, one.slope, "slope")
            columns.append((*codes, place, shape if item.shape else first))
            place += 1
        shape += len(item.shape)
    return np.array(columns, dtype=np.int64)


def record_of(law: Law, first: int) -> Int64[np.ndarray, " k"]:
    """The integers of a law, whose first parameter lies at ``first`` in ``p``."""
    inside, others = np.full((INSIDE, 2), -1), []
    for column in columns_of(law, first):
        if column[FEATURE] < INSIDE:
            inside[column[FEATURE]] = column[PLACE], column[SHAPE]
        else:
            others.append(column)
    end = first + len(law.parameters())
    head = np.array([len(others), end - 1 if law.switch == "tanh" else -1])
    return np.concatenate([head, inside.ravel(), *others]).astype(np.int64)


def _code(item: FrictionTerm, function: Callable[..., float], what: str) -> int:
    """The number of a function that is compiled into the sums, else its address."""
    inside = [getattr(module, what) for module in _MODULES]
    if function in inside:
        return inside.index(function)
    return int(_compiled(item.name, function, what).address)


@cache
def _compiled(name: str, function: Callable[..., float], what: str) -> CFunction:
    """The C function; the cache keeps it alive."""
    signature = _FEATURE if what == "feature" else _SLOPE
    return CFunction(unwrap(function), signature, {}, f"friction term {name!r}: its {what}")
