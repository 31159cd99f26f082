"""Questions of a first twin file that are answered before it is written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy

from evertwin.app.first.init_command import Said, write_starter
from evertwin.config import read
from evertwin.errors import UsageError
from evertwin.starter.numbers.oscillator_guess import driven


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Two columns without headings or stamps, four minutes at 10 Hz: a store that leaks."""
    rng = np.random.default_rng(2)
    u, y = np.repeat(rng.uniform(1.0, 3.0, 120), 20), np.zeros(2400)
    for i in range(2399):
        y[i + 1] = y[i] + 0.1 * (u[i] - 0.5 * y[i])
    np.savetxt(tmp_path / "log.dat", np.column_stack([u, y]), fmt="%.5f")
    return tmp_path / "log.dat"


def written(file: Path, *said: str) -> str:
    out = file.parent / "twin.toml"
    write_starter([file], out, ("", None), True, False, Said(answers=said))
    return out.read_text()


def test_times_and_requirement_rest_on_an_answer(recording: Path) -> None:
    asked, told = written(recording), written(recording, "log.rate=10 Hz")
    assert 'rate = "?"' in asked and "= 0.05  # a share" not in told
    assert 'time = { rate = "10 Hz" }\n' in told and 'horizon = "1 s"' in told
    spec = read(recording.parent / "twin.toml")
    assert spec.anomaly.requirement < 0.5 and not spec.anomaly.relative


def test_a_column_and_a_scale_are_taken_over(tmp_path: Path) -> None:
    t = 0.1 * np.arange(400)
    rows = np.column_stack([t, np.sin(t), np.cos(t), np.sin(0.3 * t)])
    file = tmp_path / "log.csv"
    np.savetxt(file, rows, fmt="%.5f", delimiter=",", header="time,vm,alpha,beta", comments="")
    text = written(file, "u.column=vm", "y.column=beta", "u.scale=2.5")
    assert 'u = { column = "vm", unit = "1", scale = 2.5 }  # as answered' in text
    assert 'y = { column = "beta"' in text and '"?"' not in text


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (["log.rate"], "expected NAME.WHAT=ANSWER"),
        (["log.speed=3"], "expected NAME.WHAT=ANSWER"),
        (["log.rate=3 m"], "expected a quantity in 'Hz'"),
        (["log.rate=0 Hz"], "a rate above 0"),
        (["other.rate=3 Hz"], "no table of that name"),
        (["u.column=c7"], "there is no column 'c7': expected one of c1; c2"),
        (["u.column=c2"], "u and y have one column"),
        (["w.column=c2"], "there is no such column: expected one of u; y"),
        (["model.wheel_base=1"], "the model asks no such thing"),
    ],
)
def test_an_answer_to_nothing_is_refused(
    recording: Path, said: Sequence[str], expected: str
) -> None:
    with pytest.raises(UsageError, match=expected):
        written(recording, *said)
    assert not (recording.parent / "twin.toml").exists()


def test_a_base_is_told_its_size(tmp_path: Path) -> None:
    t = 0.1 * np.arange(600)
    speed, angle = 1.0 + 0.5 * np.sin(0.2 * t), 0.3 * np.sin(0.5 * t)
    heading = np.cumsum(0.1 * speed * np.tan(angle) / 2.0)
    x, y = np.cumsum(0.1 * speed * np.cos(heading)), np.cumsum(0.1 * speed * np.sin(heading))
    head = "time,cmd_speed [m/s],steering_cmd [rad],x [m],y [m],yaw [rad]"
    file = tmp_path / "car.csv"
    rows = np.column_stack([t, speed, angle, x, y, heading])
    np.savetxt(file, rows, fmt="%.6f", delimiter=",", header=head, comments="")
    text = written(file, "model.wheel_base=2 m", "model.front_drive=false")
    assert "wheel_base = 2" in text and "front_drive = false" in text and '"?"' not in text


@pytest.mark.parametrize(("name", "value"), [("fs", 50.0), ("Ts", 0.02)])
def test_a_mat_file_says_its_rate_by_one_number(name: str, value: float, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    file = tmp_path / "run.mat"
    u = np.repeat(rng.normal(size=40), 10)
    scipy.io.savemat(file, {"u": u, "y": np.cumsum(u), name: value})
    assert 'rate = "50 Hz"' in written(file)


def test_of_a_current_that_was_set_the_voltage_answers(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    current = np.repeat(rng.choice([0.0, 1.0, 2.0, -1.0], 40), 30)
    voltage = 3.7 - 0.05 * current + rng.normal(0.0, 1e-3, 1200)
    file = tmp_path / "cell.csv"
    rows = np.column_stack([np.arange(1200.0), current, voltage])
    head = "Test_Time(s),Current(A),Voltage(V)"
    np.savetxt(file, rows, fmt="%.4f", delimiter=",", header=head, comments="")
    text = written(file)
    assert 'u = { column = "Current", unit = "A" }' in text
    assert 'y = { column = "Voltage", unit = "V" }' in text


def test_what_swings_is_told_by_a_rate_that_is_answered(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    force = np.repeat(rng.normal(size=200), 20)
    place = 1e-3 * driven(900.0, 6.0, 0.01, 900.0 * force)
    file = tmp_path / "rig.csv"
    rows = np.column_stack([force, place])
    np.savetxt(
        file, rows, fmt="%.8f", delimiter=",", header="force [N],displacement [m]", comments=""
    )
    assert 'kind = "drive"' in written(file)
    assert 'kind = "python"' in written(file, "log.rate=100 Hz")
    assert '"stiffness", 9' in (tmp_path / "twin_model.py").read_text()
