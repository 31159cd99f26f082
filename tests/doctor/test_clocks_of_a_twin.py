"""The doctor's look at clocks: planted offsets are found, and two real clocks compared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.doctor import Diagnosis
from evertwin.twin import Twin
from planted.draws import first_of

ROOT = Path(__file__).parents[2]
TWIN = """
schema = 1
name = "cart"
[model]
kind = "robot1d"
[[source]]
name = "base"
files = ["base.csv"]
match = "base*"
[source.channels]
v = { column = "v", unit = "m/s" }
[[source]]
name = "camera"
files = ["camera.csv"]
match = "camera*"
[source.channels]
x = { column = "x", unit = "m" }
[clock]
rate = "50 Hz"
[prediction]
horizon = "1 s"
"""


def examined(folder: Path, offset: float, drift: float = 0.0) -> Diagnosis:
    """A cart whose camera stamps ``offset`` + ``drift``·t too late."""
    rng = np.random.default_rng(3)
    t = np.arange(0, 120, 0.02)
    v = 0.1 * np.sin(0.9 * t) + 0.08 * np.sin(2.3 * t) + 0.05 * np.sin(0.31 * t**1.2)
    x = np.concatenate([[0.0], np.cumsum(v[:-1] * 0.02)]) + rng.normal(0, 0.0005, len(t))
    (folder / "twin.toml").write_text(TWIN)
    np.savetxt(folder / "base.csv", np.c_[t, v], "%.9g", ",", header="t,v", comments="")
    late = t + offset + drift * t
    np.savetxt(folder / "camera.csv", np.c_[late, x], "%.9g", ",", header="t,x", comments="")
    with Twin.open(folder / "twin.toml") as twin:
        return twin.doctor()


@pytest.mark.slow
@pytest.mark.parametrize("offset", [-0.2, 0.13])
def test_a_planted_offset_is_found(tmp_path: Path, offset: float) -> None:
    found = examined(tmp_path, offset)
    clock = found.figures["clocks"]["camera"]
    low, high = clock["offset"]["interval95"]
    assert low - 0.002 <= offset <= high + 0.002
    assert high - low < 0.02
    assert clock["offset"]["correlation"] > 0.9
    assert clock["against"] == "base" and clock["shared_lag"]["agree"]
    (told,) = found.of_kind("clock")
    assert told.subject == "camera" and "base" in told.reason
    advised = float(told.step.split("offset = '")[1].split(" s'")[0])
    assert advised == pytest.approx(-offset, abs=0.003)
    assert "camera against base" in str(found)


def test_a_clock_that_runs_fast_is_told(tmp_path: Path) -> None:
    found = examined(tmp_path, 0.05, drift=1e-3)
    (told,) = found.of_kind("clock")
    assert told.evidence["drift"] == pytest.approx(1e-3, rel=0.2)
    assert "run apart" in told.step


def test_equal_clocks_are_a_figure_and_no_finding(tmp_path: Path) -> None:
    found = examined(tmp_path, 0.0)
    assert not found.of_kind("clock")
    assert abs(found.figures["clocks"]["camera"]["offset"]["seconds"]) < 0.01
    assert "clock: camera against base: later by" in str(found)


@pytest.mark.slow
@pytest.mark.data
def test_odometry_against_motion_capture(data_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The log pauses for up to a second where commands change; 0.23 s without those pauses."""
    monkeypatch.setenv("EVERTWIN_DATA", str(data_dir))
    with Twin.open(ROOT / "twins" / "mrclam6.toml") as twin:
        found = twin.doctor()
    clock = found.figures["clocks"]["groundtruth"]
    assert clock["against"] == "odometry"
    assert clock["lags"]["y"]["correlation"] > 0.9
    assert clock["offset"]["seconds"] == pytest.approx(0.22, abs=0.05)
    # Turning follows faster than driving: one offset of the clocks does not explain both.
    assert not clock["shared_lag"]["agree"]
    assert clock["lags"]["heading"]["seconds"] == pytest.approx(0.17, abs=0.03)
    assert abs(clock["offset"]["drift"]) < 4 * clock["offset"]["drift_sigma"]
    assert [f.subject for f in found.of_kind("clock")] == ["groundtruth"]


def command_in_steps(folder: Path, seed: int, late: float) -> Path:
    """A cart whose command steps every few seconds; pose and command have clocks of their own."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(0.05, 0.3, 200) * rng.choice([-1, 1], 200), rng.integers(20, 60, 200))
    v = v[:3000]
    t = 1e9 + 0.1 * np.arange(len(v))
    x = np.cumsum(v * 0.1) - 0.05 * v + rng.normal(0, 0.001, len(v))  # half an interval behind
    text = TWIN.replace('[clock]\nrate = "50 Hz"\n', "") + "[anomaly]\nrequirement = '1 cm'\n"
    (folder / "twin.toml").write_text(text)
    np.savetxt(folder / "base.csv", np.c_[t, v], "%.14g", ",", header="t,v", comments="")
    pose = np.c_[t + 0.05 + late, x]
    np.savetxt(folder / "camera.csv", pose, "%.14g", ",", header="t,x", comments="")
    return folder / "twin.toml"


@first_of("seed", range(3))
@pytest.mark.parametrize("late", [0.3, pytest.param(-0.3, marks=pytest.mark.long), 0.0])
def test_sources_that_stamp_in_turn_are_compared_and_the_run_points_there(
    tmp_path: Path, seed: int, late: float
) -> None:
    with Twin.open(command_in_steps(tmp_path, seed, late)) as twin:
        found, said = twin.doctor(), twin.run().headline
    told = found.of_kind("clock", "lag")
    assert bool(told) == (late != 0.0)
    if late:
        clock = next(one for one in told if one.kind == "clock")
        advised = float(clock.step.split("offset = '")[1].split(" s'")[0])
        assert advised == pytest.approx(-late, abs=0.01)
        lag = next(one for one in told if one.kind == "lag").evidence["x"]["seconds"]
        assert lag == pytest.approx(late, abs=0.03)
    named = "as where the clocks of base and camera differ" in said and "doctor" in said
    assert named == (late != 0.0)
