"""Single axes as controllers log them: in other languages, units, turns; what is written runs."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.init_command import write_starter
from evertwin.config import TwinSpec, read
from evertwin.starter.looks.words import quantity, role, words

H = 0.01
T = H * np.arange(3000)
PLACE = 0.3 * np.sin(T) + 0.1 * np.sin(2.3 * T)
SPEED = 0.3 * np.cos(T) + 0.23 * np.cos(2.3 * T)
FORCE = (
    20 * np.gradient(SPEED, H) + 8 * np.sign(SPEED) + np.random.default_rng(0).normal(0, 0.1, 3000)
)
Written = Callable[[Mapping[str, np.ndarray]], Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    def write(columns: Mapping[str, np.ndarray]) -> Path:
        path = tmp_path / "run.csv"
        rows = np.stack([T, *columns.values()], axis=1)
        lines = [";".join(["Zeit [s]", *columns])]
        lines += [";".join(f"{x:.6f}".replace(".", ",") for x in row) for row in rows]
        path.write_bytes("\r\n".join(lines).encode("cp1252"))
        return path

    return write


def proposed(path: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> tuple[Path, str]:
    out = path.with_name("axis.toml")
    write_starter([path], out, (kind, None), force=True, as_json=False)
    return out, capsys.readouterr().out


@pytest.mark.parametrize(
    ("said", "means"),
    [
        ("Ist-Geschwindigkeit Achse 2", ("velocity", "measured")),
        ("Sollposition", ("position", "command")),
        ("Couple moteur mesuré", ("torque", "measured")),
        ("Velocidad de consigna", ("velocity", "command")),
        ("thermocouple", ("", "")),
        ("target_qd_3", ("velocity", "command")),
    ],
)
def test_headings_of_other_languages(said: str, means: tuple[str, str]) -> None:
    assert (quantity(words(said)), role(words(said))) == means


def test_an_axis_logged_in_german(written: Written, capsys: pytest.CaptureFixture[str]) -> None:
    table = {
        "Soll-Position [mm]": 1e3 * PLACE, "Ist-Position [mm]": 1e3 * PLACE,
        "Ist-Geschwindigkeit [mm/s]": 1e3 * SPEED, "Motorstrom [A]": FORCE / 50,
    }  # fmt: skip
    out, said = proposed(written(table), "drive_force", capsys)
    assert "force: scale" in said and "not used: Soll-Position\n" in said
    out.write_text(out.read_text().replace('scale = "?"', "scale = 50"))
    spec = read(out)
    assert spec.moving is not None and spec.moving.channels == {"force": "speed"}
    assert spec.moving.above == pytest.approx(0.02 * np.quantile(abs(SPEED), 0.95), rel=0.5)
    result = Twin.open(out).run()
    kinds = {event.kind for event in result.events}
    assert "tuned" in kinds and not kinds & {"external", "measurement_error"}


def test_one_axis_of_a_numbered_controller(
    written: Written, capsys: pytest.CaptureFixture[str]
) -> None:
    table = {"axis1_pos": PLACE, "axis1_vel": SPEED, "axis1_force": FORCE}
    _, said = proposed(written(table), "drive", capsys)
    assert "3 channels found" in said


def test_the_only_column_in_a_fitting_unit(
    written: Written, capsys: pytest.CaptureFixture[str]
) -> None:
    table = {"X7 [mm/s]": 1e3 * SPEED, "Kn [N]": FORCE, "aux [N/m]": PLACE}
    _, said = proposed(written(table), "drive_force", capsys)
    assert "the only one in mm/s" in said and "the only one in N" in said


def test_an_axis_that_turns_and_wraps(written: Written, capsys: pytest.CaptureFixture[str]) -> None:
    turned = np.degrees(np.cumsum(40 * SPEED) * H)
    torque = 0.02 * 40 * np.gradient(SPEED, H) + 0.4 * np.sign(SPEED)
    path = written({"spindle_torque": torque, "spindle_angle": turned % 360})
    out, said = proposed(path, "drive_force", capsys)
    assert "position_unwrapped unwrap of position" in said and "no column found" not in said
    twin = Twin.open(out)
    assert twin.model.outputs.units == ("Nm",)
    found = twin.fit([path]).parameters
    assert found["inertia"].value == pytest.approx(0.02, rel=0.02)
    assert found["Fc"].value == pytest.approx(0.4, rel=0.02)


def test_a_speed_in_turns_a_minute(written: Written, capsys: pytest.CaptureFixture[str]) -> None:
    _, said = proposed(written({"n_rpm": 400 * SPEED, "M": FORCE}), "drive_force", capsys)
    assert "rpm      the name ends in rpm" in said


def test_the_law_has_terms_of_the_place_where_a_place_is_recorded(
    written: Written, capsys: pytest.CaptureFixture[str]
) -> None:
    """So what a counterbalance does is found with what `init` writes, and named."""
    sprung = {"position [m]": PLACE, "speed [m/s]": SPEED, "force [N]": FORCE + 900.0 * PLACE}
    out, _ = proposed(written(sprung), "drive_force", capsys)
    spec = read(out)
    assert spec.tuning.ladder is not None and spec.tuning.ladder[-2:] == ("root", "spring")
    found = Twin.open(out).fit([out.with_name("run.csv")])
    assert found.parameters["Ks"].value == pytest.approx(900.0, rel=0.05)
    del sprung["position [m]"]
    out, said = proposed(written(sprung), "drive_force", capsys)
    assert "position" not in (read(out).tuning.ladder or ()) and "no column found" not in said


@pytest.mark.parametrize("heading", ["drum_angle_deg", "drumAngleDeg"])
def test_a_heading_that_ends_in_degrees_is_no_way_in_millimetres(
    heading: str, written: Written, capsys: pytest.CaptureFixture[str]
) -> None:
    _, said = proposed(written({heading: 4000.0 * PLACE, "load_Nm": FORCE}), "drive_force", capsys)
    assert "the name ends in deg" in said and "the only one in Nm" in said
    assert "mm " not in said


def test_each_axis_of_a_gantry_gets_a_file_that_runs(
    written: Written, capsys: pytest.CaptureFixture[str]
) -> None:
    table = {
        "x_act_mm": 1e3 * PLACE, "x_vel_mm/s": 1e3 * SPEED, "x_cur_A": FORCE / 50,
        "y_act_mm": -500 * PLACE, "y_vel_mm/s": -500 * SPEED, "y_cur_A": -FORCE / 80,
    }  # fmt: skip
    out, said = proposed(written(table), "drive_force", capsys)
    assert said.count("force: scale") == 2 and not out.exists()
    for axis, scale in (("x", 50), ("y", 80)):
        one = out.with_stem(f"axis_{axis}")
        columns = {c.column for c in read_answered(one, scale).source[0].channels.values()}
        assert columns == {f"{axis}_act_mm", f"{axis}_vel_mm/s", f"{axis}_cur_A"}
        with Twin.open(one) as twin:
            assert np.isfinite(twin.run().outputs["force"].rms_after)


def read_answered(file: Path, scale: float) -> TwinSpec:
    file.write_text(file.read_text().replace('scale = "?"', f"scale = {scale}"))
    return read(file)


def test_a_pose_and_its_commands_are_a_base(
    written: Written, capsys: pytest.CaptureFixture[str]
) -> None:
    v, w = 0.3 + 0.1 * np.sin(T), 0.4 * np.cos(0.5 * T)
    heading = np.cumsum(w) * H
    x, y = np.cumsum(v * np.cos(heading)) * H, np.cumsum(v * np.sin(heading)) * H
    table = {
        "cmd_lin_cm_s": 100 * v, "cmd_ang_deg_s": np.degrees(w), "pos_x_mm": 1e3 * x,
        "pos_y_mm": 1e3 * y, "yaw_deg": np.degrees(heading),
    }  # fmt: skip
    out, said = proposed(written(table), "", capsys)
    assert "differential, 5 channels found" in said and "answered" not in said
    second = round(1.0 / H)
    size = float(np.ptp(np.quantile(x[second:] - x[:-second], (0.05, 0.95))))
    asked = re.search(r"(?m)^requirement = ([\d.]+)\n", out.read_text())
    assert asked and float(asked[1]) == pytest.approx(0.02 * size, rel=0.3)
    with Twin.open(out) as twin:
        assert np.isfinite(twin.run().outputs["x"].rms_after)
    proposed(written({key: table[key] for key in list(table)[2:]}), "", capsys)
    assert 'kind = "python"' in out.read_text()  # nothing commands it


def test_an_oven_is_asked_in_kelvin(written: Written, capsys: pytest.CaptureFixture[str]) -> None:
    box = 40 + 5 * np.sin(0.1 * T)
    table = {"heater_state": (np.cos(0.1 * T) > 0), "T_oven_degC": box, "T_room_degC": 21 + H * T}
    out, said = proposed(written(table), "thermal", capsys)
    text = out.read_text()
    assert "heater     heater_state" in said and "answered" not in said
    assert re.search(r'tolerance = "[\d.]+ K"', text) and " cm" not in text
    assert read(out).model.kind == "thermal"


@pytest.mark.parametrize(
    ("drives", "fastest", "unit", "rotary"),
    [("current", 60.0, "rad/s", True), ("current", 119.0, "rad/s", True),
     ("Moment", 700.0, "rad/s", True),
     ("force", 119.0, "mm/s", False), ("current", 0.4, "m/s", False)],
)  # fmt: skip
def test_a_speed_that_no_slide_has_is_of_a_shaft(
    drives: str, fastest: float, unit: str, rotary: bool, written: Written,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path = written({"speed": fastest * SPEED / 0.53, drives: FORCE})
    text = proposed(path, "drive_force", capsys)[0].read_text()
    assert f'column = "speed", unit = "{unit}"' in text
    assert ("rotary = true" in text) is rotary


@pytest.mark.parametrize("kind", ["drive", "drive_force"])
@pytest.mark.parametrize("heading", ["motor_current_A", "motor_force_N", "Motorstrom [A]"])
def test_what_a_motor_draws_drives_the_axis(
    kind: str, heading: str, written: Written, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written({heading: FORCE, "position_m": PLACE, "speed_m_s": SPEED})
    out, _ = proposed(path, kind, capsys)
    name = heading.partition(" [")[0]
    assert re.search(rf'^force = {{ column = "{name}', out.read_text(), re.MULTILINE)


@pytest.mark.parametrize("turns", [False, True])
def test_numbers_start_from_the_recording_where_it_says_the_place_alone(
    written: Written, capsys: pytest.CaptureFixture[str], turns: bool
) -> None:
    """A mass of 1 kg without friction was what a twin of an axis of 20 kg began with."""
    angle = (20.0 * PLACE + np.pi) % (2.0 * np.pi) - np.pi  # 20 rad a metre, so 1/20 of the force
    place = {"Istwinkel [rad]": angle} if turns else {"Istposition [mm]": 1e3 * PLACE}
    pushed = {"Drehmoment [Nm]": FORCE / 20.0} if turns else {"Kraft [N]": FORCE}
    path, _ = proposed(written({**place, **pushed, "k7": np.cos(9.0 * T)}), "", capsys)
    found = read(path).model.parameters
    inertia, scale = ("inertia", 400.0) if turns else ("mass", 1.0)
    assert found[inertia].value == pytest.approx(20.0 / scale, rel=0.1)
    assert found["Fc"].value == pytest.approx(8.0 / (20.0 if turns else 1.0), rel=0.2)
