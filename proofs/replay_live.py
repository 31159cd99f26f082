"""Is a replay what was lived? `python -m proofs.replay_live [SECONDS] [SPEED] [SEED]`.

The embedded arm (Modbus) and the embedded robot (MQTT) run for so many seconds of their clocks, in
time-lapse, while sensors lie, axes wear, the floor changes and cables are cut; `evertwin serve`
runs their shipped twin files, its fits in processes. Then, for each twin:

    replay    a fresh process folds the stored samples and the logged answers, from the first one on
    export    the samples as `evertwin store export` writes them, folded with the logged answers
    rows      `Twin.run` on the exported files

The fold itself compares each record and version that it makes with the log, and refuses what
differs. In the end the whole state (of the twin, its shadow, its alignment) has to be that of the
service in every bit, and the aligned rows those of the run.
"""

from __future__ import annotations

import dataclasses
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.app.machine.demo_live import free_ports, site_of
from evertwin.app.machine.live_processes import Common, LiveMachine, arm_options, robot_options
from evertwin.app.store.store_commands import export_samples
from evertwin.config import read
from evertwin.config.spec import ChannelSpec, SourceSpec
from evertwin.engine import InProcess
from evertwin.engine.contract import Job
from evertwin.errors import StoreError
from evertwin.fold import Answer, Chunk, Request
from evertwin.loop import Live, other_settings
from evertwin.rows import Feed
from evertwin.signals.units import si_unit
from evertwin.sources.spec import TimeSpec
from evertwin.store import Batch, SqliteStore
from evertwin.store.spec import StoreSpec
from planted.serving import Served
from planted.worlds import told_its_pose
from proofs._verdict import ended
from proofs.papers_live import folded

ARM = (
    "0.1:friction.2=1.3", "0.2:bias.tau3=4 for=60", "0.3:freeze.q1=1 for=10", "0.4:push.1=60",
    "0.45:cut.modbus=1 for=20", "0.55:payload=2 for=60", "0.65:mute.modbus=1 for=20",
    "0.75:friction.5=1.3", "0.85:factor.tau2=1000 for=5",
)  # fmt: skip
ROBOT = (
    "0.15:floor=0.01 for=120", "0.3:bias.x=5 for=30", "0.4:cut.mqtt=1 for=30",
    "0.5:slip=0.2 for=90", "0.6:freeze.y=1 for=20", "0.65:mute.mqtt=1 for=20", "0.7:lag=0.3",
    "0.9:spike.x=50",
)  # fmt: skip
"""At shares of the time."""
NEWEST = "SELECT row, length, layout FROM checkpoints ORDER BY number DESC LIMIT 1"


class Silent(InProcess):
    """Answers nothing: what was not answered in the log stays open.

    >>> Silent().answers()
    ()
    """

    workers = 1  # type: ignore[assignment]

    def submit(self, request: Request, job: Job) -> None:
        """Takes no job."""

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        """None."""
        return ()


class End(NamedTuple):
    """What a store says of its twin in the end."""

    row: int
    length: int
    layout: str
    """Hashes of all that the state is made of."""


def lived(seconds: float, speed: float, seed: int, folder: Path) -> dict[str, Path]:
    """Runs everything; the stores of both twins."""

    def planned(orders: Iterable[str]) -> list[str]:
        told = (one.split(":") for one in orders)
        return [f"{float(share) * seconds:g}:{order}" for share, order in told]

    ports = free_ports(("modbus", "mqtt", "http"))
    both = Common(seed, speed, seconds=seconds)
    arm = arm_options(both._replace(order=planned(ARM)), f"127.0.0.1:{ports['modbus']}", "")
    robot = robot_options(
        both._replace(order=planned(ROBOT)), None, f"127.0.0.1:{ports['mqtt']}",
        topics="command,pose",
    )  # fmt: skip
    site = told_its_pose(site_of(folder, ports))
    store = site.parent / "demo-store"
    with ExitStack() as running:
        served = running.enter_context(Served(site))
        machines = [
            running.enter_context(LiveMachine(name, options))
            for name, options in (("arm", arm), ("robot", robot))
        ]
        for one in machines:
            one.reached()
        for one in machines:
            one.wait()
        folded(served, store)
        token = (store / "token").read_text().strip()
        for twin in served.ask("/api/v1/status", token=token)[1]["twins"]:
            for name, health in twin["sources"].items():
                told = {key: health[key] for key in ("received", "repeated", "lost", "reconnects")}
                sys.stdout.write(f"{twin['name']}: {name}: {told}\n")
    return {name: store / f"{name}_live.db" for name in ("arm", "robot")}


