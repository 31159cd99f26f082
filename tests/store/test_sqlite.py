"""The SQLite store: laws, damage, owners, kills."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import LawBroken, StoreDamaged, StoreError, StoreLocked, UsageError
from evertwin.fold import Chunk
from evertwin.fold.records import Answer, Event, Request
from evertwin.models.form import Form, Term, Version
from evertwin.store import Batch, Checkpoint, Entry, Estimate, Head, SqliteStore, check_store
from evertwin.store.chain import SEED, link
from evertwin.store.kinds import Kept, decode, encode, kind_of, loads


def event(row: int) -> Event:
    return Event(row, row * 10, "tuned", "Fc", f"entry {row}", {"row": row})


def filled(path: Path, count: int = 5) -> Path:
    store = SqliteStore(path)
    store.commit(Batch([event(row) for row in range(count)]))
    store.commit(Batch(checkpoint=Checkpoint(3, (np.arange(4000.0),))))
    version = Version(1, Form((Term("lag", "v"),)), ("v.tau",), (0.3,), 0, "lag")
    store.commit(Batch([version], chunks=[Chunk("pose", np.arange(2), np.ones((2, 3)))]))
    store.close()
    return path


def damage(path: Path, statement: str) -> None:
    """Change a closed store behind its back, its triggers removed."""
    database = sqlite3.connect(path)
    database.execute("DROP TRIGGER log_is_final")
    database.execute("DROP TRIGGER log_is_kept")
    database.execute(statement)
    database.commit()
    database.close()


def test_a_file_keeps_the_laws(tmp_path: Path) -> None:
    check_store(lambda: SqliteStore(tmp_path / "a.db"))


def test_memory_keeps_the_laws() -> None:
    check_store(lambda: SqliteStore(":memory:"), persistent=False)


class Forgetful(SqliteStore):
    """Loses the last record of every batch."""

    def commit(self, batch: Batch, *, wait: bool = True) -> Head:
        return super().commit(replace(batch, records=batch.records[:-1]), wait=wait)


def test_the_laws_are_able_to_fail() -> None:
    with pytest.raises(LawBroken, match="the end of a batch"):
        check_store(lambda: Forgetful(":memory:"), persistent=False)
    with pytest.raises(LawBroken, match="one owner: expected StoreLocked"):
        check_store(lambda: SqliteStore(":memory:"), persistent=True)


def test_a_sound_log_is_sound(tmp_path: Path) -> None:
    store = SqliteStore(filled(tmp_path / "a.db"))
    assert store.verify() == 6
    store.close()


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        (
            "UPDATE log SET content = replace(content, 'entry 2', 'entry 9')",
            "entry 3 (event, row 2)",
        ),
        (
            "UPDATE log SET row = 4 WHERE number = 2",
            "entry 2 (event, row 4) does not match its hash",
        ),
        ("UPDATE log SET kind = 'answer' WHERE number = 1", "entry 1 (answer, row 0)"),
        ("DELETE FROM log WHERE number = 4", "expected entry 4, got entry 5"),
        ("DELETE FROM log WHERE number = 6", "ends with entry 5, expected entry 6"),
        ("UPDATE log SET hash = '00' WHERE number = 5", "entry 5 (event, row 4)"),
        ("INSERT INTO log VALUES (7, 0, 'event', 9, '{}', '00')", "entry 7 (event, row 9)"),
        ("UPDATE log SET run = 2 WHERE number = 3", "entry 3 (event, row 2)"),
        ("UPDATE head SET length = 5", "ends with entry 6, expected entry 5"),
    ],
)
def test_the_first_damaged_entry_is_named(tmp_path: Path, statement: str, message: str) -> None:
    path = filled(tmp_path / "a.db")
    damage(path, statement)
    store = SqliteStore(path, read_only=True)
    with pytest.raises(StoreDamaged) as error:
        store.verify()
    store.close()
    assert message in str(error.value)


def rewrite(path: Path) -> None:
    """Changes an entry and recomputes every hash behind it, the kept end too."""
    damage(path, "UPDATE log SET row = 4 WHERE number = 2")
    database = sqlite3.connect(path)
    before = SEED
    for number, *told in database.execute(
        "SELECT number, run, kind, row, content FROM log ORDER BY number"
    ).fetchall():
        before = link(before, number, *told)
        database.execute("UPDATE log SET hash = ? WHERE number = ?", (before, number))
    database.execute("UPDATE head SET hash = ?", (before,))
    database.commit()
    database.close()


def test_a_printed_head_tells_a_rewritten_log(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db")
    store = SqliteStore(path)
    printed = store.head.printed(b"secret")
    store.close()
    rewrite(path)
    store = SqliteStore(path)
    assert store.verify() == 6  # the chain alone cannot tell
    with pytest.raises(StoreDamaged, match="the log was rewritten after that head was printed"):
        store.verify(Head.parse(printed, b"secret"))
    store.commit(Batch([event(9)]))
    with pytest.raises(StoreDamaged, match="was rewritten"):
        store.verify(Head.parse(printed))
    with pytest.raises(StoreDamaged, match="ends with entry 7, expected 9"):
        store.verify(Head(9, SEED))
    store.close()


def test_a_head_is_of_its_key_and_of_its_form() -> None:
    head = Head(3, "ab" * 32)
    signed = head.printed(b"secret")
    assert Head.parse(f" {signed}\n", b"secret") == Head.parse(head.printed()) == head
    for text, key in ((signed, b"other"), (head.printed(), b"secret"), ("9" + signed, b"secret")):
        with pytest.raises(UsageError, match="its signature is not one of this key"):
            Head.parse(text, key)
    with pytest.raises(UsageError, match="expected LENGTH:HASH"):
        Head.parse("7")


def test_the_log_cannot_be_changed_through_sql(tmp_path: Path) -> None:
    database = sqlite3.connect(filled(tmp_path / "a.db"))
    for statement in ("UPDATE log SET row = 0", "DELETE FROM log"):
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            database.execute(statement)
    database.close()


def test_what_is_read_is_checked_against_the_chain(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db")
    damage(path, "UPDATE log SET content = replace(content, '0.3', '9.9') WHERE kind = 'version'")
    store = SqliteStore(path, read_only=True)
    with pytest.raises(StoreDamaged, match=r"entry 6 \(version, row 0\) does not match its hash"):
        store.read("version")
    assert len(store.read("event")) == 5
    store.close()


def test_a_forged_version_is_refused() -> None:
    version = json.loads(encode(Version(1, Form(), ("Fc",), (0.3,), 0, "tuned")))
    with pytest.raises(StoreError, match="version 1: its content does not match its hash"):
        decode("version", version | {"values": (9.9,)})


def test_no_damage_goes_unnoticed(tmp_path: Path) -> None:
    """Bytes anywhere in the file, its index and its schema included."""
    whole = filled(tmp_path / "whole.db", 60)
    store = SqliteStore(whole)
    events, raw = store.read("event"), whole.read_bytes()
    store.close()
    told = 0
    for seed in range(120):
        rng = np.random.default_rng(seed)
        size = int(rng.choice([1, 8, 300, 3000]))
        at = int(rng.integers(0, len(raw) - size))
        path = tmp_path / f"{seed}.db"
        path.write_bytes(raw[:at] + rng.bytes(size) + raw[at + size :])
        try:
            store = SqliteStore(path, read_only=True)
            store.verify()
            kept = store.restore((np.zeros(4),))
            assert kept is not None and np.array_equal(kept.state[0], np.arange(4000.0))
            assert store.read("event") == events
        except StoreError:
            told += 1
        finally:
            store.close()
    assert told > 60


def twice(path: Path) -> SqliteStore:
    """A store with two checkpoints of one run, of which the second is damaged."""
    store = SqliteStore(path)
    for row in (3, 6):
        store.commit(Batch(checkpoint=Checkpoint(row, (np.arange(4000.0) * row,), 1)))
    return store


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE pieces SET content = zeroblob(length(content)) WHERE rowid = "
        "(SELECT max(rowid) FROM pieces)",
        "DELETE FROM pieces WHERE rowid = (SELECT max(rowid) FROM pieces)",
        "UPDATE checkpoints SET row = 7 WHERE number = 2",
        "UPDATE checkpoints SET layout = replace(layout, 's.0', 's.1') WHERE number = 2",
    ],
)
def test_a_damaged_checkpoint_gives_way_to_the_one_before(tmp_path: Path, statement: str) -> None:
    twice(tmp_path / "a.db").close()
    database = sqlite3.connect(tmp_path / "a.db")
    database.execute(statement)
    database.commit()
    database.close()
    store = SqliteStore(tmp_path / "a.db")
    found = store.restore((np.zeros(0),))
    assert found is not None and found.row == 3
    assert np.array_equal(found.state[0], np.arange(4000.0) * 3)
    store.close()


def test_a_checkpoint_of_another_form_is_refused() -> None:
    store = SqliteStore(":memory:")
    store.commit(Batch(checkpoint=Checkpoint(5, (np.zeros(2), 1))))
    with pytest.raises(StoreError, match=r"expected int64 of rank 1, got float64"):
        store.restore((np.zeros(2, dtype=np.int64), 1))
    with pytest.raises(StoreError, match=r"field s\.2 is missing"):
        store.restore((np.zeros(2), 1, 2.0))


def test_only_the_newest_checkpoints_of_the_newest_run_stay() -> None:
    store = SqliteStore(":memory:")
    for row in range(10):
        store.commit(Batch(checkpoint=Checkpoint(row, (float(row),), 1, shown=shown(row))))
    rows = {before: store.restore((0.0,), before=before) for before in (None, 8, 7)}
    assert [None if c is None else c.state for c in rows.values()] == [(9.0,), (7.0,), None]
    newest = rows[None]
    assert newest is not None and newest.shown["row"].tolist() == list(range(10))
    store.commit(Batch(checkpoint=Checkpoint(2, (2.0,), 2)))
    assert store.restore((0.0,), run=1) is None
    found = store.restore((0.0,))
    assert found is not None and found[:3] == (2, (2.0,), 2) and not found.shown
    assert store.verify() == 0


def shown(row: int) -> dict[str, np.ndarray]:
    return {"row": np.array([row])}


def test_only_what_changed_of_a_state_is_written(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "a.db")
    ring, sizes = np.zeros((20_000, 8)), []
    for row in range(4):
        ring[100 * row : 100 * row + 100] = row + 1.0
        store.commit(Batch(checkpoint=Checkpoint(row, (ring.copy(), row))))
        with sqlite3.connect(tmp_path / "a.db") as database:
            sizes.append(database.execute("SELECT sum(length(content)) FROM pieces").fetchone()[0])
        database.close()
    found = store.restore((np.zeros((0, 0)), 0))
    assert found is not None and np.array_equal(found.state[0], ring)
    assert sizes[0] < 0.1 * ring.nbytes  # pieces that are equal are one piece
    assert sizes[-1] < 0.2 * ring.nbytes
    store.close()


def test_samples_keep_their_numbers_for_ever() -> None:
    store = SqliteStore(":memory:")
    image = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    for k in range(250):
        store.commit(Batch(chunks=[Chunk("camera", np.array([k, k + 1]), image + k, task=2)]))
    found = dict(store.read_chunks(101, 240))
    assert list(found) == list(range(101, 240))
    assert found[120].v.dtype == np.float32 and np.array_equal(found[120].v, image + 119)
    assert (found[120].source, found[120].task) == ("camera", 2)
    assert [c.t.tolist() for c in store.samples("camera", 7, 8)] == [[7], [7, 8], [8]]
    assert not list(store.samples("lidar", 0, 1000))
    store.commit(Batch(forget={"camera": 1000}))
    assert list(store.read_chunks()) == []
    store.commit(Batch(chunks=[Chunk("camera", np.array([0]), image[:1])], checkpoint=(
        Checkpoint(1, (1.0,)))))  # fmt: skip
    assert [number for number, _ in store.read_chunks()] == [251]
    kept = store.restore((0.0,))
    assert kept is not None and kept.chunks == 251


def test_a_backup_is_whole_while_work_goes_on(tmp_path: Path) -> None:
    store = SqliteStore(filled(tmp_path / "a.db"))
    store.commit(Batch([event(7)]), wait=False)
    store.backup(tmp_path / "copy.db")
    head = store.head
    store.commit(Batch([event(8)]))
    copy = SqliteStore(tmp_path / "copy.db")
    assert copy.head == head and copy.verify(head) == 7
    copy.close()
    store.close()


def test_a_write_that_fails_is_told_and_nothing_follows_it(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "a.db")
    store.commit(Batch([event(0)]))
    with sqlite3.connect(tmp_path / "a.db") as other:
        other.execute("CREATE TRIGGER full BEFORE INSERT ON log WHEN NEW.row = 1 "
                      "BEGIN SELECT RAISE(ABORT, 'the disk is full'); END")  # fmt: skip
    other.close()
    store.commit(Batch([event(1)]), wait=False)
    with pytest.raises(StoreError, match="the disk is full"):
        store.flush()
    with pytest.raises(StoreError, match="the disk is full"):
        store.commit(Batch([event(2)]))
    with pytest.raises(StoreError, match="the disk is full"):
        store.close()
    again = SqliteStore(tmp_path / "a.db")
    assert [record.row for record in again.read("event")] == [0]  # type: ignore[union-attr]
    again.close()


def test_who_forgets_to_close_leaves_no_lock(tmp_path: Path) -> None:
    for row in range(3):
        store = SqliteStore(tmp_path / "a.db")
        store.commit(Batch([event(row)]), wait=False)
        del store
    store = SqliteStore(tmp_path / "a.db")
    assert len(store.read("event")) == 3
    store.close()


def test_a_foreign_file_is_refused_and_left_alone(tmp_path: Path) -> None:
    text = tmp_path / "notes.db"
    text.write_bytes(b"not a database" * 100)
    with pytest.raises(StoreError, match="file is not a database"):
        SqliteStore(text)
    assert text.read_bytes() == b"not a database" * 100
    foreign = tmp_path / "other.db"
    database = sqlite3.connect(foreign)
    database.execute("CREATE TABLE t (x)")
    database.commit()
    database.close()
    with pytest.raises(StoreError, match="a database of another program"):
        SqliteStore(foreign)
    SqliteStore(foreign.with_name("c.db")).close()  # the lock of a refused store is free again
    with pytest.raises(StoreError, match="another program"):
        SqliteStore(foreign)


def older(path: Path) -> tuple[Entry, ...]:
    """A store as schema 2 had it: without the index over samples."""
    filled(path)
    with closing(SqliteStore(path)) as store:
        store.commit(Batch([], run=1, chunks=[Chunk("pose", np.arange(9), np.ones((9, 2)))]))
        entries = store.entries()
    with closing(sqlite3.connect(path)) as database:
        database.execute("DROP INDEX samples_source_stop")
        database.execute("PRAGMA user_version = 2")
    return entries


def schema_of(path: Path) -> tuple[int, int]:
    """Its number, and whether the index is there."""
    with closing(sqlite3.connect(path)) as database:
        (found,) = database.execute("PRAGMA user_version").fetchone()
        query = "SELECT count(*) FROM sqlite_master WHERE name = 'samples_source_stop'"
        return int(found), int(database.execute(query).fetchone()[0])


def killed_at(path: Path, step: int) -> bool:
    """Opens a store in a process that dies before its how-manieth statement or renaming."""
    pid, passed, connect, renames = os.fork(), [0], sqlite3.connect, Path.replace
    if pid:
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL

    def passes(*_: object) -> None:
        passed[0] += 1
        if passed[0] == step:
            os.kill(os.getpid(), signal.SIGKILL)

    def traced(*given: Any, **named: Any) -> sqlite3.Connection:
        found = connect(*given, **named)
        found.set_trace_callback(passes)
        return found

    def replaces(self: Path, target: Path) -> Path:
        passes()
        return renames(self, target)

    sqlite3.connect, Path.replace = traced, replaces  # type: ignore[assignment, method-assign]
    SqliteStore(path).close()
    os._exit(0)


def test_an_older_store_is_upgraded_whole_or_not_at_all(tmp_path: Path) -> None:
    entries = older(tmp_path / "old.db")
    path, kept = tmp_path / "a.db", tmp_path / "a.db.schema2"
    begun, states, step = 0, set(), 0
    while True:
        step += 1
        for one in tmp_path.glob("a.db*"):
            one.unlink()
        shutil.copy(tmp_path / "old.db", path)
        killed = killed_at(path, step)
        states.add(schema_of(path))
        begun += kept.exists()
        with closing(SqliteStore(path, read_only=True)) as store:  # before it is gone on with
            assert store.entries() == entries and store.verify() == len(entries)
        with closing(SqliteStore(path)) as store:
            assert store.entries() == entries and store.recovered is None
            assert len(list(store.samples("pose", 0, 99))) == 2
        assert schema_of(path) == (3, 1) and schema_of(kept) == (2, 0)
        if not killed:
            break
    assert states == {(2, 0), (3, 1)} and begun > 3 and step > 12


def test_a_newer_store_is_refused(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db")
    damage(path, "UPDATE log SET hash = replace(hash, 'a', 'b')")  # another form chains otherwise
    database = sqlite3.connect(path)
    database.execute("PRAGMA user_version = 9")
    database.close()
    with pytest.raises(StoreError, match=r"written by a newer evertwin \(schema 9"):
        SqliteStore(path)


def test_a_missing_folder_is_no_lock(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="unable to open database file: check the folder") as error:
        SqliteStore(tmp_path / "none" / "a.db")
    assert not isinstance(error.value, StoreLocked)
    with pytest.raises(StoreError, match="no such store"):
        SqliteStore(tmp_path / "a.db", read_only=True)


def test_a_reader_looks_while_another_writes(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db")
    owner = SqliteStore(path)
    reader = SqliteStore(path, read_only=True)
    owner.commit(Batch([event(9)]))
    assert len(reader.read("event")) == 6 and reader.head == owner.head
    with pytest.raises(StoreError, match="opened read only"):
        reader.commit(Batch([event(10)]))
    reader.close()
    owner.close()


def test_the_views_show_columns(tmp_path: Path) -> None:
    database = sqlite3.connect(filled(tmp_path / "a.db"))
    rows = database.execute("SELECT row, kind, signal, reason FROM events WHERE row = 2").fetchall()
    assert rows == [(2, "tuned", "Fc", "entry 2")]
    assert database.execute("SELECT number, reason FROM versions").fetchall() == [(1, "lag")]
    for view in ("requests", "answers", "estimates"):
        assert database.execute(f"SELECT * FROM {view}").fetchall() == []
    database.close()


class Louder(Event):
    """No kind that a store knows."""


def test_what_is_no_record_is_refused() -> None:
    store = SqliteStore(":memory:")
    with pytest.raises(StoreError, match="expected one of answer, estimate, event"):
        store.commit(Batch([Louder(0, 0, "tuned", "", "")]))
    with pytest.raises(StoreError, match="does not fit its form"):
        decode("event", {"row": 1})
    with pytest.raises(StoreError, match="expected one of"):
        decode("wish", {})


CHILD = """
import sys
from evertwin.fold.records import Event
from evertwin.store import Batch, Checkpoint, SqliteStore
store = SqliteStore(sys.argv[1])
start = len(store.read("event"))
for row in range(start, start + 10_000):
    last = Checkpoint(row, (float(row),)) if row % 5 == 4 else None
    store.commit(Batch([Event(row, row, "tuned", "Fc", "x" * 200)], checkpoint=last))
    sys.stdout.write(f"{row}\\n")
    sys.stdout.flush()
