"""Living machines are processes of their own that other programs read, and that follow orders."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Queue

import numpy as np
import pytest
from asyncua import Client as OpcUaClient
from asyncua import ua
from paho.mqtt.client import Client as MqttClient
from paho.mqtt.client import MQTTMessage, MQTTMessageInfo
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from pymodbus.client import ModbusTcpClient

from evertwin.app.machine.live_processes import (
    Common,
    LiveMachine,
    arm_options,
    robot_options,
    told,
)
from evertwin.errors import DataError, UsageError
from evertwin.service.site.site_plan import read_site
from evertwin.worlds.live.machines.robot import LiveRobot
from evertwin.worlds.live.machines.sensors import Sensors, faults
from evertwin.worlds.live.orders import Knob, Knobs
from evertwin.worlds.live.voices.modbus import Registers
from evertwin.worlds.live.voices.mqtt import MqttPublisher
from evertwin.worlds.live.voices.voices import inside
from tests.sources.live.peers import need

TABLE = Registers(("cycle", *(f"{n}{a}" for n in ("q", "qd", "tau") for a in range(1, 7))))
Columns = dict[str, float]
SITES = Path(__file__).parents[2] / "sites"


@pytest.fixture(scope="module")
def arm() -> Iterator[dict[str, str]]:
    """The arm, by Modbus and OPC UA, in time-lapse."""
    options = arm_options(Common(speed=20.0), "127.0.0.1:0", "127.0.0.1:0")
    with LiveMachine("arm", options) as machine:
        yield machine.reached()


@pytest.fixture(scope="module")
def robot() -> Iterator[dict[str, str]]:
    """The robot, with a broker of its own."""
    host, port = inside()
    options = robot_options(Common(speed=20.0), None, f"{host}:{port}")
    with LiveMachine("robot", options) as machine:
        yield machine.reached()


@pytest.fixture
def registers(arm: dict[str, str]) -> Iterator[Callable[[], Columns]]:
    """Reads one coherent sample, as a controller's client does."""
    host, port = arm["modbus"].split(":")
    with ModbusTcpClient(host, port=int(port), timeout=1, retries=0) as client:

        def read() -> Columns:
            answer = client.read_holding_registers(0, count=6 + 2 * 19)
            assert not answer.isError()
            words = np.array(answer.registers, dtype=">u2").tobytes()
            forms = {"seq": ">u4", "t": ">f8"}
            return {
                name: float(np.frombuffer(words, forms.get(name, ">f4"), 1, 2 * at)[0])
                for name, at in TABLE.address.items()
            }

        # it is busy until its first sample is there
        until(lambda: not client.read_holding_registers(0, count=1).isError())
        yield read


def until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def test_registers_hold_one_sample_and_its_number(registers: Callable[[], Columns]) -> None:
    seen = []
    until(lambda: seen.append(registers()) or seen[-1]["seq"] > seen[0]["seq"] + 5)  # type: ignore[func-returns-value]
    start = seen[0]["t"] - 0.1 * seen[0]["seq"]
    for one in seen:
        assert one["t"] == pytest.approx(start + 0.1 * one["seq"], abs=1e-3)


def test_registers_cannot_be_written(arm: dict[str, str]) -> None:
    host, port = arm["modbus"].split(":")
    with ModbusTcpClient(host, port=int(port), timeout=1, retries=0) as client:
        assert client.write_register(6, 7).isError()
        assert client.write_registers(6, [7, 7]).isError()


def test_orders_change_what_is_read(arm: dict[str, str], registers: Callable[[], Columns]) -> None:
    before = registers()["q3"]
    assert told(arm["control"], "bias.q3=1 freeze.q1=1 dropout.tau6=1").startswith("ok ")
    until(lambda: np.isnan(registers()["tau6"]))
    shown, later = registers(), registers()
    assert shown["q3"] == pytest.approx(before + 1.0, abs=0.3)
    assert shown["q1"] == later["q1"]
    told(arm["control"], "bias.q3=0 freeze.q1=0 dropout.tau6=0")
    until(lambda: not np.isnan(registers()["tau6"]))


def test_a_payload_is_felt_and_laid_down_again(
    arm: dict[str, str], registers: Callable[[], Columns]
) -> None:
    before = registers()["tau2"]
    told(arm["control"], "payload=10 for=20")
    until(lambda: abs(registers()["tau2"] - before) > 20.0)
    until(lambda: abs(registers()["tau2"] - before) < 15.0)


def test_a_cable_is_cut_mute_and_mended(
    arm: dict[str, str], registers: Callable[[], Columns]
) -> None:
    assert registers()["seq"] > 0
    host, port = arm["modbus"].split(":")
    told(arm["control"], "cut.modbus=1")

    def connects() -> bool:
        with ModbusTcpClient(host, port=int(port), timeout=0.2, retries=0) as client:
            return client.connected

    until(lambda: not connects())
    told(arm["control"], "cut.modbus=0 mute.modbus=1")
    until(connects)
    with ModbusTcpClient(host, port=int(port), timeout=0.3, retries=0) as client:
        with pytest.raises(Exception, match="No response"):
            client.read_holding_registers(0, count=2)
        told(arm["control"], "mute.modbus=0")
    with ModbusTcpClient(host, port=int(port), timeout=1, retries=0) as client:
        assert not client.read_holding_registers(0, count=2).isError()