def end_of(store: Path) -> End:
    """Of the newest checkpoint."""
    with closing(sqlite3.connect(store)) as db:
        found = db.execute(NEWEST).fetchone()
    if found is None:
        raise StoreError(f"{store.name}: has no checkpoint")
    return End(*found)


def bare(store: Path, copy: Path, samples: Iterable[Chunk] | None = None) -> Path:
    """A copy without its checkpoints; with ``samples`` in place of its own."""
    with closing(SqliteStore(store, read_only=True)) as found:
        found.backup(copy)
    with closing(sqlite3.connect(copy)) as db:
        for table in ("checkpoints", "pieces", "shown"):
            db.execute(f"DELETE FROM {table}")
        if samples is not None:
            db.execute("DELETE FROM samples")
            db.execute("DELETE FROM sqlite_sequence WHERE name = 'samples'")
        db.commit()
    if samples is not None:
        with closing(SqliteStore(copy)) as made:
            made.commit(Batch(chunks=list(samples)))
    return copy


def fold(file: Path, store: Path) -> None:
    """What the store has, folded from its first sample on, with the answers that its log has."""
    spec = dataclasses.replace(read(file), store=StoreSpec(str(store)))
    with Twin(spec) as twin:
        if said := other_settings(twin.setup, twin._ledger):
            sys.exit(f"{store.name}: nothing is folded: {said}")
        Live.of(twin.setup, twin._ledger, {}, Silent(), True).rest()


def exported(file: Path, spec: TwinSpec, store: Path) -> TwinSpec:
    """Writes the samples of each source to a file, and says what a twin file would of them."""
    sources = []
    for one in spec.source:
        out = store.with_name(f"{store.stem}-{one.name}.npz")
        export_samples(file, out, (one.name, store), (-np.inf, np.inf), False)
        channels = {
            name: ChannelSpec(name, si_unit(channel.unit)) for name, channel in one.channels.items()
        }
        sources.append(
            SourceSpec(
                one.name, channels, files=(str(out),), match=out.name, time=TimeSpec("t_ns", "ns"),
                task="task", slack=one.slack, timeout=one.timeout,
            )
        )  # fmt: skip
    return dataclasses.replace(spec, source=tuple(sources), store=StoreSpec())


def rows(file: Path, store: Path, out: TwinSpec) -> bool:
    """Are the rows of a run on the exported files those that the service had?"""
    spec = dataclasses.replace(read(file), store=StoreSpec(str(store)))
    with Twin(spec) as twin:
        lived = twin.view(10**9) if twin.going() else None
    with Twin(out) as twin:
        trace = twin.run().trace
    assert lived is not None
    count = len(lived.row)
    return all(
        trace[name][:count].tobytes() == getattr(lived, attribute).tobytes()
        for name, attribute in (("t", "t"), ("measured", "measured"), ("input", "inputs"))
    )


def found(name: str, store: Path, folder: Path) -> dict[str, bool]:
    """What came of one twin."""
    file = folder / "twins" / f"{name}_live.toml"
    end, spec = end_of(store), read(file)

    def again(copy: Path) -> bool:
        done = subprocess.run(
            [sys.executable, "-m", "proofs.replay_live", "fold", str(file), str(copy)], check=False
        )
        return done.returncode == 0 and end_of(copy) == end

    out = exported(file, spec, store)
    chunks = Feed(out, Twin(out).model).chunks()
    checks: dict[str, Callable[[], bool]] = {
        "replay": lambda: again(bare(store, folder / f"{name}-a.db")),
        "export": lambda: again(bare(store, folder / f"{name}-b.db", chunks)),
        "rows": lambda: rows(file, Path(shutil.copy(store, folder / f"{name}-c.db")), out),
    }
    told = {what: check() for what, check in checks.items()}
    sys.stdout.write(f"{name}: {end.row} rows, {end.length} entries of the log: {told}\n")
    sys.stdout.flush()
    return {f"{name}: {what}": good for what, good in told.items()}


def main(seconds: float = 1800.0, speed: float = 10.0, seed: int = 1) -> int:
    """Exit code 0 where nothing differs in any bit."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stores = lived(seconds, speed, int(seed), folder)
        told = {
            what: good for one in stores for what, good in found(one, stores[one], folder).items()
        }
    return ended(told)


if __name__ == "__main__":
    given = sys.argv[1:]
    if given[:1] == ["fold"]:
        fold(Path(given[1]), Path(given[2]))
    else:
        sys.exit(main(*map(float, given)))
