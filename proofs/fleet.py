"""What faults cost a fleet: `python -m proofs.fleet [FAULTS] [SEED] [TWINS]`.

Three nodes (`evertwin serve`) share twins on one PostgreSQL server; each reaches it through a line
of its own. A publisher goes on sending samples (MQTT, QoS 1) to all twins, while a node is, drawn
by seed, killed (-9) and started again, paused (SIGSTOP) or cut off from the server, for half a
lease to three. In the end

    lost       samples that the broker acknowledged to the publisher and the stores have not
    repeated   samples that a store has twice
    owners     entries and samples that stand behind one of a greater token: two owners writing
    gap        from a fault until a twin of that node takes samples again
    replay     each twin's samples, folded anew in a fresh process: its state, bit for bit
"""

from __future__ import annotations

import itertools
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import paho.mqtt.client as paho

from evertwin.errors import StoreError
from evertwin.store import SharedStore
from evertwin.store.postgres import Postgres
from planted.postgres import Server
from planted.serving import TWINS, Served
from proofs._verdict import ended
from proofs.broker import Broker
from proofs.replay_live import bare, end_of

LEASE = 2.0
RATE = 20.0
"""Samples a second, each twin."""
SOON = 0.25
"""Seconds in which what was under way when a fault came still arrives."""
NODES = ("north", "south", "west")
FAULTS = ("killed", "paused", "cut off")
SITE = """schema = 1
name = "{node}"
warm = false
[http]
port = 0
[fleet]
store = "postgresql://evertwin@127.0.0.1:{port}/postgres"
node = "{node}"
lease = {lease}
"""
ENTRY = """[[twin]]
file = "robot1d.toml"
name = "{twin}"
workers = 0
[[twin.source]]
source = "log"
protocol = "mqtt"
port = {broker}
topic = "{twin}"
"""


