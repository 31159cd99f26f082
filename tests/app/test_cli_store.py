"""`evertwin store`, `evertwin events`, and what is said to a twin whose store is in use."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from evertwin.app.outlook.plan_text import _line
from evertwin.config import read
from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.prognosis.laws.plans.planning import PlanItem
from evertwin.store import Batch, SqliteStore
from evertwin.twin import Twin
from planted.serving import TWINS

from .conftest import Command, columns, save


@pytest.fixture
def ran(call: Command, folder: Path) -> Path:
    assert call("run", "robot.toml", "--data", "robot.csv").code == 0
    return folder / "robot.db"


def changed(path: Path) -> None:
    """An entry changed behind the store's back."""
    database = sqlite3.connect(path)
    database.execute("DROP TRIGGER log_is_final")
    database.execute("UPDATE log SET content = replace(content, 'twin file', 'win file')")
    database.commit()
    database.close()


def test_events_are_listed(call: Command, ran: Path) -> None:
    text = call("events", "robot.toml").out
    assert "configured" in text and "promoted" in text
    listed = call("events", "robot.toml", "--kind", "promoted", "--json").json
    assert listed["schema"] == "evertwin.events/1"
    assert [event["kind"] for event in listed["events"]] == ["promoted"]


def test_the_store_of_another_twin_is_refused(call: Command, ran: Path, folder: Path) -> None:
    assert call("store", "backup", "robot.toml", "kept.db").code == 0
    other = (folder / "robot.toml").read_text().replace('name = "robot"', 'name = "cart"')
    (folder / "cart.toml").write_text(other)
    for words in (("events", "cart.toml"), ("store", "verify", "cart.toml"),
                  ("store", "export", "cart.toml", "x.csv"),
                  ("store", "restore", "cart.toml", "kept.db"),
                  ("model", "list", "cart.toml")):  # fmt: skip
        done = call(*words)
        assert done.code == 4 and "that of the twin 'robot', and this is 'cart'" in done.err
    assert call("store", "verify", str(ran)).code == 0


def test_a_version_is_shown_with_what_is_known_of_it(call: Command, ran: Path) -> None:
    shown = call("model", "show", "robot.toml", "1", "--json").json["parameters"]["gain"]
    low, high = shown["interval95"]
    assert low < shown["value"] < high and shown["verdict"] == "identifiable"
    assert (
        f"({low:.4g} … {high:.4g}, 95 %; identifiable)"
        in call("model", "show", "robot.toml", "1").out
    )
    before = call("model", "show", "robot.toml", "0", "--json").json["parameters"]["gain"]
    assert before["interval95"] is None and before["verdict"] == "not tuned"


def test_a_head_is_printed_and_verified(call: Command, ran: Path, folder: Path) -> None:
    (folder / "key").write_text("secret\n")
    printed = call("store", "head", "robot.toml").out.strip()
    signed = call("store", "head", "robot.toml", "--key", "key", "--json").json
    assert signed["printed"].startswith(f"{printed}:")
    assert printed == call("model", "list", "robot.toml", "--json").json["head"]
    assert call("model", "rollback", "robot.toml").code == 0
    done = call("store", "verify", "robot.toml", "--head", signed["printed"], "--key", "key")
    assert done.code == 0 and "as it was printed" in done.out
    forged = f"{printed[:-1]}{'1' if printed[-1] == '0' else '0'}"
    wrong = call("store", "verify", "robot.toml", "--head", forged)
    assert wrong.code == 4 and "the log was rewritten" in wrong.err
    assert "evertwin store recover" in wrong.err
    unsigned = call("store", "verify", "robot.toml", "--head", printed, "--key", "key")
    assert unsigned.code == 2 and "signature" in unsigned.err
    for key, said in (("none", "cannot be read"), ("empty", "expected a secret")):
        (folder / "empty").write_text("")
        assert said in call("store", "head", "robot.toml", "--key", key).err


def test_what_never_ran_has_nothing_to_repair(call: Command, folder: Path) -> None:
    done = call("store", "recover", "robot.toml")
    assert done.code == 2 and "no such store" in done.err
    assert not (folder / "robot.db").exists()


def test_a_sound_store_stays(call: Command, ran: Path) -> None:
    done = call("store", "recover", "robot.toml")
    assert done.code == 0 and "all of them sound: nothing to recover" in done.out
    assert not list(ran.parent.glob("robot.db.corrupt*"))
    missing = call("store", "export", "robot.toml", "x.csv")
    assert missing.code == 2 and "pushed to a running twin" in missing.err
    other = call("store", "export", "robot.toml", "x.csv", "--source", "gps")
    assert other.code == 2 and "no source is 'gps'" in other.err


