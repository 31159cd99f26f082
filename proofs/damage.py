"""What a damaged store comes to: `python -m proofs.damage [STORES] [SEED]`.

A shipped twin file runs two days through the command line. Its store (closed, or as a kill leaves
it, with its write-ahead log) is damaged at random: bytes changed, zeroed, pages swapped or doubled,
the end cut off. Then the two days are run again. Counted: stores that start; stores that say
exactly which entries they lost; content that differs from what was written and was not told; stores
that `verify` finds damaged thereafter, and that are repaired as it says; logs that are whole again
once the recordings are named again.
"""

from __future__ import annotations

import contextlib
import shutil
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from evertwin.errors import EvertwinError, StoreDamaged
from evertwin.fold import Event
from evertwin.store import Entry, SqliteStore
from proofs._verdict import ended
from proofs.kills import DAYS, NEVER, Kill, begun, called, warm

PAGE = 4096
# in place, as disks do it: nothing moves
KINDS = ("changed", "zeroed", "cut off", "pages swapped", "page doubled", "one bit")
TAIL = 16 * PAGE
"""A log whose end is gone looks as after a crash: its last pages are left alone."""


def damaged(raw: bytes, kind: str, rng: np.random.Generator, room: int) -> bytes:
    """``raw`` with a damage somewhere before its last ``room`` bytes."""
    size = int(rng.choice([1, 16, 400, 4096, 20_000]))
    last = max(len(raw) - room - size, 1)
    at = int(rng.integers(0, last))
    if kind == "one bit":
        return raw[:at] + bytes([raw[at] ^ 1 << int(rng.integers(8))]) + raw[at + 1 :]
    if kind == "zeroed":
        return raw[:at] + bytes(size) + raw[at + size :]
    if kind == "cut off" and not room:
        return raw[: max(at, PAGE)]
    if kind == "pages swapped":
        one, other = (PAGE * int(k) for k in rng.integers(0, max(last // PAGE, 1), 2))
        out = bytearray(raw)
        out[one : one + PAGE], out[other : other + PAGE] = (
            raw[other : other + PAGE], raw[one : one + PAGE],
        )  # fmt: skip
        return bytes(out)
    if kind == "page doubled":
        at -= at % PAGE
        return raw[: at + PAGE] + raw[at : at + PAGE] + raw[at + 2 * PAGE :]
    return raw[:at] + rng.bytes(size) + raw[at + size :]


def whole(folder: Path, *, killed: bool) -> tuple[Entry, ...]:
    """A store of two days; ``killed``: with its log beside it, as a kill at the end leaves it."""
    begun(folder)
    if called(folder, DAYS[0]) != 0:
        raise SystemExit((folder / "err.txt").read_text())
    kill = Kill("before SqlStore.close", 1) if killed else NEVER
    if called(folder, DAYS[1], kill) != (-signal.SIGKILL if killed else 0):
        raise SystemExit((folder / "err.txt").read_text())
    store = SqliteStore(folder / "robot.db", read_only=True)
    entries = store.entries()
    store.close()
    return entries


def said(entries: tuple[Entry, ...]) -> list[tuple[int, str, int, str]]:
    """The log without its numbers, and without what says that it was damaged."""
    return [entry[1:5] for entry in entries if '"kind":"recovered"' not in entry.content]


def one(folder: Path, entries: tuple[Entry, ...], counts: Counter[str]) -> None:
    """Starts a damaged store, and looks at what it says and has."""
    try:
        store = SqliteStore(folder / "robot.db")
    except EvertwinError as error:
        counts["refused"] += 1
        print(f"refused: {error}")
        return
    counts["started"] += 1
    found, told = store.entries(), store.recovered
    kept = len(entries) if told is None else int(told.evidence["kept"])  # type: ignore[arg-type]
    counts["told"] += told is not None
    counts["entries lost"] += len(entries) - kept
    as_said = told is None or told.evidence["lost"] == len(entries) - kept
    counts["not told"] += found[:kept] != entries[:kept] or not as_said
    store.close()
    for words in DAYS:
        if called(folder, words) != 0:
            counts["bricked"] += 1
            print((folder / "err.txt").read_text()[-500:])
            return
    store = SqliteStore(folder / "robot.db")
    with contextlib.closing(store):
        try:
            store.verify()
        except StoreDamaged:  # in what is read again only to go on from it
            counts["mended when told to"] += 1
            store.recover()
        counts["whole again"] += said(store.entries()) == said(entries)
        store.verify()
        assert all(isinstance(event, Event) for event in store.read("event"))


def main() -> int:
    """Prints the counts."""
    least = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    rng, counts = (
        np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 1),
        Counter[str](),
    )
    with tempfile.TemporaryDirectory() as name:
        warm(begun(Path(name) / "warm"), DAYS)
        starts = []
        for killed in (False, True):
            start = Path(name) / ("killed" if killed else "closed")
            starts.append((start, whole(start, killed=killed)))
        for number in range(least):
            start, entries = starts[number % 2]
            folder = Path(name) / "damaged"
            shutil.rmtree(folder, ignore_errors=True)
            shutil.copytree(start, folder)
            log = folder / "robot.db-wal"
            ahead = log.exists() and log.stat().st_size > 0  # who reads leaves an empty one
            file = log if ahead and rng.random() < 0.5 else folder / "robot.db"
            room = TAIL if file == log else 0
            kind = KINDS[number // 2 % len(KINDS)]
            file.write_bytes(damaged(file.read_bytes(), kind, rng, room))
            one(folder, entries, counts)
    names = (
        "started", "refused", "told", "entries lost", "not told", "bricked", "mended when told to",
        "whole again",
    )  # fmt: skip
    print(", ".join(f"{name} {counts[name]}" for name in names))
    return ended({
        "every store starts": counts["started"] == least,
        "what is lost is said": counts["not told"] == 0,
        "bricked 0": counts["bricked"] == 0,
        "whole again once the recordings are named": counts["whole again"] == least,
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
