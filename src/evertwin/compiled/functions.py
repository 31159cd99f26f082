"""One source, two ways to run it: plain Python at once, machine code where that pays.

Numba takes half a second to load and seconds to compile a loop; a few hundred rows take plain
Python less. So what `njit` decorates, a `Function`, runs plain until it has taken `BRIEF` seconds,
or would: then its machine code is read from Numba's cache. Where there is none yet, it is compiled
once it has taken as long as compiling it will, in this process and those before it. Both forms give
the same bits, which tests hold for every kernel.

Whatever a function names is looked up in its module, in the form that it needs: the plain form of a
function calls the plain forms of others, the compiled form their machine code.

>>> @njit(cache=True)
... def total(values):
...     found = 0.0
...     for value in values:
...         found += value
...     return found
>>> total(np.arange(4.0))
6.0
"""

from __future__ import annotations

import atexit
import importlib
import inspect
import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import cached_property, update_wrapper
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np

from evertwin.compiled.kept import (
    index_of_code,
    is_kept,
    plain_seconds,
    write_plain_seconds,
)
from evertwin.compiled.stamp import names_of, stamp_of
from evertwin.errors import UsageError

LOG = logging.getLogger("evertwin.compiled")
BRIEF = 0.3
"""Seconds that a function runs plain before Numba and its machine code are loaded."""
READ = 0.02
"""The same where Numba is loaded already."""
PER_BYTE = 1e-3
"""Seconds that compiling takes for each byte of Python's code, callees included."""
LONG = 3.0
"""Seconds of compiling from which it is said."""
SLOW = 5e-6
"""Seconds that plain Python is taken to need for each number of the longest array."""


_LOOKED_FOR: list[Function] = []
"""Functions whose machine code was looked for, and was not there."""


def _write_down() -> None:
    for function in _LOOKED_FOR:
        if function._ready is None:
            seconds = function._before + function._spent
            write_plain_seconds(function.py_func, function.stamp, seconds)


atexit.register(_write_down)


def at_once() -> None:
    """From now on all functions are machine code from their first call: the process lives long."""
    global BRIEF, READ, PER_BYTE
    BRIEF = READ = PER_BYTE = 0.0


STEP = (
    "int64(CPointer(int64), CPointer(float64), CPointer(float64), float64, CPointer(float64), "
    "CPointer(float64), CPointer(float64))"
)
OBSERVE = "int64(CPointer(int64), CPointer(float64), CPointer(float64))"
"""Signatures of a model's kernel, as Numba reads them:

    step(context*, x*, u*, dt, p*, x_next*, y*) -> int64        0: fine, else y is an error
    observe(context*, x*, y*) -> int64                          adopts y (NaN: nothing) into x
"""


Plain = TypeVar("Plain", bound=Callable[..., Any])


