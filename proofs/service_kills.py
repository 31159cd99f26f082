"""What `kill -9` costs: `python -m proofs.service_kills [KILLS] [SEED] [SPEED] [MINUTES]`.

The embedded arm (Modbus) and the embedded robot (MQTT, QoS 1, through mosquitto) go on sending in
time-lapse while the service that follows them is killed again and again: before and after named
points of its code, and at random times while it starts and runs. Most lives are forked from a
process that has imported what it needs, every tenth begins anew as `python -m evertwin`. After so
many MINUTES it is judged by the kills that there were. In the end

    MQTT       each sample that the robot sent is in the store, once
    Modbus     no sample is there twice; what was said while nobody listened is stated
    records    none is in the log twice, and the chain is sound
    champions  every promotion follows the version that was live
    replay     a fresh process folds what is stored, with the logged answers: the log as it is, and
               the state as it is, bit for bit
"""

from __future__ import annotations

import contextlib
import importlib
import itertools
import os
import re
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from evertwin.app.cli import main as command_line
from evertwin.app.machine.demo_live import free_ports, site_of
from evertwin.app.machine.live_processes import Common, LiveMachine, arm_options, robot_options
from evertwin.fold import Event
from evertwin.service.service import Service
from evertwin.store import SqliteStore
from planted.serving import Served
from planted.worlds import told_its_pose
from proofs._verdict import ended
from proofs.broker import SAVED, Broker
from proofs.kills import Kill as Point
from proofs.kills import _around, _counting
from proofs.replay_live import bare, end_of, fold

POINTS = (
    ("evertwin.sources.live.mqtt.source", "Mqtt.decode"),
    ("evertwin.sources.live.mqtt.source", "Mqtt.committed"),
    ("evertwin.service.twin.live_twin", "AtWork.keep"),
    ("evertwin.service.twin.live_twin", "AtWork.fold"),
    ("evertwin.rows.samples", "Samples.keep"),
    ("evertwin.loop.live", "Live._go_on"),
    ("evertwin.loop.live", "Live.settle"),
    ("evertwin.ledger.run_log", "RunLog.say"),
    ("evertwin.ledger.run_log", "RunLog.again"),
    ("evertwin.ledger.ledger", "Ledger.commit"),
    ("evertwin.loop.driver", "Driver.beat"),
    ("evertwin.loop.slow_work", "SlowWork.send"),
    ("evertwin.loop.decisions.decide", "Decide._promote"),
    ("evertwin.store.sql.writer", "Writer.flush"),
    ("evertwin.store.sql.tables", "Tables.write"),
    ("evertwin.store.sql.checkpoints", "Checkpoints.write"),
    ("evertwin.store.sql.checkpoints", "Checkpoints.restore"),
)
LONGEST = 2.0
"""Seconds that a service runs at most before it is killed."""
ANEW = 10
"""Every so manieth life begins with a new process."""


class Life(NamedTuple):
    """One life of the service."""

    how: str
    died: float
    ready: float
    """Seconds until every twin ran; NaN: it died before."""


