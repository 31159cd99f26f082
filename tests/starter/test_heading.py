"""The twin file that is proposed for a moving base watches its heading, too."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.machines.mobile import Differential
from evertwin.starter.looks.words import quantity, words
from planted.draws import first_of

STEP, ROWS = 0.1, 4000


def recorded(folder: Path, seed: int, turn_gain: float) -> Path:
    """A base on its way; from the middle on with another gain of its turns."""
    rng = np.random.default_rng(seed)
    u = np.column_stack([
        np.repeat(rng.uniform(0.0, 0.5, ROWS // 40), 40),
        np.repeat(rng.uniform(-0.8, 0.8, ROWS // 25), 25),
    ])  # fmt: skip
    base = Differential()
    x, parts = np.zeros(3), []
    for part, gain in ((u[: ROWS // 2], 1.0), (u[ROWS // 2 :], turn_gain)):
        p = base.parameters.with_values({"gain": 1.0, "turn_gain": gain}).values
        x, y = base.simulate(x, part, np.full(len(part), STEP), p)
        parts.append(y)
    pose = np.concatenate(parts) + rng.normal(0.0, [0.002, 0.002, 0.004], (ROWS, 3))
    # the pose of a row is that before its command acts
    table = np.column_stack([STEP * np.arange(ROWS), np.roll(u, -1, axis=0), pose])[:-1]
    file = folder / f"{seed}-{turn_gain}.csv"
    heads = "t [s],v [m/s],w [rad/s],x [m],y [m],heading [rad]"
    np.savetxt(file, table, fmt="%.5f", delimiter=",", header=heads, comments="")
    return file


@first_of("seed", [1, 2, 3])
def test_a_turning_gain_that_is_off_is_told(tmp_path: Path, seed: int) -> None:
    file = recorded(tmp_path, seed, 0.75)
    twin = tmp_path / "robot.toml"
    write_starter([file], twin, ("", None), False, False)
    limit = re.search(r"(?m)^requirement = ([\d.]+)\n", twin.read_text())
    assert limit and 0.001 <= float(limit[1]) <= 0.02  # at most 0.5 m in a prediction of 1 s
    spec = read(twin)
    assert spec.anomaly.outputs == ("x", "y", "heading") and not spec.anomaly.relative
    healthy = recorded(tmp_path, seed, 1.0)
    for recording, off in ((file, True), (healthy, False)):
        with Twin(spec) as one:
            told = one.run(recording).of_kind("suspected", "abnormal")
        assert bool(told) == off, [event.reason for event in told]
        assert not off or told[0].signal == "heading"


@pytest.mark.parametrize("rate", ["rad/s", "deg/s"])
@pytest.mark.parametrize("heading", ["rad", "deg"])
@first_of("seed", range(5))
def test_a_heading_and_its_rate_tell_their_units(
    tmp_path: Path, seed: int, heading: str, rate: str
) -> None:
    """A heading that goes on over turns is far from zero in radians, too."""
    table = np.loadtxt(recorded(tmp_path, seed, 0.8), delimiter=",", skiprows=1)
    table[:, 5] = np.unwrap(table[:, 5]) * (1.0 if heading == "rad" else 180.0 / np.pi)
    table[:, 2] *= 1.0 if rate == "rad/s" else 180.0 / np.pi
    file = tmp_path / "plain.csv"
    np.savetxt(file, table, fmt="%.6f", delimiter=",", header="t,v,w,x,y,theta", comments="")
    write_starter([file], tmp_path / "base.toml", ("differential", None), False, False)
    told = read(tmp_path / "base.toml").source[0].channels
    assert (told["heading"].unit, told["w"].unit) == (heading, rate)


@pytest.mark.parametrize("turn", ["cmd_vel_yaw", "yaw_cmd", "w_cmd"])
def test_a_commanded_yaw_is_the_turn_rate(tmp_path: Path, turn: str) -> None:
    file = recorded(tmp_path, 4, 1.0)
    rest = file.read_text().partition("\n")[2]
    file.write_text(f"t,cmd_vel_x,{turn},odom_x,odom_y,odom_yaw\n{rest}")
    twin = tmp_path / "robot.toml"
    write_starter([file], twin, ("", None), False, False)
    spec = read(twin)
    columns = {name: one.column for name, one in spec.source[0].channels.items()}
    assert spec.model.kind == "differential"
    assert (columns["w"], columns["heading"]) == (turn, "odom_yaw")


def test_a_german_heating_is_the_heater(tmp_path: Path) -> None:
    file = tmp_path / "bath.csv"
    rows = "".join(f"{k};{k // 7 % 2};{40 + k % 9};{20 + k % 2}\n" for k in range(200))
    file.write_text(f"Zeit [s];Heizung;Badtemperatur [°C];Raumtemperatur [°C]\n{rows}")
    write_starter([file], tmp_path / "bath.toml", ("thermal", None), False, False)
    assert read(tmp_path / "bath.toml").source[0].channels["heater"].column == "Heizung"


def test_a_torque_in_per_cent_of_the_rated_one_is_a_torque() -> None:
    assert quantity(words("J1_ActTrq"), "%") == "torque"
    assert quantity(words("J1_ActPos"), "deg") == "position"