class _Written:
    """What both kinds of functions share: the source, and its plain form."""

    __name__: str
    __qualname__: str

    def __init__(self, py_func: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(cast("Callable[..., Any]", self), py_func)
        self.py_func, self.exact = py_func, True
        self.options = {name: given for name, given in options.items() if name != "cache"}
        self._keeps = bool(options.get("cache")) and Path(py_func.__code__.co_filename).is_file()

    def __reduce__(self) -> str:
        return self.__qualname__

    @cached_property
    def plain(self) -> Callable[..., Any]:
        """The source, run by the interpreter; so is every function that it calls, if exact."""
        return _naming(
            self.py_func, lambda it: it.plain if isinstance(it, _Written) and it.exact else it
        )

    @cached_property
    def stamp(self) -> str:
        """What machine code of it is made of."""
        return stamp_of(self)

    def _cached(self, made: Any, source: Callable[..., Any]) -> Any:
        """Numba's function, with a cache that knows code by its stamp."""
        from numba.core.caching import FunctionCache

        if self._keeps:
            cache = made._cache = FunctionCache(source)
            cache._cache_file = index_of_code()(
                cache_path=cache.cache_path, filename_base=cache._impl.filename_base,
                source_stamp=self.stamp,
            )  # fmt: skip
        return made


class Function(_Written):
    """A function of arrays and numbers; see `njit`."""

    def __init__(
        self, py_func: Callable[..., Any], options: dict[str, Any], per: str = "",
        exact: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(py_func, options)
        self.exact = exact
        names = list(inspect.signature(py_func).parameters)
        self._per = slice(names.index(per), names.index(per) + 1) if per else slice(None)
        self._spent, self._rate, self._patience = 0.0, SLOW, 0.0
        self._before = 0.0  # of processes that ended
        self._ready: Callable[..., Any] | None = None
        self._dispatchers: dict[str, Any] = {}

    @property
    def compiled(self) -> Any:
        """Numba's dispatcher."""
        return self._dispatcher("", no_cfunc_wrapper=True)

    @property
    def inner(self) -> Any:
        """The same for other machine code alone: what Python would call it by takes as long."""
        return self._dispatcher("_inner", no_cfunc_wrapper=True, no_cpython_wrapper=True)

    def _dispatcher(self, named: str, **without: bool) -> Any:
        with _compiling_alone():
            if named not in self._dispatchers:
                import numba

                source = _naming(self.py_func, _machine_code)
                source.__qualname__ += named  # a file of its own in the cache
                made = numba.njit(**self.options, **without)(source)
                _of_any_number(made)
                self._dispatchers[named] = self._cached(made, source)
            return self._dispatchers[named]

    def __call__(self, *arguments: Any) -> Any:
        if self._ready is None:
            if not self._pays(arguments):
                return self._plainly(arguments)
            self._ready = self.compiled
        if arguments and isinstance(arguments[0], CFunction):
            count = 1 + isinstance(arguments[1], CFunction)  # a model's step and observe
            arguments = (*map(int, arguments[:count]), *arguments[count:])
        return self._ready(*arguments)

    def _pays(self, arguments: tuple[Any, ...]) -> bool:
        """Would it have taken too long with these arguments?"""
        if not self.exact:
            return True
        if PER_BYTE == 0.0:
            return True
        taken = self._spent + self._rate * self._size(arguments)
        brief = READ if "numba" in sys.modules else BRIEF
        if taken <= max(brief, self._patience):
            return False
        if is_kept(self.py_func, self.stamp):
            return True
        if self._keeps and not self._patience:
            self._before = plain_seconds(self.py_func, self.stamp)
            _LOOKED_FOR.append(self)
        self._patience = taken + brief  # looking for kept code costs something, too
        pays = self._before + taken > self._compiling
        if pays and self._keeps and self._compiling > LONG:
            said = "compiling %s, once: up to %.0f s; its code is kept for every later start"
            LOG.info(said, f"{self.__module__}.{self.__name__}", self._compiling)
        return pays

    def _size(self, arguments: tuple[Any, ...]) -> int:
        """Numbers to go through: those of the longest array."""
        return max((a.size for a in _arrays(arguments[self._per])), default=1) or 1

    @cached_property
    def _compiling(self) -> float:
        """Seconds that compiling will take, about."""
        tree = {self.py_func}
        for function in (found := [self.py_func]):
            named = (function.__globals__.get(name) for name in names_of(function.__code__))
            new = {it.py_func for it in named if isinstance(it, Function)} - tree
            tree |= new
            found += new
        return PER_BYTE * sum(len(function.__code__.co_code) for function in tree)

    def _plainly(self, arguments: tuple[Any, ...]) -> Any:
        began = time.thread_time()
        before = [array.copy() for array in _arrays(arguments)]
        try:
            with np.errstate(all="ignore"):
                return _python(self.plain(*arguments))
        except (ArithmeticError, ValueError):
            # Python's own numbers raise where machine code goes on with inf or nan.
            for array, kept in zip(_arrays(arguments), before, strict=True):
                if array.flags.writeable:
                    array[...] = kept
            self._ready = self.compiled
            return self(*arguments)
        finally:
            took = time.thread_time() - began
            self._spent += took
            self._rate = max(self._rate, took / self._size(arguments))


class CFunction(_Written):
    """A function that machine code calls by its address; see `cfunc`.

    >>> @cfunc(OBSERVE)
    ... def nothing(context, x, y):
    ...     return 0
    >>> nothing.plain(None, None, None)
    0
    """

    def __init__(
        self, py_func: Callable[..., Any], signature: str, options: dict[str, Any], what: str = ""
    ) -> None:
        super().__init__(py_func, {"cache": True, **options})
        self.signature, self._what = signature, what or self.__qualname__
        self._made: Any = None
        self._address = 0

    def _compiled(self) -> Any:
        from numba.core.ccallback import CFunc
        from numba.core.errors import NumbaError, UnsupportedBytecodeError
        from numba.core.sigutils import normalize_signature

        source, kinds = _naming(self.py_func, _machine_code), normalize_signature(self.signature)
        try:
            made = self._cached(CFunc(source, kinds, {}, self.options), source)
            made.compile()
        except (NumbaError, UnsupportedBytecodeError) as error:
            raise UsageError(
                f"{self._what} cannot be compiled: expected arithmetic on numbers, with math "
                f"alone; {error}"
            ) from error
        return made

    @property
    def address(self) -> int:
        """Where its machine code stands, for as long as this object lives.

        Raises:
            UsageError: Numba cannot compile the source.
        """
        return self._address or self._placed()

    def _placed(self) -> int:
        with _compiling_alone():
            if not self._address:  # another thread may have been first
                self._made = self._compiled()
                self._address = int(self._made.address)
        return self._address

    def __index__(self) -> int:
        return self.address


def _compiling_alone() -> AbstractContextManager[None]:
    """Numba's own lock, before any other: two threads that take several wait for ever else."""
    from numba.core.compiler_lock import global_compiler_lock

    return cast("AbstractContextManager[None]", global_compiler_lock)


def njit(
    per: str = "", *, exact: bool = True, **options: Any
) -> Callable[[Callable[..., Any]], Function]:
    """Decorates a function that is written as `numba.njit` wants it, with its options.

    Args:
        per: argument whose size the work is in proportion to, where it is not the longest array.
        exact: do both forms give the same bits? Else it always runs as machine code.
        options: of `numba.njit`.
    """
    return lambda py_func: Function(py_func, options, per, exact)


def cfunc(signature: str, **options: Any) -> Callable[[Callable[..., Any]], CFunction]:
    """Decorates a function that others call by its address; compiled when that is first asked.

    Args:
        signature: as Numba reads it, such as `STEP`.
        options: of `numba.cfunc`.
    """
    return lambda py_func: CFunction(py_func, signature, options)


def instead(machine_code: str) -> Callable[[Plain], Plain]:
    """Decorates the plain form of what compiled functions have ``machine_code`` for.

    Args:
        machine_code: ``module:name`` of something that Numba knows.
    """

    def marked(function: Plain) -> Plain:
        function.__dict__["machine_code"] = machine_code
        return function

    return marked


def _of_any_number(made: Any) -> None:
    """Makes no code of its own for each number that a call has written down, as Numba would."""
    from numba.core.types.containers import BaseNamedTuple, BaseTuple
    from numba.core.types.misc import unliteral

    def plain(it: Any) -> Any:
        if not isinstance(it, BaseTuple):
            return unliteral(it)
        named = it.instance_class if isinstance(it, BaseNamedTuple) else None
        return BaseTuple.from_types(tuple(map(plain, it)), named)

    asked = made.get_call_template
    made.get_call_template = lambda args, kws: asked(tuple(map(plain, args)), kws)


def _machine_code(it: Any) -> Any:
    if isinstance(it, Function):
        return it.inner
    name = getattr(it, "machine_code", None) if callable(it) else None
    if name is None:
        return it
    module, _, name = name.partition(":")
    return getattr(importlib.import_module(module), name)


def _naming(function: Callable[..., Any], form: Callable[[Any], Any]) -> Callable[..., Any]:
    """The function with everything that it names in another form."""
    assert isinstance(function, FunctionType)
    space = dict(function.__globals__)
    code, defaults, inside = function.__code__, function.__defaults__, function.__closure__
    made = FunctionType(code, space, function.__name__, defaults, inside)
    made.__qualname__, made.__module__ = function.__qualname__, function.__module__
    for name in names_of(code):
        if name in space:
            itself = getattr(space[name], "py_func", None) is function
            space[name] = made if itself else form(space[name])
    return made


def _arrays(values: tuple[Any, ...]) -> Iterator[np.ndarray]:
    """All arrays among the values, those of named tuples too."""
    for value in values:
        if isinstance(value, np.ndarray):
            yield value
        elif isinstance(value, tuple):
            yield from _arrays(value)


def _python(result: Any) -> Any:
    """Numbers as compiled functions give them."""
    if isinstance(result, np.generic):
        return result.item()
    return tuple(map(_python, result)) if type(result) is tuple else result
