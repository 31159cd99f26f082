"""Messages printed without headings: said, with the line that is missing, which then does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.sources import inspect, open_recording
from evertwin.sources.texts.echoed import _MESSAGES, fitting, heading
from evertwin.starter import kind_of, look

N = 400
V, ANGLE = np.repeat([0.4, 0.9, 0.6, 1.2], N // 4), np.repeat([0.1, -0.2, 0.3, 0.0], N // 4)


def _rows(path: Path, frame: str, members: np.ndarray) -> Path:
    lines = []
    for i, row in enumerate(members):
        stamp = 1_741_958_000_432_100_057 + 50_000_000 * i
        cells = (f"{x:.9f}" for x in row)
        lines.append(f"{stamp // 10**9},{stamp % 10**9},{frame},{','.join(cells)}\n")
    path.write_text("".join(lines))
    return path


def _drive(path: Path) -> Path:
    none = np.zeros(N)
    return _rows(path, "base_link", np.column_stack([ANGLE, none, V, none, none]))


def _pose(path: Path) -> Path:
    heading = np.cumsum(0.05 * V * np.tan(ANGLE) / 0.33)
    x, y = np.cumsum(0.05 * V * np.cos(heading)), np.cumsum(0.05 * V * np.sin(heading))
    none = np.zeros(N)
    turn = (none, none, np.sin(heading / 2), np.cos(heading / 2))
    return _rows(path, "map", np.column_stack([x, y, none, *turn]))


def test_the_line_that_is_missing_is_told_and_does(tmp_path: Path) -> None:
    drive, pose = _drive(tmp_path / "drive.csv"), _pose(tmp_path / "pose.csv")
    (said,) = open_recording(pose).notes
    assert "ros2 topic echo --csv" in said
    assert said in inspect(pose).findings
    line = said.rpartition("first line: ")[2]
    assert line == heading("geometry_msgs/PoseStamped")
    (other,) = open_recording(drive).notes
    assert "sensor_msgs/Range or ackermann_msgs/AckermannDriveStamped" in other
    pose.write_text(f"{line}\n{pose.read_text()}")
    told = heading("ackermann_msgs/AckermannDriveStamped")
    drive.write_text(f"{told}\n{drive.read_text()}")
    assert kind_of(look([drive, pose])[0]) == "bicycle"


@pytest.mark.parametrize("row", ["0.1,0.2,on,3", "1741958000,1741958001,on,3", "5,7,,1"])
def test_other_tables_without_headings_are_left_alone(row: str, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"{row}\n" * 9)
    assert not open_recording(file).notes


def test_a_message_of_unknown_length_is_said_all_the_same(tmp_path: Path) -> None:
    (said,) = open_recording(_rows(tmp_path / "a.csv", "", np.ones((9, 25)))).notes
    assert "names of its members" in said


def test_each_message_fits_its_own_heading() -> None:
    for message in _MESSAGES:
        names = heading(message).split(",")
        kinds = "".join("t" if name.endswith("frame_id") else "n" for name in names)
        assert message in fitting(kinds)
        assert len(set(names)) == len(names)
