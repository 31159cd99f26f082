"""Plain at first, machine code where that pays, and the same bits either way."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core.caching import InTreeCacheLocator

from evertwin.compiled import functions, kept
from evertwin.compiled.calls import call, call_real
from evertwin.compiled.functions import Function, cfunc, njit
from evertwin.compiled.kept import is_kept, plain_seconds
from evertwin.compiled.memory import (
    behind,
    borrowed,
    carray,
    copied,
    ordered,
    reals,
    scratch,
)
from evertwin.compiled.stamp import stamp_of
from evertwin.errors import UsageError
from evertwin.sync import places
from evertwin.sync.arbiter.plausible_loop import doubted, suspected

SUM = "float64(CPointer(float64), int64)"


@njit(cache=True)
def squared(value: float) -> float:
    return value * value


@njit(cache=True)
def power(values: Any) -> float:
    total = 0.0
    for value in values:
        total += squared(value)
    return total


@njit(cache=True, error_model="numpy")
def inverted(values: Any, one: float) -> Any:
    values[0] += 1.0
    zero = one - 1.0
    return one / zero


@cfunc("int64(CPointer(float64), int64)")
def doubled(values: Any, n: int) -> int:
    own = carray(values, (n,))
    for i in range(n):
        own[i] *= 2.0
    return 7


@cfunc(SUM)
def summed(values: Any, n: int) -> float:
    total = 0.0
    for i in range(n):
        total += behind(values, i)[0]
    return total


@njit(cache=True)
def all_of_it(f: int, g: int, values: Any) -> Any:
    own, room = borrowed(values), scratch()
    code = call(f, own.ctypes.data, own.size)
    room[3] = reals(own.ctypes.data)[own.size - 1]
    return code, room[3], call_real(g, own.ctypes.data, own.size)


def fresh(function: Function) -> Function:
    return Function(function.py_func, function.options | {"cache": True})


def test_little_work_runs_plain_and_much_is_compiled() -> None:
    loop = fresh(power)
    assert loop(np.arange(4.0)) == 14.0 and loop._ready is None
    assert type(loop(np.arange(4.0))) is float
    assert loop(np.ones(10**6)) == 1e6 and loop._ready is loop.compiled
    assert loop(np.arange(4.0)) == 14.0


def test_time_that_was_spent_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(functions, "PER_BYTE", 1.0)
    monkeypatch.setattr(functions, "is_kept", lambda *_: False)
    loop = fresh(power)
    loop._spent = 1.1 * functions.BRIEF
    loop(np.arange(4.0))
    assert loop._ready is None
    monkeypatch.setattr(functions, "is_kept", lambda *_: True)
    loop(np.arange(4.0))
    assert loop._ready is None  # looked for a moment ago
    loop._spent += 1.1 * functions.BRIEF
    loop(np.arange(4.0))
    assert loop._ready is not None
    monkeypatch.setattr(functions, "is_kept", lambda *_: False)
    late = fresh(power)
    late._spent = 1.1 * late._compiling
    late(np.arange(4.0))
    assert late._ready is not None


def test_time_that_processes_before_spent_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(functions, "PER_BYTE", 1.0)
    for times in (1, 2, 3):  # of a third of what compiling takes
        monkeypatch.setattr(functions, "_LOOKED_FOR", [])
        loop = fresh(power)
        loop._spent = 0.4 * loop._compiling
        loop(np.arange(4.0))
        functions._write_down()
        assert (loop._ready is not None) == (times == 3)
    other = fresh(inverted)
    assert plain_seconds(other.py_func, other.stamp) == 0.0
    (note,) = tmp_path.glob("*/*.plain")
    note.write_text("half a")
    assert plain_seconds(power.py_func, power.stamp) == 0.0


def test_where_nothing_may_be_written_code_is_the_users(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(kept.os, "access", lambda *_: False)
    monkeypatch.setattr("numba.config.CACHE_DIR", "")
    monkeypatch.setattr(InTreeCacheLocator, "from_function", lambda *_: None)
    assert fresh(power).compiled(np.arange(3.0)) == 5.0
    assert is_kept(power.py_func, power.stamp)
    assert list(tmp_path.glob("numba/*/*.nbi"))


def test_machine_code_is_found_in_the_cache() -> None:
    assert power.compiled(np.arange(3.0)) == 5.0
    assert is_kept(power.py_func, power.stamp)
    assert not is_kept(power.py_func, summed.stamp)
    assert not is_kept(test_machine_code_is_found_in_the_cache, power.stamp)


@pytest.mark.parametrize("ends", ["nbi", "nbc"])
def test_code_of_a_version_that_is_gone_is_compiled_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ends: str
) -> None:
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path))
    assert fresh(power).compiled(np.arange(3.0)) == 5.0
    (file,) = tmp_path.glob(f"*/*.{ends}")
    gone = b"cevertwin.gone\nGone\n."  # a class of a module that is not there
    file.write_bytes(pickle.dumps(numba.__version__) + gone if ends == "nbi" else gone)
    assert fresh(power).compiled(np.arange(4.0)) == 14.0
    assert gone not in file.read_bytes()


def test_work_is_told_by_the_named_argument() -> None:
    loop = Function(power.py_func, power.options)
    assert loop._size((np.ones(3), (np.ones(5), np.ones(2)))) == 5
    named = Function(inverted.py_func, inverted.options, "one")
    assert named._size((np.ones(3), np.ones(2))) == 2


def test_what_python_refuses_is_left_to_machine_code() -> None:
    loop, values = fresh(inverted), np.zeros(2)
    assert loop(values, 1.0) == np.inf
    assert values[0] == 1.0 and loop._ready is not None


def test_c_functions_are_called_plain_and_compiled() -> None:
    outs = []
    for form in (all_of_it.plain, all_of_it.compiled):
        values = np.array([1.0, 2.0, 3.5])
        given = (doubled, summed) if form is all_of_it.plain else (int(doubled), int(summed))
        outs.append((*form(*given, values), values.tolist()))
    assert outs[0] == outs[1] == (7, 7.0, 13.0, [2.0, 4.0, 7.0])


def test_a_c_function_that_python_refuses_runs_as_machine_code() -> None:
    @cfunc("int64(CPointer(float64))", error_model="numpy")
    def broken(values: Any) -> int:
        values[0] = 1.0 / values[0]
        return 0

    values = np.zeros(1)
    assert call(broken, values.ctypes.data) == 0 and values[0] == np.inf


def test_arithmetic_alone_can_be_compiled() -> None:
    @cfunc("int64(int64)")
    def wordy(n: int) -> Any:
        return {"n": [n]}.items()

    with pytest.raises(UsageError, match="wordy cannot be compiled"):
        _ = wordy.address


class Pair(NamedTuple):
    values: Any
    place: int


@njit()
def noted(pair: Pair, kind: int, where: tuple[int, int]) -> int:
    pair.values[pair.place] += kind
    return where[0] + where[1]


@njit()
def noted_thrice(values: Any) -> int:
    first = noted(Pair(values, 0), 7, (3, 1))
    return (
        first
        + noted(Pair(values, 1), len(values), (len(values), 2))
        + noted(Pair(values, len(values) - 1), 5, (first, len(values)))
    )


def test_numbers_that_a_call_has_written_down_make_no_code_of_their_own() -> None:
    """A loop that tells of eight kinds would be compiled eight times, for each user."""
    values, plain = np.zeros(4), np.zeros(4)
    assert noted_thrice.compiled(values) == noted_thrice.plain(plain)
    assert values.tolist() == plain.tolist()
    assert len(noted.inner.signatures) == 1


def test_functions_travel_by_name() -> None:
    assert copy(power) is power and pickle.dumps(power).count(b"power") == 1
    assert copy(doubled) is doubled


def test_constants_of_a_module_and_options_are_part_of_the_stamp(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stamps = [stamp_of(doubted)]
    monkeypatch.setattr(places, "FACTORS", 2.0 * places.FACTORS)
    stamps.append(stamp_of(doubted))
    monkeypatch.setattr(suspected, "options", {})
    stamps.append(stamp_of(doubted))
    monkeypatch.setattr(places, "FOREIGN", 1.0, raising=False)
    assert stamp_of(doubted) == stamps[-1] and len(set(stamps)) == 3


def test_what_a_called_function_reads_is_part_of_the_stamp(tmp_path: Path) -> None:
    """Numba alone would call old machine code after an upgrade of another file."""
    inner, outer = tmp_path / "inner_kernel.py", tmp_path / "outer_kernel.py"
    head = "from evertwin.compiled.functions import njit\n"
    outer.write_text(
        head + "from inner_kernel import inner\n"
        "@njit(cache=True)\ndef outer(x):\n    return inner(x) + 1.0\n"
        "print(outer.compiled(2.0))\n"
    )
    said = []
    for factor in (2.0, 2.0, 5.0):
        inner.write_text(
            head + f"FACTOR = {factor}\n@njit(cache=True)\ndef inner(x):\n    return FACTOR * x\n"
        )
        done = subprocess.run(
            [sys.executable, "-B", str(outer)], capture_output=True, text=True, check=True,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        )  # fmt: skip
        said.append(float(done.stdout))
    assert said == [5.0, 5.0, 11.0]
    assert len(list((tmp_path / "cache").rglob("*outer*.nbi"))) == 1


def test_code_that_moved_to_another_module_is_compiled_anew() -> None:
    def twice(x: float) -> float:
        return 2.0 * x

    here = stamp_of(twice)
    twice.__module__ = "evertwin.elsewhere"
    assert stamp_of(twice) != here


@njit()
def rising(values: Any, into: Any) -> None:
    copied(into, ordered(values))


@pytest.mark.parametrize("form", ["plain", "compiled"])
def test_numbers_are_ordered_and_copied_in_both_forms(form: str) -> None:
    rng = np.random.default_rng(5)
    for size in (0, 1, 2, 3, 10, 11, 257):
        values = rng.integers(0, 50, size) / 7.0
        given, into = values.copy(), np.full(size + 2, -1.0)
        getattr(rising, form)(given, into)
        assert np.array_equal(given, values)
        assert into[:size].tolist() == sorted(values) and into[size:].tolist() == [-1.0, -1.0]
