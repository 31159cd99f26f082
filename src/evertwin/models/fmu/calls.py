"""Calls of C functions by address, from compiled code.

All whole numbers and pointers travel as 64 bits: a function that expects fewer reads the lower
ones. Every function gives FMI's status, 32 bits.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def call(typing: Any, function: Any, arguments: Any) -> Any:
    """The status of the function at address ``function``, given whole numbers and numbers."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        given = cgutils.unpack_tuple(builder, values[1])
        kind = ir.FunctionType(ir.IntType(32), [value.type for value in given])
        pointer = builder.inttoptr(values[0], kind.as_pointer())
        return builder.sext(builder.call(pointer, given), ir.IntType(64))

    return types.int64(types.int64, arguments), code
