"""The store on a PostgreSQL server of the tests' own: laws, owners, partitions, failures."""

from __future__ import annotations

import itertools
import sqlite3
import subprocess
import sys
import threading
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.errors import (
    LawBroken,
    MissingExtra,
    OwnershipLost,
    StoreError,
    StoreLocked,
    StoreUnwritable,
)
from evertwin.fold import Chunk, Event
from evertwin.store import (
    Batch,
    Checkpoint,
    SharedStore,
    SqliteStore,
    SqlOwners,
    check_owners,
    check_store,
)
from evertwin.store.owners.owners import fence
from evertwin.store.postgres.database import Postgres, driver, told
from evertwin.store.sql.database import Database
from evertwin.store.sql.store import SqlStore
from evertwin.twin import Twin
from planted.serving import TWINS

NAMES = (f"twin-{k}" for k in itertools.count())


@pytest.fixture
def twin() -> str:
    """A name that no test had before."""
    return next(NAMES)


def event(row: int) -> Event:
    return Event(row, row * 10, "tuned", "Fc", f"entry {row}", {"row": row})


def chunk(first: int) -> Chunk:
    return Chunk("pose", np.arange(first, first + 3), np.full((3, 2), float(first)))


def test_the_laws_of_a_store(postgres: str, twin: str) -> None:
    check_store(lambda: SharedStore(postgres, twin))


def test_the_laws_of_a_store_under_a_token(postgres: str, twin: str) -> None:
    with closing(Postgres(postgres)) as database:
        token = SqlOwners(database).claim(twin, "north", 60.0)
        check_store(lambda: SharedStore(postgres, twin, token), persistent=False)


def test_the_laws_of_owners(postgres: str) -> None:
    with closing(Postgres(postgres)) as database:
        check_owners(
            SqlOwners(database), lambda twin, token: SharedStore(postgres, twin, token), time.sleep
        )


def test_a_claim_waits_for_what_relies_on_a_token_and_a_renewal_does_not(
    postgres: str, twin: str
) -> None:
    with closing(Postgres(postgres)) as database, closing(Postgres(postgres)) as other:
        owners, others = SqlOwners(database), SqlOwners(other)
        first = owners.claim(twin, "north", 0.2)
        assert first is not None
        with closing(Postgres(postgres, twin, first)) as writes:
            check = fence(twin, first, writes.shared, writes.locked)
            with writes.transaction() as db:
                check(db)
                began = time.monotonic()
                assert owners.renew({twin: (first, "x")}, 0.2) == {twin: ""}
                assert time.monotonic() < began + 0.5
                time.sleep(0.3)
                with pytest.raises(StoreUnwritable, match="lock timeout"):
                    others.claim(twin, "south", 60.0)
            with closing(driver().connect(postgres)) as claims:
                text = "UPDATE evertwin.owners SET token = token + 1 WHERE twin = %s"
                claims.execute(text, (twin,))
                held = threading.Timer(0.5, claims.commit)
                held.start()
                began = time.monotonic()
                with pytest.raises(OwnershipLost), writes.transaction() as late:
                    check(late)
                assert time.monotonic() > began + 0.3
                held.join()


def test_the_laws_of_owners_can_fail() -> None:
    database = Database(":memory:")
    with pytest.raises(LawBroken, match="under an old token: expected OwnershipLost"):
        check_owners(SqlOwners(database), lambda *_: SqlStore(database), time.sleep)

    def unfair(twin: str, token: int) -> SqlStore:
        return SqlStore(database, fence=fence(twin, token))

    class Generous(SqlOwners):
        def claim(self, twin: str, node: str, lease: float) -> int | None:
            return super().claim(twin, node, lease) or 7

    with pytest.raises(LawBroken, match="one owner: expected None, got 7"):
        check_owners(Generous(Database(":memory:")), unfair, time.sleep)


def test_twins_do_not_see_each_other(postgres: str, twin: str) -> None:
    with (
        closing(SharedStore(postgres, twin)) as one,
        closing(SharedStore(postgres, next(NAMES))) as other,
    ):
        one.commit(Batch([event(1)], chunks=[chunk(0)], checkpoint=Checkpoint(1, (1.0,))))
        other.commit(Batch([event(2), event(3)]))
        assert one.read("event") == (event(1),)
        assert other.read("event") == (event(2), event(3))
        assert (one.chunks, other.chunks, other.restore((0.0,))) == (1, 0, None)


