"""ROS 1 against a real master and nodes that are not ours."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.sources.live import LiveSource, open_live
from evertwin.sources.spec import ArraySpec, ChannelSpec, SourceSpec, TimeSpec
from tests.sources.live.peers import free_port, hear, listen
from tests.sources.live.ros_peers import Master, master

ODOM = SourceSpec(
    "odom", {"x": ChannelSpec("/odom.pose.pose.position.x", "m"),
             "heading": ChannelSpec("/odom.pose.pose.orientation.yaw", "rad")},
    time=TimeSpec("/odom.stamp", "ns"),
)  # fmt: skip
COMMAND = SourceSpec(
    "command",
    {"v": ChannelSpec("/cmd_vel.linear.x", "m/s")},
    time=TimeSpec("/cmd_vel.logged", "ns"),
)
SCAN = ArraySpec("scan", (20,), column="/scan.ranges", time=TimeSpec("/scan.stamp", "ns"))
FRAME = SourceSpec(
    "frame",
    {"x": ChannelSpec("/tf.transforms.base_link.transform.translation.x", "m")},
    time=TimeSpec("/tf.stamp", "ns"),
)
PLACES = ("{{transforms: [{{header: {{frame_id: {}}}, child_frame_id: {}, "
          "transform: {{translation: {{x: {}}}, rotation: {{w: 1.0}}}}}}]}}")  # fmt: skip
QUARTER = ("{header: auto, pose: {pose: {position: {x: 1.5}, "
           "orientation: {z: 0.7071067811865476, w: 0.7071067811865476}}}}")  # fmt: skip
RANGES = f"{{header: auto, ranges: [.inf, {', '.join(['2.5'] * 19)}]}}"


def source(uri: str, spec: SourceSpec | ArraySpec = ODOM, **settings: object) -> LiveSource:
    found = open_live({"source": spec.name, "protocol": "ros", "master": uri, **settings}, spec)
    found.backoff.shortest = found.backoff._bound = 0.05  # type: ignore[attr-defined]
    found.backoff.longest = 0.2  # type: ignore[attr-defined]
    return found


@pytest.mark.system
def test_topics_with_and_without_a_header(tmp_path: Path) -> None:
    with (
        master(tmp_path) as ros,
        ros.node(*ros.says("/odom", "nav_msgs/Odometry", QUARTER)),
        ros.node(*ros.says("/scan", "sensor_msgs/LaserScan", RANGES)),
        ros.node(*ros.says("/robot1/cmd_vel", "geometry_msgs/Twist", "{linear: {x: 0.25}}")),
        ros.node(*ros.says("/tf", "tf2_msgs/TFMessage", PLACES.format("odom", "base_link", 3.0))),
        ros.node(*ros.says("/tf", "tf2_msgs/TFMessage", PLACES.format("map", "odom", 7.0))),
    ):
        sources = [source(ros.uri), source(ros.uri, SCAN),
                   source(ros.uri, COMMAND, topic="/robot1/cmd_vel"),
                   source(ros.uri, FRAME)]  # fmt: skip

        async def all_of_them() -> list[list[Chunk]]:
            hearing = (hear(one, lambda given: len(given) >= 30) for one in sources)
            return await asyncio.gather(*hearing)

        began = time.time()
        odom, scan, command, frame = asyncio.run(all_of_them())
        ended = time.time()
    np.testing.assert_allclose([c.v[0] for c in odom], [[1.5, np.pi / 2]] * len(odom))
    np.testing.assert_array_equal(scan[0].v[0], [np.inf, *[2.5] * 19])
    assert command[0].v[0, 0] == 0.25
    # others place other frames on the same topic: they are no samples, and none is refused
    assert {float(chunk.v[0, 0]) for chunk in frame} == {3.0}
    for chunks in (odom, scan, command):
        stamps = np.array([c.t[0] for c in chunks]) * 1e-9
        assert began < stamps.min() <= stamps.max() < ended
        assert 0.01 < np.median(np.diff(stamps)) < 0.03
    assert all(one.health.losses == 0 and not one.health.rejected for one in sources)


@pytest.mark.system
def test_no_master_a_dead_child_a_dead_master(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "evertwin.live")
    with master(tmp_path) as ros:
        odom = source(ros.uri)
        ros.kill()
        before = set(os.listdir("/proc/self/fd"))

        async def life() -> list[Chunk]:
            hearing = asyncio.create_task(hear(odom, lambda given: done.is_set(), 30.0))
            await state("down")
            assert odom.health.reason.startswith("no master at http://127.0.0.1:")
            ros.start()
            with speaker(ros):
                await state("up")
                os.kill(children()[0], signal.SIGKILL)
                await state("down")
                await state("up")
                ros.kill()
            await state("down")
            assert "master" in odom.health.reason
            ros.start()
            with speaker(ros):
                await state("up")
            done.set()
            return await hearing

        async def state(wanted: str) -> None:
            async with asyncio.timeout(15):
                while odom.health.state != wanted:
                    await asyncio.sleep(0.01)

        done = asyncio.Event()
        chunks = asyncio.run(life())
        assert not children() and len(os.listdir("/proc/self/fd")) <= len(before)
    assert len({int(c.t[0]) for c in chunks}) == len(chunks)
    assert odom.health.reconnects == 2 and odom.health.lost
    said = [record.levelname for record in caplog.records]
    assert said == ["WARNING", "INFO", "WARNING", "INFO", "WARNING", "INFO"]


def speaker(ros: Master):  # type: ignore[no-untyped-def]
    return ros.node(*ros.says("/odom", "nav_msgs/Odometry", QUARTER))


def children() -> list[int]:
    """The rospy processes of this one."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                parent = (entry / "stat").read_text().rpartition(")")[2].split()[1]
            except OSError:
                continue
            if int(parent) == os.getpid() and any(w.endswith(b"ros/child.py") for w in words):
                found.append(int(entry.name))
    return found


@pytest.mark.system
def test_what_is_no_odometry_is_counted(tmp_path: Path) -> None:
    with (
        master(tmp_path) as ros,
        ros.node(*ros.says("/odom", "std_msgs/String", "{data: hello}")),
    ):
        odom = source(ros.uri)
        listen(odom, lambda _: sum(odom.health.rejected.values()) > 5)
    assert dict(odom.health.rejected).keys() == {"no column of the twin in it"}
    assert odom.health.noted  # of a stamp that its type does not have


def test_what_cannot_be_heard_is_said_before() -> None:
    two = SourceSpec("two", {**ODOM.channels, **COMMAND.channels}, time=ODOM.time)
    with pytest.raises(UsageError, match="columns of one topic"):
        source("http://127.0.0.1:1", two).open()
    with pytest.raises(UsageError, match="http://HOST:PORT"):
        source("127.0.0.1:11311")
    absent = source(f"http://127.0.0.1:{free_port()}", python="/nowhere/python3")
    listen(absent, lambda _: absent.health.state == "down")
    assert "no master" in absent.health.reason
