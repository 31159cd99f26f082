"""What a twin says goes out over MQTT and OPC UA, and nothing comes in that could write."""

from __future__ import annotations

import asyncio
import json
import math
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
import pytest
from asyncua import Client, ua

from planted.serving import Served, site
from planted.worlds import record_robot

BROKER = """
import asyncio, sys
from amqtt.broker import Broker
async def main():
    broker = Broker({"listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{sys.argv[1]}"}},
                     "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin":
                                 {"allow_anonymous": True}}})
    await broker.start()
    await asyncio.Event().wait()
asyncio.run(main())
"""


def free() -> int:
    with socket.create_server(("127.0.0.1", 0)) as line:
        return int(line.getsockname()[1])


@pytest.fixture
def broker() -> Iterator[int]:
    port = free()
    process = subprocess.Popen([sys.executable, "-W", "ignore", "-c", BROKER, str(port)],
                               stderr=subprocess.DEVNULL)  # fmt: skip
    end = time.monotonic() + 15
    while time.monotonic() < end:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            break
        except OSError:
            time.sleep(0.05)
    yield port
    process.kill()
    process.wait()


class Listening:
    """What comes at the broker, by topic."""

    def __init__(self, port: int) -> None:
        self.heard: dict[str, list[bytes]] = {}
        self._came = threading.Condition()
        self.client = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id="panel")
        self.client.on_message = self._message
        self.client.connect("127.0.0.1", port)
        self.client.subscribe("hall/#", qos=1)
        self.client.loop_start()

    def _message(self, _: Any, __: Any, message: Any) -> None:
        with self._came:
            self.heard.setdefault(message.topic, []).append(message.payload)
            self._came.notify_all()

    def wait(self, topic: str, count: int = 1) -> list[bytes]:
        with self._came:
            enough = self._came.wait_for(lambda: len(self.heard.get(topic, ())) >= count, 20)
            assert enough, (topic, self.heard.keys())
            return self.heard[topic]

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()


async def read(port: int) -> dict[str, Any]:
    async with Client(f"opc.tcp://127.0.0.1:{port}/evertwin") as client:
        space = await client.get_namespace_index("urn:evertwin:twin")
        names = ("x.measured", "x.predicted", "x.residual", "x.mark", "condition")
        nodes = [client.get_node(ua.NodeId(f"robot.{name}", space)) for name in names]
        told = await client.read_values(nodes)  # one request, so of one row
        for node, value in zip(nodes, told, strict=True):
            with pytest.raises(ua.UaStatusCodeError):
                await node.write_value(value)
        return dict(zip(names, told, strict=True))


def test_a_twin_tells_and_answers(tmp_path: Path, broker: int) -> None:
    record_robot(tmp_path / "run.csv", "--light", "--world", "w3", "--seconds", "20", "--seed", "3")
    file, opcua = site(tmp_path, "robot", speed=20), free()
    file.write_text(
        file.read_text() + f'[[twin.publisher]]\nprotocol = "mqtt"\nport = {broker}\n'
        f'topic = "hall"\n[[twin.publisher]]\nprotocol = "opcua"\nport = {opcua}\n'
    )
    panel = Listening(broker)
    try:
        with Served(file) as served:
            assert panel.wait("hall/robot/online")[0] == b"1"
            rows = json.loads(panel.wait("hall/robot/rows")[0])
            assert set(rows["outputs"]["x"]) >= {"measured", "predicted", "residual", "sigma"}
            served.until(lambda status: status["twins"][0]["rows"] > 60)
            ask = {"id": 7, "whatif": {"speed": {"factor": 1.2}}}
            wrong = "no json", '{"id": 8, "whatif": {"sped": 1}}', '{"id": 9}'
            for text in (json.dumps(ask), *wrong):
                panel.client.publish("hall/robot/ask", text, qos=1)
            answers = [json.loads(a) for a in panel.wait("hall/robot/answer", 4)]
            by = {one["id"]: one for one in answers}
            assert by[7]["answer"]["schema"] == "evertwin.whatif/1"
            assert "one table, not none" in by[9]["error"]
            assert "sped" in by[8]["error"] and "expected" in by[None]["error"]
            assert json.loads(panel.wait("hall/robot/health")[-1])["name"] == "robot"
            assert json.loads(panel.wait("hall/robot/events")[-1])["events"]
            served.until(
                lambda status: (
                    all(p["state"] == "up" for p in status["twins"][0]["publishers"])
                    and status["twins"][0]["publishers"][1].get("sent", 0) > 2
                )
            )
            seen = (asyncio.run(read(opcua)) for _ in range(30))  # no row, or one that begins
            told = next(one for one in seen if math.isfinite(one["x.residual"]))
            assert abs(told["x.measured"] - told["x.predicted"] - told["x.residual"]) < 1e-12
            assert told["condition"] in ("good", "unjudged", "check", "out_of_specification")
            served.kill()
            assert panel.wait("hall/robot/online", 2)[-1] == b"0"  # its last will
    finally:
        panel.close()
