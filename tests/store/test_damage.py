"""A damaged store starts from what is sound, and says exactly what is lost."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.errors import StoreDamaged, StoreError
from evertwin.fold import Chunk, Event
from evertwin.store import Batch, Checkpoint, Entry, Progress, SqliteStore
from evertwin.store.sqlite.pages import check_log, rows_in
from proofs.damage import whole
from proofs.kills import Kill, called

ENTRIES = 400


def event(row: int) -> Event:
    return Event(row, row * 10, "tuned", "Fc", f"entry {row} " + "x" * (row % 90), {"row": row})


def filled(path: Path, *, close: bool = True) -> tuple[Entry, ...]:
    """Four hundred entries, a long one, samples, three checkpoints."""
    store = SqliteStore(path)
    state = np.arange(40_000.0)
    for row in range(0, ENTRIES, 50):
        state[row : row + 50] = row
        long = [Event(row, 0, "tuned", "", "y" * 20_000)] if row == 200 else []
        chunk = Chunk("pose", np.arange(row, row + 50), np.ones((50, 3)) * row)
        store.commit(
            Batch(
                [*map(event, range(row, row + 50)), *long], run=1, chunks=[chunk],
                checkpoint=Checkpoint(row + 50, (state.copy(), row), 1, shown=shown(row)),
                progress=Progress(1, row + 50, "ab"),
            )
        )  # fmt: skip
    entries = store.entries()
    if close:
        store.close()
    else:  # as a kill leaves it: its log beside it
        for end in ("", "-wal"):
            shutil.copy(f"{path}{end}", f"{path}.left{end}")
        store.close()
        for end in ("", "-wal"):
            os.replace(f"{path}.left{end}", f"{path}{end}")
    return entries


def shown(row: int) -> dict[str, np.ndarray]:
    return {"row": np.arange(row, row + 5)}


def check(path: Path, entries: tuple[Entry, ...]) -> SqliteStore:
    """It opens; its log begins as it did; what it says is lost is what is lost."""
    store = SqliteStore(path)
    if store.recovered is None:
        assert store.entries() == entries
        try:
            store.verify()
        except StoreDamaged:  # bytes of a state or a sample: told when they are read
            store.recover()
    found = store.entries()
    if store.recovered is not None:
        evidence: Any = store.recovered.evidence
        kept = evidence["kept"]
        assert found[:kept] == entries[:kept] and len(found) == kept + 1
        assert store.record(found[-1]) == store.recovered
        assert (path.parent / evidence["file"]).exists()
    assert store.verify() == len(found)
    kept_state = store.restore((np.zeros(0), 0))
    if kept_state is not None:
        row = kept_state.row
        assert kept_state.state[1] == row - 50
        assert np.array_equal(kept_state.state[0][:row], np.repeat(np.arange(0, row, 50), 50))
        assert kept_state.shown["row"].tolist() == [
            k for begin in range(0, row, 50) for k in range(begin, begin + 5)
        ]
    for number, chunk in store.read_chunks():
        assert chunk.t[0] == 50 * (number - 1)
    return store


@pytest.mark.slow
@pytest.mark.parametrize("close", [True, False], ids=["closed", "killed"])
def test_every_damaged_store_starts(tmp_path: Path, close: bool) -> None:
    path = tmp_path / "whole.db"
    entries = filled(path, close=close)
    raw = {end: Path(f"{path}{end}").read_bytes() for end in (("",) if close else ("", "-wal"))}
    told, lost = 0, []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        end = str(rng.choice(list(raw)))
        folder = tmp_path / str(seed)
        folder.mkdir()
        for name, content in raw.items():
            changed = damaged(content, rng, whole=end == "-wal") if name == end else content
            (folder / f"a.db{name}").write_bytes(changed)
        store = check(folder / "a.db", entries)
        if store.recovered is not None:
            told += 1
            lost.append(store.recovered.evidence["lost"])
        store.close()
        shutil.rmtree(folder)
    assert told > 5 and max(lost) > 0


def damaged(raw: bytes, rng: np.random.Generator, *, whole: bool) -> bytes:
    """Bytes changed, zeroed, or cut off; ``whole``: not at the end, as a crash would do."""
    size = min(int(rng.choice([1, 8, 300, 3000, 9000])), len(raw) - 1)
    at = int(rng.integers(0, len(raw) - size - (60_000 if whole else 0)))
    how = rng.integers(0, 4)
    if how == 0:
        return raw[:at] + bytes(size) + raw[at + size :]
    if how == 1 and at > 0 and not whole:
        return raw[:at]
    return raw[:at] + rng.bytes(size) + raw[at + size :]


def test_nothing_is_lost_but_what_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    entries = filled(path)
    raw = bytearray(path.read_bytes())
    place = raw.index(b"entry 120 ")
    raw[place] ^= 1
    path.write_bytes(raw)
    with pytest.raises(StoreDamaged, match="entry 121"):
        SqliteStore(path, read_only=True).verify()
    store = check(path, entries)
    assert store.recovered is not None
    evidence: Any = store.recovered.evidence
    assert (evidence["kept"], evidence["lost"]) == (120, ENTRIES + 1 - 120)
    assert evidence["checkpoint_row"] is None
    assert "entries 121 to 401 of the log are lost (rows 120 to 399 and others)" in (
        store.recovered.reason
    )
    assert "kept as a.db.corrupt.1" in store.recovered.reason
    store.close()
    again = SqliteStore(path)
    assert again.recovered is None and again.head.length == 121
    again.close()


def test_the_newest_sound_checkpoint_stays(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    entries = filled(path)
    raw = bytearray(path.read_bytes())
    raw[raw.index(b"entry 380 ")] ^= 1
    path.write_bytes(raw)
    store = check(path, entries)
    found = store.restore((np.zeros(0), 0))
    assert found is not None and found.row == 350
    assert store.recovered is not None and "run 1 can go on from row 350" in store.recovered.reason
    assert store.progress() == Progress(1, 400, "ab")
    store.close()


def test_damage_behind_what_was_looked_at_is_repaired_on_demand(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    entries = filled(path)
    store = SqliteStore(path)
    with sqlite3.connect(path) as database:
        database.execute("DROP TRIGGER log_is_final")
        database.execute("UPDATE log SET content = '{}' WHERE number = 7")
    database.close()
    with pytest.raises(StoreDamaged, match="entry 7"):
        store.read("event")
    lost = store.recover()
    assert lost.evidence["kept"] == 6 and store.entries()[:6] == entries[:6]
    store.commit(Batch([event(1)]))
    store.close()


def test_a_log_with_a_hole_is_not_taken_for_its_beginning(tmp_path: Path) -> None:
    """SQLite would go back to what stood before the first damaged frame, and say nothing."""
    path = tmp_path / "a.db"
    entries = filled(path, close=False)
    log = Path(f"{path}-wal")
    check_log(path)
    raw = bytearray(log.read_bytes())
    torn = raw[:-3000]
    log.write_bytes(torn)
    check_log(path)  # as a crash leaves it
    for place in (10, 40_000):
        changed = bytearray(raw)
        changed[place] ^= 1
        log.write_bytes(changed)
        with pytest.raises(StoreDamaged, match=r"-wal: byte .* were changed"):
            check_log(path)
    store = check(path, entries)
    assert store.recovered is not None and store.recovered.evidence["lost"] == 0
    assert Path(f"{path}.corrupt.1-wal").exists()
    store.close()


TWICE = """
import os, signal, sqlite3, sys
db = sqlite3.connect(sys.argv[1], isolation_level=None)
db.execute("PRAGMA page_size = 4096")
db.execute("PRAGMA journal_mode = WAL")
db.execute("PRAGMA cache_size = 2")
db.execute("CREATE TABLE IF NOT EXISTS t (a)")
db.execute("BEGIN")
for k in range(int(sys.argv[2])):
    db.execute("INSERT INTO t VALUES (?)", ("x" * 3000,))
