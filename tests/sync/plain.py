"""The plain-Python twin of a compiled loop: the same source, run by the interpreter.

Calls of compiled models go to the same address through ctypes.
"""

from __future__ import annotations

import ctypes
import types
from collections.abc import Callable
from typing import Any

from numba.core.dispatcher import Dispatcher

from evertwin.models.native import call_observe, call_step
from evertwin.sync.borrow import borrowed

I64, F64 = ctypes.c_int64, ctypes.c_double
_STEP = ctypes.CFUNCTYPE(I64, I64, I64, I64, F64, I64, I64, I64)
_OBSERVE = ctypes.CFUNCTYPE(I64, I64, I64, I64)


def _step(address: int, c: int, x: int, u: int, dt: float, p: int, ahead: int, y: int) -> int:
    return int(_STEP(address)(c, x, u, dt, p, ahead, y))


def _observe(address: int, c: int, x: int, y: int) -> int:
    return int(_OBSERVE(address)(c, x, y))


def _same(array: Any) -> Any:
    return array


def plain(function: Any) -> Callable[..., Any]:
    """``function`` and all compiled functions that it calls, as plain Python."""
    source = function.py_func
    names = {}
    for name, value in source.__globals__.items():
        if value is call_step:
            names[name] = _step
        elif value is call_observe:
            names[name] = _observe
        elif value is borrowed:
            names[name] = _same
        elif isinstance(value, Dispatcher) and name != source.__name__:
            names[name] = plain(value) if name in source.__code__.co_names else value
    return types.FunctionType(source.__code__, {**source.__globals__, **names})
