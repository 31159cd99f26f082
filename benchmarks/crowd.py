"""How many robot twins one machine carries: `python -m benchmarks.crowd [SECONDS] [COUNT …]`.

For each count, twins of `twins/robot1d.toml` with ten rows a second of a replayed recording run

    local    in one process, each with its SQLite file;
    shared   in one process as the only node of a fleet, on a PostgreSQL server under tokens;
    two      in two such nodes, that share the twins out.

Printed after `WARM` seconds, over SECONDS: rows a second that came through of those that were sent,
the p99 from the arrival of a sample until its verdict is durable (of the middle twin, and of the
worst), processor seconds a second (nodes; the server), and resident memory a twin. A count *holds*
where 95 % of the rows came through and the worst twin's p99 is at most a second. Load of the
machine by others, in processors, stands beside it: what a machine has left counts.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.hall import TICK
from planted.postgres import Server
from planted.serving import Served, nodes, site
from planted.worlds import record_robot

WARM = 80.0
"""Seconds before the first look: a p99 is of a twin's newest thousand rows, none of its start."""
RATE = 10.0
LEASE = 10.0
FOLDED = re.compile(r'^evertwin_twin_folded_seconds\{twin="[^"]*"\} (\S+)$', re.MULTILINE)


class Look(NamedTuple):
    """How the nodes stood."""

    at: float
    rows: int
    spent: float
    """Processor seconds of the nodes and what they have started."""
    others: float
    """Of all other processes but the server's."""
    server: float


def processor(pid: int) -> float:
    """Seconds that a process and its ended children have had."""
    try:
        told = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return 0.0
    return sum(map(int, told.rsplit(")", 1)[1].split()[11:15])) / TICK


def children(pid: int) -> list[int]:
    """A process and all below it."""
    found = [pid]
    for one in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in one.read_text().split():
            found += children(int(child))
    return found


def busy() -> float:
    """Processor seconds of the whole machine."""
    told = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]
    return (sum(map(int, told[:3])) + sum(map(int, told[5:8]))) / TICK


def look(served: list[Served], server: int) -> Look:
    """Now."""
    rows = sum(t["rows"] for one in served for t in one.ask("/api/v1/status")[1]["twins"])
    spent = sum(processor(p) for one in served for p in children(one.process.pid))
    of_server = sum(map(processor, children(server))) if server else 0.0
    return Look(time.perf_counter(), rows, spent, busy() - spent - of_server, of_server)


def run(folder: Path, count: int, seconds: float, kind: str) -> bool:
    """One way, one count; does it hold?"""
    twins = tuple(f"robot{k}" for k in range(count))
    with ExitStack() as running:
        server = running.enter_context(Server(f"max_connections={3 * count + 50}")) \
            if kind != "local" else None  # fmt: skip
        if server is None:
            files = [site(folder, *twins, speed=RATE)]
        else:
            names = ("north", "south")[: 2 if kind == "two" else 1]
            found = nodes(folder, server.address, names, twins, lease=LEASE, speed=RATE)
            files = list(found.values())
        for file in files:  # slow work runs in the processes that a node's twins share
            text = file.read_text().replace("warm = false", "warm = true")
            file.write_text(text.replace("workers = 0\n", ""))
        served = [Served(file) for file in files]
        for one in served:
            running.callback(one.kill)
        limit = time.monotonic() + 120.0 + 2.0 * count

        def told() -> int:
            every = [t for one in served for t in one.ask("/api/v1/status")[1]["twins"]]
            return sum(bool(t["rows"]) for t in every)

        while (running_now := told()) < count and time.monotonic() < limit:
            time.sleep(1.0)
        time.sleep(WARM)
        pid = server.pid if server is not None else 0
        first = look(served, pid)
        time.sleep(seconds)
        last = look(served, pid)
        text = "".join(str(one.ask("/metrics")[1]) for one in served)
        memory = sum(_resident(one.process.pid) for one in served)
    span, late = last.at - first.at, np.array([float(one) for one in FOLDED.findall(text)])
    share = (last.rows - first.rows) / span / (RATE * count)
    middle, worst = (np.median(late), late.max()) if len(late) else (np.inf, np.inf)
    holds = share >= 0.95 and worst <= 1.0 and running_now == count
    spent, others, of_server = ((b - a) / span for a, b in zip(first[2:], last[2:], strict=True))
    print(f"{count:4} twins {kind:6} {running_now} run, rows {share:4.0%}, p99 {middle:.2f} s "
          f"(worst {worst:.2f} s), processors: nodes {spent:.2f}, server {of_server:.2f}, "
          f"others {others:.2f}; {memory / count / 2**20:.1f} MB a twin: "
          f"{'holds' if holds else 'does not hold'}", flush=True)  # fmt: skip
    return holds


def _resident(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main(seconds: float = 60.0, *counts: int) -> None:
    """Prints the figures: each count all ways, until no way holds."""
    for count in counts or (50, 100, 200, 400, 1000):
        held = []
        for kind in ("local", "shared", "two"):
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", "6000")
                held.append(run(folder, count, seconds, kind))
        if not any(held):
            break


if __name__ == "__main__":
    main(*map(float, sys.argv[1:2]), *map(int, sys.argv[2:]))
