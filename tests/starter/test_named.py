"""Names, numbers, units and ranges decide which column could feed a channel."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.signals import Channel, Layout
from evertwin.starter import look
from evertwin.starter.channels.named import matched

ARM = Layout(
    tuple(Channel(f"q{i}", "rad", kind="angle") for i in (1, 2))
    + tuple(Channel(f"qd{i}", "rad/s") for i in (1, 2))
    + (Channel("T", "K"),)
)


def test_numbers_agree_and_units_are_told(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    head = "time [s],joint 1 velocity [rad/s],joint_2_velocity,q1,joint position 2,note,temperature"
    rows = [f"{i / 100},0.{i % 3},0.{i % 4},{i},{2 * i},7,{20 + i % 3}" for i in range(300)]
    path.write_text("\n".join([head, *rows]) + "\n")
    found = {m.channel: m for m in matched(ARM, look([path])[0])}
    assert found["q1"].column == "q1" and found["q1"].unit == "deg"
    assert found["qd1"].column == "joint 1 velocity" and found["qd1"].unit == "rad/s"
    assert found["T"].column == "temperature" and found["T"].unit == "degC"
    numbers = {name: match.column for name, match in found.items()}
    assert all(("1" in column) == ("1" in name) for name, column in numbers.items() if name != "T")


def test_a_name_takes_axes_apart_and_no_difference_for_the_quantity(tmp_path: Path) -> None:
    base = Layout(
        (
            *(Channel(f"v{a}", "m/s") for a in "xy"),
            Channel("w", "rad/s"),
            Channel("x", "m"),
            Channel("heading", "rad", kind="angle"),
        )
    )
    path = tmp_path / "run.csv"
    path.write_text(
        "time;Robot speed along Y axis [m/s];Robot speed along X axis [m/s]"
        ";Rotational speed [rad/s];Delta X local position [m];Angle [deg]\n"
        + "".join(
            f"{i / 10};{i % 3 / 9};{i % 5 / 9};{i % 7 / 9};0.0{i % 4};{i}\n" for i in range(300)
        )
    )
    found = matched(base, look([path])[0])
    assert {m.channel: m.column for m in found} == {
        "vy": "Robot speed along Y axis",
        "vx": "Robot speed along X axis",
        "w": "Rotational speed",
        "heading": "Angle",
    }


@pytest.mark.parametrize(
    ("said", "unit"),
    [("1/min", "rpm"), ("min-1", "rpm"), ("U/min", "U/min"), ("Hz", "turn/s"), ("rad/s", "rad/s")],
)
def test_a_shaft_is_counted_in_turns(said: str, unit: str, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{i / 100},{i % 300},{i % 7}" for i in range(300)]
    path.write_text("\n".join([f"time [s],motor speed [{said}],torque [Nm]", *rows]) + "\n")
    shaft = Layout((Channel("speed", "rad/s"), Channel("torque", "Nm")))
    found = {m.channel: m for m in matched(shaft, look([path])[0])}
    assert (found["speed"].column, found["speed"].unit) == ("motor speed", unit)
    assert found["speed"].scale == 1.0


def test_a_rate_of_which_nobody_knows_what_turns_is_asked(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{i / 100},{i % 300},{i % 7}" for i in range(300)]
    path.write_text("\n".join(["time [s],motor speed [1/s],torque [Nm]", *rows]) + "\n")
    shaft = Layout((Channel("speed", "rad/s"), Channel("torque", "Nm")))
    found = {m.channel: m for m in matched(shaft, look([path])[0])}
    assert found["speed"].scale == "?"


@pytest.mark.parametrize("faulty", [9999.0, "mm"])
def test_a_few_rows_beyond_all_others_say_nothing_of_the_unit(
    tmp_path: Path, faulty: float | str
) -> None:
    """20 s of a map in mm, in 10 min in m, had all of them read in mm."""
    path = tmp_path / "run.csv"
    place = [2.0 + 0.001 * i for i in range(600)]
    for i in range(300, 320):
        place[i] = 1000.0 * place[i] if isinstance(faulty, str) else faulty
    lines = [f"{i},{x}" for i, x in enumerate(place)]
    path.write_text("\n".join(["t [s],pose.x", *lines]) + "\n")
    (found,) = matched(Layout((Channel("x", "m"),)), look([path])[0])
    assert found.unit == "m"
