"""The embedded robot at a real ROS 1 master: heard live, recorded by rosbag, played back."""

from __future__ import annotations

import asyncio
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.machine.live_processes import Common, LiveMachine, robot_options
from evertwin.config import read
from evertwin.fold import Chunk
from evertwin.ros.node import NodeDown, Raw, Subscription, node_at
from evertwin.ros.spec import Place
from evertwin.ros.topics import simulate
from evertwin.ros.transforms import transforms
from evertwin.sources.live import open_live
from evertwin.sources.robot_logs.bag_files import messages
from evertwin.worlds.live.voices.ros import TYPES, RosVoice
from tests.sources.live.peers import free_port
from tests.sources.live.ros_peers import master

TWIN = read(Path(__file__).parent.parent.parent / "twins" / "robot_ros.toml")
SECONDS = 8.0
PLAIN = ("/imu", "/odom", "/tf", "/tf_static", "/clock", "/cmd_vel", "/scan", "/amcl_pose")


async def heard(uri: str, speaker: list[str]) -> tuple[dict[str, list[Chunk]], dict[str, Raw]]:
    """What the sources of the twin file hear, from before somebody speaks until all is quiet; and
    the newest message of each topic."""
    sources = {one.name: open_live({"source": one.name, "protocol": "ros", "master": uri}, one)
               for one in (*TWIN.source, *TWIN.array)}  # fmt: skip
    found: dict[str, list[Chunk]] = {name: [] for name in sources}
    newest = [time.monotonic() + 10.0]

    async def listen(name: str) -> None:
        source = sources[name]
        source.open()
        async for chunk in source.chunks():
            found[name].append(chunk)
            newest[0] = time.monotonic()
            source.committed(chunk)

    tasks = [asyncio.create_task(listen(name)) for name in sources]
    async with node_at(Place(uri)) as node:
        lines = {topic: node.subscribe(topic) for topic in PLAIN}
        raw = await said(speaker, newest, lines)
    for source in sources.values():
        source.close()
    await asyncio.gather(*tasks)
    assert not any(one.health.losses for one in sources.values())
    return found, raw


async def said(
    speaker: list[str], newest: list[float], lines: dict[str, Subscription]
) -> dict[str, Raw]:
    """The newest of each line, once it is quiet."""
    process = await asyncio.create_subprocess_exec(*speaker, stdout=subprocess.DEVNULL)
    while time.monotonic() < newest[0] + 0.7:
        await asyncio.sleep(0.05)
    if process.returncode is None:
        process.terminate()
    await process.wait()
    raw = {}
    for topic, line in lines.items():
        with suppress(TimeoutError):
            while True:
                async with asyncio.timeout(0.01):
                    raw[topic] = await line.next()
    return raw


def columns(chunks: list[Chunk]) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate([c.t for c in chunks]), np.concatenate([c.v for c in chunks])


@pytest.mark.system
def test_lived_recorded_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = tmp_path / "lived.bag"
    with master(tmp_path) as ros:
        asyncio.run(simulate(Place(ros.uri)))
        for name in ("ROS_MASTER_URI", "ROS_IP"):
            monkeypatch.setenv(name, ros.environment[name])
        options = robot_options(Common(speed=5.0, seconds=SECONDS), None, ros=Place(ros.uri))
        machine = LiveMachine.command("robot", options)
        with ros.recording(bag, "/cmd_vel", "/amcl_pose", "/scan"):
            lived, raw = asyncio.run(heard(ros.uri, machine))
        check = subprocess.run(["rosbag", "check", str(bag)], capture_output=True, text=True)
        assert check.returncode == 0, check.stdout
        play = ["rosbag", "play", "--clock", "--hz", "500", "-r", "5", "-d", "0.7", str(bag)]
        played, _ = asyncio.run(heard(ros.uri, play))
    count = {"command": SECONDS, "pose": SECONDS, "scan": 2 * SECONDS}
    for name, wanted in count.items():
        (t, v), (again, w) = columns(lived[name]), columns(played[name])
        assert len(t) == wanted
        np.testing.assert_array_equal(v, w)
        if name != "command":  # the only one without a stamp of its own
            np.testing.assert_array_equal(t, again)
    recorded = [one.connection.topic for one in messages(bag, "ros1")]
    assert {topic: recorded.count(topic) for topic in recorded} == {
        "/cmd_vel": SECONDS, "/amcl_pose": SECONDS, "/scan": 2 * SECONDS,
    }  # fmt: skip
    assert {topic: one.type for topic, one in raw.items()} == {
        **TYPES, "/tf_static": "tf2_msgs/TFMessage"
    }  # fmt: skip
    (odom,) = transforms(raw["/tf"].data)
    assert (odom.parent, odom.child) == ("odom", "base_link")
    children = {one.child: one.parent for one in transforms(raw["/tf_static"].data)}
    assert children == {"base_scan": "base_link", "imu_link": "base_link"}
    # the clock of ROS is the machine's: what has no stamp is stamped by it
    assert 0 <= odom.t - raw["/cmd_vel"].at < 1.1e9


def test_without_a_master_it_says_so() -> None:
    voice = RosVoice(Place(f"http://127.0.0.1:{free_port()}"), None)
    with pytest.raises(NodeDown, match="no master at http"):
        asyncio.run(voice.open())
