"""The SQLite store: laws, damage, owners, kills."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import LawBroken, StoreError, StoreLocked
from evertwin.fold.records import Answer, Event, Request
from evertwin.models.form import Form, Term, Version
from evertwin.store import Estimate, SqliteStore, check_store
from evertwin.store.chain import SEED, link
from evertwin.store.kinds import Kept, decode, encode, kind_of, loads


def event(row: int) -> Event:
    return Event(row, row * 10, "tuned", "Fc", f"entry {row}", {"row": row})


def filled(path: Path, count: int = 5) -> Path:
    store = SqliteStore(path)
    store.append([event(row) for row in range(count)])
    store.checkpoint((np.arange(4.0),), 3)
    store.append([Version(1, Form((Term("lag", "v"),)), ("v.tau",), (0.3,), 0, "lag")])
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
    """Loses the last record of every append."""

    def append(self, records: Sequence[Kept], row: int | None = None) -> None:
        super().append(list(records)[:-1], row)


def test_the_laws_are_able_to_fail() -> None:
    with pytest.raises(LawBroken, match="read gives what was appended"):
        check_store(lambda: Forgetful(":memory:"), persistent=False)
    with pytest.raises(LawBroken, match="one owner: expected StoreLocked"):
        check_store(lambda: SqliteStore(":memory:"), persistent=True)


def test_a_sound_log_is_sound(tmp_path: Path) -> None:
    store = SqliteStore(filled(tmp_path / "a.db"))
    assert store.verify() == 7
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
        ("DELETE FROM log WHERE number = 7", "ends with entry 6, expected entry 7"),
        ("UPDATE log SET hash = '00' WHERE number = 5", "entry 5 (event, row 4)"),
        ("INSERT INTO log VALUES (8, 'event', 9, '{}', '00')", "entry 8 (event, row 9)"),
        ("UPDATE head SET length = 6", "ends with entry 7, expected entry 6"),
    ],
)
def test_the_first_damaged_entry_is_named(tmp_path: Path, statement: str, message: str) -> None:
    path = filled(tmp_path / "a.db")
    damage(path, statement)
    store = SqliteStore(path)
    with pytest.raises(StoreError) as error:
        store.verify()
    store.close()
    assert message in str(error.value)


def test_a_rewritten_chain_does_not_match_the_kept_end(tmp_path: Path) -> None:
    """Whoever recomputes all hashes after a change has changed the last one."""
    path = filled(tmp_path / "a.db")
    damage(path, "UPDATE log SET row = 4 WHERE number = 2")
    database = sqlite3.connect(path)
    before = SEED
    for number, kind, row, content in database.execute(
        "SELECT number, kind, row, content FROM log ORDER BY number"
    ).fetchall():
        before = link(before, number, kind, row, content)
        database.execute("UPDATE log SET hash = ? WHERE number = ?", (before, number))
    database.commit()
    database.close()
    store = SqliteStore(path)
    with pytest.raises(StoreError, match="ends with entry 7, expected entry 7 with hash"):
        store.verify()
    store.close()


def test_the_log_cannot_be_changed_through_sql(tmp_path: Path) -> None:
    database = sqlite3.connect(filled(tmp_path / "a.db"))
    for statement in ("UPDATE log SET row = 0", "DELETE FROM log"):
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            database.execute(statement)
    database.close()


def test_a_forged_version_is_refused(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db")
    damage(path, "UPDATE log SET content = replace(content, '0.3', '9.9') WHERE kind = 'version'")
    store = SqliteStore(path)
    with pytest.raises(StoreError, match="version 1: its content does not match its hash"):
        store.read("version")
    store.close()


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
            store = SqliteStore(path)
            store.verify()
            kept = store.restore((np.zeros(4),))
            assert kept is not None and np.array_equal(kept.state[0], np.arange(4.0))
            assert store.read("event") == events
        except StoreError:
            told += 1
        finally:
            store.close()
    assert told > 60


@pytest.mark.parametrize("flip", range(0, 300, 37))
def test_a_damaged_checkpoint_is_refused(tmp_path: Path, flip: int) -> None:
    path = filled(tmp_path / "a.db")
    database = sqlite3.connect(path)
    ((state,),) = database.execute("SELECT state FROM checkpoints").fetchall()
    flipped = bytearray(state)
    flipped[flip % len(flipped)] ^= 1
    database.execute("UPDATE checkpoints SET state = ?", (bytes(flipped),))
    database.commit()
    database.close()
    store = SqliteStore(path)
    with pytest.raises(StoreError, match="checkpoint before row 3 does not match its hash"):
        store.restore((np.zeros(4),))
    store.close()


def test_a_checkpoint_of_another_form_is_refused() -> None:
    store = SqliteStore(":memory:")
    store.checkpoint((np.zeros(2), 1), 5)
    with pytest.raises(StoreError, match=r"expected int64 of rank 1, got float64"):
        store.restore((np.zeros(2, dtype=np.int64), 1))
    with pytest.raises(StoreError, match=r"field s\.2 is missing"):
        store.restore((np.zeros(2), 1, 2.0))


def test_only_the_newest_checkpoints_stay() -> None:
    store = SqliteStore(":memory:")
    for row in range(10):
        store.checkpoint((float(row),), row)
    assert store.restore((0.0,)) == (9, (9.0,))
    assert store.restore((0.0,), before=8) == (7, (7.0,))
    assert store.restore((0.0,), before=7) is None
    assert store.verify() == 10


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


def test_a_newer_store_is_refused(tmp_path: Path) -> None:
    path = filled(tmp_path / "a.db")
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
    owner.append([event(9)])
    assert len(reader.read("event")) == 6
    with pytest.raises(StoreError, match="opened read only"):
        reader.append([event(10)])
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
        store.append([Louder(0, 0, "tuned", "", "")])
    with pytest.raises(StoreError, match="does not fit its form"):
        decode("event", {"row": 1})
    with pytest.raises(StoreError, match="expected one of"):
        decode("wish", {})


CHILD = """
import sys
from evertwin.fold.records import Event
from evertwin.store import SqliteStore
store = SqliteStore(sys.argv[1])
start = len(store.read("event"))
for row in range(start, start + 10_000):
    store.append([Event(row, row, "tuned", "Fc", "x" * 200)])
    if row % 5 == 4:
        store.checkpoint((float(row),), row)
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
    store.append(records, row=1)
    for kind in ("event", "answer", "request", "estimate", "version"):
        expected = tuple(record for record in records if kind_of(record) == kind)
        assert store.read(kind) == expected
    assert store.verify() == len(records)
    assert all(encode(decode(kind_of(r), loads(encode(r)))) == encode(r) for r in records)
    store.close()
