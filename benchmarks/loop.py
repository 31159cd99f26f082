"""Rows through the whole loop: `python -m benchmarks.loop [--rows 1000000]`.

`Twin.run` and `Twin.push` on shipped twin files, `twins/robot.toml` and `twins/arm.toml`, at the
rates of their recordings (1 and 10 rows a second). The machine changes every million rows, so
that the loop has to fit, to correct and to try; what it did is printed beside the rate.

* In blocks of 65,536 rows: rows per second of processor time, all threads of the process counted,
  fits and searches included; also where the machine does not change. Cost per row and the
  process's memory from 10⁴ rows on, up to ``--most`` rows.
* One pushed row, store in memory: processor time of `Twin.push`, slow work in the same process
  included.
* One pushed row, store in a file: wall-clock from `Twin.push` until its transaction is durable.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.config import TwinSpec, read
from evertwin.config.spec import StoreSpec
from evertwin.fold import Block, Chunk, make_block
from evertwin.store import Store
from evertwin.worlds.drive import WORLDS, commands, sweep, target

ROOT = Path(__file__).parent.parent
SEED = 0
SIZE = 65_536
"""Rows of a block."""
EVERY = 1_000_000
"""Rows from change to change."""
NEVER = 10**12
NS = 10**9
SHOWN = ("tuned", "corrected", "promoted", "rejected", "rolled_back")


class Machine(NamedTuple):
    """A machine with the twin file that belongs to it."""

    name: str
    rate: int
    """Rows a second."""
    asked: float
    """Rows per second of processor time."""
    every: int = EVERY

    @property
    def spec(self) -> TwinSpec:
        """The shipped twin file."""
        return read(ROOT / "twins" / f"{self.name}.toml")

    def blocks(self, rows: int) -> Iterator[Block]:
        """The recording, in blocks."""
        source = _Robot(self) if self.name == "robot" else _Arm(self)
        for start in range(0, rows, SIZE):
            i = np.arange(start, min(start + SIZE, rows))
            t = i * NS // self.rate
            before = None if start == 0 else int((start - 1) * NS // self.rate)
            yield make_block(t=t, **source.rows(i), before=before, row=start)


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


class _Robot:
    """A base whose drive does not do what it is told; at each change it gets a lower cap."""

    def __init__(self, machine: Machine) -> None:
        self.every, self.place, self.turned = machine.every, np.zeros(2), 0.0

    def rows(self, i: np.ndarray) -> dict[str, np.ndarray]:
        """Inputs and outputs of these rows, which follow those before."""
        rng, n = np.random.default_rng((SEED, int(i[0]))), len(i)
        truth, how = WORLDS["w3"]
        v = commands(rng, how, n)
        begin = int(-i[0] % self.every)
        if begin < n:
            # a training sequence, as the twin file says: five seconds of standing, then a sweep
            first = np.concatenate([np.zeros(5), sweep(how, 5)])[: n - begin]
            v[begin : begin + len(first)] = first
        w = 0.02 * np.sin(2 * np.pi * i / 60.0)
        aim = np.where((i // self.every) % 2, target(replace(truth, cap=12.0), v), target(truth, v))
        step = aim + truth.noise * (v > 0) * rng.standard_normal(n)
        step[i == 0] = 0.0
        turn = np.where(i == 0, 0.0, w)
        heading = self.turned + np.cumsum(turn)
        middle = heading - 0.5 * turn
        place = self.place + np.cumsum(
            step[:, None] * np.stack([np.cos(middle), np.sin(middle)], 1), 0
        )
        self.place, self.turned = place[-1], heading[-1]
        seen = 0.01 * (place + truth.sensor * rng.standard_normal((n, 2)))
        angle = heading + 0.001 * rng.standard_normal(n)
        pose = np.column_stack([seen, np.angle(np.exp(1j * angle))])
        return {"u": np.column_stack([0.01 * v, w]), "y": pose}


class _Arm:
    """Six joints that move at once; at each change their Coulomb friction is another one."""

    def __init__(self, machine: Machine) -> None:
        self.machine, self.model = machine, Twin(machine.spec).model
        rng = np.random.default_rng(SEED)
        self.w, self.a = rng.uniform(0.2, 0.7, 6), rng.uniform(0.3, 0.9, 6)
        self.noise = (0.5, 0.8, 0.5, 0.08, 0.08, 0.06)

    def rows(self, i: np.ndarray) -> dict[str, np.ndarray]:
        """Inputs and outputs of these rows."""
        a, w, t = self.a, self.w, i[:, None] / self.machine.rate
        u = np.concatenate(
            [a * np.sin(w * t), a * w * np.cos(w * t), -a * w**2 * np.sin(w * t)], axis=1
        )
        p, rng = self.model.parameters, np.random.default_rng((SEED, int(i[0])))
        y = np.empty((len(i), 6))
        for odd, share in enumerate((2.0, 2.6)):
            now = (i // self.machine.every) % 2 == odd
            true = {name: share * p[name].value for name in p.names if name.startswith("Fc")}
            values = p.with_values(true).values
            y[now] = self.model.simulate(np.zeros(0), u[now], np.zeros(now.sum()), values)[1]
        return {"u": u, "y": y + self.noise * rng.standard_normal(y.shape)}


def in_blocks(machine: Machine, rows: int) -> tuple[float, Counter[str], int]:
    """Seconds of processor time that `Twin.run` takes, events by kind, fits and searches."""
    spent = 0.0

    def counted() -> Iterator[Block]:
        nonlocal spent
        made = machine.blocks(rows)
        while True:
            begin = time.process_time()
            block = next(made, None)
            spent += time.process_time() - begin
            if block is None:
                return
            yield block

    with Twin(machine.spec) as twin:
        begin = time.process_time()
        twin.run(counted())
        took = time.process_time() - begin - spent
        said = Counter(event.kind for event in twin.events)
        return took, said, len(twin.store.read("request"))


def memory() -> float:
    """Resident memory of this process [MB]."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


