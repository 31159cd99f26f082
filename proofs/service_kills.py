"""What `kill -9` costs a running service: `python -m proofs.service_kills [KILLS] [SEED] [mqtt]`.

A service follows the embedded robot and is killed at random times, while it starts and while it
runs, again and again. The robot is a replayed recording; with ``mqtt`` it goes on sending with QoS
1 through a broker (mosquitto) whether the service is there or not. In the end the service's store
has each sample once, its rows are those of a twin that nobody killed, bit for bit, its events too,
and its log is sound.
"""

from __future__ import annotations

import json
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from evertwin import Twin
from evertwin.config import read
from evertwin.fold import plain
from evertwin.sources.recorded import Recorded
from evertwin.store import SqliteStore
from planted.serving import Served, site
from planted.worlds import record_robot
from proofs._verdict import ended
from proofs.broker import SAVED, Broker

RATE = 50
"""Rows a second."""
LONGEST = 1.0
"""Seconds that a service runs before it is killed, after its start."""


def killed(file: Path, kills: int, rng: np.random.Generator) -> tuple[list[float], int]:
    """Seconds from a start until it was ready, where it lived so long; kills while it started."""
    ready, early = [], 0
    for _ in range(kills):
        began = time.perf_counter()
        served = Served(file)
        if rng.uniform() < 0.3:  # while the twin opens, goes on, folds again
            time.sleep(rng.uniform(0.0, 0.5))
            early += 1
        else:
            served.until(lambda _: True)
            ready.append(time.perf_counter() - began)
            time.sleep(rng.uniform(0.0, LONGEST))
        served.kill()
    return ready, early


MQTT = """protocol = "mqtt"
port = {port}
topic = "robot/state"
sequence = "seq"
publisher = "session"
"""


class Sender:
    """The robot, sending each row of its recording once."""

    def __init__(self, port: int, file: Path) -> None:
        self.rows = [line.split(",") for line in file.read_text().splitlines()[1:]]
        self._client = paho.Client(CallbackAPIVersion.VERSION2, client_id="robot")
        self._client.max_inflight_messages_set(1)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        self._thread = threading.Thread(target=self._send)
        self._thread.start()

    def _send(self) -> None:
        for seq, (t, v, x) in enumerate(self.rows):
            told = {"t": float(t), "v_cmd": float(v), "x": float(x), "seq": seq, "session": "one"}
            self._client.publish("robot/state", json.dumps(told), qos=1).wait_for_publish(10.0)
            time.sleep(1.0 / RATE)

    def end(self) -> None:
        """Returns when all are sent."""
        self._thread.join()
        self._client.disconnect()
        self._client.loop_stop()


def _sending(file: Path) -> tuple[Broker, Sender]:
    """Broker and robot; the service is there once, so that the broker keeps what comes for it."""
    broker = Broker(*SAVED)
    text = file.read_text()
    file.write_text(text[: text.index("protocol")] + MQTT.format(port=broker.port))
    with Served(file) as served:
        served.until(lambda _: True)
        time.sleep(2.0)  # it has subscribed
        sender = Sender(broker.port, file.parent / "run.csv")
        served.until(lambda status: status["twins"][0]["sources"]["log"]["received"] > 0)
    return broker, sender


def main(kills: int = 100, seed: int = 1, way: str = "replay") -> int:
    """Exit code 0 where nothing is lost, repeated or changed."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        each = 0.5 * LONGEST if way == "replay" else 1.0  # the broker keeps what comes meanwhile
        seconds = str(int(each * kills * RATE) + 100)
        record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", seconds)
        file = site(folder, "robot", speed=float(RATE))
        count = len((folder / "run.csv").read_text().splitlines()) - 1
        broker, sender = (None, None) if way == "replay" else _sending(file)
        ready, early = killed(file, kills, rng)
        file.write_text(file.read_text().replace(f"speed = {float(RATE)}", "speed = inf"))
        if broker is not None and sender is not None:
            sender.end()
        with Served(file) as served:
            served.until(lambda status: status["twins"][0]["rows"] >= count, 600.0)
            found = served.ask("/api/v1/twins/robot/rows?last=4000&points=4000")[1]
        with Twin(read(folder / "robot1d.toml")) as twin:
            chunks = list(Recorded.of(twin.spec.source[0], (folder / "run.csv",)).read())
            for chunk in chunks:
                twin.push(chunk)
            view, said = twin.view(4000), [(e.row, e.kind, e.reason) for e in twin.events]
        stamps = np.concatenate([chunk.t for chunk in chunks])
        store = SqliteStore(folder / "store" / "robot.db", read_only=True)
        kept = np.concatenate([chunk.t for _, chunk in store.read_chunks()])
        told = [store.record(entry) for entry in store.entries(kinds=("event",))]
        events = [(e.row, e.kind, e.reason) for e in told]  # type: ignore[union-attr]
        entries = store.verify()
        store.close()
    lost, twice = len(set(stamps) - set(kept)), len(kept) - len(set(kept))
    shown = {"measured": view.measured, "predicted": view.predicted, "sigma": view.band}
    other = [key for key, column in shown.items()
             if tuple(found["outputs"]["x"][key]) != plain(column[:, 0].tolist())]  # fmt: skip
    if broker is not None:
        broker.stop(kill=True)
    print(
        f"{way}: {kills} kills ({early} while it started), {len(stamps)} samples, {entries} entries"
    )
    print(f"samples lost {lost}, twice {twice}; columns that differ: {', '.join(other) or 'none'}")
    print(f"events {len(events)}, as those of a twin that nobody killed: {events == said}")
    if ready:
        print(f"ready after p50 {np.median(ready):.2f} s, p99 {np.quantile(ready, 0.99):.2f} s")
    return ended({"each sample once": lost + twice == 0, "the same rows": not other,
                  "the same events": events == said})  # fmt: skip


if __name__ == "__main__":
    given = sys.argv[1:]
    sys.exit(main(*map(int, given[:2]), *given[2:]))
