"""From a damaged store to one that starts: what is sound goes into a new file, the rest is told.

Sound is the log from its first entry up to the first that is gone or does not match its hash; every
checkpoint whose place in that log, pieces and hash match; every sample that matches its hash. The
damaged file is kept beside the new one as ``….corrupt.N``, its write-ahead log with it.

    build FILE.new ─▶ FILE becomes FILE.corrupt.N ─▶ FILE-wal follows ─▶ FILE.new becomes FILE

A process that is killed on the way leaves a state from which the next one goes on.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evertwin.errors import StoreDamaged, StoreError
from evertwin.fold import Event
from evertwin.store.chain import SEED, Entry, Head, link
from evertwin.store.kinds import KINDS, encode
from evertwin.store.sql.checkpoints import KEPT, shown_proof
from evertwin.store.sql.database import Database, Foreign
from evertwin.store.sql.pieces import name_of, names_in, proof
from evertwin.store.sqlite.pages import Found, rows_in

COLUMNS: Mapping[str, tuple[type, ...]] = {
    "log": (type(None), int, str, int, str, str),
    "head": (type(None), int, str, int),
    "checkpoints": (type(None), int, int, int, int, int, str, str),
    "pieces": (str, bytes),
    "shown": (type(None), int, bytes, str),
    "progress": (type(None), int, int, str, str),
    "samples": (type(None), str, int, int, int, bytes, str),
    "inbox": (type(None), str, str),
}
"""Table → types of its columns; a rowid is stored beside them."""
TABLES = {types: name for name, types in COLUMNS.items()}


@dataclass
class _Sound:
    """What was found in a damaged file and matches its hash."""

    entries: list[Entry] = field(default_factory=list)
    beyond: list[Entry] = field(default_factory=list)
    """Behind the first that is gone."""
    length: int = 0
    """Entries that the log had, as far as anything says."""
    checkpoints: list[tuple[Any, ...]] = field(default_factory=list)
    shown: dict[int, tuple[int, bytes, str]] = field(default_factory=dict)
    progress: tuple[Any, ...] | None = None
    names: set[str] = field(default_factory=set)
    """Pieces that are there."""
    samples: set[int] = field(default_factory=set)
    damaged: set[int] = field(default_factory=set)
    """Samples of which something is left, but not all."""
    asked: set[int] = field(default_factory=set)
    """What other processes asked for: it may have been heard, so it is told and not kept."""

    @property
    def newest(self) -> int:
        """Number of the newest sample that anything says of."""
        counted = (int(row[3]) for row in self.checkpoints)
        return max([0, *self.samples, *self.damaged, *counted])


def rebuild(path: Path, why: StoreError) -> Event:
    """Starts a store anew from what is sound of it; what was lost, as its log says it.

    Raises:
        StoreError: ``why``, where something is in it, and nothing of a store of this evertwin: it
            is left alone.
    """
    sound = _found(path)
    mine = sound.entries or (not isinstance(why, Foreign) and (sound.beyond or sound.length))
    if not mine and path.stat().st_size > 0:
        said = str(why).removesuffix(": check the disk")
        raise type(why)(
            f"{said}: nothing in it is a store's, so it stays as it is: move it away to begin "
            "anew, or name another file in [store] path"
        ) from why
    fresh, corrupt = Path(f"{path}.new"), _free(path)
    for old in (fresh, Path(f"{fresh}-wal"), Path(f"{fresh}-shm")):
        old.unlink(missing_ok=True)
    lost = _told(sound, corrupt.name, str(why))
    _write(fresh, path, sound, lost)
    os.replace(path, corrupt)
    finish(path)
    return lost


def finish(path: Path) -> None:
    """Ends what `rebuild` began, if it was killed between its renames."""
    fresh, log = Path(f"{path}.new"), Path(f"{path}-wal")
    if path.exists() or not fresh.exists():
        return
    if log.exists():
        newest = Path(f"{path}.corrupt.{_newest(path)}")
        os.replace(log, f"{newest}-wal")
    Path(f"{path}-shm").unlink(missing_ok=True)
    os.replace(fresh, path)
    mark_of(path).unlink(missing_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    os.fsync(folder)
    os.close(folder)


def mark_of(path: Path) -> Path:
    """What stands beside a store in which damage was found, until it is rebuilt."""
    return Path(f"{path}.damaged")


def _newest(path: Path) -> int:
    named = (p.name.rsplit(".", 1)[-1] for p in path.parent.glob(f"{path.name}.corrupt.*"))
    return max((int(end) for end in named if end.isdecimal()), default=0)


def _free(path: Path) -> Path:
    return Path(f"{path}.corrupt.{_newest(path) + 1}")


# ---------------------------------------------------------------------- reading


def _tables(path: Path) -> Iterator[tuple[str, Found]]:
    """Rows by the table that their columns fit."""
    for row in rows_in(path):
        name = TABLES.get(tuple(type(value) for value in row.values))
        if name is not None:
            yield name, row


def _found(path: Path) -> _Sound:
    """What is sound of all but pieces and samples, which are looked at again when written."""
    found, sound = dict[int, list[Entry]](), _Sound()
    checkpoints, progress = dict[int, tuple[Any, ...]](), list[tuple[Any, ...]]()
    for table, (number, values) in _tables(path):
        row: tuple[Any, ...] = values[1:]
        if table == "log" and row[1] in KINDS:
            found.setdefault(number, []).append(Entry(number, *row))
        elif table == "head" and number == 1:
            sound.length = max(sound.length, row[0])
        elif table == "checkpoints":
            checkpoints[number] = row
        elif table == "pieces" and name_of(values[1]) == values[0]:  # type: ignore[arg-type]
            sound.names.add(str(values[0]))
        elif table == "shown" and name_of(row[1]) == row[2]:
            sound.shown[number] = row
        elif table == "progress" and proof(*row[:3]) == row[3]:
            progress.append(row)
        elif table == "samples":
            (sound.samples if _is_sample(row) else sound.damaged).add(number)
        elif table == "inbox" and proof(row[0]) == row[1]:
            sound.asked.add(number)
    _split(sound, found)
    sound.checkpoints = [row for _, row in sorted(checkpoints.items()) if _holds(row, sound)][
        -KEPT:
    ]
    sound.progress = max(progress, key=lambda row: row[:2], default=None)
    return sound


def _split(sound: _Sound, found: Mapping[int, list[Entry]]) -> None:
    """The log up to the first entry that is gone or does not match, and what is behind."""
    before = SEED
    while True:
        number = len(sound.entries) + 1
        fits = [e for e in found.get(number, ()) if e.hash == link(before, *e[:-1])]
        if not fits:
            break
        sound.entries.append(fits[0])
        before = fits[0].hash
    sound.beyond = [one[0] for number, one in sorted(found.items()) if number > len(sound.entries)]
    sound.length = max(sound.length, len(sound.entries), *(e.number for e in sound.beyond))


def _holds(row: tuple[Any, ...], sound: _Sound) -> bool:
    """Does a checkpoint match its hash, its place in the log, its pieces, its shown rows?"""
    run, _, length, _, shown, layout, digest = row
    if not 0 <= length <= len(sound.entries):
        return False
    end = sound.entries[length - 1].hash if length else SEED
    names = [part[2] for _, part in sorted(sound.shown.items()) if part[0] == run][:shown]
    try:
        there = names_in(layout) <= sound.names
    except StoreDamaged:
        return False
    return there and proof(*row[:-1], end, shown_proof(names)[1]) == digest


def _is_sample(row: tuple[Any, ...]) -> bool:
    *told, content, digest = row
    return bool(proof(*told, name_of(content)) == digest)


# ---------------------------------------------------------------------- writing


def _told(sound: _Sound, name: str, why: str) -> Event:
    """What is lost, in words and figures."""
    kept, rows = len(sound.entries), [entry.row for entry in sound.beyond]
    lost, samples = sound.length - kept, len(sound.damaged - sound.samples)
    said = ["nothing of the log is lost"]
    if not sound.length:
        said = ["it is empty: whatever its log held is gone, all versions with it"]
    if lost:
        about = f" (rows {min(rows)} to {max(rows)} and others)" if rows else ""
        said = [f"entries {kept + 1} to {sound.length} of the log are lost{about}"]
    newest = sound.checkpoints[-1] if sound.checkpoints else None
    if newest is None:
        said.append("no checkpoint is left: a run that was cut off is folded from its first row")
    else:
        said.append(f"run {newest[0]} can go on from row {newest[1]}")
    if samples:
        said.append(f"{samples} samples are damaged")
    if sound.asked:
        said.append(
            f"whether {len(sound.asked)} orders of other processes were heard is not known: say "
            "them again"
        )
    evidence = {
        "kept": kept, "lost": lost, "samples_damaged": samples, "file": name, "why": why,
        "checkpoint_row": None if newest is None else newest[1],
    }  # fmt: skip
    reason = f"the store was damaged: {'; '.join(said)}; the damaged file is kept as {name}"
    return Event(max((e.row for e in sound.entries[-1:]), default=0), 0, "recovered", "", reason,
                 evidence)  # fmt: skip


def _write(fresh: Path, path: Path, sound: _Sound, lost: Event) -> None:
    """The new file, whole and durable."""
    entries = [*sound.entries, _entry(sound.entries, lost)]
    head = Head(entries[-1].number, entries[-1].hash)
    needed = {name for row in sound.checkpoints for name in names_in(row[5])}
    runs = {row[0] for row in sound.checkpoints[-1:]}
    database = Database(str(fresh))
    with database.transaction() as db:
        db.executemany("INSERT INTO log VALUES (?, ?, ?, ?, ?, ?)", entries)
        db.execute("UPDATE head SET length = ?, hash = ?", head)
        kept = (row for row in sound.checkpoints if row[0] in runs)
        db.executemany("INSERT INTO checkpoints VALUES (NULL, ?, ?, ?, ?, ?, ?, ?)", kept)
        shown = (part for _, part in sorted(sound.shown.items()) if part[0] in runs)
        db.executemany("INSERT INTO shown VALUES (NULL, ?, ?, ?)", shown)
        if sound.progress is not None:
            db.execute("INSERT INTO progress VALUES (1, ?, ?, ?, ?)", sound.progress)
        for table, (number, values) in _tables(path):
            if table == "pieces" and values[0] in needed and name_of(values[1]) == values[0]:  # type: ignore[arg-type]
                db.execute("INSERT OR IGNORE INTO pieces VALUES (?, ?)", values)
            elif table == "samples" and _is_sample(values[1:]):
                db.execute("INSERT OR IGNORE INTO samples VALUES (?, ?, ?, ?, ?, ?, ?)",
                           (number, *values[1:]))  # fmt: skip
        # numbers of samples that are gone are not given again
        db.execute("DELETE FROM sqlite_sequence WHERE name = 'samples'")
        db.execute("INSERT INTO sqlite_sequence VALUES ('samples', ?)", (sound.newest,))
    database.close()


def _entry(entries: Iterable[Entry], event: Event) -> Entry:
    last = list(entries)[-1:]
    before = last[0].hash if last else SEED
    number = last[0].number + 1 if last else 1
    told = (0, "event", event.row, encode(event))
    return Entry(number, *told, link(before, number, *told))