def measure_blocks(machine: Machine, rows: int) -> None:
    """Prints rows per second with changes and without."""
    for told in (machine, machine._replace(every=NEVER)):
        took, said, asked = in_blocks(told, rows)
        events = ", ".join(f"{said[kind]} {kind}" for kind in SHOWN if said[kind])
        say(
            f"{machine.name}, {rows} rows, {'changing' if told is machine else 'unchanged'}: "
            f"{rows / took / 1e6:.3f} M rows/s (asked {machine.asked / 1e6:.1f}); "
            f"{asked} requests: {events}"
        )


def measure_sizes(machine: Machine, most: int) -> None:
    """Prints cost per row and memory by the number of rows."""
    for rows in (10**k for k in range(4, 9)):
        if rows <= most:
            took, said, _ = in_blocks(machine, rows)
            say(f"{machine.name}, {rows:9d} rows: {1e6 * took / rows:7.3f} us a row, "
                f"{memory():.0f} MB, {said['promoted']} promoted")  # fmt: skip


def samples(machine: Machine, rows: int) -> list[Chunk]:
    """The recording, one sample a chunk, as a source sends it."""
    name, found = machine.spec.source[0].name, []
    for block in machine.blocks(rows):
        u = block.u
        if machine.name == "robot":
            u = np.concatenate([u[1:], u[-1:]])  # a command acts from its stamp on
        values = np.concatenate([u, block.y], axis=1)
        found += [Chunk(name, block.t[i : i + 1], values[i : i + 1]) for i in range(len(block.t))]
    return found


def pushed(machine: Machine, rows: int, pause: float) -> np.ndarray:
    """Processor seconds of each `Twin.push` of one row; ``pause``: from push to push."""
    spent, clock = np.empty(rows), time.perf_counter
    with Twin(machine.spec) as twin:
        began = clock()
        for i, one in enumerate(samples(machine, rows)):
            while pause and clock() < began + i * pause:
                time.sleep(min(pause, 0.0005))
            begin = time.thread_time()
            twin.push(one)
            spent[i] = time.thread_time() - begin
        twin.finish()
    return spent[rows // 4 :]


def durable(machine: Machine, rows: int, folder: Path, pause: float) -> np.ndarray:
    """Seconds from each `Twin.push` of one row until a store in a file has it for good."""
    spec = replace(machine.spec, store=StoreSpec("twin.db"), folder=str(folder))
    at, done, clock = np.empty(rows), np.zeros(rows), time.perf_counter
    count, ended = 0, threading.Event()

    def look(store: Store) -> None:
        seen = 0
        while seen < rows and not (ended.is_set() and seen == count):
            upto = count
            if upto == seen:
                time.sleep(0.0002)
                continue
            store.flush()
            done[seen:upto] = clock()
            seen = upto

    with Twin(spec) as twin:
        watcher = threading.Thread(target=look, args=(twin.store,))
        watcher.start()
        began = clock()
        for i, one in enumerate(samples(machine, rows)):
            while clock() < began + i * pause:
                time.sleep(0.0002)
            at[i] = clock()
            twin.push(one)
            count = i + 1
        ended.set()
        watcher.join()
        twin.finish()
    return (done - at)[rows // 4 :]


def said_of(spent: np.ndarray) -> str:
    """Median and 99 %."""
    p50, p99 = np.quantile(spent, [0.5, 0.99])
    return f"{1e6 * p50:.0f} us median, {1e6 * p99:.0f} us at 99 %"


def measure_pushed(machine: Machine, rows: int) -> None:
    """Prints what one pushed row costs."""
    for told, pause, count in (
        ("as fast as they go", 0.0, rows), ("1000 a second", 1e-3, rows),
        ("50 a second, each folded alone", 0.02, rows // 20),
    ):  # fmt: skip
        say(f"{machine.name}, one pushed row, {told}: {said_of(pushed(machine, count, pause))} "
            "(asked 50 and 1000)")  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        spent = durable(machine, rows // 4, Path(name), 1e-3)
    say(f"{machine.name}, row -> durable, 1000 a second: {said_of(spent)} (asked 25000 and 100000)")


def main() -> None:
    """Both machines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--most", type=int, default=1_000_000)
    parser.add_argument("--pushed", type=int, default=20_000)
    parser.add_argument("--machine", choices=("robot", "arm"), nargs="*", default=("robot", "arm"))
    chosen = parser.parse_args()
    machines = {"robot": Machine("robot", 1, 1e6), "arm": Machine("arm", 10, 3e5)}
    for machine in (machines[name] for name in chosen.machine):
        in_blocks(machine, 100_000)
        measure_blocks(machine, chosen.rows)
        measure_pushed(machine, chosen.pushed)
        measure_sizes(machine, chosen.most)


if __name__ == "__main__":
    main()
