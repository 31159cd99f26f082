"""Does slow work keep the service waiting? `python -m proofs.loop_lag [SECONDS] [TWINS] [RATE]`.

So many robots follow a replayed recording at so many rows a second while their fits, corrections
and trials run in processes. Lag of the event loop: how late a sleep of 20 ms wakes up. From the
arrival of a sample until the store has it on the disk, and until it has what the twin says of the
row that the sample completes; beside what the twin file declares: slack of its sources, delay of
its filters, its beat. Figures mean something on an idle machine alone.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from evertwin import Twin
from evertwin.rows import Feed
from evertwin.rows.alignment import Alignment
from planted.serving import Served, site
from planted.worlds import record_robot
from proofs._verdict import ended

P99, WORST, DURABLE = 0.020, 0.250, 0.050


def flushes(file: Path, seconds: float) -> float:
    """For so long, five times a second, 4 KiB are written and flushed: p99 of the time [s]."""
    took, ends = [], time.perf_counter() + seconds
    with file.open("wb", buffering=0) as out:
        while time.perf_counter() < ends:
            began = time.perf_counter()
            out.write(bytes(4096))
            os.fsync(out.fileno())
            took.append(time.perf_counter() - began)
            time.sleep(0.2)
    return float(np.quantile(took, 0.99))


def main(seconds: int = 60, twins: int = 2, rate: int = 10) -> int:
    """Exit code 0 where the lag p99 is within 20 ms, the worst within 250 ms, durable p99 50 ms."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        length = str(seconds * rate + 100)
        record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", length)
        names = [f"robot{k}" for k in range(twins)]
        with Served(site(folder, *names, speed=float(rate), workers=1)) as served:
            served.until(lambda _: True, 300.0)
            disk = flushes(folder / "probe", seconds)
            lag = served.ask("/api/v1/status")[1]["lag"]
            figures = served.ask("/metrics")[1].splitlines()
            events: Counter[str] = Counter()
            for one in names:
                told = served.ask(f"/api/v1/twins/{one}/events?limit=10000")[1]["events"]
                events.update(event["kind"] for event in told)
        with Twin.open(folder / "robot1d.toml") as twin:
            spec, brings = twin.spec, Feed(twin.spec, twin.model).live()
            delay = Alignment.of(spec, twin.model, brings).delay
            beat = twin.setup.at(float(rate)).beat.every
    took = {
        key: max(float(line.rpartition(" ")[2]) for line in figures
                 if line.startswith(f"evertwin_twin_{key}_seconds{{"))
        for key in ("durable", "folded")
    }  # fmt: skip
    print(f"{twins} twins, {rate} rows/s each, {seconds} s; events: {dict(events)}")
    print(f"lag of the loop: p99 {1e3 * lag['p99']:.1f} ms, worst {1e3 * lag['worst']:.1f} ms")
    slack = max(one.slack for one in spec.source)
    print(f"declared: slack {slack:g} s, delay of filters {delay} rows, a beat every {beat} rows")
    for key, text in (("durable", "durable"), ("folded", "what is said of its row is durable")):
        print(f"from arrival until {text}: p99 {1e3 * took[key]:.1f} ms")
    print(f"4 KiB onto the same disk meanwhile: p99 {1e3 * disk:.1f} ms")
    return ended({"lag p99 within 20 ms": lag["p99"] <= P99,
                  "worst lag within 250 ms": lag["worst"] <= WORST,
                  "both p99 within 50 ms": max(took.values()) <= DURABLE})  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
