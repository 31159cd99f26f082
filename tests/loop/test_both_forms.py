"""Whole twins, each loop run plain and as machine code on the same arguments: the same bits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from evertwin.compiled import functions
from evertwin.compiled.functions import CFunction, Function

from .machines import arm, play, robot

CALLS = 4
"""Calls of each function that are compared."""


def copied(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple):
        made = [copied(one) for one in value]
        return type(value)(*made) if hasattr(value, "_fields") else tuple(made)
    return value


def bits(value: Any) -> Iterator[Any]:
    """Everything in a value, NaN equal to NaN."""
    if isinstance(value, tuple):
        for one in value:
            yield from bits(one)
    elif isinstance(value, np.ndarray):
        real = value.dtype.kind == "f"
        yield value.dtype, value.shape, np.where(np.isnan(value), np.nan, value).tobytes() if real \
            else value.tobytes()  # fmt: skip
    elif not isinstance(value, CFunction):
        yield type(value), str(value)


@pytest.mark.slow
@pytest.mark.parametrize("case", [robot, arm], ids=["robot", "arm"])
def test_plain_python_and_machine_code_give_the_same_bits(
    case: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: Counter[str] = Counter()

    def both(function: Function, *arguments: Any) -> Any:
        name = f"{function.__module__}.{function.__qualname__}"
        seen[name] += 1
        told = tuple(int(a) if isinstance(a, CFunction) else a for a in arguments)
        if seen[name] > CALLS:
            return function.compiled(*told)
        twins = copied(arguments)
        with np.errstate(all="ignore"):
            plain = functions._python(function.plain(*twins))
        result = function.compiled(*told)
        assert list(bits((plain, twins))) == list(bits((result, arguments))), name
        return result

    monkeypatch.setattr(Function, "__call__", both)
    found = case()
    play(found, [found.rows])
    assert {"evertwin.sync.track.track_loop.run", "evertwin.trial.gate_loop.run"} <= set(seen)
