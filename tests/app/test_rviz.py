"""`evertwin ros rviz`: what is written for which topics, and what it asks for."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evertwin.ros.spec import Place
from tests.sources.live.peers import free_port

SITE = 'schema = 1\nname = "hall"\n[[twin]]\nfile = "robot.toml"\n'
OUT = '[[twin.publisher]]\nprotocol = "ros"\nmaster = "http://127.0.0.1:{}"\nmap = "hall"\n'
SAID = {
    "/scan": "sensor_msgs/LaserScan", "/odom": "nav_msgs/Odometry", "/rosout": "rosgraph_msgs/Log",
    "/evertwin/robot/path": "nav_msgs/Path",
    "/evertwin/robot/markers": "visualization_msgs/MarkerArray",
}  # fmt: skip


def site(folder: Path, port: int) -> Path:
    file = folder / "site.toml"
    file.write_text(SITE + OUT.format(port))
    return file


def test_a_display_for_each_topic_that_can_be_drawn(
    tmp_path: Path, call: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def said(place: Place) -> dict[str, str]:
        return SAID if place.master.endswith(":1") else {"/rosout": SAID["/rosout"]}

    monkeypatch.setattr("evertwin.app.site.rviz_command.topics_of", said)
    done = call("ros", "rviz", str(site(tmp_path, 1)), "--json")
    told = json.loads(done.out)
    assert done.code == 0 and told["topics"] == [topic for topic in SAID if topic != "/rosout"]
    assert told["start"] == f"ROS_MASTER_URI=http://127.0.0.1:1 rviz -d {tmp_path / 'site.rviz'}"
    written = json.loads((tmp_path / "site.rviz").read_text())["Visualization Manager"]
    assert written["Global Options"]["Fixed Frame"] == "hall"
    shown = {one["Name"]: one["Class"] for one in written["Displays"]}
    assert shown == {
        "Grid": "rviz/Grid", "TF": "rviz/TF", "/scan": "rviz/LaserScan", "/odom": "rviz/Odometry",
        "/robot/path": "rviz/Path", "/robot/markers": "rviz/MarkerArray",
    }  # fmt: skip
    done = call("ros", "rviz", str(site(tmp_path, 2)))
    assert done.code == 4 and "nothing that RViz draws is published" in done.err


def test_what_it_asks_for(tmp_path: Path, call: Callable[..., Any]) -> None:
    done = call("ros", "rviz", str(site(tmp_path, free_port())))
    assert done.code == 4 and "start it, the robot and evertwin serve first" in done.err
    file = tmp_path / "bare.toml"
    file.write_text(SITE)
    done = call("ros", "rviz", str(file))
    assert done.code == 2 and 'no [[twin.publisher]] with protocol = "ros"' in done.err
