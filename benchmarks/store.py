"""What the store costs: `python -m benchmarks.store [FOLDER]`.

1. Checkpoints of the shipped twins: bytes of the state, time that the fold waits (a copy), time of
   the store's thread, bytes written, while rows come at 10 Hz, 1 kHz and as fast as they are read.
2. A run of a recorded hour at 100 Hz with a store and without: rows per processor second.
3. Samples pushed one by one: time until the call returns, and until they are durable.
4. Opening a store of 1,000 to 100,000 entries, to work and to look at.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from evertwin import Twin
from evertwin.config import read
from evertwin.config.spec import ModelSpec, PredictionSpec, Span, StoreSpec, TwinSpec
from evertwin.fold import Block, Chunk, Event, copy, make_block
from evertwin.fold.state import leaves
from evertwin.ledger.versions import Versions
from evertwin.loop.driver import Driver
from evertwin.setup.setup import Setup
from evertwin.store import Batch, Checkpoint, SqliteStore

TWINS = Path(__file__).parent.parent / "twins"


def rows_of(setup: Setup, first: int, n: int) -> Block:
    """Rows of nothing in particular."""
    rng = np.random.default_rng(first)
    nu, ny = len(setup.model.inputs), len(setup.model.outputs)
    t = (first + np.arange(n)) * 10**7
    before = None if first == 0 else (first - 1) * 10**7
    return make_block(
        t, rng.normal(size=(n, nu)), rng.normal(size=(n, ny)), before=before, row=first
    )


def checkpoints(folder: Path) -> None:
    """Prints one line per twin and pace."""
    for name in ("robot1d", "robot", "arm"):
        spec = read(TWINS / f"{name}.toml")
        setup = Twin(spec).setup.at(100.0)
        driver = Driver(setup, Versions(setup.model), lambda row, said: None)
        state = driver.step(driver.init(), rows_of(setup, 0, 20_000))
        size = sum(leaf.nbytes for leaf in leaves(state).values())
        for pace in (10, 1000, 100_000):
            store = SqliteStore(folder / f"{name}{pace}.db")
            waits, works, written, last = [], [], [], set[str]()
            for _ in range(12):
                state = driver.follow.keep(state, rows_of(setup, state.row, pace))
                state = state._replace(row=state.row + pace)
                begun = time.perf_counter()
                kept = copy(state)
                waits.append(time.perf_counter() - begun)
                begun = time.perf_counter()
                store.commit(Batch(checkpoint=Checkpoint(state.row, kept, 1)))
                works.append(time.perf_counter() - begun)
                found = dict(store._db.query("SELECT name, length(content) FROM pieces"))
                written.append(sum(n for k, n in found.items() if k not in last))
                last = set(found)
            store.close()
            told = (1e3 * np.median(waits[2:]), np.median(written[2:]) / 1e3,
                    1e3 * np.median(works[2:]))  # fmt: skip
            print(f"{name:8} {size / 1e6:5.2f} MB  {pace:7d} rows a second: the fold waits "
                  "{:5.2f} ms, written {:7.1f} kB in {:5.1f} ms".format(*told))  # fmt: skip


def runs(folder: Path) -> None:
    """Prints rows per processor second with a store and without."""
    n = 360_000
    rng = np.random.default_rng(1)
    v = np.repeat(rng.uniform(-0.2, 0.2, n // 100), 100)
    x = np.r_[0.0, np.cumsum(0.01 * v[:-1])] + rng.normal(0.0, 1e-3, n)
    columns = {"t": np.arange(n) / 100, "v": v, "x": x}
    plain = TwinSpec("cart", ModelSpec("robot1d"), beat=Span(100),
                     prediction=PredictionSpec(horizon=1.0))  # fmt: skip
    kept = replace(plain, store=StoreSpec("run.db"), folder=str(folder))
    Twin(plain).run(columns)
    for name, spec in (("without a store", plain), ("with a store", kept)):
        with Twin(spec) as twin:
            begun = time.process_time()
            twin.run(columns)
            took = time.process_time() - begun
            head = twin.store.head.length
        print(f"{name:16} {n / took / 1e3:8.0f} k rows per processor second, {head} entries")


def samples(folder: Path) -> None:
    """Prints quantiles of the time of a sample."""
    store = SqliteStore(folder / "samples.db")
    value = np.ones((1, 7))
    for wait, name in ((False, "returns"), (True, "durable")):
        spent = []
        for k in range(2000):
            chunk = Chunk("pose", np.array([k]), value)
            begun = time.perf_counter()
            store.commit(Batch(chunks=(chunk,)), wait=wait)
            spent.append(1e3 * (time.perf_counter() - begun))
            if not wait:
                time.sleep(5e-4)
        store.flush()
        p50, p99 = np.percentile(spent, [50, 99])
        print(f"a sample is {name}: {p50:.3f} ms median, {p99:.3f} ms 99 %")
    store.close()


def openings(folder: Path) -> None:
    """Prints the time of an opening by the size of the log."""
    for count in (1_000, 10_000, 100_000):
        path = folder / f"{count}.db"
        store = SqliteStore(path)
        for start in range(0, count, 1000):
            store.commit(Batch([Event(k, k, "tuned", "Fc", "off by 9 %", {"before": 0.09})
                                for k in range(start, start + 1000)]), wait=False)  # fmt: skip
        store.close()
        spent = []
        for reading in (False, True):
            begun = time.process_time()
            SqliteStore(path, read_only=reading).close()
            spent.append(1e3 * (time.process_time() - begun))
        begun = time.process_time()
        store = SqliteStore(path, read_only=True)
        store.verify()
        whole = 1e3 * (time.process_time() - begun)
        store.close()
        print(f"{count:7d} entries, {path.stat().st_size / 1e6:5.1f} MB: to work "
              f"{spent[0]:6.1f} ms, to look at {spent[1]:5.1f} ms, "
              f"verified whole {whole:7.1f} ms")  # fmt: skip


def main() -> int:
    """Prints all."""
    with tempfile.TemporaryDirectory(dir=sys.argv[1] if len(sys.argv) > 1 else None) as name:
        for part in (checkpoints, runs, samples, openings):
            part(Path(name))
    return 0


if __name__ == "__main__":
    sys.exit(main())
