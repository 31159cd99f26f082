"""Messages exported to a table: a stamp in two columns is one clock, a quaternion a yaw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.sources import inspect
from evertwin.sources.columns.cells import Cell
from evertwin.sources.recorded import Clock, Recorded

START = 1_716_799_999
TWIST = ("twist.twist.linear.x", "twist.twist.angular.z")
POSE = ("pose.pose.position.x", "pose.pose.position.y")
TURN = tuple(f"pose.pose.orientation.{axis}" for axis in "xyzw")


def numbers(seed: int, rows: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps [ns] at about 20 Hz, the cells of a message beside them, and its heading."""
    rng = np.random.default_rng(seed)
    ns = START * 10**9 + np.cumsum(rng.integers(45_000_000, 55_000_000, rows))
    yaw = np.cumsum(rng.normal(0.0, 0.1, rows))
    twist = np.column_stack([rng.uniform(-0.5, 1, rows), np.zeros(rows), rng.uniform(-1, 1, rows)])
    place = np.column_stack([np.cumsum(rng.normal(0, 0.1, (rows, 2)), axis=0), np.zeros(rows)])
    turn = np.column_stack([np.zeros((rows, 2)), np.sin(yaw / 2), np.cos(yaw / 2)])
    return ns, np.column_stack([twist[:, 0], twist[:, 2], place[:, :2], turn]), yaw


def exported(folder: Path, seed: int, how: str, unit: bool = True) -> tuple[Path, np.ndarray]:
    ns, cells, yaw = numbers(seed)
    cells[:, 4:] *= 1.0 if unit else 3.0
    heads = ["header.seq", "header.stamp.secs", "header.stamp.nsecs", *TWIST, *POSE, *TURN]
    clocks = [f"{k},{t // 10**9},{t % 10**9}" for k, t in enumerate(ns.tolist())]
    if how == "echo":
        heads = ["%time", "field.header.seq", "field.header.stamp", *(
            f"field.{name}" for name in (*TWIST, *POSE, *TURN))]  # fmt: skip
        clocks = [f"{t},{k},{t}" for k, t in enumerate(ns.tolist())]
    elif how == "two":  # the names of ROS 2
        heads = [h.replace("nsecs", "nanosec").replace("secs", "sec") for h in heads]
    elif how == "unstamped":
        clocks = [f"{k},0,0" for k in range(len(ns))]
    lines = [f"{c},{','.join(f'{x:.9f}' for x in row)}" for c, row in zip(clocks, cells.tolist())]
    file = folder / "log.csv"
    file.write_text("\n".join([",".join(heads), *lines]) + "\n")
    return file, np.angle(np.exp(1j * yaw))


@pytest.mark.parametrize("how", ["seq", "two", "echo"])
@pytest.mark.parametrize("seed", [1, 2])
def test_an_exported_message_is_one_clock_and_a_pose(tmp_path: Path, how: str, seed: int) -> None:
    file, yaw = exported(tmp_path, seed, how)
    (table,) = inspect(file).tables
    ns = numbers(seed)[0]
    assert table.time is not None and (table.time.start, table.time.end) == (ns[0], ns[-1])
    assert [c.column for c in table.clocks] == ["field.header.stamp"] * (how == "echo")
    write_starter([file], tmp_path / "base.toml", ("", None), False, False)
    spec = read(tmp_path / "base.toml")
    found = {name: c.column for name, c in spec.source[0].channels.items()}
    before = "field." * (how == "echo")
    wanted = dict(zip(("v", "w", "x", "y"), (*TWIST, *POSE)))
    wanted["heading"] = "pose.pose.orientation.yaw"
    assert found == {name: before + column for name, column in wanted.items()}
    assert spec.model.kind == "differential"
    cells = (Cell("heading", found["heading"], "rad"),)
    time = spec.source[0].time
    (chunk,) = Recorded("log", (file,), cells, Clock(time.column, time.unit)).read()
    assert chunk.t.tolist() == ns.tolist()
    np.testing.assert_allclose(np.exp(1j * chunk.v[:, 0]), np.exp(1j * yaw), atol=1e-6)


def test_what_is_no_stamp_and_no_turn_adds_no_column(tmp_path: Path) -> None:
    file, _ = exported(tmp_path, 3, "unstamped", unit=False)
    (table,) = inspect(file).tables
    assert table.time is None and len(table.columns) == 11  # a sequence is no time either
    write_starter([file], tmp_path / "base.toml", ("differential", None), False, False)
    text = (tmp_path / "base.toml").read_text()
    assert 'rate = "?"' in text and 'heading = { column = "?"' in text