"""


def child(path: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", CHILD, str(path)], stdout=subprocess.PIPE, text=True
    )


def test_a_second_process_is_refused_and_told_by_whom(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with child(path) as owner:
        assert owner.stdout is not None
        owner.stdout.readline()
        with pytest.raises(StoreLocked, match=f"is open in process {owner.pid} on") as error:
            SqliteStore(path)
        owner.kill()
    assert error.value.exit_code == 75
    SqliteStore(path).close()


def test_what_was_acknowledged_survives_kills(tmp_path: Path) -> None:
    path, rng, acknowledged = tmp_path / "a.db", np.random.default_rng(7), 0
    for _ in range(5):
        with child(path) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(float(rng.uniform(0.0, 0.05)))
            os.kill(process.pid, signal.SIGKILL)
            acknowledged += 1 + len(process.stdout.readlines())
        store = SqliteStore(path)
        rows = [record.row for record in store.read("event") if isinstance(record, Event)]
        assert rows == list(range(len(rows)))
        assert acknowledged <= len(rows) <= acknowledged + 1
        acknowledged = len(rows)  # the one whose acknowledgement was lost counts from here
        found = store.restore((0.0,))
        assert found is None or found.state == (float(found.row),)
        assert store.verify() >= len(rows)
        store.close()


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.text(max_size=5)
    | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=8,
)  # fmt: skip
NAMES = st.text(min_size=1, max_size=5)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
WHOLE = st.integers(0, 2**60)
RECORDS = st.one_of(
    st.builds(Event, WHOLE, WHOLE, NAMES, NAMES, NAMES, st.dictionaries(NAMES, JSON)),
    st.builds(Answer, WHOLE, WHOLE, st.dictionaries(NAMES, JSON)),
    st.builds(Request, WHOLE, NAMES, WHOLE, WHOLE, WHOLE, st.tuples(WHOLE, WHOLE)),
    st.builds(Estimate, WHOLE, WHOLE, WHOLE, NAMES, NUMBERS, NUMBERS, NUMBERS),
    st.builds(
        lambda n, values: Version(n, Form(), tuple(values), tuple(values.values())),
        WHOLE,
        st.dictionaries(NAMES, NUMBERS, max_size=3),
    ),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(RECORDS, max_size=8))
def test_every_record_comes_back(records: list[Kept]) -> None:
    store = SqliteStore(":memory:")
    store.commit(Batch(records, row=1))
    for kind in ("event", "answer", "request", "estimate", "version"):
        expected = tuple(record for record in records if kind_of(record) == kind)
        assert store.read(kind) == expected
    assert store.verify() == len(records)
    assert all(encode(decode(kind_of(r), loads(encode(r)))) == encode(r) for r in records)
    store.close()
