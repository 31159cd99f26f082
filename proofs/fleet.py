"""What faults cost a fleet: `python -m proofs.fleet [FAULTS] [SEED] [TWINS] [RATE]`.

Three nodes (`evertwin serve`) share twins on one PostgreSQL server; each reaches it through a line
of its own. A publisher goes on sending samples (MQTT, QoS 1) to all twins, RATE a second to each.
Drawn by seed, a node is killed (-9) and started again, paused (SIGSTOP) or cut off from the server;
or the server is killed with all its processes and started again, or each write to its disk takes a
tenth to half of a second longer; for half a lease to three. In the end

    lost       samples that the broker acknowledged to the publisher and the stores have not
    repeated   samples that a store has twice
    owners     entries and samples that stand behind one of a greater token: two owners writing
    gap        from a fault until a twin of that node takes samples again
    replay     each twin's samples, folded anew in a fresh process: its state, bit for bit
"""

from __future__ import annotations

import itertools
import os
import re
import signal
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

from evertwin.errors import StoreError, StoreUnwritable
from evertwin.store import SharedStore
from evertwin.store.postgres.database import Postgres
from planted.postgres import Server
from planted.serving import TWINS, Served
from proofs._plant import Line, Machines
from proofs._verdict import ended
from proofs.broker import Broker
from proofs.replay_live import bare, end_of

LEASE = 2.0
SOON = 0.25
"""Seconds in which what was under way when a fault came still arrives."""
NODES = ("north", "south", "west")
FAULTS = ("killed", "paused", "cut off", "server killed", "slow disk")
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
                try:
                    found = database.query(text)
                except StoreUnwritable:  # it is being started again
                    continue
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


def struck(server: Server, what: str, seconds: float, rng: np.random.Generator) -> None:
    """A fault of the server, for so long."""
    if what == "slow disk":
        server.wait(rng.uniform(0.1, 0.5))
        time.sleep(seconds)
        server.wait(0.0)
    else:
        server.kill()
        time.sleep(seconds)
        began = time.monotonic()
        server.start()
        took = time.monotonic() - began
        print(f"   the server answers {took:.1f} s later", file=sys.stderr, flush=True)


def suffered(
    nodes: list[Node], server: Server, watch: Watch, faults: int, rng: np.random.Generator
) -> list[tuple[str, str, float]]:
    """Fault after fault: what, twin, when, for each twin that the node had."""
    found = []
    for number in range(faults):
        busy = [one for one in nodes if one.name in watch.owner.values()]
        node, what = busy[rng.integers(len(busy))], FAULTS[rng.integers(len(FAULTS))]
        length = LEASE * rng.uniform(0.5, 3.0)
        now = time.monotonic()
        of_server = what in FAULTS[3:]
        whose = "server" if of_server else node.name
        found += [(what, t, now) for t, name in watch.owner.items() if of_server or name == whose]
        print(f"{number + 1}: {whose} {what} for {length:.1f} s", file=sys.stderr, flush=True)
        if of_server:
            struck(server, what, length, rng)
        else:
            node.suffer(what, length)
        time.sleep(LEASE * rng.uniform(0.0, 2.0))
    return found


def main(faults: int = 300, seed: int = 1, count: int = 6, rate: float = 20.0) -> int:
    """Exit code 0 where nothing is lost, repeated, written by two, or changed."""
    rng = np.random.default_rng(seed)
    twins = [f"twin{k}" for k in range(count)]
    with tempfile.TemporaryDirectory() as name, ExitStack() as running:
        folder, server = Path(name), running.enter_context(Server("max_connections=400", slow=True))
        broker = Broker("max_queued_messages 0")
        running.callback(broker.stop, kill=True)
        entries = "".join(ENTRY.format(twin=twin, broker=broker.port) for twin in twins)
        nodes = [Node(one, folder, server.port, entries) for one in NODES]
        for node in nodes:
            running.callback(lambda node=node: node.served.__exit__())
        watch = Watch(server.address)
        until(lambda: len(watch.owner) == count, 120.0, "owners")
        until(lambda: sum(map(_running, nodes)) == count, 120.0, "every twin")
        time.sleep(3.0)  # the broker knows from here on for whom it keeps what comes
        machines = Machines(broker.port, twins, rng, rate)
        time.sleep(3.0)
        found = suffered(nodes, server, watch, faults, rng)
        time.sleep(3.0 * LEASE)
        machines.end()
        wanted = {twin: len(sent) for twin, sent in machines.acknowledged.items()}
        with suppress(TimeoutError):  # then what lacks is told as lost
            until(lambda: watch.seen[-1][1] == wanted, 60.0, "rest")
        watch.end()
        refused = sum(node.refused() for node in nodes)
        codes = [node.served.end() for node in nodes]
        return _told(server.address, folder, machines, watch, found, (faults, refused, codes))


def _running(node: Node) -> int:
    """Twins of a node that run."""
    told = node.served.ask("/api/v1/status")[1]["twins"]
    return sum(one["state"] == "running" for one in told)


def _told(
    server: str, folder: Path, machines: Machines, watch: Watch,
    found: list[tuple[str, str, float]], rest: tuple[int, int, list[int]],
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
    gaps = {what: np.array([watch.gap(t, at) for w, t, at in found if w == what])
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
    sys.exit(main(*map(int, sys.argv[1:4]), *map(float, sys.argv[4:5])))