def _child(site: Path, kill: Point) -> NoReturn:
    passed = _counting(Counter(), kill)
    for module, name in POINTS:
        owner, method = name.split(".")
        kind = getattr(importlib.import_module(module), owner)
        setattr(kind, method, _around(kind.__dict__[method], name, passed))
    start = Service.start

    async def started(self: Service) -> None:
        await start(self)
        (site.parent / "ready").write_text(str(time.time()))

    Service.start = started  # type: ignore[method-assign]
    log = os.open(site.parent / "log.jsonl", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    for stream in (1, 2):
        os.dup2(log, stream)
    try:
        command_line(["serve", str(site), "--log", "json"])
    finally:
        os._exit(1)


def forked(site: Path, kill: Point, seconds: float) -> Life:
    """A life that ends at a point, or so many seconds after it was ready; below zero: after its
    beginning."""
    ready = site.parent / "ready"
    ready.unlink(missing_ok=True)
    sys.stdout.flush()
    began = time.time()
    pid = os.fork()
    if pid == 0:
        _child(site, kill)
    how, end = kill.how, np.inf
    while os.waitpid(pid, os.WNOHANG)[0] == 0:
        if seconds < 0.0 or ready.exists():  # from when every twin runs, or from the fork
            end = min(end, time.monotonic() + abs(seconds))
        if time.monotonic() > end:
            how = "time"
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            break
        time.sleep(0.005)
    with contextlib.suppress(FileNotFoundError, ValueError):
        return Life(how, time.time(), float(ready.read_text()) - began)
    return Life(how, time.time(), np.nan)


def anew(site: Path, seconds: float) -> Life:
    """A life in a process of its own, that ends so many seconds after it was ready."""
    began = time.time()
    served = Served(site)
    token = (site.parent / "demo-store" / "token").read_text().strip()
    while served.ask("/-/ready", token=token)[0] != 200:
        time.sleep(0.02)
    ready = time.time() - began
    time.sleep(seconds)
    served.kill()
    return Life("anew", time.time(), ready)


def lives(site: Path, kills: int, minutes: float, rng: np.random.Generator) -> Iterator[Life]:
    """One after the other: each point in turn, before and after it."""
    ends = time.monotonic() + 60.0 * minutes
    named = [f"{when} {name}" for _, name in POINTS for when in ("before", "after")]
    for number, how in zip(range(kills), itertools.cycle(named)):
        if time.monotonic() > ends:
            return
        if number % ANEW == ANEW - 1:
            yield anew(site, rng.uniform(0.0, LONGEST))
        elif number % 3 == 2:
            yield forked(site, Point("time", np.inf), rng.uniform(-0.5, 1.0) * LONGEST)
        else:
            yield forked(site, Point(how, int(rng.geometric(0.5))), LONGEST)


def drained(served: Served, token: str) -> None:
    """Waits until the broker has nothing more and all that came is folded, by both twins: only then
    is what lacks at the end lost, and what a replay folds all that was lived."""
    calm, before = 0, -1
    while calm < 4:
        time.sleep(5.0)
        status = served.ask("/api/v1/status", token=token)[1]
        twins, robot = status["twins"], status["twins"][1]["sources"].values()
        count = sum(one["received"] for one in robot)
        at_work = any(one["waiting"] or one["busy"] for one in twins)
        still = status["ready"] and count == before and not at_work
        up = all(one["state"] == "up" for one in robot)
        calm, before = (calm + 1 if still and up else 0), count


def stamps(store: SqliteStore, source: str) -> np.ndarray:
    """Of all samples of a source, in seconds."""
    found = [chunk.t for chunk in store.samples(source, -(2**62), 2**62)]
    return np.concatenate(found) / 1e9 if found else np.zeros(0)


def champions(store: SqliteStore) -> int:
    """Promotions that do not follow the version that was live."""
    live, wrong = 0, 0
    for event in store.read("event"):
        if isinstance(event, Event) and event.kind in ("promoted", "rolled_back"):
            replaced = re.search(r"replaces (\d+)", event.reason)
            wrong += replaced is not None and int(replaced[1]) != live
            live = int(event.evidence["version"])
    return wrong


def twice(store: SqliteStore) -> int:
    """Entries of the log that stand there more than once."""
    return sum(count - 1 for count in Counter(e[1:5] for e in store.entries()).values())


def found(name: str, folder: Path, store: Path) -> tuple[dict[str, bool], str]:
    """What a store says in the end."""
    with closing(SqliteStore(store, read_only=True)) as kept:
        sources = ("command", "pose") if name == "robot" else ("controller",)
        came = {one: np.sort(stamps(kept, one)) for one in sources}
        step = 1.0 if name == "robot" else 0.1
        repeated = {one: len(t) - len(np.unique(t)) for one, t in came.items()}
        last = max(t[-1] for t in came.values())  # both speak until the end
        span = {one: round((last - t[0]) / step) + 1 for one, t in came.items()}
        missing = {one: span[one] - len(np.unique(t)) for one, t in came.items()}
        entries, doubled, wrong = kept.verify(), twice(kept), champions(kept)
    copy = bare(store, folder / f"{name}-again.db")
    fold(folder / "twins" / f"{name}_live.toml", copy)
    lived, again = end_of(store), end_of(copy)
    if lived != again:
        print(f"{name}: lived {lived.row} rows, {lived.length} entries of the log; folded again "
              f"{again.row}, {again.length}; other: {lived.layout != again.layout}")  # fmt: skip
    demands = {
        f"{name}: no sample twice": not any(repeated.values()),
        f"{name}: no record twice": doubled == 0, f"{name}: one champion": wrong == 0,
        f"{name}: replay": lived == again,
    }  # fmt: skip
    if name == "robot":
        demands["robot: no sample lost"] = not any(missing.values())
    told = f"{name}: sent {span}, missing {missing}, twice {repeated}; {entries} entries, "
    return demands, told + f"{doubled} twice, {wrong} champions beside another"


def main(
    kills: int = 100, seed: int = 1, speed: float = 10.0, minutes: float = float("inf")
) -> int:  # fmt: skip
    """Exit code 0 where nothing is lost, repeated or changed."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as name, ExitStack() as running:
        folder, broker = Path(name), Broker(*SAVED, "max_queued_messages 0")
        running.callback(broker.stop, kill=True)
        ports = free_ports(("modbus", "mqtt", "http")) | {"mqtt": broker.port}
        both = Common(seed, speed)
        worn = both._replace(order=["100:friction.2=1.3", "300:friction.5=1.4"])
        arm = arm_options(worn, f"127.0.0.1:{ports['modbus']}", "")
        robot = robot_options(both, f"127.0.0.1:{broker.port}", topics="command,pose")
        site = told_its_pose(site_of(folder, ports))
        site.write_text(re.sub(r"(?m)^warm = .*", "warm = false", site.read_text()))
        with Served(site):  # once whole: the broker knows from here on for whom it keeps what comes
            time.sleep(10.0)
        machines = [LiveMachine("arm", arm), LiveMachine("robot", robot)]
        for one in machines:
            running.enter_context(one).reached()
        lived = list(lives(site, kills, minutes, rng))
        for one in machines:  # what came while the service ends would be stored, and not folded
            one.__exit__()
        with Served(site) as served:  # what the broker keeps comes
            token = (site.parent / "demo-store" / "token").read_text().strip()
            drained(served, token)
        demands: dict[str, bool] = {}
        for twin in ("arm", "robot"):
            reached, text = found(twin, folder, site.parent / "demo-store" / f"{twin}_live.db")
            demands |= reached
            print(text)
    ready = np.array([one.ready for one in lived if one.how != "anew" and np.isfinite(one.ready)])
    new = np.array([one.ready for one in lived if one.how == "anew"])
    counts = Counter(one.how for one in lived)
    random, new_ones = counts.pop("time", 0), counts.pop("anew", 0)
    print(f"{len(lived)} kills: {random} at random times, {new_ones} of new processes, "
          f"{sum(counts.values())} at {len(counts)} points")  # fmt: skip
    for text, took in (("forked", ready), ("new processes", new)):
        if len(took):
            print(f"ready again, {text}: p50 {np.median(took):.2f} s, "
                  f"p99 {np.quantile(took, 0.99):.2f} s")  # fmt: skip
    return ended(demands)


if __name__ == "__main__":
    words = sys.argv[1:]
    sys.exit(main(*map(int, words[:2]), *map(float, words[2:])))