class Line:
    """A line to the server that can be cut."""

    def __init__(self, port: int) -> None:
        self._to, self._cut = port, False
        self._open: set[socket.socket] = set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                here, _ = self._listener.accept()
                if self._cut:
                    here.close()
                    continue
                there = socket.create_connection(("127.0.0.1", self._to))
                self._open |= {here, there}
                for one, other in ((here, there), (there, here)):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    threading.Thread(target=self._pump, args=(one, other), daemon=True).start()

    def _pump(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while said := one.recv(1 << 16):
                other.sendall(said)
        for end in (one, other):
            self._open.discard(end)
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def cut(self, cut: bool) -> None:
        """Cuts it, whatever is on its way; or lets it carry again."""
        self._cut = cut
        for end in tuple(self._open) if cut else ():
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


class Machines:
    """What all twins' machines send, at a steady pace; and what the broker acknowledged."""

    def __init__(self, port: int, twins: list[str], rng: np.random.Generator) -> None:
        self._said: list[tuple[str, int, paho.MQTTMessageInfo]] = []
        self._twins, self._rng, self._ends = twins, rng, threading.Event()
        self._client = paho.Client(paho.CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        self._client.max_inflight_messages_set(1000)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        self._thread = threading.Thread(target=self._speak, daemon=True)
        self._thread.start()

    def _speak(self) -> None:
        ways, second, began = dict.fromkeys(self._twins, 0.0), 0, time.monotonic()
        while not self._ends.is_set():
            speed = 5.0 + 15.0 * (second // 10 % 2)
            for twin in self._twins:
                x = ways[twin] + self._rng.normal(0.0, 0.2)
                text = json.dumps({"t": float(second), "v_cmd": speed, "x": round(x, 3)})
                self._said.append((twin, second, self._client.publish(twin, text, qos=1)))
                ways[twin] += 1.1 * speed
            second += 1
            self._ends.wait(max(began + second / RATE - time.monotonic(), 0.0))

    def end(self) -> None:
        """Says no more; all that was said is acknowledged."""
        self._ends.set()
        self._thread.join()
        for _, _, one in self._said:
            one.wait_for_publish(10.0)
        self._client.loop_stop()

    @property
    def acknowledged(self) -> dict[str, list[int]]:
        """What the broker took of each twin's, in seconds of the machine."""
        found: dict[str, list[int]] = {twin: [] for twin in self._twins}
        for twin, second, one in self._said:
            if one.is_published():
                found[twin].append(second)
        return found


class Watch:
    """How many samples each twin has, and whose it is, again and again."""

    def __init__(self, server: str) -> None:
        self.seen: list[tuple[float, dict[str, int]]] = []
        self.owner: dict[str, str] = {}
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._look, args=(server,), daemon=True)
        self._thread.start()

    def _look(self, server: str) -> None:
        with closing(Postgres(server)) as database:
            text = "SELECT twin, samples, node FROM evertwin.head JOIN evertwin.owners USING (twin)"
            while not self._ends.wait(0.05):
                found = database.query(text)
                self.owner = {twin: node for twin, _, node in found}
                self.seen.append((time.monotonic(), {twin: n for twin, n, _ in found}))

    def gap(self, twin: str, since: float) -> float:
        """Seconds without a new sample around a fault."""
        pairs = itertools.pairwise((at, found.get(twin, 0)) for at, found in self.seen)
        came = np.array([at for (_, before), (at, count) in pairs if count > before])
        place = int(np.searchsorted(came, since + SOON))
        return float(came[min(place, len(came) - 1)] - came[max(place - 1, 0)])

    def end(self) -> None:
        """Looks no more."""
        self._ends.set()
        self._thread.join()


class Node:
    """One node: its folder, its line, its process."""

    def __init__(self, name: str, folder: Path, port: int, entries: str) -> None:
        self.name, self.line = name, Line(port)
        own = folder / name
        own.mkdir()
        (own / "robot1d.toml").write_text((TWINS / "robot1d.toml").read_text())
        self.site = own / "site.toml"
        self.site.write_text(SITE.format(node=name, port=self.line.port, lease=LEASE) + entries)
        self.served = Served(self.site)

    def suffer(self, what: str, seconds: float) -> None:
        """A fault, for so long."""
        if what == "killed":
            self.served.kill()
            time.sleep(seconds)
            self.served = Served(self.site)
        elif what == "paused":
            os.kill(self.served.process.pid, signal.SIGSTOP)
            time.sleep(seconds)
            os.kill(self.served.process.pid, signal.SIGCONT)
        else:
            self.line.cut(True)
            time.sleep(seconds)
            self.line.cut(False)

    def refused(self) -> int:
        """Transactions under an old token."""
        return len(re.findall(r"refused: token", (self.site.parent / "log.jsonl").read_text()))


def until(done: Any, seconds: float, what: str) -> None:
    """Waits; says what did not come."""
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            raise TimeoutError(what)
        time.sleep(0.1)


def two_writing(server: str) -> int:
    """Rows that stand behind one of a greater token."""
    count = 0
    with closing(Postgres(server)) as database:
        for table in ("samples", "log"):
            text = (
                "SELECT count(*) FROM (SELECT token, max(token) OVER (PARTITION BY twin ORDER BY "
                f"number) AS newest FROM evertwin.{table}) AS one WHERE token < newest"
            )
            count += int(database.query(text)[0][0])
    return count


def replayed(server: str, twin: str, folder: Path) -> bool:
    """Does a fresh process come to the state that the fleet left?"""
    file, copy = folder / f"{twin}.db", folder / f"{twin}-again.db"
    with closing(SharedStore(server, twin, read_only=True)) as store:
        store.backup(file)
    twin_file = folder / f"{twin}.toml"
    text = (TWINS / "robot1d.toml").read_text()
    twin_file.write_text(text.replace('name = "robot1d"', f'name = "{twin}"', 1))
    bare(file, copy)
    words = ["-m", "proofs.replay_live", "fold", str(twin_file), str(copy)]
    done = subprocess.run([sys.executable, *words], check=False)
    try:
        return done.returncode == 0 and end_of(file) == end_of(copy)
    except StoreError as error:
        print(f"{twin}: {error}")
        return False


def suffered(
    nodes: list[Node], watch: Watch, faults: int, rng: np.random.Generator
) -> list[tuple[str, str, float]]:
    """Fault after fault: what, twin, when, for each twin that the node had."""
    found = []
    for number in range(faults):
        busy = [one for one in nodes if one.name in watch.owner.values()]
        node, what = busy[rng.integers(len(busy))], FAULTS[rng.integers(len(FAULTS))]
        length = LEASE * rng.uniform(0.5, 3.0)
        now = time.monotonic()
        found += [(what, twin, now) for twin, name in watch.owner.items() if name == node.name]
        print(f"{number + 1}: {node.name} {what} for {length:.1f} s", file=sys.stderr, flush=True)
        node.suffer(what, length)
        time.sleep(LEASE * rng.uniform(0.0, 2.0))
    return found


def main(faults: int = 300, seed: int = 1, count: int = 6) -> int:
    """Exit code 0 where nothing is lost, repeated, written by two, or changed."""
    rng = np.random.default_rng(seed)
    twins = [f"twin{k}" for k in range(count)]
    with tempfile.TemporaryDirectory() as name, ExitStack() as running:
        folder, server = Path(name), running.enter_context(Server())
        broker = Broker("max_queued_messages 0")
        running.callback(broker.stop, kill=True)
        entries = "".join(ENTRY.format(twin=twin, broker=broker.port) for twin in twins)
        nodes = [Node(one, folder, server.port, entries) for one in NODES]
        for node in nodes:
            running.callback(lambda node=node: node.served.__exit__())
        watch = Watch(server.address)
        until(lambda: len(watch.owner) == count, 60.0, "owners")
        until(lambda: sum(map(_running, nodes)) == count, 60.0, "every twin")
        time.sleep(3.0)  # the broker knows from here on for whom it keeps what comes
        machines = Machines(broker.port, twins, rng)
        time.sleep(3.0)
        struck = suffered(nodes, watch, faults, rng)
        time.sleep(3.0 * LEASE)
        machines.end()
        wanted = {twin: len(sent) for twin, sent in machines.acknowledged.items()}
        with suppress(TimeoutError):  # then what lacks is told as lost
            until(lambda: watch.seen[-1][1] == wanted, 60.0, "rest")
        watch.end()
        refused = sum(node.refused() for node in nodes)
        codes = [node.served.end() for node in nodes]
        return _told(server.address, folder, machines, watch, struck, (faults, refused, codes))


def _running(node: Node) -> int:
    """Twins of a node that run."""
    told = node.served.ask("/api/v1/status")[1]["twins"]
    return sum(one["state"] == "running" for one in told)


def _told(
    server: str, folder: Path, machines: Machines, watch: Watch,
    struck: list[tuple[str, str, float]], rest: tuple[int, int, list[int]],
) -> int:  # fmt: skip
    faults, refused, codes = rest
    lost = repeated = kept = 0
    for twin, sent in machines.acknowledged.items():
        with closing(SharedStore(server, twin, read_only=True)) as store:
            store.verify()
            stamps = [int(t) // 10**9 for _, chunk in store.read_chunks() for t in chunk.t]
        kept += len(stamps)
        lost += len(set(sent) - set(stamps))
        repeated += len(stamps) - len(set(stamps))
    same = {twin: replayed(server, twin, folder) for twin in machines.acknowledged}
    gaps = {what: np.array([watch.gap(t, at) for w, t, at in struck if w == what])
            for what in FAULTS}  # fmt: skip
    every, two = np.concatenate(list(gaps.values())), two_writing(server)
    sent_all = sum(map(len, machines.acknowledged.values()))
    print(f"{faults} faults on {len(NODES)} nodes, {len(same)} twins, lease {LEASE} s: "
          f"{sent_all} samples acknowledged, lost {lost}, repeated {repeated}; "
          f"rows by an owner of before {two}; transactions refused {refused}")  # fmt: skip
    for what, took in (*gaps.items(), ("all", every)):
        if len(took):
            print(f"gap, {what}: {len(took)} twins, p50 {np.median(took):.1f} s, "
                  f"p99 {np.quantile(took, 0.99):.1f} s, longest {took.max():.1f} s")  # fmt: skip
    print(f"replay: {Counter(same.values())[True]} of {len(same)} states are those of the fleet")
    return ended({
        "nothing lost": lost == 0, "nothing repeated": repeated == 0, "one owner": two == 0,
        "replay": all(same.values()), "every node ends well": codes == [0, 0, 0],
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
