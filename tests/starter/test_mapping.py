"""Recordings as others write them: which column is taken for which channel, and what is asked."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.errors import UsageError
from evertwin.machines.catalog import machine
from evertwin.refit.workers import setup_of
from evertwin.starter import Proposal, look, mapped
from evertwin.starter.numbers.payload import acting

T = np.arange(0.0, 20.0, 0.01)
JOINTS = 6
Columns = Mapping[str, np.ndarray]
Written = Callable[..., Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    def write(columns: Columns, name: str = "run.csv", head: str | None = "") -> Path:
        lines = [] if head is None else [",".join(columns)]
        table = np.stack(list(columns.values()), axis=1)
        lines += [",".join(f"{value:.6g}" for value in row) for row in table]
        (tmp_path / name).write_text("\n".join(lines) + "\n")
        return tmp_path / name

    return write


def motion(joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, speed and torque of a joint."""
    w, noise = 0.7 + 0.2 * joint, np.random.default_rng(joint).normal(size=len(T))
    q = np.sin(w * T) + 0.1 * joint
    qd = w * np.cos(w * T)
    return q, qd + 0.01 * noise, 5 * np.sign(qd) - 3 * w**2 * np.sin(w * T) + 0.2 * noise


def arm(heading: Callable[[str, int], str], degrees: bool = False) -> dict[str, np.ndarray]:
    factor = 180 / np.pi if degrees else 1.0
    told = {"t": T}
    for i, what in enumerate(("q", "qd", "tau")):
        for j in range(JOINTS):
            told[heading(what, j)] = motion(j)[i] * (factor if what != "tau" else 1.0)
    return told


def proposed(*files: Path, kind: str = "arm") -> Proposal:
    options = {"urdf": "ur5_like"} if kind == "arm" else {}
    return mapped(machine(kind, options), look(files)[0])


def columns(proposal: Proposal) -> dict[str, str]:
    return {match.channel: match.column for match in proposal.matches}


WORDS = {"q": "pos", "qd": "vel", "tau": "torque"}
LONG = {"q": "positions", "qd": "velocities", "tau": "efforts"}
FRANKA = {"q": "q", "qd": "dq", "tau": "tau_J"}
URSCRIPT = {"q": "actual_q", "qd": "actual_qd", "tau": "actual_torque"}
UNITS = {"q": "rad", "qd": "rad/s", "tau": "Nm"}
PARTS = ("pan", "tilt", "roll", "hand", "boom", "stick")
HEADINGS: dict[str, Callable[[str, int], str]] = {
    "controllers": lambda what, j: f"{LONG[what]}.{j}",
    "joint first": lambda what, j: f"J{j + 1}_{WORDS[what]}",
    "from zero": lambda what, j: f"{URSCRIPT[what]}_{j}",
    "an index": lambda what, j: f"{FRANKA[what]}[{j}]",
    "parts": lambda what, j: f"{PARTS[j]}_{WORDS[what]}",
    "brackets": lambda what, j: f"joint{j + 1}/{WORDS[what]}[{UNITS[what]}]",
}  # fmt: skip


@pytest.mark.parametrize("heading", HEADINGS.values(), ids=HEADINGS)
def test_an_arm_is_found_whatever_its_headings(
    written: Written, heading: Callable[[str, int], str]
) -> None:
    table = arm(heading)
    found = proposed(written(table))
    order = [re.sub(r"\[\D+\]", "", name) for name in table if name != "t"]
    want = [f"{what}{j + 1}" for what in ("q", "qd", "tau") for j in range(JOINTS)]
    assert columns(found) == dict(zip(want, order, strict=True))
    assert [d.name for d in found.derivations] == [f"qdd{j + 1}" for j in range(JOINTS)]
    assert not found.questions


def test_numbers_tell_angle_from_speed_where_nothing_is_named(written: Written) -> None:
    found = proposed(written(arm(lambda what, j: f"{what}{j}"), head=None))
    assert columns(found) == {
        f"{what}{j + 1}": f"c{2 + 6 * i + j}"
        for i, what in enumerate(("q", "qd", "tau")) for j in range(JOINTS)
    }  # fmt: skip
    assert found.questions == tuple(f"tau{j + 1}: scale" for j in range(JOINTS))


def test_an_angle_in_degrees_is_told_by_its_speed(written: Written) -> None:
    table = arm(lambda what, j: f"{WORDS[what]}_{j}")
    small = {
        name: v * (np.degrees(1) if name.startswith("pos") else 1) for name, v in table.items()
    }
    found = proposed(written(small))
    assert {m.unit for m in found.matches if m.channel.startswith("q")} == {"deg", "rad/s"}