def test_opc_ua_shows_the_same_and_takes_nothing(arm: dict[str, str]) -> None:
    async def ask() -> tuple[list[ua.DataValue], ua.DataValue]:
        async with OpcUaClient(arm["opcua"]) as client:
            space = await client.get_namespace_index("urn:evertwin:machine")
            nodes = [client.get_node(f"ns={space};s=arm.{name}") for name in ("seq", "t", "tau2")]
            with pytest.raises(ua.UaStatusCodeError):
                await nodes[2].write_value(3.0)
            told(arm["control"], "dropout.tau2=1 for=5")
            await asyncio.sleep(0.05)
            bad = await nodes[2].read_data_value(raise_on_bad_status=False)
            return await client.read_attributes(nodes), bad

    (seq, t, _), bad = asyncio.run(ask())
    assert t.SourceTimestamp == seq.SourceTimestamp
    assert t.SourceTimestamp.timestamp() == pytest.approx(t.Value.Value, abs=1e-5)
    assert bad.StatusCode is not None and not bad.StatusCode.is_good()


def listen(where: str, topic: str, count: int) -> list[Columns]:
    """Messages of a topic, by a client of its own."""
    got: Queue[MQTTMessage] = Queue()
    client = MqttClient(CallbackAPIVersion.VERSION2)
    client.on_connect = lambda *_: client.subscribe(topic, qos=1)
    client.on_message = lambda _, __, message: got.put(message)
    host, port = where.split(":")
    client.connect(host, int(port))
    client.loop_start()
    try:
        return [json.loads(got.get(timeout=5.0).payload) for _ in range(count)]
    finally:
        client.disconnect()
        client.loop_stop()


def test_the_robot_says_command_and_pose(robot: dict[str, str]) -> None:
    told_ = listen(robot["mqtt"], "robot/command", 5)
    assert [one["seq"] - told_[0]["seq"] for one in told_] == [0, 1, 2, 3, 4]
    assert [one["t"] - told_[0]["t"] for one in told_] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert len({one["session"] for one in told_}) == 1
    told(robot["control"], "bias.x=1000 dropout.heading=1 for=30")
    until(lambda: listen(robot["mqtt"], "robot/pose", 1)[0]["heading"] is None)
    assert listen(robot["mqtt"], "robot/pose", 1)[0]["x"] > 700.0


def test_the_lidar_sees_the_hall(robot: dict[str, str]) -> None:
    (scan,) = listen(robot["mqtt"], "robot/scan", 1)
    ranges = np.array(scan["ranges"])
    assert ranges.shape == (180,) and 0.3 < ranges.min() < ranges.max() < 12.0


def test_slip_stands_between_wheels_and_floor() -> None:
    robots = LiveRobot("w3", 1), LiveRobot("w3", 1)
    robots[1].knobs.tell("slip=0.5", 0.0)
    for one in robots:
        one.knobs.tell("start=0", 0.0)
    way = []
    for one in robots:
        said = [sample for _ in range(500) for sample in one.advance()]
        odom = [sample.values["v"] for sample in said if sample.topic == "odom"]
        pose = [sample.values for sample in said if sample.topic == "pose"]
        steps = np.diff([[p["x"], p["y"]] for p in pose], axis=0)
        way.append((np.sum(odom) / 10.0, np.sum(np.hypot(*steps.T)) / 100.0))
    (dry, true), (wheels, slipped) = way
    assert dry == pytest.approx(true, rel=0.15)
    assert wheels == pytest.approx(2.0 * slipped, rel=0.15)


def test_messages_of_a_cut_cable_come_late(robot: dict[str, str]) -> None:
    came: list[int] = []
    client = MqttClient(CallbackAPIVersion.VERSION2)
    client.on_connect = lambda *_: client.subscribe("robot/pose", qos=1)
    client.on_message = lambda _, __, message: came.append(json.loads(message.payload)["seq"])
    host, port = robot["mqtt"].split(":")
    client.connect(host, int(port))
    client.loop_start()
    try:
        until(lambda: len(came) > 2)
        told(robot["control"], "cut.mqtt=1 for=10")
        begun = came[-1]
        until(lambda: came[-1] > begun + 15, 10.0)
        assert came == list(range(came[0], came[-1] + 1))
    finally:
        client.disconnect()
        client.loop_stop()


