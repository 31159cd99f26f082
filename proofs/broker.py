"""What a restarted broker loses of QoS 1 messages, and why: `python -m proofs.broker [KILLS]`.

Needs mosquitto. 1,522 messages go to a subscriber; the broker is restarted after the 147th. In the
first part the subscriber is a plain client, with each setting by itself, and the publisher keeps
what was not acknowledged: what is missing was acknowledged to it. In the second part it is
evertwin's source, which acknowledges what is committed, and the broker is killed again and again.
"""

from __future__ import annotations

import asyncio
import json
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from evertwin.sources.live import LiveSource, open_live
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from proofs._verdict import ended

MESSAGES, AT = 1522, 147
TOPIC = "machine/state"
OFF = ("persistence false",)
ON = ("persistence true",)
SAVED = (*ON, "autosave_on_changes true", "autosave_interval 1")


class Broker:
    """A mosquitto that can be ended and started again."""

    def __init__(self, *lines: str) -> None:
        folder = tempfile.mkdtemp()
        with socket.socket() as found:
            found.bind(("127.0.0.1", 0))
            self.port = found.getsockname()[1]
        self.config = Path(folder) / "mosquitto.conf"
        own = (f"listener {self.port} 127.0.0.1", "allow_anonymous true", "user root",
               f"persistence_location {folder}/")  # fmt: skip
        self.config.write_text("\n".join((*own, *lines)) + "\n", encoding="utf-8")
        self.start()

    def start(self) -> None:
        """Starts, and waits until it listens."""
        command = ["mosquitto", "-c", str(self.config)]
        self.process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for _ in range(500):
            with suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 0.2):
                return
            time.sleep(0.01)

    def stop(self, *, kill: bool) -> None:
        """Ends: killed, or asked to."""
        (self.process.kill if kill else self.process.terminate)()
        self.process.wait()


def client(name: str, port: int, expiry: int = 86400) -> paho.Client:
    """A client whose session outlives the line, unless ``expiry`` is 0."""
    made = paho.Client(paho.CallbackAPIVersion.VERSION2, client_id=name, protocol=paho.MQTTv5)
    properties = Properties(PacketTypes.CONNECT)
    properties.SessionExpiryInterval = expiry
    made.reconnect_delay_set(1, 1)
    made.connect("127.0.0.1", port, 60, clean_start=False, properties=properties)
    return made


def plain(lines: Sequence[str], *, kill: bool, each: bool, expiry: int = 86400) -> tuple[int, int]:
    """Messages lost, and how many of them the broker had acknowledged to the publisher."""
    broker, got, acknowledged = Broker(*lines), set[int](), set[int]()
    subscriber = client("subscriber", broker.port, expiry)
    subscribed: list[bool] = []

    def connected(line: paho.Client, *_: Any) -> None:
        if each or not subscribed:
            line.subscribe(TOPIC, 1)
        subscribed.append(True)

    subscriber.on_connect = connected
    subscriber.on_message = lambda _c, _u, message: got.add(int(message.payload))
    subscriber.loop_start()
    publisher = client("publisher", broker.port)
    numbers: dict[int, int] = {}
    publisher.on_publish = lambda _c, _u, mid, *_: acknowledged.add(mid)
    publisher.loop_start()
    time.sleep(0.5)
    for number in range(MESSAGES):
        numbers[number] = publisher.publish(TOPIC, str(number), qos=1).mid
        time.sleep(1 / 400)
        if number == AT - 1:
            broker.stop(kill=kill)
            time.sleep(0.5)
            broker.start()
    end = time.monotonic() + 5.0
    while time.monotonic() < end and len(got) < MESSAGES:
        time.sleep(0.05)
    for one in (subscriber, publisher):
        one.loop_stop()
    broker.stop(kill=True)
    lost = set(range(MESSAGES)) - got
    return len(lost), sum(numbers[number] in acknowledged for number in lost)


