"""Memory that a compiled function reaches by an address, or has for the time of a call.

>>> kept = np.array([1.5, 2.5])
>>> float(reals(kept.ctypes.data)[1]), behind(kept, 1).tolist()
(2.5, [2.5])
"""

from __future__ import annotations

import ctypes
from typing import Any, TypeVar

import numpy as np

from evertwin.compiled.functions import instead

Lent = TypeVar("Lent")

SCRATCH = 160
"""Reals in one piece of working memory."""
MOST = 1 << 22
"""Reals that lie behind one address at most; what is not there is never touched."""


@instead("numba:carray")
def carray(pointer: Any, shape: tuple[int, ...]) -> Any:
    """The array that starts at a pointer, or where an array starts."""
    if isinstance(pointer, np.ndarray):
        return pointer.ravel()[: int(np.prod(shape))].reshape(shape)
    return np.ctypeslib.as_array(pointer, tuple(map(int, shape)))


@instead("evertwin.compiled.intrinsics:borrowed")
def borrowed(lent: Lent) -> Lent:
    """An array, or all arrays of a tuple, without an owner: whoever borrows must not outlive who
    lends.

    Numba counts references to an array atomically, at each call and each assignment; in a loop
    that judges one row after the other this costs more than the judging.
    """
    return lent


@instead("evertwin.compiled.intrinsics:reals")
def reals(address: int) -> Any:
    """The float64 values that start at ``address``, to be indexed; not bounded."""
    return np.ctypeslib.as_array((ctypes.c_double * MOST).from_address(int(address)))


@instead("evertwin.compiled.intrinsics:scratch")
def scratch() -> Any:
    """`SCRATCH` reals that live as long as the call: a step must neither allocate nor share."""
    return np.zeros(SCRATCH)


@instead("evertwin.compiled.intrinsics:room")
def room(size: int) -> Any:
    """Room for ``size`` reals, as `scratch`; not for a function that asks in a loop."""
    return np.zeros(size)


@instead("evertwin.compiled.intrinsics:copied")
def copied(into: Any, values: Any) -> None:
    """Fills ``into`` with as many ``values``. Numba compiles four seconds for a slice that takes an
    array, most of it the sentence for arrays of other shapes.
    """
    into[: len(values)] = values


@instead("evertwin.compiled.intrinsics:ordered")
def ordered(values: Any) -> Any:
    """The numbers in rising order, none of them NaN; for the same reason."""
    return np.sort(values)


@instead("evertwin.compiled.intrinsics:behind")
def behind(p: Any, place: int) -> Any:
    """The numbers of ``p``, an array or a pointer, from ``place`` on."""
    if isinstance(p, np.ndarray):
        return p[place:]
    return ctypes.cast(ctypes.addressof(p.contents) + 8 * int(place), type(p))
