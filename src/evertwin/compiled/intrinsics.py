"""What `evertwin.compiled.calls` and `evertwin.compiled.memory` are in machine code."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from evertwin.compiled.memory import SCRATCH

_REALS = types.CPointer(types.float64)


def _calling(result: ir.Type, builder: Any, arguments: Any) -> Any:
    """Whole numbers, pointers among them, travel as 64 bits."""
    address, packed = arguments
    given = cgutils.unpack_tuple(builder, packed)
    function = ir.FunctionType(result, [value.type for value in given])
    return builder.call(builder.inttoptr(address, function.as_pointer()), given)


def _number(kind: Any) -> Any:
    """What a C function takes: pointers as they are, the rest as 64 bits."""
    if isinstance(kind, types.Float | types.CPointer):
        return kind
    return types.int64


@intrinsic
def call(typing: Any, address: Any, *numbers: Any) -> Any:
    """``f(*numbers)`` for the function at ``address``; gives an int64."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _calling(ir.IntType(64), builder, arguments)

    given = types.BaseTuple.from_types(tuple(map(_number, numbers)))
    return types.int64(types.int64, given), code


@intrinsic
def call_real(typing: Any, address: Any, *numbers: Any) -> Any:
    """``f(*numbers)`` for the function at ``address``; gives a float64."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _calling(ir.DoubleType(), builder, arguments)

    given = types.BaseTuple.from_types(tuple(map(_number, numbers)))
    return types.float64(types.int64, given), code


@intrinsic
def borrowed(typing: Any, lent: Any) -> Any:
    """An array, or all of a tuple, without an owner."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _disowned(context, builder, signature.args[0], arguments[0])

    return lent(lent), code


def _disowned(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.Array):
        view = context.make_array(kind)(context, builder, value)
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()
    for k, one in enumerate(kind if isinstance(kind, types.BaseTuple) else ()):
        part = _disowned(context, builder, one, builder.extract_value(value, k))
        value = builder.insert_value(value, part, k)
    return value


@intrinsic
def reals(typing: Any, address: Any) -> Any:
    """A pointer."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.DoubleType().as_pointer())

    return _REALS(types.int64), code


@intrinsic
def scratch(typing: Any) -> Any:
    """Room on the stack of the function that asks for it."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return cgutils.alloca_once(builder, ir.DoubleType(), size=SCRATCH)

    return _REALS(), code


@intrinsic
def room(typing: Any, size: Any) -> Any:
    """As much of it as is asked for."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.alloca(ir.DoubleType(), arguments[0])

    return _REALS(types.int64), code


@intrinsic
def behind(typing: Any, p: Any, place: Any) -> Any:
    """A pointer into an array or behind a pointer."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        first = arguments[0]
        if isinstance(signature.args[0], types.Array):
            first = cgutils.create_struct_proxy(signature.args[0])(context, builder, first).data
        return builder.gep(first, [arguments[1]])

    return _REALS(p, types.int64), code


@njit
def copied(into: Any, values: Any) -> None:
    """One number after the other."""
    for i in range(len(values)):
        into[i] = values[i]


@njit
def ordered(values: Any) -> Any:
    """Shell's way: numbers far apart change places first."""
    found = values.copy()
    gap = len(found) // 2
    while gap > 0:
        for i in range(gap, len(found)):
            value, place = found[i], i
            while place >= gap and found[place - gap] > value:
                found[place] = found[place - gap]
                place -= gap
            found[place] = value
        gap = 1 if gap == 2 else gap * 5 // 11
    return found
