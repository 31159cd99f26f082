"""Calls of C functions by address, from compiled code.

All whole numbers and pointers travel as 64 bits: a function that expects fewer reads the lower
ones. Every function gives FMI's status, 32 bits.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

__all__ = ["call1", "call2", "call3", "call4", "call5", "do_step2", "do_step3", "set_time"]

_I, _F = ir.IntType(64), ir.DoubleType()


def _emit(builder: Any, arguments: Any) -> Any:
    kinds = [argument.type for argument in arguments[1:]]
    function = ir.FunctionType(ir.IntType(32), kinds)
    pointer = builder.inttoptr(arguments[0], function.as_pointer())
    return builder.sext(builder.call(pointer, arguments[1:]), _I)


def _code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return _emit(builder, list(arguments))


_i, _f = types.int64, types.float64


@intrinsic
def call1(typing: Any, f: Any, a: Any) -> Any:
    """``f(a)``."""
    return _i(_i, _i), _code


@intrinsic
def call2(typing: Any, f: Any, a: Any, b: Any) -> Any:
    """``f(a, b)``."""
    return _i(_i, _i, _i), _code


@intrinsic
def call3(typing: Any, f: Any, a: Any, b: Any, c: Any) -> Any:
    """``f(a, b, c)``."""
    return _i(_i, _i, _i, _i), _code


@intrinsic
def call4(typing: Any, f: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """``f(a, b, c, d)``."""
    return _i(_i, _i, _i, _i, _i), _code


@intrinsic
def call5(typing: Any, f: Any, a: Any, b: Any, c: Any, d: Any, e: Any) -> Any:
    """``f(a, b, c, d, e)``."""
    return _i(_i, _i, _i, _i, _i, _i), _code


@intrinsic
def set_time(typing: Any, f: Any, a: Any, t: Any) -> Any:
    """``f(a, t)`` with a number ``t``."""
    return _i(_i, _i, _f), _code


@intrinsic
def do_step2(typing: Any, f: Any, a: Any, t: Any, h: Any, b: Any) -> Any:
    """FMI 2: ``f(instance, time, step, flag)``."""
    return _i(_i, _i, _f, _f, _i), _code


@intrinsic
def do_step3(typing: Any, f: Any, a: Any, t: Any, h: Any, b: Any, c: Any, d: Any, e: Any,
             g: Any) -> Any:  # fmt: skip
    """FMI 3: ``f(instance, time, step, flag, event, end, early, last)``."""
    return _i(_i, _i, _f, _f, _i, _i, _i, _i, _i), _code
