"""What every test shares: shapes checked at run time, and the folder of real recordings.

Shapes and types of evertwin's functions are checked while the tests run (jaxtyping with beartype).
Modules that compile kernels are left out: Numba must see the plain function. The hook is installed
here because it has to come before the first import of evertwin. JAXTYPING_DISABLE=1 switches it
off.
"""

from __future__ import annotations

import ast
import dataclasses
import doctest
import functools
import gc
import importlib
import inspect
import os
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

import jaxtyping
import numpy as np
import pytest
from jaxtyping import install_import_hook

# Python looks for garbage after every 700 new objects: a tenth of the time of tests and compiling.
gc.set_threshold(50_000, 20, 50)

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "evertwin"


COMPILING = {"cfunc", "instead", "njit"}
"""Decorators of `evertwin.compiled.functions`."""


def compiles(source: str) -> bool:
    """True if the module imports Numba, llvmlite, or a decorator of compiled functions."""
    if not any(word in source for word in ("numba", "llvmlite", *COMPILING)):
        return False  # parsing every file takes two seconds of each process
    for node in ast.walk(ast.parse(source)):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        if any(name.split(".")[0] in ("numba", "llvmlite") for name in names):
            return True
        if isinstance(node, ast.ImportFrom) and COMPILING & {a.name for a in node.names}:
            return True
    return False


def hooked_modules() -> list[str]:
    """Every leaf module of evertwin that holds plain Python; packages only re-export."""
    return [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for path in sorted(PACKAGE.rglob("*.py"))
        if not path.name.startswith("__") and not compiles(path.read_text(encoding="utf-8"))
    ]


OFTEN = 20
"""So many calls of a function are checked in each test."""
LONG = 20
"""Letters from which on a text is no word."""
_calls: Counter[int] = Counter()
_made: Counter[int] = Counter()


def kind(value: Any) -> Any:
    """What a check sees of a value: equal for two values that are both sound or both not."""
    of = type(value)
    if of is np.ndarray:
        return value.dtype, value.shape
    if of is tuple:
        return of, *map(kind, value)
    if of is list:
        return of, *map(kind, value[:1] + value[-1:])
    if of is dict:
        return of, *map(kind, next(iter(value.items()), ()))
    return value if of is str and len(value) < LONG else of  # a word may be one of a few


def at_first(checked: Callable[..., Any]) -> Callable[..., Any]:
    """A decorator whose functions are checked in the first calls of each test.

    Checks of all calls took half of the time of long tests, and those of calls of a kind that was
    found sound before a third. Each check is made when it is first needed: making it takes a
    thousand times as long as making a function, so those in functions, which are made with each
    call, are left alone after a while.
    """

    def seldom(it: FunctionType, check: Callable[[Any], Any]) -> Callable[..., Any]:
        key, checked = id(it.__code__), None
        ended: dict[int, Any] = {}
        known: dict[Any, set[Any]] = {}

        def run(*arguments: Any, **named: Any) -> Any:
            """The call, or what came of it in this thread, to be checked behind it."""
            return ended[thread()] if thread() in ended else it(*arguments, **named)

        thread = threading.get_ident
        again = FunctionType(run.__code__, it.__globals__, it.__name__, None, run.__closure__)
        functools.update_wrapper(again, it)

        @functools.wraps(it)
        def told(*arguments: Any, **named: Any) -> Any:
            nonlocal checked
            if _calls[key] >= OFTEN:
                return it(*arguments, **named)
            _calls[key] += 1
            given = kind(arguments), kind(tuple(named.items()))
            if sound := known.get(given):
                result = it(*arguments, **named)
                if kind(result) in sound:
                    return result
                ended[thread()] = result
            checked = checked or check(again)
            try:
                result = checked(*arguments, **named)
            finally:
                ended.pop(thread(), None)
            known.setdefault(given, set()).add(kind(result))
            return result

        return told

    def decorator(**options: Any) -> Callable[[Any], Any]:
        check = checked(**options)

        def told(it: Any) -> Any:
            if dataclasses.is_dataclass(it) and isinstance(start := it.__init__, FunctionType):
                it.__init__ = seldom(start, check)  # type: ignore[misc]
                return it
            if not isinstance(it, FunctionType):
                return check(it)
            if "<locals>" in it.__qualname__:
                _made[id(it.__code__)] += 1
                if _made[id(it.__code__)] > OFTEN:
                    return it
            return seldom(it, check)

        return told

    return decorator


