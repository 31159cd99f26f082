"""What `kill -9` leaves of a store: `python -m proofs.kills [KILLS] [SEED]`.

The command line runs in child processes (forked from one that has imported and compiled what it
needs; a share of them is started anew as `python -m evertwin`) on a shipped twin file with a store:
runs of two days, runs that go on after a kill, and an operator's commands. They are killed at
successive SQL statements, before and after named points of the code, and at random times; what was
killed is repeated, and killed again. In the end the log has to be, entry for entry and hash for
hash, that of the same commands without a kill.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import itertools
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from evertwin.app.cli import main as command_line
from evertwin.errors import StoreError
from evertwin.loop import run as loop_run
from evertwin.store import Entry, Head, SqliteStore
from evertwin.store.sql.database import Foreign
from evertwin.worlds.robot import main as record
from proofs._verdict import ended

TWIN = Path(__file__).parent.parent / "twins" / "robot1d.toml"
ADDED = """
[store]
path = "robot.db"

[[indicator]]
name = "gain"
component = "gearbox"
parameter = "gain"
limit = 0.7
direction = "below"
"""
RUN = ("run", "robot.toml", "--data", "monday.csv")
DAYS = (RUN, ("run", "robot.toml", "--data", "tuesday.csv"))
OPERATOR = (
    ("model", "promote", "robot.toml", "0", "--reason", "to see"),
    ("model", "rollback", "robot.toml"),
    ("model", "pin", "robot.toml", "0"),
    ("model", "pin", "robot.toml"),
    ("model", "load", "robot.toml", "values.json"),
    ("decide", "robot.toml", "gearbox", "replaced", "--reason", "worn"),
)
POINTS = (
    ("evertwin.store.sqlite.lock", "Lock._take"),
    ("evertwin.store.sql.database", "Database._create"),
    ("evertwin.store.sql.checkpoints", "Checkpoints.restore"),
    ("evertwin.store.sql.store", "SqlStore.close"),
    ("evertwin.store.sql.tables", "Tables.write"),
    ("evertwin.store.sql.checkpoints", "Checkpoints.write"),
    ("evertwin.store.sql.writer", "Writer.put"),
    ("evertwin.store.sql.writer", "Writer.flush"),
    ("evertwin.ledger.ledger", "Ledger.commit"),
    ("evertwin.ledger.ledger", "Ledger.say"),
    ("evertwin.ledger.run_log", "RunLog.say"),
    ("evertwin.ledger.run_log", "RunLog.again"),
    ("evertwin.loop.driver", "Driver.beat"),
    ("evertwin.refit.work", "Work.content"),
    ("evertwin.loop.slow_work", "SlowWork.send"),
    ("evertwin.loop.decisions.decide", "Decide._promote"),
    ("evertwin.loop.run", "Run._finished"),
)
HOW = {
    "statement",
    "time",
    *(f"{when} {name}" for _, name in POINTS for when in ("before", "after")),
}
MOST = 12
"""Kills in a row before a command is left to end."""


class Kill(NamedTuple):
    """Where a child dies."""

    how: str
    """``statement``, ``time``, or a point with ``before`` or ``after``."""
    at: float
    """The how-manieth, or after how many seconds."""


NEVER = Kill("statement", np.inf)


# ---------------------------------------------------------------------- inside the child


def die() -> NoReturn:
    """As a machine does that loses its power, as far as a process can."""
    os.kill(os.getpid(), signal.SIGKILL)
    raise SystemExit


def _counting(counts: Counter[str], kill: Kill) -> Callable[[str], None]:
    def passed(name: str) -> None:
        counts[name] += 1
        if name == kill.how and counts[name] == kill.at:
            die()

    return passed


def _prepared(kill: Kill, counts: Counter[str], acked: Path) -> None:
    """Faults at statements and points; every state that is durable is told on a file."""
    passed = _counting(counts, kill)
    connect = sqlite3.connect

    def traced(*given: Any, **named: Any) -> sqlite3.Connection:
        found = connect(*given, **named)
        found.set_trace_callback(lambda text: passed("statement"))
        return found

    sqlite3.connect = traced  # type: ignore[assignment]
    for module, name in POINTS:
        owner, method = name.split(".")
        kind = getattr(importlib.import_module(module), owner)
        setattr(kind, method, _around(kind.__dict__[method], name, passed))
    sheet = importlib.import_module("evertwin.store.sql.tables").Tables
    write, file = sheet.write, acked.open("a", buffering=1)

    def acknowledged(self: Any, jobs: Any) -> None:
        write(self, jobs)
        last = next((job.entries[-1] for job in reversed(jobs) if job.entries), None)
        if last is not None:
            file.write(f"{last.number}:{last.hash}\n")

    sheet.write = acknowledged
    # a checkpoint after every piece: a second's work is all that this recording takes
    loop_run.SECONDS = loop_run.SHARE = 0.0


def _around(method: Any, name: str, passed: Callable[[str], None]) -> Any:
    inner = method.__func__ if isinstance(method, classmethod) else method

    def wrapped(*given: Any, **named: Any) -> Any:
        passed(f"before {name}")
        found = inner(*given, **named)
        passed(f"after {name}")
        return found

    return classmethod(wrapped) if isinstance(method, classmethod) else wrapped


def _child(folder: Path, words: Sequence[str], kill: Kill) -> NoReturn:
    os.chdir(folder)
    for stream, name in ((1, "out.txt"), (2, "err.txt")):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), stream)
    counts, code = Counter[str](), 101
    _prepared(kill, counts, folder / "acked.txt")
    try:
        command_line(list(words))
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        Path("counts.json").write_text(json.dumps(counts))
        sys.stdout.flush()
        os._exit(code)


# ---------------------------------------------------------------------- outside


def called(folder: Path, words: Sequence[str], kill: Kill = NEVER, *, anew: bool = False) -> int:
    """Exit code of a command; −9 where it was killed.

    Raises:
        ValueError: there is no such point.
    """
    if kill.how not in HOW:
        raise ValueError(f"nothing passes {kill.how!r}")
    if anew:
        process = subprocess.Popen(
            [sys.executable, "-m", "evertwin", *words], cwd=folder, stdout=subprocess.DEVNULL,
            stderr=(folder / "err.txt").open("w"),
        )  # fmt: skip
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(kill.at if kill.how == "time" else None)
        process.kill()
        return process.wait()
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        _child(folder, words, kill)
    if kill.how == "time":
        time.sleep(kill.at)
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def log_of(folder: Path) -> tuple[Entry, ...]:
    """The log; empty where there is no store yet."""
    file = folder / "robot.db"
    if not file.exists():
        return ()
    try:
        store = SqliteStore(file, read_only=True)
    except Foreign:
        return ()  # its tables were not yet made
    try:
        store.verify()
        for line in _acked(folder):
            store.verify(Head.parse(line))
        return store.entries()
    finally:
        store.close()


def _acked(folder: Path) -> list[str]:
    """The newest head that a child was told to be durable."""
    file = folder / "acked.txt"
    lines = file.read_text().splitlines(keepends=True) if file.exists() else []
    return [line for line in lines if line.endswith("\n")][-1:]


@dataclass
class Tally:
    """What was counted."""

    kills: Counter[str] = field(default_factory=Counter)
    lost: int = 0
    doubled: int = 0
    bricked: int = 0
    different: int = 0
    went_on: list[float] = field(default_factory=list)
    """Time until a repeated command had ended [s]."""

    def compare(self, found: Sequence[Entry], expected: Sequence[Entry]) -> None:
        """A log beside that of the same commands without a kill."""
        self.different += found != expected
        many = Counter(entry[1:5] for entry in found) - Counter(entry[1:5] for entry in expected)
        self.doubled += sum(many.values())
        few = Counter(entry[1:5] for entry in expected) - Counter(entry[1:5] for entry in found)
        self.lost += sum(few.values())


@dataclass
class Case:
    """Commands from a start, without a kill."""

    name: str
    start: Path
    commands: Sequence[Sequence[str]]
    logs: list[tuple[Entry, ...]] = field(default_factory=list)
    """Before the first command, and after each."""
    counts: list[dict[str, int]] = field(default_factory=list)
    """How often each fault could strike in it."""
    seconds: list[float] = field(default_factory=list)

    def unbroken(self, folder: Path) -> None:
        """Runs it once."""
        shutil.copytree(self.start, folder)
        self.logs.append(log_of(folder))
        for words in self.commands:
            begun = time.monotonic()
            if called(folder, words) != 0:
                raise SystemExit(f"{words}: {(folder / 'err.txt').read_text()}")
            self.seconds.append(time.monotonic() - begun)
            self.counts.append(json.loads((folder / "counts.json").read_text()))
            self.logs.append(log_of(folder))

    def faults(self, rng: np.random.Generator) -> Iterator[tuple[int, Kill]]:
        """Each statement of each command, then some of each point, then random times."""
        for k, counts in enumerate(self.counts):
            for at in range(1, counts["statement"] + 1):
                yield k, Kill("statement", at)
            for name, count in counts.items():
                if name != "statement":
                    for at in sorted({*rng.integers(1, count + 1, 3).tolist(), count}):
                        yield k, Kill(name, at)
            for _ in range(max(10, counts["statement"] // 4)):
                yield k, Kill("time", float(rng.uniform(0, 1.1 * self.seconds[k])))

    def broken(self, folder: Path, k: int, first: Kill, rng: np.random.Generator, tally: Tally
               ) -> None:  # fmt: skip
        """The commands once more, the one with number ``k`` killed, and killed again."""
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.start, folder)
        for j, words in enumerate(self.commands):
            if j == k:
                self._killed(folder, j, first, rng, tally)
            begun = time.monotonic()
            if self._done(folder, j) and j == k and words[0] != "run":
                continue  # it was kept before the child could say so
            if called(folder, words) != 0:
                tally.bricked += 1
                sys.stdout.write(
                    f"{self.name} {first}: {(folder / 'err.txt').read_text()[-900:]}\n"
                )
                return
            if j == k:
                tally.went_on.append(time.monotonic() - begun)
        try:
            tally.compare(log_of(folder), self.logs[-1])
        except StoreError as error:
            tally.lost += 1
            sys.stdout.write(f"{self.name} {first}: {error}\n")

    def _killed(self, folder: Path, j: int, first: Kill, rng: np.random.Generator, tally: Tally
                ) -> None:  # fmt: skip
        kill, anew = first, rng.random() < 0.01
        for _ in range(MOST):
            if anew:
                kill = Kill("time", float(rng.uniform(1.0, 8.0)))
            if called(folder, self.commands[j], kill, anew=anew) != -signal.SIGKILL:
                return
            tally.kills["time, started anew" if anew else kill.how.split()[0]] += 1
            with contextlib.suppress(StoreError):
                log_of(folder)
            if rng.random() < 0.5:
                return
            kill = Kill("statement", int(rng.integers(1, self.counts[j]["statement"] + 1)))

    def _done(self, folder: Path, j: int) -> bool:
        """Has the log already what the command adds?"""
        return len(log_of(folder)) >= len(self.logs[j + 1])


def begun(start: Path) -> Path:
    """A folder with a twin file, the recordings of two days, and parameter values."""
    start.mkdir()
    (start / "robot.toml").write_text(TWIN.read_text() + ADDED)
    for name, seed in (("monday", 5), ("tuesday", 6)):
        record(["--light", "--world", "w3", "--seed", str(seed), "--seconds", "250",
                "--out", str(start / f"{name}.csv")])  # fmt: skip
    (start / "values.json").write_text(json.dumps({"parameters": {"gain": {"value": 0.97}}}))
    return start


def cases(folder: Path) -> Iterator[Case]:
    """From nothing; from one day; from a run that was cut off; an operator's commands."""
    start = begun(folder / "start")
    yield Case("two days", start, DAYS)
    one = folder / "one"
    shutil.copytree(start, one)
    called(one, RUN)
    yield Case("operator", one, OPERATOR)
    cut = folder / "cut"
    shutil.copytree(start, cut)
    if called(cut, RUN, Kill("after Driver.beat", 26)) != -signal.SIGKILL:
        raise SystemExit("the run that is to be cut off ended")
    yield Case(
        "meanwhile", cut, (("model", "pin", "robot.toml", "0"), RUN, *OPERATOR[3:4], DAYS[1])
    )