async def committed(source: LiveSource, done: threading.Event) -> Counter[int]:
    """How often each message came, committed one by one."""
    came: Counter[int] = Counter()
    source.open()

    async def read() -> None:
        async for chunk in source.chunks():
            came[int(chunk.v[0, 0])] += 1
            source.committed(chunk)

    reading = asyncio.create_task(read())
    quiet = time.monotonic()
    before = -1
    while not done.is_set() or time.monotonic() < quiet + 5.0:
        await asyncio.sleep(0.1)
        if len(came) != before or not done.is_set():
            before, quiet = len(came), time.monotonic()
    source.close()
    await reading
    return came


def killed(kills: int) -> tuple[int, int, int, str]:
    """Messages sent, lost and repeated, and what health says, over ``kills`` of the broker."""
    broker = Broker(*SAVED)
    table = {"source": "machine", "protocol": "mqtt", "port": broker.port, "topic": TOPIC,
             "sequence": "n", "client": "twin", "timeout": "2 s"}  # fmt: skip
    spec = SourceSpec("machine", {"n": ChannelSpec("n", "1")}, time=TimeSpec("t", "ms"))
    source, done, sent = open_live(table, spec), threading.Event(), 0

    def live() -> None:
        nonlocal sent
        publisher = client("publisher", broker.port)
        publisher.loop_start()
        while source.health.state == "connecting" and sent < 1000:
            publisher.publish("other", b"", qos=1)
            time.sleep(0.5)
            sent = _publish(publisher, sent, 1)
        for _ in range(kills):
            sent = _publish(publisher, sent, 300)
            broker.stop(kill=True)
            time.sleep(0.2)
            broker.start()
        sent = _publish(publisher, sent, 300)
        time.sleep(2.0)
        publisher.loop_stop()
        done.set()

    threading.Thread(target=live, daemon=True).start()
    came = asyncio.run(committed(source, done))
    broker.stop(kill=True)
    first = min(came)
    lost = sum(number not in came for number in range(first, sent))
    health = source.health
    told = f"reconnects {health.reconnects}, lost {dict(health.lost)}, repeats {health.repeated}"
    return sent - first, lost, sum(count > 1 for count in came.values()), told


def _publish(publisher: paho.Client, first: int, count: int) -> int:
    for number in range(first, first + count):
        publisher.publish(TOPIC, json.dumps({"n": number, "t": 10 * number}), qos=1)
        time.sleep(1 / 300)
    return first + count


def main(kills: int = 10) -> int:
    """Both parts."""
    if shutil.which("mosquitto") is None:
        print("mosquitto is not installed")
        return 4
    print(f"{MESSAGES} messages, restart after {AT}: lost, of these acknowledged to the publisher")
    found = {}
    for name, lines, kill, each, expiry in (
        ("no persistence, killed, subscribes once", OFF, True, False, 86400),
        ("no persistence, ended, subscribes once", OFF, False, False, 86400),
        ("persistence, never saved, killed, subscribes once", ON, True, False, 86400),
        ("session expiry 0, persistence, ended, subscribes once", ON, False, False, 0),
        ("persistence, ended, subscribes once", ON, False, False, 86400),
        ("saved at each change, killed, subscribes once", SAVED, True, False, 86400),
        ("no persistence, killed, subscribes at each connection", OFF, True, True, 86400),
    ):
        found[name] = plain(lines, kill=kill, each=each, expiry=expiry)
        print(f"  {name:55} {found[name][0]:5} {found[name][1]:5}")
    sent, lost, repeated, told = killed(kills)
    print(f"evertwin, {kills} kills: sent {sent}, lost {lost}, repeated {repeated}; {told}")
    forgot = [lost for lost, _ in found.values()][:4]
    return ended(
        {
            "a forgotten session explains the loss": min(forgot) > 1300,
            "a kept session does not lose": found["persistence, ended, subscribes once"][0] == 0,
            "evertwin loses nothing": lost == 0 and repeated == 0,
        }
    )


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 10))
