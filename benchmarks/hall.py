"""What a hall costs: `python -m benchmarks.hall [SECONDS] [TWINS]`.

One service, by `evertwin serve`, on one core, its fits and corrections in processes beside it:

1. so many robots (`twins/robot1d.toml`), each with ten rows a second of a replayed recording;
2. one twin of 18 channels at 1,000 rows a second: six joints of the embedded arm's kind, whose
   angles, speeds and torques are replayed (`twins/arm_live.toml`, accelerations derived).

Printed: share of a core that the service takes [processor seconds a second], its resident memory,
rows a second that came through, and how the stores grow, after `WARM` seconds and from then on.
Processor seconds count, so a busy machine changes them little.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planted.serving import ENTRY, TWINS, Served, site
from planted.worlds import record_robot

WARM = 20.0
"""Seconds before the first look: kernels are read, versions are found."""
TICK = os.sysconf("SC_CLK_TCK")
SHARE, MEMORY, FAST = 1.0, 4 << 30, 0.5
"""Asked: 200 robots on one core in 4 GB; 1 kHz with half a core."""


class Look(NamedTuple):
    """How a service stood."""

    at: float
    processor: float
    memory: int
    rows: int
    stores: int


def look(served: Served, folder: Path) -> Look:
    """Now."""
    own = Path(f"/proc/{served.process.pid}")
    user, system = (
        int(x) for x in own.joinpath("stat").read_text().rsplit(")", 1)[1].split()[11:13]
    )
    pages = int(own.joinpath("statm").read_text().split()[1])
    rows = sum(one["rows"] for one in served.ask("/api/v1/status")[1]["twins"])
    stores = sum(file.stat().st_size for file in (folder / "store").glob("*.db*"))
    return Look(
        time.perf_counter(),
        (user + system) / TICK,
        pages * os.sysconf("SC_PAGE_SIZE"),
        rows,
        stores,
    )


def measured(folder: Path, file: Path, seconds: float) -> tuple[Look, Look]:
    """A service after `WARM` seconds, and so much later."""
    with Served(file) as served:
        served.until(lambda status: all(one["rows"] for one in status["twins"]), 600.0)
        time.sleep(WARM)
        first = look(served, folder)
        time.sleep(seconds)
        return first, look(served, folder)


def told(what: str, first: Look, last: Look, twins: int) -> float:
    """Prints a line; the share of a core."""
    span = last.at - first.at
    share, rows = (last.processor - first.processor) / span, (last.rows - first.rows) / span
    growth = (last.stores - first.stores) / span / twins
    print(
        f"{what}: {share:.2f} of a core, {last.memory / 2**20:.0f} MB resident "
        f"({last.memory / twins / 2**20:.1f} a twin), {rows:.0f} rows/s, stores grow by "
        f"{3600 * growth / 2**20:.1f} MB an hour a twin"
    )
    return share


def robots(folder: Path, twins: int, seconds: float) -> bool:
    """Part 1."""
    record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", "6000")
    names = [f"robot{k}" for k in range(twins)]
    file = site(folder, *names, speed=10.0, workers=1)
    shared = "\n".join(line for line in file.read_text().splitlines() if line != "workers = 1")
    file.write_text(shared)  # all share the service's processes
    try:
        first, last = measured(folder, file, seconds)
    except OSError as error:
        print(f"{twins} robots at 10 Hz: the service does not answer: {error}")
        return False
    share = told(f"{twins} robots at 10 Hz", first, last, twins)
    whole = last.rows - first.rows >= 0.95 * 10 * twins * (last.at - first.at)
    return share <= SHARE and last.memory <= MEMORY and whole


def fast(folder: Path, seconds: float) -> bool:
    """Part 2."""
    n = round((seconds + 4 * WARM) * 1000)
    t = np.arange(n) * 1e-3
    speed = 0.3 + 0.05 * np.arange(6)
    q = np.sin(np.outer(t, speed))
    qd = np.cos(np.outer(t, speed)) * speed
    torque = 8.0 * np.tanh(qd / 0.02) + 10.0 * qd + 20.0 * np.cos(q)
    columns = np.column_stack([t, q, qd, torque])
    names = ["t", *(f"{kind}{k}" for kind in ("q", "qd", "tau") for k in range(1, 7))]
    np.savetxt(folder / "arm.csv", columns, "%.6g", ",", header=",".join(names), comments="")
    text = (TWINS / "arm_live.toml").read_text()
    text = text.replace('task = "cycle"', "").replace('breakdown = "breakdowns/arm_live.toml"', "")
    (folder / "arm_live.toml").write_text(text[: text.index("[prognosis]")])
    entry = ENTRY.format(name="arm", speed=1).replace("robot1d.toml", "arm_live.toml")
    entry = entry.replace('"log"', '"controller"').replace("run.csv", "arm.csv")
    file = folder / "site.toml"
    head = 'schema = 1\nname = "hall"\nwarm = true\n[http]\nport = 0\n'
    file.write_text(head + entry.replace("workers = 0", "workers = 1"))
    first, last = measured(folder, file, seconds)
    share = told("18 channels at 1 kHz", first, last, 1)
    return share <= FAST and last.rows - first.rows >= 950 * (last.at - first.at)


def main(seconds: int = 60, twins: int = 200) -> int:
    """Exit code 0 where what is asked is reached."""
    reached = []
    for part in (lambda where: robots(where, twins, seconds), lambda where: fast(where, seconds)):
        with tempfile.TemporaryDirectory() as name:
            reached.append(part(Path(name)))
    missed = [what for what, good in zip(("robots", "1 kHz"), reached, strict=True) if not good]
    print(f"MISSED: {', '.join(missed)}" if missed else "all reached")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