def test_what_is_exported_is_whole_or_says_what_is_left_out(call: Command, folder: Path) -> None:
    toml, t = str(TWINS / "robot_ros.toml"), np.arange(3) * 10**8  # commands, poses and scans
    spec = read(TWINS / "robot_ros.toml")
    with closing(SqliteStore(folder / "live.db")) as store:
        chunks = [Chunk(one.name, t, np.ones((3, len(one.channels)))) for one in spec.source]
        scans = np.arange(540.0).reshape(3, 180)
        scans[0, 0] = np.nan
        store.commit(Batch([], run=1, chunks=[*chunks, Chunk("scan", t, scans)]))

    def export(file: str, *more: str) -> Any:
        return call("store", "export", toml, file, "--store", "live.db", *more)

    done = export("s.mcap", "--json")
    assert done.code == 0 and done.json["samples"] == {"command": 3, "pose": 3, "scan": 3}
    with (folder / "s.mcap").open("rb") as file:
        found = make_reader(file).iter_messages(topics="scan")
        said = [json.loads(message.data) for _, _, message in found]
    assert said[0]["/scan.ranges"][:2] == [None, 1.0] and said[2]["/scan.ranges"][-1] == 539.0
    two = export("s.csv")
    assert two.code == 2 and "--source command" in two.err and ".mcap" in two.err
    assert export("s.csv", "--source", "pose").code == 0
    assert "they are arrays" in export("s.csv", "--source", "scan").err
    assert export("s.mcap", "--source", "scan", "--json").json["samples"] == {"scan": 3}
    none = export("s.mcap", "--source", "gps")
    assert none.code == 2 and "there are command, pose, scan" in none.err


def test_a_label_has_a_reason(call: Command, ran: Path) -> None:
    done = call("label", "robot.toml", "2", "true", "--reason", " ")
    assert done.code == 2 and "expected a reason" in done.err


def test_a_damaged_store_is_told_and_repaired(call: Command, ran: Path) -> None:
    changed(ran)
    told = call("store", "verify", "robot.toml")
    assert told.code == 4 and "entry 2 (event, row 0) does not match its hash" in told.err
    repaired = call("store", "recover", "robot.toml", "--json").json["event"]
    assert repaired["kind"] == "recovered" and repaired["evidence"]["kept"] == 1
    assert call("store", "verify", "robot.toml").code == 0
    assert call("run", "robot.toml", "--data", "robot.csv").code == 0
    assert (ran.parent / "robot.db.corrupt.1").exists()


def test_a_run_starts_from_a_damaged_store(call: Command, ran: Path) -> None:
    changed(ran)
    assert call("run", "robot.toml", "--data", "robot.csv").code == 0
    kinds = [e["kind"] for e in call("events", "robot.toml", "--json").json["events"]]
    assert kinds.count("recovered") == 1 and kinds.count("promoted") == 1


def test_a_backup_is_a_store(call: Command, ran: Path, folder: Path) -> None:
    owner = SqliteStore(ran)
    assert call("store", "backup", "robot.toml", "copy.db").code == 0
    owner.close()
    copy = SqliteStore(folder / "copy.db")
    assert copy.entries() == SqliteStore(ran).entries()
    copy.close()
    assert call("store", "backup", "robot.toml", "copy.db").code == 2
    assert call("store", "backup", "robot.toml", "none/copy.db").code == 2


def test_a_twin_without_a_store_has_none(call: Command, folder: Path) -> None:
    (folder / "plain.toml").write_text(
        (folder / "robot.toml").read_text().replace('path = "robot.db"', "")
    )
    done = call("store", "head", "plain.toml")
    assert done.code == 2 and "keeps nothing" in done.err


def test_what_is_said_while_a_twin_works_is_heard(call: Command, ran: Path, folder: Path) -> None:
    with Twin.open(folder / "robot.toml") as working:
        said = call("model", "pin", "robot.toml", "0", "--reason", "it squeaks")
        assert said.code == 0 and "is asked to heed this at its next beat" in said.err
        assert "is open in" in said.err and "wait until" not in said.err
        assert call("model", "promote", "robot.toml", "9").code == 2
        assert not working.pinned
        working._ledger.hear()
        assert working.pinned and working.champion.number == 0
    events = call("events", "robot.toml", "--kind", "pinned", "--json").json["events"]
    assert len(events) == 1 and events[0]["evidence"]["person"]
    assert call("model", "list", "robot.toml", "--json").json["pinned"] is True


def test_what_a_fit_finds_becomes_a_version(call: Command, ran: Path) -> None:
    found = call("fit", "robot.toml", "--train", "robot.csv", "--keep", "--json")
    assert found.code == 0 and found.json["version"] == 2
    assert "evertwin model promote robot.toml 2" in found.err
    shown = call("model", "show", "robot.toml", "2", "--json").json
    assert shown["parameters"]["gain"]["value"] == found.json["parameters"]["gain"]["value"]
    assert call("model", "list", "robot.toml", "--json").json["champion"] == 1
    assert call("model", "promote", "robot.toml", "2").code == 0
    text = (ran.parent / "robot.toml").read_text()
    (ran.parent / "bare.toml").write_text(text.replace('path = "robot.db"', ""))
    refused = call("fit", "bare.toml", "--train", "robot.csv", "--keep")
    assert refused.code == 2 and "keeps nothing" in refused.err