def test_a_node_keeps_others_out(postgres: str, twin: str) -> None:
    with closing(Postgres(postgres)) as database:
        owners = SqlOwners(database)
        first = owners.claim(twin, "north", 60.0)
        with pytest.raises(StoreLocked, match="node 'north' works with it"):
            SharedStore(postgres, twin)
        assert first is not None and owners.release(twin, first)
        with closing(SharedStore(postgres, twin)) as outside:
            outside.commit(Batch([event(1)]))
            owners.claim(twin, "south", 60.0)
            with pytest.raises(OwnershipLost, match="token 1 is old, node 'south' has 2"):
                outside.commit(Batch([event(2)], chunks=[chunk(0)]))
            with pytest.raises(OwnershipLost):  # what a refused write held back is never written
                outside.flush()
            with closing(SharedStore(postgres, twin, read_only=True)) as seen:
                assert (seen.read("event"), seen.chunks) == ((event(1),), 0)
            with pytest.raises(OwnershipLost):
                outside.close()


def test_a_claim_waits_for_a_commit_under_way(postgres: str, twin: str) -> None:
    with closing(Postgres(postgres)) as database, closing(Postgres(postgres, twin)) as writing:
        owners = SqlOwners(database)
        token = owners.claim(twin, "north", 0.0)
        assert token == 1
        claimed: list[int | None] = []
        taking = threading.Thread(target=lambda: claimed.append(owners.claim(twin, "south", 9.0)))
        with writing.transaction() as db:
            fence(twin, token, writing.shared, writing.locked)(db)
            taking.start()
            taking.join(0.2)
            assert not claimed
        taking.join()
        assert claimed == [2]


def test_samples_lie_in_a_partition_a_day(postgres: str, twin: str) -> None:
    with (
        closing(SharedStore(postgres, twin)) as store,
        closing(Postgres(postgres, twin)) as database,
    ):
        store.commit(Batch(chunks=[chunk(0), chunk(3)]))
        query = "SELECT tableoid::regclass::text, day::text FROM evertwin.samples WHERE twin = ?"
        ((place, day), other) = database.query(query, (twin,))
        assert place == "samples_" + day.replace("-", "") and other == (place, day)
        parts = database.query(
            "SELECT 1 FROM pg_inherits WHERE inhparent = 'evertwin.samples'::regclass"
        )
        assert len(parts) >= 2  # tomorrow's too: midnight passes between two statements
        store.commit(Batch(forget={"pose": 4}))
        assert [number for number, _ in store.read_chunks()] == [2] and store.chunks == 2


def test_a_copy_is_a_file(postgres: str, twin: str, tmp_path: Path) -> None:
    with closing(SharedStore(postgres, twin)) as store:
        state = (np.arange(9000.0), 7)
        checkpoint = Checkpoint(5, state, 1, shown={"row": np.arange(3)})
        store.commit(Batch([event(1), event(2)], chunks=[chunk(0)], checkpoint=checkpoint))
        store.commit(Batch(chunks=[chunk(1)], forget={"pose": 3}))
        store.backup(tmp_path / "copy.db")
        head = store.head
    with closing(SqliteStore(tmp_path / "copy.db")) as copy:
        assert (copy.head, copy.verify(), copy.chunks) == (head, 2, 2)
        found = copy.restore(state)
        assert found is not None and np.array_equal(found.state[0], state[0])
        copy.commit(Batch([event(3)], chunks=[chunk(2)]))
        assert [number for number, _ in copy.read_chunks()] == [2, 3]


def test_the_log_is_append_only(postgres: str, twin: str) -> None:
    with (
        closing(SharedStore(postgres, twin)) as store,
        closing(Postgres(postgres, twin)) as database,
    ):
        store.commit(Batch([event(1)]))
        for change in ("UPDATE log SET row = 2", "DELETE FROM log"):
            with pytest.raises(StoreError, match="append-only"), database.transaction() as db:
                db.execute(change)


def test_a_reader_asks_the_owner(postgres: str, twin: str) -> None:
    with pytest.raises(StoreError, match="no such store"):
        SharedStore(postgres, twin, read_only=True)
    with closing(SharedStore(postgres, twin)) as store:
        with closing(SharedStore(postgres, twin, read_only=True)) as reader:
            reader.ask([event(4)])
            with pytest.raises(StoreError, match="read only"):
                reader.commit(Batch())
            asked, last = store.asked()
            assert asked == (event(4),)
            store.commit(Batch(asked, heard=last))
            assert reader.read("event") == (event(4),) and store.asked() == ((), 0)
        with pytest.raises(StoreError, match="restore it from a backup"):
            store.recover()


