"""Drives and a spring between them, of which one speed is measured, cut in mid-motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameter, Parameters, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.fold import make_block, take
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.tuning import Problem
from evertwin.tuning.posing.before import later
from evertwin.tuning.spec import TuningSpec
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

ROWS, AT, STEP, NOISE = 4800, 2200, 0.02, 0.2
TRUE = {"lag": 0.6, "gain": 12.0, "pitch": 14.0, "damping": 0.15}


def drives(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    speed, slope, inner = x
    lag, gain, pitch, damping = p
    for _ in range(2):
        h = dt / 2
        inner += h * (gain * u[0] - inner) / lag
        slope += h * (pitch * pitch * (inner - speed) - 2.0 * damping * pitch * slope)
        speed += h * slope
    return [speed, slope, inner], [speed]


def model() -> FunctionModel:
    units = {"lag": "s", "gain": "rad/s/V", "pitch": "rad/s", "damping": "1"}
    return FunctionModel(
        drives, Layout.of(u="V"), Layout.of(speed="rad/s"),
        Layout.of(speed="rad/s", slope="rad/s^2", inner="rad/s"),
        Parameters(tuple(Parameter(k, v, units[k], v / 20, v * 20) for k, v in TRUE.items())),
    )  # fmt: skip


def recorded(seed: int, gain: float = 12.0) -> dict[str, np.ndarray]:
    """Its gain is ``gain`` from row `AT` on."""
    rng = np.random.default_rng(seed)
    u = 5.0 + np.repeat(rng.uniform(-3.0, 3.0, ROWS // 60), 60)
    p, x, speed = np.array(list(TRUE.values())), [0.0] * 3, np.zeros(ROWS)
    for k in range(1, ROWS):
        p[1] = gain if k >= AT else 12.0
        x, (speed[k],) = drives(x, u[k : k + 1], STEP, p)
    return {"t": np.arange(ROWS) * STEP, "u": u, "speed": speed + rng.normal(0.0, NOISE, ROWS)}


def run(seed: int) -> RunResult:
    spec = TwinSpec(
        "drives", ModelSpec("python"), prediction=PredictionSpec(2.0),
        anomaly=AnomalySpec(requirement=1.5, relative=False, window=Span(rows=1000)),
        tuning=TuningSpec(window=Span(rows=2000)),
    )  # fmt: skip
    with Twin(spec, model()) as twin:
        return twin.run(recorded(seed, 14.4))


@first_of("seed", range(2))
def test_a_change_in_motion_is_tuned_from_where_the_machine_was(seed: int) -> None:
    result = run(seed)
    assert result.of_kind("changed") and result.of_kind("promoted")
    assert not result.of_kind("not_identifiable")
    for name, true in (TRUE | {"gain": 14.4}).items():
        assert abs(result.parameters[name].value - true) < 0.5 * true
    assert abs(result.parameters["gain"].value - 14.4) < 0.2


@pytest.mark.parametrize("seed", range(3))
def test_a_window_begins_where_the_rows_before_came_to(seed: int) -> None:
    data, twin = recorded(seed), model()
    rows = make_block(
        np.round(data["t"] * 1e9).astype(np.int64), data["u"][:, None], data["speed"][:, None]
    )
    window = take(rows, 1000, 3000)
    known, anew = (Problem(twin, (window,), horizon=2.0, before=before) for before in ((rows,), ()))
    first = [np.sqrt(np.nanmean(one.first[:50] ** 2)) for one in (known, anew)]
    assert first[0] < 1.5 * NOISE < 3.0 * NOISE < first[1]
    p = twin.parameters.values
    (cut,) = later(twin, p, 2.0, ((), (window,)))
    assert 1050 < cut.row <= 2000
    assert later(twin, p, 2.0, ((rows,), (window,)))[0].row == 1000
    assert later(twin, p, 2.0, ((), (take(rows, 0, 500),)))[0].row == 0
    single = take(rows, 1000, 1001)
    assert [len(one.t) for one in later(twin, p, 2.0, ((), (single, window)))] == [1, 2000]


@pytest.mark.parametrize("seed", range(2))
def test_a_part_of_a_file_is_fitted_from_where_the_rows_before_came_to(
    seed: int, tmp_path: Path
) -> None:
    data, path = recorded(seed), tmp_path / "drives.csv"
    columns = np.column_stack(list(data.values()))
    np.savetxt(path, columns, delimiter=",", header="t,u,speed", comments="")
    named = {k: ChannelSpec(k, v) for k, v in (("u", "V"), ("speed", "rad/s"))}
    source = SourceSpec("log", files=(str(path),), time=TimeSpec("t", "s"), channels=named)
    spec = TwinSpec("drives", ModelSpec("python"), source=(source,), prediction=PredictionSpec(2.0))
    with Twin(spec, model()) as twin:
        done = twin.fit([f"{path}@20:40"])
    assert abs(done.fit["pitch"] - 14.0) < 1.0 and abs(done.fit["damping"] - 0.15) < 0.1
    assert done.train[0].rms < 3.0 * NOISE
