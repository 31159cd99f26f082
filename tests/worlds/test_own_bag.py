"""A bag that the embedded robot wrote is read by its twin file, and by `init`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.info_command import show_info
from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.errors import DataError
from evertwin.report.scan_picture import MOST, draw_scans
from evertwin.sources import open_recording
from evertwin.sources.robot_logs.bag_scans import scans_of
from evertwin.sources.robot_logs.ros_messages import flat
from evertwin.worlds.live.recorder import main as record

TWIN = Path(__file__).parents[2] / "twins" / "robot_ros.toml"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("bag") / "robot.mcap"
    record(["robot", "--seconds", "40", "--record", str(file)])
    return file


def test_a_recorded_robot_runs_by_its_twin_file(bag: Path) -> None:
    with Twin.open(TWIN) as twin:
        result = twin.run(bag)
    assert result.samples == 40 and not result.left_out
    assert np.isfinite(result.outputs["heading"].rms_after)


def test_a_recorded_robot_is_proposed_whole(bag: Path) -> None:
    twin = bag.with_name("new.toml")
    write_starter([bag], twin, ("", None), False, False)
    spec = read(twin)
    found = {name: c.column for one in spec.source for name, c in one.channels.items()}
    assert found == {
        "v": "/cmd_vel.linear.x", "w": "/cmd_vel.angular.z",
        "x": "/amcl_pose.pose.pose.position.x", "y": "/amcl_pose.pose.pose.position.y",
        "heading": "/amcl_pose.pose.pose.orientation.yaw",
    }  # fmt: skip


def test_a_turn_in_the_plane_may_leave_its_zeros_out() -> None:
    short = dict(flat({"q": {"z": np.sin(0.3), "w": np.cos(0.3)}}))
    assert short["q.yaw"] == pytest.approx(0.6)
    for other in ({"z": 1.0}, {"w": 1.0}, {"x": 1.0, "z": 0.0, "w": 1.0}, {"z": 1, "w": 1, "h": 2}):
        assert "q.yaw" not in dict(flat({"q": other}))


def test_a_file_of_scans_has_its_picture(bag: Path, tmp_path: Path) -> None:
    show_info(bag, as_json=False, check=False, picture=tmp_path / "scans.png")
    assert (tmp_path / "scans.png").read_bytes().startswith(b"\x89PNG")
    (scans,) = scans_of(open_recording(bag))
    figure = draw_scans([scans])
    assert len(figure.axes) == MOST
    drawn = np.hypot(*figure.axes[-1].lines[0].get_xydata().T)
    assert np.allclose(drawn, scans.ranges[-1], equal_nan=True)
    (tmp_path / "run.csv").write_text("t,x\n0,1\n1,2\n")
    with pytest.raises(DataError, match="no image and no scan"):
        show_info(tmp_path / "run.csv", as_json=False, check=False, picture=tmp_path / "no.png")