# An int is welcome where a float is expected, as PEP 484 has it. A hint that cannot be checked at
# run time leaves that one function unchecked.
CHECKER = (
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True, "
    "warning_cls_on_decorator_exception=beartype.roar.BeartypeClawDecorWarning))"
)
install_import_hook(hooked_modules(), CHECKER)
jaxtyping.jaxtyped = at_first(jaxtyping.jaxtyped)  # type: ignore[assignment]


from evertwin.compiled import functions  # noqa: E402  (the hook comes before evertwin)
from planted.postgres import Server, programs  # noqa: E402


def _from_module(
    self: doctest.DocTestFinder,
    module: object,
    obj: object,
    original: Callable[..., bool] = doctest.DocTestFinder._from_module,  # type: ignore[attr-defined]
) -> bool:
    """See through the wrapper of the hook, so that a function's examples are still collected."""
    return original(self, module, inspect.unwrap(obj) if callable(obj) else obj)


doctest.DocTestFinder._from_module = _from_module  # type: ignore[attr-defined]


@pytest.fixture
def run_as(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """``run_as("machine code")``, ``run_as("plain")``: the form that compiled functions take."""

    def machine_code(function: functions.Function, *arguments: Any) -> Any:
        told = (int(a) if isinstance(a, functions.CFunction) else a for a in arguments)
        return function.compiled(*told)

    def plain(function: functions.Function, *arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return functions._python(function.plain(*arguments))

    forms = {"machine code": machine_code, "plain": plain}
    return lambda form: monkeypatch.setattr(functions.Function, "__call__", forms[form])


def in_ci() -> bool:
    """True where nothing may be skipped."""
    return os.environ.get("CI", "").lower() in ("1", "true", "yes")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Lines are counted where tests are short: counting takes as long again as the test itself."""
    _calls.clear()
    if not item.get_closest_marker("slow") or "COVERAGE_PROCESS_CONFIG" not in os.environ:
        return (yield)
    counting = sys.gettrace(), threading.gettrace(), os.environ.pop("COVERAGE_PROCESS_CONFIG")
    sys.settrace(None)
    threading.settrace(None)  # type: ignore[arg-type]
    try:
        return (yield)
    finally:
        sys.settrace(counting[0])
        threading.settrace(counting[1])  # type: ignore[arg-type]
        os.environ["COVERAGE_PROCESS_CONFIG"] = counting[2]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that need system packages run in CI only."""
    if in_ci():
        return
    for item in items:
        if item.get_closest_marker("system"):
            item.add_marker(pytest.mark.skip(reason="needs system packages: runs with CI=true"))


def pytest_collection_finish() -> None:
    """What was imported and collected stays: it is never looked through for garbage."""
    gc.collect()
    gc.freeze()


def pytest_unconfigure() -> None:
    """At the end all is freed as usual."""
    gc.unfreeze()


def absent(what: str) -> None:
    """Fail in CI, skip elsewhere, in either case naming what is absent."""
    message = f"{what}: set EVERTWIN_DATA to the folder of the real recordings"
    if in_ci():
        pytest.fail(message)
    pytest.skip(message)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings."""
    value = os.environ.get("EVERTWIN_DATA")
    if not value:
        absent("EVERTWIN_DATA is not set")
    folder = Path(str(value)).expanduser().resolve()
    if not folder.is_dir():
        absent(f"EVERTWIN_DATA={value} is no folder")
    return folder


@pytest.fixture(scope="session")
def data_set(data_dir: Path) -> Callable[[str], Path]:
    """One set of the folder by name: ``data_set("emps")``."""

    def folder(name: str) -> Path:
        if not (data_dir / name).is_dir():
            absent(f"the set '{name}' is absent from {data_dir}")
        return data_dir / name

    return folder


@pytest.fixture(scope="session")
def own_terms(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A package with terms of its own, installed as a user installs one: its folder."""
    folder = tmp_path_factory.mktemp("site")
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps",
         "--no-build-isolation", "--target", str(folder), str(ROOT / "tests/plugins/package")],
        check=True,
    )  # fmt: skip
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    yield folder
    sys.path.remove(str(folder))


@pytest.fixture(scope="session")
def postgres() -> Iterator[str]:
    """The address of a PostgreSQL server of the tests' own."""
    if programs() is None:
        message = "PostgreSQL is not installed (Debian: postgresql)"
        pytest.fail(message) if in_ci() else pytest.skip(message)
    with Server("fsync=off") as running:
        yield running.address