def test_desired_values_and_currents_are_not_what_was_measured(written: Written) -> None:
    table = {"t": T}
    for j in range(JOINTS):
        q, qd, tau = motion(j)
        table |= {
            f"target_q_{j}": q + 0.001, f"actual_q_{j}": q, f"actual_qd_{j}": qd,
            f"target_current_{j}": 0.1 * tau + 0.1, f"actual_current_{j}": 0.1 * tau,
        }  # fmt: skip
    found = proposed(written(table))
    assert columns(found)["q1"] == "actual_q_0" and columns(found)["tau6"] == "actual_current_5"
    assert found.questions[0] == "tau1: scale"


def test_positions_and_torques_in_two_files(written: Written) -> None:
    joints = [motion(j) for j in range(JOINTS)]
    one = written({f"Joint_{j + 1}": q for j, (q, _, _) in enumerate(joints)}, "pos_data.csv")
    two = written({f"Joint_{j + 1}": m for j, (_, _, m) in enumerate(joints)}, "torque_data.csv")
    found = proposed(one, two)
    assert {(m.channel[:-1], m.source) for m in found.matches} == {("q", 0), ("tau", 1)}
    assert [d.name for d in found.derivations][:1] == ["qd1"]


def test_a_base_is_commanded_by_commands_and_answers_with_its_pose(written: Written) -> None:
    v, w = 0.3 * np.sin(T), 0.2 * np.cos(0.3 * T)
    table = {
        "t": T, "left_wheel_vel": v * 5, "cmd_vel_linear_x": v, "cmd_vel_angular_z": w,
        "icp_x": np.cumsum(v) * 0.01, "icp_y": 0.1 * np.sin(0.1 * T),
        "icp_yaw": np.cumsum(w) * 0.01, "delta_x": 0.01 * v, "range": np.full(len(T), 3.0),
    }  # fmt: skip
    found = proposed(written(table), kind="differential")
    assert columns(found) == {
        "v": "cmd_vel_linear_x", "w": "cmd_vel_angular_z", "x": "icp_x", "y": "icp_y",
        "heading": "icp_yaw",
    }  # fmt: skip
    assert not found.questions


def test_two_commanded_wheels_become_speed_and_turn_rate(written: Written) -> None:
    table = {
        "t": T, "cmd_left": np.sin(T), "cmd_right": np.cos(T), "left_vel": np.sin(T - 0.1),
        "right_vel": np.cos(T - 0.1), "x": np.sin(0.1 * T), "y": np.cos(0.1 * T), "yaw": 0.1 * T,
    }  # fmt: skip
    found = proposed(written(table), kind="differential")
    assert columns(found)["left"] == "cmd_left" and columns(found)["right"] == "cmd_right"
    assert found.questions == ("v: value", "w: value")


def test_what_stays_constant_is_asked_about(written: Written, tmp_path: Path) -> None:
    still = {"t": T, "v_cmd": np.full(len(T), 0.3), "x": 0.3 * T}
    found = proposed(written(still), kind="robot1d")
    assert found.questions == ("v: column",)
    assert "v_cmd would do, but stays at 0.3" in found.matches[0].reason
    faster = written({**still, "v_cmd": np.full(len(T), 0.5)}, "two.csv")
    assert not proposed(tmp_path / "run.csv", faster, kind="robot1d").questions


def test_an_axis_moved_by_a_voltage(written: Written) -> None:
    table = {"t": T, "qm": np.sin(T), "qg": np.sin(T + 0.01), "vir": np.cos(T)}
    found = proposed(written(table), kind="drive")
    assert columns(found) == {"force": "vir", "position": "qm"}
    assert [d.name for d in found.derivations] == ["speed"]
    assert found.questions == ("force: scale",)


def test_the_room_is_the_steadiest_temperature(written: Written) -> None:
    table = {
        "t": T, "t1": 30 + np.sin(T), "t2": 31 + np.sin(T), "t3": 21 + 0.1 * np.sin(T),
        "heater_on": (np.sin(T) > 0).astype(float), "average_temperature": 30.5 + np.sin(T),
    }  # fmt: skip
    found = proposed(written(table), kind="thermal")
    assert columns(found) == {"heater": "heater_on", "box": "average_temperature", "room": "t3"}


@pytest.mark.parametrize(("most", "unit", "asks"), [(1, "1", False), (100, "%", False),
                                                   (3000, "1", True)])  # fmt: skip
def test_a_share_without_a_unit_is_told_by_its_values(
    most: float, unit: str, written: Written, *, asks: bool
) -> None:
    table = {
        "t": T, "HeaterDuty": most * (np.sin(T) > 0), "ChamberTemp": 60 + 20 * np.sin(T),
        "RoomTemp": 21 + 0.1 * np.sin(T),
    }  # fmt: skip
    found = proposed(written(table), kind="thermal")
    (heater,) = (match for match in found.matches if match.channel == "heater")
    assert (heater.column, heater.unit) == ("HeaterDuty", unit)
    assert found.questions == (("heater: scale",) if asks else ())