if sys.argv[2] == "1":
    db.execute("COMMIT")
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_transaction_left_behind_a_shorter_one_is_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    for rows in ("1", "60", "1"):
        killed = subprocess.run([sys.executable, "-c", TWICE, str(path), rows], check=False)
        assert killed.returncode == -signal.SIGKILL
        check_log(path)
    assert len(Path(f"{path}-wal").read_bytes()) > 20 * 4096


def test_rows_are_read_as_sqlite_reads_them(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    database = sqlite3.connect(path)
    database.execute("PRAGMA page_size = 4096")
    database.execute("CREATE TABLE t (a, b, c, d, e)")
    rng, rows = np.random.default_rng(1), []
    for k in range(300):
        size = int(rng.choice([0, 5, 400, 4061, 4062, 5000, 30_000]))
        whole = int(rng.integers(-(2 ** int(rng.integers(1, 63))), 2 ** int(rng.integers(1, 63))))
        rows.append((k % 2, whole, float(rng.normal()), "ä" * size, rng.bytes(size)))
    database.executemany("INSERT INTO t VALUES (?, ?, ?, ?, ?)", rows)
    database.commit()
    database.close()
    found = {row.number: row.values for row in rows_in(path) if len(row.values) == 5}
    assert [found.get(k + 1) for k in range(300)] == rows


KILLED = """
import os, signal, sys
import evertwin.store.sqlite.salvage as salvage
from evertwin.store import SqliteStore
replace, count = os.replace, 0
def stops(*given):
    global count
    if count == int(sys.argv[2]):
        os.kill(os.getpid(), signal.SIGKILL)
    count += 1
    replace(*given)
os.replace = stops
SqliteStore(sys.argv[1]).close()
"""


@pytest.mark.parametrize("stop", [0, 1, 2])
def test_a_kill_on_the_way_is_gone_on_from(tmp_path: Path, stop: int) -> None:
    path = tmp_path / "a.db"
    entries = filled(path, close=False)
    raw = bytearray(Path(f"{path}-wal").read_bytes())
    raw[raw.index(b"entry 380 ")] ^= 1
    Path(f"{path}-wal").write_bytes(raw)
    done = subprocess.run([sys.executable, "-c", KILLED, str(path), str(stop)], check=False)
    assert done.returncode == -signal.SIGKILL
    store = SqliteStore(path)
    found = store.entries()
    assert found[:380] == entries[:380] and found[380].kind == "event"
    assert Path(f"{path}.corrupt.1").exists() and Path(f"{path}.corrupt.1-wal").exists()
    assert (store.recovered is None) == (stop > 0)
    store.close()


def test_what_is_no_store_is_left_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.db"
    filled(path)
    with sqlite3.connect(path) as database:
        database.execute("PRAGMA user_version = 9")
    database.close()
    # a log that is ours throughout is ours, whatever a header says
    with caplog.at_level(logging.WARNING, logger="evertwin"):
        store = SqliteStore(path)
    assert store.recovered is not None and store.recovered.evidence["lost"] == 0
    assert "nothing of the log is lost" in caplog.text
    store.close()
    for content in (b"notes " * 5000, bytes(40_000)):
        other = tmp_path / "b.db"
        other.write_bytes(content)
        with pytest.raises(StoreError):
            SqliteStore(other)
        assert other.read_bytes() == content
        other.unlink()


def test_a_store_of_no_bytes_is_told(tmp_path: Path) -> None:
    path = tmp_path / "robot.db"
    path.touch()
    store = SqliteStore(path)
    (event,) = store.read("event")
    assert event.kind == "recovered"
    assert "whatever its log held is gone, all versions with it" in event.reason
    assert (tmp_path / "robot.db.corrupt.1").stat().st_size == 0
    store.close()
    again = SqliteStore(path)
    assert again.recovered is None
    again.close()


def test_what_is_no_store_says_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "robot.db"
    path.write_text("no store\n")
    for log in (None, b""):
        if log is not None:
            Path(f"{path}-wal").write_bytes(log)
        with pytest.raises(StoreError, match="it stays as it is: move it away to begin anew"):
            SqliteStore(path)
        assert path.read_text() == "no store\n"


def test_the_proof_dies_where_it_is_told_to_and_nowhere_else(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"nothing passes 'before SqliteStore\.close'"):
        called(tmp_path, (), Kill("before SqliteStore.close", 1))
    assert whole(tmp_path / "killed", killed=True)
    assert (tmp_path / "killed" / "robot.db-wal").stat().st_size > 0
