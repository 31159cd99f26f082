"""Older days: files that the log names, read back as if they had stayed."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import duckdb
import numpy as np
import pytest

from evertwin.errors import StoreDamaged
from evertwin.fold import Chunk, equal
from evertwin.store import Batch, Checkpoint, SqliteStore
from evertwin.store.opening import restore
from evertwin.store.sqlite.archive import DAY

STEP = DAY // 8
NAMES = ("number", "X", "x")  # one as a column of ours, two that differ by case alone


def filled(path: Path) -> SqliteStore:
    """Four days of two sources, a late piece, NaN and infinity; a checkpoint in the last day."""
    store = SqliteStore(path)
    rng = np.random.default_rng(1)
    for k in range(32):
        t = np.arange(3) * 1000 + k * STEP
        v = rng.normal(size=(3, 3))
        v[0, 0], v[1, 1] = np.nan, np.inf
        scan = Chunk("a scan/../x", t[:1] + 7, rng.normal(size=(1, 2, 2)), task=k // 8)
        store.commit(Batch(chunks=(Chunk("arm", t, v, task=k // 8), scan)), wait=False)
    late = Chunk("arm", np.array([5, 3]), np.ones((2, 3)))
    store.commit(Batch(chunks=(late,), checkpoint=Checkpoint(60, (1.0,), chunks=60)))
    return store


def everything(store: SqliteStore) -> list[Chunk]:
    return [c for one in ("arm", "a scan/../x") for c in store.samples(one, -DAY, 9 * DAY)]


def put_away(store: SqliteStore, newest: int) -> int:
    """What is older than a stamp goes to files."""
    moved = 0
    for source, names in (("arm", NAMES), ("a scan/../x", ())):
        for day in list(store.whole(source, newest)):
            written = store.archive.write(source, day, store.of_day(source, day), names)
            assert written is not None
            store.commit(Batch([written.event(0)], moved=(written.gone,)))
            moved += 1
    return moved


def test_older_days_are_read_back_bit_for_bit(tmp_path: Path) -> None:
    with closing(filled(tmp_path / "r.db")) as store:
        before = everything(store)
        assert put_away(store, 3 * DAY + 5) == 6
        kept = [number for number, _ in store.read_chunks()]
        assert (
            len(kept) == 17 and min(kept[:-1]) > 48
        )  # the last day; the late piece: no checkpoint
        after = sorted(everything(store), key=lambda c: (c.source != "arm", len(c.t) == 2))
        assert len(after) == len(before) == 65
        before.sort(key=lambda c: (c.source != "arm", len(c.t) == 2))
        assert all(equal(tuple(a), tuple(b)) for a, b in zip(before, after, strict=True))
        some = list(store.samples("arm", STEP, STEP + 1000))
        assert [chunk.t.tolist() for chunk in some] == [[STEP, STEP + 1000]]
        assert put_away(store, 3 * DAY) == 0
        assert store.verify() == 6
    with closing(SqliteStore(tmp_path / "r.db", read_only=True)) as again:
        assert len(everything(again)) == 65
    files = str(tmp_path / "r.db.days" / "arm" / "*.parquet")
    assert duckdb.sql(f"SELECT count(*) FROM read_parquet('{files}')").fetchall() == [(72,)]
    asked = f"SELECT max(X), count(X), count(refused), min(refused) FROM read_parquet('{files}')"
    most, believed, refused, which = duckdb.sql(asked).fetchall()[0]
    assert most < 10.0 and (believed, refused, which) == (48, 24, "X")
    assert not (tmp_path / "x").exists()  # a source's name leads nowhere


@pytest.mark.parametrize("kind", ["changed", "gone"])
def test_a_file_that_is_not_what_the_log_names_is_told(tmp_path: Path, kind: str) -> None:
    with closing(filled(tmp_path / "r.db")) as store:
        put_away(store, 2 * DAY)
        store.backup(tmp_path / "copy.db")
    file = sorted((tmp_path / "r.db.days" / "arm").iterdir())[0]
    content = file.read_bytes()
    if kind == "changed":
        file.write_bytes(content[:99] + bytes([content[99] ^ 1]) + content[100:])
    else:
        file.unlink()
    with closing(SqliteStore(tmp_path / "r.db", read_only=True)) as store:
        for look in (store.verify, lambda: everything(store)):
            with pytest.raises(StoreDamaged, match=file.name):
                look()
    assert restore(tmp_path / "r.db", tmp_path / "copy.db") == 4
    with closing(SqliteStore(tmp_path / "r.db")) as store:
        assert store.verify() == 4 and len(everything(store)) == 65


def test_a_kill_between_file_and_log_leaves_each_sample_once(tmp_path: Path) -> None:
    with closing(filled(tmp_path / "r.db")) as store:
        written = store.archive.write("arm", "1970-01-01", store.of_day("arm", "1970-01-01"), NAMES)
        assert written is not None and written.samples == 24
    with closing(SqliteStore(tmp_path / "r.db")) as store:
        assert len(everything(store)) == 65  # the file has no name in the log: it does not count
        assert put_away(store, 2 * DAY) == 4
        assert len(everything(store)) == 65


def test_a_repaired_store_keeps_its_days(tmp_path: Path) -> None:
    path = tmp_path / "r.db"
    with closing(filled(path)) as store:
        put_away(store, 2 * DAY)
    with closing(sqlite3.connect(path)) as raw:
        raw.execute("UPDATE samples SET content = x'00' WHERE number = 50")
        raw.commit()
    with closing(SqliteStore(path)) as store:
        event = store.recover()
        assert "nothing of the log is lost" in event.reason and "; 1 samples" in event.reason
        assert len(everything(store)) == 64 and store.verify() == 5
