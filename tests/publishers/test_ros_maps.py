"""Map, costs and tables as ROS messages, and as rosbag records them from a real master."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.features.maps.cost_map import Inflation, inflated, read_costs
from evertwin.features.maps.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, save
from evertwin.publishers.contract import News
from evertwin.publishers.ros_maps import MAPS, Maps
from tests.publishers.test_ros_out import HEALTH, OUTPUTS, SCENE, heard, publisher, wait
from tests.sources.live.ros_peers import master

TABLE = "number,x,y,heading,length,width\n1,{x},1.0,0.5,1.2,0.8\n"


def room(folder: Path) -> Occupancy:
    """A folder as `evertwin map` and `evertwin tables` leave it."""
    cells = np.full((30, 40), FREE, np.uint8)
    cells[10, 10], cells[20:, :] = OCCUPIED, UNKNOWN
    drawn = Occupancy(cells, 0.1, (-1.0, -2.0))
    save(drawn, folder / "map.yaml")
    save(inflated(drawn, [], Inflation(0.2, 0.5)), folder / "costs.yaml", "raw")
    (folder / "tables.csv").write_text(TABLE.format(x=2.0))
    return drawn


def test_what_stands_in_the_files_is_said_and_again_when_it_changes(tmp_path: Path) -> None:
    drawn, maps = room(tmp_path), Maps(tmp_path, "map")
    said = dict(maps.changed(5 * 10**9))
    assert set(said) == set(MAPS) and maps.reason == ""
    data = np.array(said["map"]["data"]).reshape(drawn.cells.shape)
    assert (data[10, 10], data[0, 0], data[25, 0]) == (100, 0, -1)
    about = said["map"]["info"]
    assert (about["width"], about["height"], about["resolution"]) == (40, 30, 0.1)
    assert about["origin"]["position"] == {"x": -1.0, "y": -2.0}
    costs = np.array(said["costs"]["data"]).reshape(drawn.cells.shape)
    assert costs[10, 10:17].tolist() == [100, 99, 99, 36, 13, 5, 0] and costs[25, 0] == -1
    plate = said["tables"]["markers"][1]
    assert (plate["pose"]["position"]["x"], plate["scale"]["x"]) == (2.0, 1.2)
    assert dict(maps.changed(6 * 10**9)) == {}
    (tmp_path / "tables.csv").write_text(TABLE.format(x=3.0))
    os.utime(tmp_path / "tables.csv", ns=(1, 1))
    moved = dict(maps.changed(7 * 10**9))
    assert list(moved) == ["tables"]
    assert moved["tables"]["markers"][0]["action"] == 3  # the one before is taken away
    assert moved["tables"]["markers"][1]["pose"]["position"]["x"] == 3.0
    maps.again()
    assert set(dict(maps.changed(8 * 10**9))) == set(MAPS)


def test_what_cannot_be_read_is_named_and_not_said(tmp_path: Path) -> None:
    room(tmp_path)
    (tmp_path / "map.pgm").write_bytes(b"P5\n40 30\n255\n123")
    maps = Maps(tmp_path, "map")
    assert set(dict(maps.changed(0))) == {"costs", "tables"}
    broken = Maps(tmp_path, "map")
    (tmp_path / "costs.yaml").unlink(), (tmp_path / "tables.csv").unlink()
    assert dict(broken.changed(0)) == {} and "3 bytes of image, expected 40" in broken.reason
    with pytest.raises(DataError, match=r"expected costs \(mode: raw\), got a map"):
        room(tmp_path)
        read_costs(tmp_path / "map.yaml")


@pytest.mark.system
def test_as_rosbag_records_them(tmp_path: Path) -> None:
    bag, topics = tmp_path / "said.bag", [f"/evertwin/robot/{name}" for name in MAPS]
    room(tmp_path)
    with master(tmp_path) as ros:
        out = publisher(ros.uri, "robot", OUTPUTS, SCENE, maps=str(tmp_path))

        async def speak() -> None:
            out.open()
            await wait(lambda: out.health["state"] == "up")
            for topic in topics:
                await wait(lambda: ros.connected(topic) >= 1, 30.0)  # noqa: B023
            out.publish(News("robot", "health", HEALTH))
            await asyncio.sleep(1.0)
            await out.close()

        with ros.recording(bag, *topics):
            asyncio.run(speak())
    said = heard(bag)
    (drawn,), (costs,), (tables,) = (said[topic] for topic in topics)
    assert (drawn.info.width, drawn.info.height, len(drawn.data)) == (40, 30, 1200)
    assert drawn.data[10 * 40 + 10] == 100 and costs.data[10 * 40 + 13] == 36
    assert [one.text for one in tables.markers] == ["", "", "table 1"]
