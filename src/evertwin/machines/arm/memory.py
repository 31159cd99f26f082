"""Memory of a compiled step: constants behind an address, and room on the stack.

A kernel gets one ``int64`` array as its context. The arm's geometry is made of real numbers, so the
context holds the address of an array of them, and `reals` makes it readable. `scratch` is working
memory without an allocation: a step must neither allocate nor share memory between threads.

Both have a plain-Python twin, so that a kernel's source runs uncompiled in the tests.

>>> import numpy as np
>>> kept = np.array([1.5, 2.5])
>>> float(reals(kept.ctypes.data)[1])
2.5
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

SCRATCH = 160
"""Reals in one piece of working memory: `JOINTS` joints with ten reals each."""
JOINTS = 16
"""Joints that a compiled arm can have."""
MOST = 1 << 22
"""Reals that lie behind one address at most; what is not there is never touched."""


def reals(address: int) -> Any:
    """The float64 values that start at ``address``, to be indexed; not bounded."""
    return np.ctypeslib.as_array((ctypes.c_double * MOST).from_address(int(address)))


def scratch() -> Any:
    """`SCRATCH` reals that live as long as the call."""
    return np.zeros(SCRATCH)


@intrinsic
def _reals(typing: Any, address: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(types.int64), code


@intrinsic
def _scratch(typing: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return cgutils.alloca_once(builder, ir.DoubleType(), size=SCRATCH)

    return types.CPointer(types.float64)(), code


overload(reals)(lambda address: lambda address: _reals(address))
# Inlined, because memory on the stack ends with the function that asked for it.
overload(scratch, inline="always")(lambda: lambda: _scratch())
