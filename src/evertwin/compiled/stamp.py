"""What kept machine code was made of: a hash over a function and over all that it names.

Numba's cache looks at the file of a function alone. Machine code holds what the function called
and the constants that it read too, so code of an older version would be called with arguments that
it does not know. The stamp says all of it, wherever it is written, and is the same for the same
source, whenever its files were written.

>>> def half(value):
...     return value * RATIO
>>> RATIO = 0.5
>>> before = stamp_of(half)
>>> RATIO = 0.25
>>> stamp_of(half) == before
False
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Iterator
from enum import EnumMeta
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

OURS = __name__.partition(".")[0]
Say = Callable[[bytes], None]


def names_of(code: CodeType) -> Iterator[str]:
    """What a function names, those inside it too."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from names_of(constant)


def stamp_of(function: object) -> str:
    """A hash over a function's code and options and what it names: functions, constants, fields."""
    told = hashlib.blake2b(digest_size=16)
    _tell(function, told.update, set(), frozenset())
    return told.hexdigest()


def _tell(it: Any, say: Say, seen: set[str], names: frozenset[str]) -> None:
    """``names``: what is read of ``it``, should it be a module."""
    say(repr(sorted(getattr(it, "options", {}).items())).encode())
    it = getattr(it, "py_func", it)
    it = inspect.unwrap(it) if callable(it) else it
    if isinstance(it, FunctionType):
        _function(it, say, seen)
    elif isinstance(it, ModuleType):
        if it.__name__.partition(".")[0] == OURS:
            for name in sorted(names & vars(it).keys()):
                say(name.encode())
                _tell(vars(it)[name], say, seen, names)
    elif isinstance(it, EnumMeta):
        say(repr([(name, it[name].value) for name in it.__members__]).encode())
    elif isinstance(it, type):
        say(repr((it.__module__, it.__qualname__, getattr(it, "_fields", ()))).encode())
    elif isinstance(it, tuple):
        for part in it:
            _tell(part, say, seen, names)
    elif isinstance(it, np.ndarray):
        say(repr((it.dtype.str, it.shape)).encode() + it.tobytes())
    elif isinstance(it, bool | int | float | str | np.generic):
        say(repr(it).encode())


def _function(it: FunctionType, say: Say, seen: set[str]) -> None:
    place = f"{it.__module__}.{it.__qualname__}"
    if place in seen or it.__module__.partition(".")[0] in ("numpy", "numba", "math"):
        return
    seen.add(place)
    say(place.encode())  # machine code looks for its module when it is loaded
    _code(it.__code__, say)
    say(repr(it.__defaults__).encode())
    module = str(getattr(it, "machine_code", "")).partition(":")[0]
    if module.partition(".")[0] == OURS and (spec := find_spec(module)) and spec.origin:
        say(Path(spec.origin).read_bytes())
    names = frozenset(names_of(it.__code__))
    for name in sorted(names & it.__globals__.keys()):
        say(name.encode())
        _tell(it.__globals__[name], say, seen, names)


def _code(code: CodeType, say: Say) -> None:
    say(code.co_code)
    say(repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            _code(constant, say)
        else:
            say(repr(constant).encode())