def test_a_twin_that_is_looked_at_keeps_no_version(ran: Path) -> None:
    with (
        Twin.open(ran.parent / "robot.toml", reading=True) as twin,
        pytest.raises(UsageError, match="open to look at"),
    ):
        twin.keep(twin.fit(ran.parent / "robot.csv"))


def test_a_label_is_said_from_the_command_line(call: Command, ran: Path) -> None:
    listed = call("events", "robot.toml", "--kind", "suspected", "--json").json["events"]
    number = str(listed[0]["number"])
    said = call("label", "robot.toml", number, "faulty", "--reason", "unplugged", "--rows", "3:9")
    assert said.code == 0 and "suspected: faulty: unplugged" in said.out
    for words in (("nonsense",), ("faulty", "--rows", "nine"), ("cause", "--cause", "rust")):
        wrong = call("label", "robot.toml", number, *words, "--reason", "x")
        assert wrong.code == 2 and wrong.err.startswith("evertwin: "), wrong.err
    assert "no cause 'rust'" in wrong.err


def test_a_wrong_number_of_an_event_says_where_numbers_are(call: Command, ran: Path) -> None:
    events = call("events", "robot.toml", "--json").json["events"]
    wrong = call("label", "robot.toml", "99999", "true", "--reason", "x")
    assert wrong.code == 2 and "evertwin events robot.toml" in wrong.err
    assert str(events[-1]["number"]) in wrong.err and wrong.err.count("\n") == 1


def test_what_a_service_keeps_is_found_by_its_site_file(
    call: Command, ran: Path, folder: Path
) -> None:
    (folder / "store").mkdir()
    (folder / "robot.db").rename(folder / "store" / "left.db")
    text = (folder / "robot.toml").read_text("utf-8")
    (folder / "robot.toml").write_text(text.replace('path = "robot.db"', ""), "utf-8")
    bare = call("model", "list", "robot.toml", "--json")
    assert [one["version"] for one in bare.json["versions"]] == [0] and not bare.err
    site = 'schema = 1\nname = "hall"\n[[twin]]\nfile = "robot.toml"\nname = "left"\n'
    (folder / "site.toml").write_text(site, "utf-8")
    found = call("model", "list", "robot.toml", "--json")
    assert len(found.json["versions"]) > 1 and "left.db" in found.err
    assert call("model", "show", "robot.toml", "1").code == 0
    assert "promoted" in call("events", "robot.toml").out
    assert call("store", "verify", "robot.toml").code == 0
    refused = call("model", "promote", "robot.toml", "0")
    assert refused.code == 2 and "left.db" in refused.err and "page" in refused.err


def test_what_only_looks_reads_the_store_that_a_service_keeps(call: Command, folder: Path) -> None:
    assert call("run", "robot.toml", "--data", "robot.csv").code == 0
    file = folder / "robot.toml"
    file.write_text(file.read_text().partition("[store]")[0])
    (folder / "site.toml").write_text('[[twin]]\nfile = "robot.toml"\n')
    (folder / "store").mkdir()
    (folder / "robot.db").rename(folder / "store" / "robot.db")
    live = call("model", "list", "robot.toml", "--json").json["champion"]
    assert live > 0
    done = call("export", "robot.toml", "--format", "json", "-o", "out.json")
    assert f"version {live}" in done.out and "read from the service's" in done.err
    told = call("fit", "robot.toml", "--train", "robot.csv")
    assert told.code == 0 and "read from the service's" in told.err
    set_ = call("setpoint", "robot.toml", "--wanted", "10 cm/s", "--data", "robot.csv")
    assert f"version {live}:" in set_.out


def test_a_kind_that_no_event_has_is_answered_with_those_there_are(call: Command) -> None:
    assert call("run", "robot.toml", "--data", "robot.csv").code == 0
    done = call("events", "robot.toml", "--kind", "frob")
    assert done.code == 0 and not done.out.strip()
    assert "no event is 'frob'; the log has configured, " in done.err and "promoted" in done.err
    assert not call("events", "robot.toml", "--kind", "promoted").err


def test_a_date_that_is_over_is_said_to_be() -> None:
    item = PlanItem("pump", "d", 10.0, 0.01, 2.0, 3.0, 50.0)
    assert "on 2020-01-11, after 10 d (in the past: dates count from the newest row)" in _line(
        item, "2020-01-11"
    )
    assert "in the past" not in _line(item, "2999-01-11")


def test_the_first_line_of_a_twin_file_tells_of_all_recordings(call: Command, folder: Path) -> None:
    names = [f"run{k:02}.csv" for k in range(14)]
    for k, name in enumerate(names):
        save(folder / name, columns(60, seed=k))
    assert call("init", *names, "-o", "many.toml", "--model", "robot1d").code == 0
    first = (folder / "many.toml").read_text().splitlines()[0]
    assert "from run00.csv, run01.csv, run02.csv … run13.csv (14 files):" in first