def test_bodies_of_an_arm_stay_once_they_are_known(
    written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = written(arm(lambda what, j: f"{what}{j + 1}"))
    write_starter([table], tmp_path / "new.toml", ("arm", None), force=False, as_json=False)
    names = set(setup_of(read(tmp_path / "new.toml")).once)
    known = machine("arm", {"urdf": "ur5_like", "base": True}).parameters.names
    assert names == {name for name in known if "." in name or name.startswith("Ia")}


@pytest.mark.parametrize("count", [4, 5, 7])
def test_an_arm_of_other_joints_is_not_taken_for_the_built_in_one(
    written: Written, tmp_path: Path, count: int
) -> None:
    told = {"t": T} | {
        f"{what}{j + 1}": motion(j)[0] for what in ("q", "tau") for j in range(count)
    }
    with pytest.raises(UsageError, match=f"of {count} joints, .* --urdf FILE"):
        write_starter([written(told)], tmp_path / "new.toml", ("arm", None), False, False)
    assert not (tmp_path / "new.toml").exists()


def test_what_stands_in_for_a_description_is_said(
    written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = written(arm(lambda what, j: f"{what}{j + 1}"))
    write_starter([table], tmp_path / "new.toml", ("arm", None), force=False, as_json=False)
    said = "bodies of ur5_like, as no description was given: give the arm's own, --urdf FILE"
    assert said in capsys.readouterr().out
    assert f"# {said}" in (tmp_path / "new.toml").read_text()


SCARA = [
    {
        "name": "shoulder",
        "a": 0.35,
        "d": 0.4,
        "mass": 9.0,
        "com": [-0.17, 0, 0],
        "inertia": [0.03, 0.12, 0.12],
    },
    {
        "name": "elbow",
        "a": 0.3,
        "alpha": np.pi,
        "mass": 6.0,
        "com": [-0.15, 0, 0],
        "inertia": [0.01, 0.06, 0.06],
    },
    {
        "name": "quill",
        "kind": "prismatic",
        "mass": 1.5,
        "com": [0, 0, -0.1],
        "inertia": [0.005, 0.005, 0.001],
    },
]


WRIST = {"name": "wrist", "mass": 0.5, "com": [0, 0, -0.02], "inertia": [1e-3, 1e-3, 1e-3]}
FOUR = [*SCARA, WRIST]


def test_of_a_load_only_numbers_that_act_are_proposed() -> None:
    """What is carried along an axis that stays upright moves no motor of a SCARA."""
    scara = machine("arm", {"dh": FOUR, "convention": "standard", "payload": True})
    assert acting(scara) == ("m", "mx", "my")
    six = machine("arm", {"urdf": "ur5_like", "payload": True, "base": True})
    assert acting(six) == ("m", "mx", "my", "mz")


@pytest.mark.parametrize("slide", ["Z", "Q", "lift"])
def test_a_slide_among_numbered_joints_is_one_of_them(written: Written, slide: str) -> None:
    """Not position, velocity, acceleration and current of the first joint for its four joints."""
    joints, told = ("J1", "J2", slide, "J4"), {"t": T}
    for k, what in enumerate(("Position", "Velocity", "Acceleration", "Current")):
        told |= {f"{joint} {what}": motion(j)[min(k, 2)] for j, joint in enumerate(joints)}
    found = mapped(machine("arm", {"dh": FOUR, "convention": "standard"}), look([written(told)])[0])
    known = {match.channel: match.column for match in found.matches}
    for channel, what in {"q": "Position", "qd": "Velocity", "tau": "Current"}.items():
        own = [known[f"{channel}{j + 1}"] for j in range(4)]
        assert own == [f"{joint} {what}" for joint in joints]


@pytest.mark.parametrize(
    ("way", "speed", "units"),
    [(1e3, 1e3, ("mm", "mm/s")), (1.0, 1.0, ("m", "m/s")), (1e3, 1.0, ("mm", "m/s"))],
)
def test_a_slide_s_place_and_speed_tell_each_other_s_unit(
    written: Written, way: float, speed: float, units: tuple[str, str]
) -> None:
    """The other joints are in degrees, so what the family reaches says nothing of it."""
    told = {"t": T}
    for what in ("q", "qd", "tau"):
        for j in range(3):
            q, qd, tau = motion(j)
            size = {"q": way, "qd": speed}.get(what, 1.0) * 0.1 if j == 2 else 180 / np.pi
            told[f"axis{j + 1}_{WORDS[what]}"] = {"q": q, "qd": qd, "tau": tau / size}[what] * size
    options = {"dh": SCARA, "convention": "standard"}
    found = mapped(machine("arm", options), look([written(told)])[0])
    known = {match.channel: (match.unit, match.reason) for match in found.matches}
    assert (known["q3"][0], known["qd3"][0]) == units
    assert known["q3"][1] == known["qd3"][1] == "place and speed fit each other"
    assert known["q1"][0] == "deg"
