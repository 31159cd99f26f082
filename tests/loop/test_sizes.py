"""Settings that would ask for far too much are refused at once, with what to do."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from evertwin.ahead.spec import DockSpec
from evertwin.config.spec import (
    AnomalySpec,
    ClockSpec,
    CutSpec,
    DeriveSpec,
    FilterSpec,
    ModelSpec,
    Span,
    TuningSpec,
    TwinSpec,
)
from evertwin.errors import DataError, EvertwinError, UsageError
from evertwin.fold import make_block
from evertwin.machines.assembly.path import Joints, Limits, Pause, plan
from evertwin.models.terms.rows import level_count, propose_levels
from evertwin.rows.smoothing import low_pass
from evertwin.setup.windows import windows_of

ROWS = make_block(t=np.arange(10) * 10**9, u=np.zeros((10, 1)), y=np.zeros((10, 1)))
FINE = Limits((1.0,), (1.0,))


def slow(cutoff: float) -> None:
    rule = FilterSpec(kind="savgol", cutoff=cutoff)
    low_pass(TwinSpec("a", ModelSpec("drive"), clock=ClockSpec(rate=100.0), filter=rule))


CASES: dict[str, tuple[Callable[[], object], str]] = {
    "windows": (lambda: windows_of([ROWS], CutSpec(length=2.0, step=1e-9)), "windows of 10 rows"),
    "windows below a nanosecond": (
        lambda: windows_of([ROWS], CutSpec(length=1e-12)), "windows of 10 rows"
    ),
    "levels": (lambda: propose_levels(np.array([0.0, 1.0]), quantum=1e-12), "makes 1e+12 levels"),
    "levels of nothing": (lambda: level_count(0.0, 1.0, 5e-324), "makes inf levels"),
    "phases": (
        lambda: AnomalySpec(phases={n: tuple(float(k) for k in range(99)) for n in "abc"}),
        "at most 1000 phases, got 1000000",
    ),
    "savgol": (lambda: slow(1e-6), "below 16384 rows"),
    "savgol without end": (lambda: slow(5e-324), "cutoff: expected a number at least"),
    "slope": (lambda: DeriveSpec("a", "slope", ("b",), value=float("inf")), "value: expected"),
    "pause": (lambda: plan([Pause(1e9)], [0.0], FINE), "a move of 1e+11 rows"),
    "pause without end": (lambda: plan([Pause(float("inf"))], [0.0], FINE), "a move of inf rows"),
    "move": (lambda: plan([Joints((1.0,))], [0.0], FINE, rate=1e12), "expected at most 1000000"),
    "docking": (lambda: DockSpec("a.toml", step=1e-9), "expected at most 1000000 steps"),
    "span": (
        lambda: TwinSpec(
            "a", ModelSpec("drive"), clock=ClockSpec(rate=1e6),
            tuning=TuningSpec(window=Span(seconds=60.0)),
        ),
        "60 s: 6e+07 rows at 1e+06 Hz: expected at most 1000000",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_too_much_is_refused_at_once(case: str) -> None:
    make, said = CASES[case]
    with pytest.raises(EvertwinError, match=re.escape(said)) as error:
        make()
    assert isinstance(error.value, UsageError | DataError)


def test_a_time_is_so_many_rows_of_the_clock() -> None:
    assert Span(seconds=0.25).at(100.0) == 25
    assert Span(seconds=0.1).at(30.0) == 3
    assert Span(7).at(None) == 7
    with pytest.raises(UsageError, match=r"1 s: a time needs the rate of the rows: set rate"):
        Span(seconds=1.0).at(None)
    with pytest.raises(UsageError, match="both or neither"):
        Span()
