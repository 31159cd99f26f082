"""Parts of recordings, windows of a fit, spans of calibration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin.anomaly import Cusum, Residuals
from evertwin.config.spec import (
    AnomalySpec,
    ChannelSpec,
    CutSpec,
    ModelSpec,
    PredictionSpec,
    SourceSpec,
    TimeSpec,
    TwinSpec,
)
from evertwin.errors import DataError, UsageError
from evertwin.fold import make_block
from evertwin.setup.detectors import Detect
from evertwin.setup.windows import apart, windows_of
from evertwin.signals import Layout
from evertwin.sources.merging import Excerpt
from evertwin.twin import Twin

SPEC = TwinSpec(
    name="robot",
    model=ModelSpec("robot1d"),
    source=(
        SourceSpec(
            name="log",
            channels={"v": ChannelSpec("v", "m/s"), "x": ChannelSpec("x", "m")},
            time=TimeSpec("t"),
        ),
    ),
    prediction=PredictionSpec(horizon=1.0),
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "run@home.csv"
    lines = [f"{100 + 0.1 * i:.1f},{0.2},{0.02 * i:.3f}" for i in range(100)]
    file.write_text("\n".join(["t,v,x", *lines]) + "\n")
    return file


def test_parts_that_meet_share_no_row(log: Path) -> None:
    with Twin(SPEC) as twin:
        first, second = (twin.blocks([f"{log}@{part}"])[0] for part in (":4", "4:"))
        whole = twin.blocks([log])[0]
    assert np.array_equal(np.concatenate([first.t, second.t]), whole.t)
    assert len(first.t) == 40


@pytest.mark.parametrize("part", ["a:b", "3:1", "1:2:3"])
def test_a_part_that_is_none_says_how_to_write_one(log: Path, part: str) -> None:
    with pytest.raises(UsageError, match="START"):
        Excerpt.parse(f"{log}@{part}")


def test_a_part_without_rows_is_an_error(log: Path) -> None:
    with Twin(SPEC) as twin, pytest.raises(DataError, match="@START:STOP"):
        twin.blocks([f"{log}@50:60"])


def test_windows_are_cut_and_kept_apart() -> None:
    rows = make_block(t=np.arange(100) * 10**8, u=np.zeros((100, 1)), y=np.zeros((100, 1)))
    found = windows_of([rows], CutSpec(length=2.0, step=0.5))
    assert {len(w.t) for w in found} == {20}
    assert [w.row for w in found] == list(range(0, 81, 5))
    assert [w.row for w in apart(found)] == [0, 20, 40, 60, 80]
    with pytest.raises(DataError, match="as long as a window"):
        windows_of([rows], CutSpec(length=20.0))


def calm(rows: int, first: int = 0) -> Residuals:
    r = np.random.default_rng(first).normal(size=(rows, 1))
    made = Residuals.of(r, interval=1.0)
    return made._replace(row=made.row + first, t=made.t + first * 10**9)


def test_the_first_task_calibrates_and_no_row_after_it() -> None:
    detect = Detect.of(AnomalySpec(calibration=float("inf")), Layout.of(x="m"), np.array([True]), 1)
    cusum = detect.cusum.collect(detect.init().cusum, calm(3000))
    state, failed = detect.beat(detect.init()._replace(cusum=cusum), task_end=False)
    assert (state.cusum.calibration.ready, failed[0]) == (False, "")
    state, _ = detect.beat(state, task_end=True)
    assert state.cusum.calibration.ready
    assert state.drift.calibration.ready
    known = state.cusum.calibration
    again, _ = detect.beat(state, task_end=True)
    assert again.cusum.calibration is known


def test_too_short_a_first_task_is_said_and_more_is_collected() -> None:
    detect = Detect.of(AnomalySpec(calibration=float("inf")), Layout.of(x="m"), np.array([True]), 1)
    cusum = detect.cusum.collect(detect.init().cusum, calm(300))
    state, (reason, rows) = detect.beat(detect.init()._replace(cusum=cusum), task_end=True)
    assert "at least 1000 are needed" in reason
    assert rows == 300
    state = state._replace(cusum=detect.cusum.collect(state.cusum, calm(2000, 300)))
    state, _ = detect.beat(state, task_end=True)
    assert state.cusum.calibration.ready


def test_the_collector_keeps_the_newest_rows() -> None:
    small = Cusum(("x",), capacity=2000)
    state = small.collect(small.init(), calm(1500))
    state = small.collect(state, calm(1200, 1500))
    assert state.collected == 2000
    assert state.calm.row[[0, -1]].tolist() == [700, 2699]
    state = small.collect(state, calm(2500, 2700))
    assert state.calm.row[[0, -1]].tolist() == [3200, 5199]


def test_a_span_calibrates_when_it_has_passed() -> None:
    spec = replace(AnomalySpec(), calibration=1999.0)
    detect = Detect.of(spec, Layout.of(x="m"), np.array([True]), 1)
    cusum = detect.cusum.collect(detect.init().cusum, calm(1500))
    state, _ = detect.beat(detect.init()._replace(cusum=cusum))
    assert not state.cusum.calibration.ready
    state = state._replace(cusum=detect.cusum.collect(state.cusum, calm(500, 1500)))
    assert detect.beat(state)[0].cusum.calibration.ready