def test_orders_that_cannot_be_followed_say_what_can(arm: dict[str, str]) -> None:
    for orders, match in {
        "paylod=2": "did you mean 'payload'",
        "friction.9=2": "expected 1, 2, 3, 4, 5, 6",
        "payload=99": "expected 0 to 15",
        "payload": "expected NAME=NUMBER",
        "payload=nan": "expected NAME=NUMBER",
        "for=3": "expected orders",
        "payload=2 for=-1": "above 0",
    }.items():
        with pytest.raises(UsageError, match=match):
            told(arm["control"], orders)
    assert "arm at" in told(arm["control"], "?") and "payload" in told(arm["control"], "?")
    with pytest.raises(DataError, match="no machine answers"):
        told("127.0.0.1:1", "payload=2")
    with pytest.raises(UsageError, match="HOST:PORT"):
        told("here", "payload=2")


@pytest.mark.system
def test_mbpoll_reads_the_arm(arm: dict[str, str]) -> None:
    need("mbpoll")
    host, port = arm["modbus"].split(":")
    asked = ["mbpoll", "-m", "tcp", "-a", "1", "-r", "9", "-c", "6", "-t", "4:float", "-B", "-1"]
    done = subprocess.run([*asked, "-p", port, host], capture_output=True, text=True, timeout=10)
    angles = [float(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("[")]
    assert len(angles) == 6 and np.all(np.abs(angles) < 2 * np.pi)


@pytest.mark.system
def test_mosquitto_sub_reads_the_robot(robot: dict[str, str]) -> None:
    need("mosquitto_sub")
    _, port = robot["mqtt"].split(":")
    asked = ["mosquitto_sub", "-p", port, "-t", "robot/pose", "-q", "1", "-C", "3", "-W", "5"]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=10)
    assert [json.loads(line)["x"] is not None for line in done.stdout.splitlines()] == [True] * 3


def test_a_recording_is_what_would_be_published(tmp_path: Path) -> None:
    plan = ["3:bias.x=5 for=2"]
    common = Common(seconds=8.0, record=tmp_path / "run.csv", order=plan)
    for name, options in {
        "robot": robot_options(common, None),
        "arm": arm_options(common._replace(order=[], seconds=1.0), "", ""),
    }.items():
        with LiveMachine(name, options) as machine:
            machine.wait()
    pose = np.genfromtxt(tmp_path / "run-pose.csv", delimiter=",", skip_header=1)
    assert pose[:, 0] == pytest.approx(np.arange(8.0))
    lying = pose[:, 2] > 4.0
    assert lying.tolist() == [False] * 3 + [True] * 2 + [False] * 3
    with pytest.raises(UsageError, match="--seconds"):
        Common(record=tmp_path / "x.csv").options()
    assert len((tmp_path / "run.csv").read_text().splitlines()) == 11


@pytest.mark.parametrize("file", sorted(SITES.glob("*.toml")), ids=lambda file: file.stem)
def test_shipped_sites_name_every_source_of_their_twins(file: Path) -> None:
    for plan in read_site(file).twins:
        assert plan.spec is not None and not plan.wrong
        named = [one.source for one in plan.sources]
        assert named[: len(plan.spec.source)] == [one.name for one in plan.spec.source]
        assert set(named[len(plan.spec.source) :]) <= {one.name for one in plan.spec.array}


def test_each_sensor_lies_in_its_way() -> None:
    knobs = Knobs({**faults(("x", "y")), "load": Knob("[kg]")})
    sensors = Sensors(knobs)
    knobs.tell("factor.x=1000 spike.y=7", 0.0)
    assert sensors.give({"x": 1.0, "y": 1.0, "z": 3.0}) == {"x": 1000.0, "y": 8.0, "z": 3.0}
    knobs.tell("freeze.y=1 for=2", 1.0)
    assert [sensors.give({"y": y})["y"] for y in (2.0, 3.0)] == [1.0, 1.0]
    knobs.tick(3.0)
    assert sensors.give({"y": 4.0})["y"] == 4.0
    knobs.tell("load=3", 3.0)
    assert knobs.turned() == {"load": 3.0, "factor.x": 1000.0}


def test_what_the_broker_did_not_take_holds_up_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A queue that was full: the broker in this process has to be let go of all the same."""
    publisher = MqttPublisher("robot")
    refused = MQTTMessageInfo(1)
    refused.rc = MQTTErrorCode.MQTT_ERR_QUEUE_SIZE
    monkeypatch.setattr(MqttClient, "is_connected", lambda self: True)
    monkeypatch.setattr(MqttClient, "publish", lambda self, *_, **__: refused)
    publisher.say("pose", {"x": 1.0})
    publisher.close()


def test_a_machine_that_does_not_end_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    deaf = "import signal, time; signal.signal(15, signal.SIG_IGN)"
    deaf += "; print('{}', flush=True); time.sleep(60)"
    monkeypatch.setattr(LiveMachine, "command", lambda *_: [sys.executable, "-c", deaf])
    monkeypatch.setattr("evertwin.app.machine.live_processes.ENDING", 0.2)
    with LiveMachine("robot", []) as machine:
        assert machine.reached() == {}
