"""A first look at machines, as `evertwin doctor site.toml` prints it."""

from __future__ import annotations

import asyncio
import struct
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path

import pytest

from evertwin.sources.live.contract import Around
from evertwin.sources.live.look import SHOWN, look
from evertwin.sources.live.registry import read_settings
from evertwin.sources.live.ros.spec import RosSettings
from evertwin.sources.live.ros.topics import look_ros, wanted
from evertwin.worlds.live.voices.broker import OwnBroker
from evertwin.worlds.live.voices.mqtt import MqttPublisher
from tests.sources.live.peers import free_port
from tests.sources.live.ros_peers import master
from tests.sources.live.test_modbus import server
from tests.sources.live.test_mqtt import mosquitto, said
from tests.sources.live.test_ros import ODOM, QUARTER


def floats(asked: bytes) -> bytes:
    """42.5 in every pair of registers; input registers are refused."""
    count = struct.unpack(">H", asked[10:12])[0]
    if asked[7] == 4:
        return asked[:4] + struct.pack(">HBBB", 3, asked[6], 0x84, 2)
    if asked[7] == 2:
        return asked[:4] + struct.pack(">HBBBB", 4, asked[6], 2, 1, 1)
    content = (struct.pack(">f", 42.5) * count)[: 2 * count]
    return asked[:4] + struct.pack(">HBBB", 3 + len(content), asked[6], 3, len(content)) + content


def test_registers_side_by_side() -> None:
    with server(floats) as port:
        table = {"source": "log", "protocol": "modbus", "port": port}
        lines = asyncio.run(look(read_settings(table), Around()))
        table["registers"] = {"speed": 0, "coil": {"address": 2, "table": "discrete"}}
        mapped = asyncio.run(look(read_settings(table), Around()))
    assert lines[-1] == "input        0 and on: exception 2: illegal address"
    assert lines[1].split()[2] == "422a" and "42.5" in lines[1]
    assert len(lines) == 1 + SHOWN + 3 and "and 930 more" in lines[-3]
    assert mapped[-1].endswith("speed = 16938")


def sparse(asked: bytes) -> bytes:
    """Registers 0 to 130 and 4000 to 4010; two of them hold something."""
    first, count = struct.unpack(">HH", asked[8:12])
    if asked[7] != 3 or not (first + count <= 131 or 4000 <= first <= first + count <= 4011):
        return asked[:4] + struct.pack(">HBBB", 3, asked[6], asked[7] | 0x80, 2)
    words = [{127: 7, 4005: 9}.get(first + k, 0) for k in range(count)]
    content = struct.pack(f">{count}H", *words)
    return asked[:4] + struct.pack(">HBBB", 3 + len(content), asked[6], 3, len(content)) + content


def test_registers_are_found_wherever_a_map_begins() -> None:
    with server(sparse) as port:
        settings = read_settings({"source": "log", "protocol": "modbus", "port": port})
        _, *held, rest, refused = asyncio.run(look(settings, Around()))
    assert [line.split()[1:4:2] for line in held] == [["127", "7"], ["4005", "9"]]
    assert rest.startswith("holding  142 registers answer") and "exception 2" in refused


def test_a_device_that_falls_silent_shows_what_it_said() -> None:
    """Some let a question for what they do not have unanswered."""

    def silent(asked: bytes) -> bytes:
        first = struct.unpack(">H", asked[8:10])[0]
        return sparse(asked) if asked[7] == 3 and first < 4006 else b""

    with server(silent) as port:
        table = {"source": "log", "protocol": "modbus", "port": port, "timeout": 0.3}
        lines = asyncio.run(look(read_settings(table), Around()))
    assert any("4005" in line for line in lines)
    assert "5000 and on: not asked: " in "\n".join(lines)


@pytest.mark.system
def test_topics_of_a_broker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evertwin.sources.live.look.LISTEN", 1.0)
    with mosquitto(tmp_path) as broker:
        table = {"source": "robot", "protocol": "mqtt", "port": broker.port}

        def publish() -> None:
            time.sleep(0.3)
            broker.publish([said(1)])

        lines = ["", "no message"]
        while lines[1].startswith("no message"):  # a busy machine may speak after the look
            publishing = threading.Thread(target=publish)
            publishing.start()
            lines = asyncio.run(look(read_settings(table), Around(tmp_path)))
            publishing.join()
    assert "20 messages at most" in lines[0] and lines[1].startswith("robot/state  1.0 a second")
    assert "pose.x=1" in lines[1] and "q.0=1" in lines[1]


def test_topics_of_the_broker_that_comes_with_the_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evertwin.sources.live.look.LISTEN", 0.5)
    port = free_port()
    table = {"source": "pose", "protocol": "mqtt", "port": port, "version": 3}

    async def looked() -> list[str]:
        broker, machine = OwnBroker(("127.0.0.1", port)), MqttPublisher("robot")
        await broker.open()
        try:
            machine.open(broker.near)
            looking = asyncio.create_task(look(read_settings(table), Around(tmp_path)))
            while not looking.done():
                machine.say("pose", {"x": 1.5})
                await asyncio.sleep(0.1)
            return looking.result()
        finally:
            await asyncio.to_thread(machine.close)
            await broker.close()

    lines = asyncio.run(looked())
    assert "MQTT 3.1.1 does not tell" in lines[0]
    assert lines[1].startswith("robot/pose  ") and "x=1.5" in lines[1]


@pytest.mark.system
def test_topics_of_a_ros_master(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evertwin.sources.live.ros.topics.LISTEN", 1.0)
    with master(tmp_path) as ros, ros.node(*ros.says("/odom", "nav_msgs/Odometry", QUARTER)):
        table = {"source": "odom", "protocol": "ros", "master": ros.uri}
        settings = read_settings(table)
        assert isinstance(settings, RosSettings)
        known = wanted(settings, ODOM) | {"/cmd_vel": {"linear.x": "v [m/s]"}}

        def heard(asked: Callable[[], Coroutine[None, None, list[str]]]) -> list[str]:
            while not (lines := asyncio.run(asked())) or not lines[0].startswith("/odom"):
                pass  # it listens for a second only: the speaker may have started after it
            return lines

        lines = heard(lambda: look_ros(settings.place, known))
        bare = heard(lambda: look(settings, Around(tmp_path)))
    assert lines[0].startswith("/odom  nav_msgs/Odometry  ") and "time /odom.stamp" in lines[0]
    assert "/odom.pose.pose.orientation.yaw=1.5708 → heading [rad]" in lines[0]
    assert lines[-1] == "nobody says /cmd_vel.linear.x, of which the twin file makes v [m/s]"
    assert "/odom.pose.pose.orientation.yaw=1.5708" in bare[0] and "→" not in bare[0]