def test_a_line_that_is_cut_is_told(postgres: str, twin: str) -> None:
    store = SharedStore(postgres, twin)
    store.commit(Batch([event(1)]))
    with closing(Postgres(postgres)) as database:
        query = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = ?"
        database.query(query, (f"evertwin {twin}",))
    with pytest.raises(StoreUnwritable, match="check server, network, disk"):
        store.commit(Batch([event(2)]))
    with pytest.raises(StoreUnwritable):
        store.close()
    with closing(SharedStore(postgres, twin)) as again:  # the lock went with the line
        assert again.read("event") == (event(1),)


def test_who_is_paused_in_a_transaction_is_cut(
    postgres: str, twin: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evertwin.store.postgres.database.STALLED", 1.0)
    with (
        closing(Postgres(postgres, twin)) as database,
        pytest.raises(StoreUnwritable, match="idle-in-transaction"),
        database.transaction() as db,
    ):
        db.execute("SELECT 1")
        time.sleep(1.3)
        db.execute("SELECT 1")


def test_a_twin_file_names_the_server(
    postgres: str, twin: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "cart.toml"
    text = (TWINS / "robot1d.toml").read_text().replace('name = "robot1d"', f'name = "{twin}"', 1)
    file.write_text(text + f'\n[store]\npath = "{postgres}"\n')
    with Twin.open(file) as first:
        first.promote(0, "to see", "anna")
        with pytest.raises(StoreLocked, match="open in another process"):
            Twin.open(file)
        with Twin.open(file, reading=True) as seen:  # another process asks
            seen.pin(0, "as it is")
            assert [e.kind for e in seen.events] == ["configured", "promoted"]
    with Twin.open(file) as again:
        assert again.pinned and [e.kind for e in again.events][-1] == "pinned"
    for words, said in (
        (["events", str(file)], "to see"), (["store", "verify", str(file)], "all of them sound"),
        (["store", "backup", str(file), str(tmp_path / "copy.db")], "4 entries"),
        (["store", "recover", str(file)], "use the server's own tools"),
    ):  # fmt: skip
        with suppress(SystemExit):
            main(words)
        out, err = capsys.readouterr()
        assert said in out + err


def test_no_server(twin: str) -> None:
    with pytest.raises(StoreUnwritable, match=r"127\.0\.0\.1:1/plant: twin-\d+: "):
        SharedStore("postgresql://me:secret@127.0.0.1:1/plant", twin)
    assert "secret" not in told("postgresql://me:secret@db/plant", twin)


def test_a_local_store_needs_no_table_of_owners(tmp_path: Path) -> None:
    SqliteStore(tmp_path / "a.db").close()
    with closing(sqlite3.connect(tmp_path / "a.db")) as file:
        assert not file.execute("SELECT 1 FROM sqlite_master WHERE name = 'owners'").fetchall()


def test_a_local_twin_loads_nothing_of_it() -> None:
    program = (
        "import sys; from evertwin import Twin; Twin('twins/robot1d.toml').close(); "
        "print([one for one in sys.modules if one.startswith(('psycopg', 'evertwin.fleet')) "
        "or one in ('evertwin.store.postgres.database', 'evertwin.store.postgres.store')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=TWINS.parent
    )
    assert done.stdout.strip() == "[]", done.stderr


def test_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    driver.cache_clear()
    with pytest.raises(MissingExtra, match=r"pip install 'evertwin\[fleet\]'"):
        SharedStore("postgresql://127.0.0.1:1/plant", "arm")
    driver.cache_clear()


def test_nodes_that_start_at_once_make_the_tables_once(postgres: str) -> None:
    for _ in range(3):
        name = f"fresh{next(NAMES).replace('-', '_')}"
        with closing(driver().connect(postgres, autocommit=True)) as db:
            db.execute(f"CREATE DATABASE {name}")
        server, opened, failed = f"{postgres.rsplit('/', 1)[0]}/{name}", [], []

        def start(server: str = server, opened: list = opened, failed: list = failed) -> None:
            try:
                with closing(SharedStore(server, next(NAMES))) as store:
                    opened.append(store)
            except StoreError as error:
                failed.append(error)

        threads = [threading.Thread(target=start) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(opened) == 8, failed