def warm(folder: Path, commands: Sequence[Sequence[str]]) -> None:
    """Imports and compiles what the commands need, here, before the first child."""
    here = os.getcwd()
    os.chdir(folder)
    for words in commands:
        with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
            command_line(list(words))
    os.chdir(here)


def main() -> int:
    """Prints what was counted."""
    least = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    rng, tally = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 1), Tally()
    with tempfile.TemporaryDirectory() as name:
        folder, known = Path(name), []
        warm(begun(folder / "warm"), (*DAYS, *OPERATOR))
        for case in cases(folder):
            case.unbroken(folder / f"unbroken {case.name}")
            known.append((case, list(case.faults(rng))))
        for _, faults in known:
            rng.shuffle(faults)  # type: ignore[arg-type]
        statements = [sum(c["statement"] for c in case.counts) for case, _ in known]
        print(f"{', '.join(case.name for case, _ in known)}: {statements} statements")
        for pairs in itertools.zip_longest(
            *([(case, *f) for f in faults] for case, faults in known)
        ):
            for case, k, kill in filter(None, pairs):
                case.broken(folder / "broken", k, kill, rng, tally)
            if sum(tally.kills.values()) >= least:
                break
    took = np.percentile(tally.went_on, [50, 99]) if tally.went_on else (np.nan, np.nan)
    print(f"kills {sum(tally.kills.values())}: " + ", ".join(
        f"{count} {how}" for how, count in tally.kills.most_common()))  # fmt: skip
    print(f"lost {tally.lost}, doubled {tally.doubled}, bricked {tally.bricked}, "
          f"logs that differ {tally.different}")  # fmt: skip
    print(f"repeated command ended after {took[0]:.2f} s (median), {took[1]:.2f} s (99 %)")
    return ended({
        "lost 0": tally.lost == 0, "doubled 0": tally.doubled == 0,
        "bricked 0": tally.bricked == 0, "log = unbroken": tally.different == 0,
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
