"""`evertwin serve` as a process: many twins, kills, poison, reload, stop."""

from __future__ import annotations

import contextlib
import json
import signal
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.config import read
from evertwin.fold import plain
from evertwin.sources.recorded import Recorded
from evertwin.store import SqliteStore
from evertwin.store.spec import StoreSpec
from evertwin.twin import Twin
from planted.draws import first_of
from planted.serving import ENTRY, Served, said_to, site
from planted.worlds import record_robot


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("robot") / "run.csv"
    record_robot(file, "--light", "--world", "w3", "--seconds", "60", "--seed", "2")
    return file


@pytest.fixture
def hall(tmp_path: Path, recording: Path) -> Path:
    (tmp_path / "run.csv").write_bytes(recording.read_bytes())
    return tmp_path


def ended(status: dict) -> bool:  # type: ignore[type-arg]
    return all(one["state"] in ("ended", "quarantined") for one in status["twins"])


def test_a_killed_service_goes_on_as_if_nothing_had_been(hall: Path) -> None:
    file = site(hall, "robot", speed=100)
    for rows in (40, 110):
        with Served(file) as served:
            served.until(lambda status, rows=rows: status["twins"][0]["rows"] >= rows)
            served.kill()
    with Served(file) as served:
        served.until(ended)
        found = served.ask("/api/v1/twins/robot/rows?last=10000&points=10000")[1]
        samples = served.ask("/api/v1/twins/robot/samples?source=log&limit=10000")[1]
        events = served.ask("/api/v1/twins/robot/events")[1]["events"]
        assert served.end() == 0
    with Twin(read(hall / "robot1d.toml")) as twin:
        chunks = list(Recorded.of(twin.spec.source[0], (hall / "run.csv",)).read())
        for chunk in chunks:
            twin.push(chunk)
        view = twin.view(10_000)
        said = [(e.row, e.kind, e.reason) for e in twin.events if e.kind != "started"]
    stamps = [stamp for chunk in samples["chunks"] for stamp in chunk["t"]]
    assert stamps == np.concatenate([chunk.t for chunk in chunks]).tolist()
    assert found["row"] == view.row.tolist() and found["t"] == view.t.tolist()
    for name in ("measured", "predicted"):
        assert tuple(found["outputs"]["x"][name]) == plain(getattr(view, name)[:, 0].tolist())
    assert found["version"] == view.version.tolist()
    assert [(e["row"], e["kind"], e["reason"]) for e in events if e["kind"] != "started"] == said
    assert any(kind in ("tuned", "abnormal") for _, kind, _ in said)


def test_a_poison_twin_is_alone_with_it(hall: Path) -> None:
    file = site(hall, "good", "broken")
    (hall / "store").mkdir()
    (hall / "store" / "broken.db").write_bytes(b"no store at all, " * 999)
    bad = hall / "poison.toml"
    bad.write_text((hall / "robot1d.toml").read_text().replace('kind = "robot1d"', 'kind = "nil"'))
    entry = ENTRY.replace("robot1d.toml", "poison.toml").format(name="poison", speed=200)
    file.write_text(file.read_text() + entry + '[[twin]]\nfile = "absent.toml"\n')
    with Served(file) as served:
        status = served.until(ended)
        twins = {one["name"]: one for one in status["twins"]}
        assert twins["good"]["state"] == "ended" and twins["good"]["rows"] > 100
        for name in ("poison", "absent"):
            assert twins[name]["state"] == "quarantined" and twins[name]["condition"] == "failure"
        assert "nil" in twins["poison"]["reason"] and "absent.toml" in twins["absent"]["reason"]
        assert twins["broken"]["state"] == "quarantined" or twins["broken"]["rows"] > 100
        code, told = served.ask("/api/v1/twins/poison/rows")
        assert code == 400 and "quarantined" in told["error"]


def test_the_configuration_is_taken_anew_without_a_stop(hall: Path) -> None:
    file = site(hall, "one", "two", speed=10)
    with Served(file) as served:
        served.until(lambda status: all(one["rows"] > 0 for one in status["twins"]))
        text = file.read_text()
        file.write_text(text.replace("[[twin]]", "[[twin]]\nfiel = 3", 1))
        code, told = served.ask("/api/v1/reload", {})
        assert code == 400 and "fiel" in told["error"] and "site.toml:8" in told["error"]
        before = served.twin("one")
        assert served.twin("two")["state"] in ("running", "ended")
        head = text[: text.index("[[twin]]")]
        entries = [ENTRY.format(name=name, speed=10) for name in ("one", "three")]
        file.write_text(head + "".join(entries))
        served.process.send_signal(signal.SIGHUP)
        status = served.until(lambda status: status["reloads"] == 1)
        assert [one["name"] for one in status["twins"]] == ["one", "three"]
        assert status["error"] == "" and status["twins"][0]["rows"] >= before["rows"]
        file.write_text(file.read_text().replace("workers = 0", "workers = 0\nqueue = 9", 1))
        code, told = served.ask("/api/v1/reload", {})
        assert (code, told["started"], told["stopped"]) == (200, ["one"], [])
        kept = file.read_text()
        for text, later in ((kept.replace("port = 0", "port = 1"), ["port"]), (kept, [])):
            file.write_text(text)
            assert served.ask("/api/v1/reload", {})[1]["after_restart"] == later


def test_a_typo_in_a_twin_file_changes_nothing_and_is_told(hall: Path) -> None:
    """Of a twin that runs; at a start it is in quarantine, with the reason."""
    file, twin = site(hall, "one", speed=10), hall / "robot1d.toml"
    good = twin.read_text()
    line = 1 + good.splitlines().index(next(t for t in good.splitlines() if t.startswith("kind")))
    bad = good.replace("\nkind", "\nkint", 1)
    with Served(file) as served:
        served.until(lambda status: status["twins"][0]["rows"] > 3)
        twin.write_text(bad)
        code, told = served.ask("/api/v1/reload", {})
        status = served.ask("/api/v1/status")[1]
        for said in (told["error"], status["error"]):
            assert f"robot1d.toml:{line}:" in said and "kint" in said
        assert code == 400 and status["twins"][0]["state"] == "running" and not status["reloads"]
        served.process.send_signal(signal.SIGHUP)
        assert served.twin("one")["state"] == "running"
        received = served.twin("one")["sources"]["log"]["received"]
        twin.write_text(good)
        file.write_text(file.read_text().replace("workers = 0", "workers = 0\nqueue = 9", 1))
        code, told = served.ask("/api/v1/reload", {})
        assert code == 200 and told["started"] == ["one"]
        status = served.until(lambda status: status["twins"][0]["state"] in ("running", "ended"))
        assert status["error"] == ""
        assert status["twins"][0]["sources"]["log"]["received"] >= received  # counted on
    twin.write_text(bad)
    with Served(file) as served:
        (told,) = served.until(lambda _: True)["twins"]
    assert (told["state"], told["condition"]) == ("quarantined", "failure")
    assert f"robot1d.toml:{line}:" in told["why"] and "kint" in told["why"]


def test_a_twin_that_cannot_be_built_changes_nothing_either(hall: Path) -> None:
    """Model, name of a parameter, what may be tuned: the one that runs goes on."""
    file, twin = site(hall, "one", speed=10), hall / "robot1d.toml"
    good = twin.read_text()
    slips = (
        good.replace('kind = "robot1d"', 'kind = "robot1e"', 1),
        good.replace("parameters.gain", "parameters.gian", 1),
        good.replace("[tuning]", '[tuning]\neditable = ["gian"]', 1),
    )
    with Served(file) as served:
        served.until(lambda status: status["twins"][0]["rows"] > 3)
        for bad in slips:
            assert bad != good
            twin.write_text(bad)
            code, told = served.ask("/api/v1/reload", {})
            assert code == 400 and "robot1d.toml" in told["error"]
            assert "gian" in told["error"] or "robot1e" in told["error"]
            status = served.ask("/api/v1/status")[1]
            assert status["reloads"] == 0 and status["error"] == told["error"]
            assert status["twins"][0]["state"] in ("running", "ended")
        twin.write_text(good + "\n")
        assert served.ask("/api/v1/reload", {})[0] == 200


def test_a_stop_keeps_the_state_tells_systemd_and_a_second_service_is_refused(hall: Path) -> None:
    line, environment = said_to(hall)
    file = site(hall, "robot", speed=50)
    with line, Served(file, **environment, WATCHDOG_USEC="400000") as served:
        assert line.recv(100) == b"READY=1"
        served.until(lambda status: status["twins"][0]["rows"] > 40)
        assert line.recv(100) == b"WATCHDOG=1"
        with Served(file) as second:
            (other,) = second.until(lambda _: True)["twins"]
        assert other["state"] == "quarantined" and "is open in process" in other["reason"]
        rows = served.twin("robot")["rows"]
        with contextlib.suppress(BlockingIOError):
            line.setblocking(False)
            while line.recv(100):
                pass
        line.settimeout(10)
        assert served.end() == 0
        heard = b""
        while heard != b"STOPPING=1":
            heard = line.recv(100)
    store = SqliteStore(hall / "store" / "robot.db", read_only=True)
    (kept,) = store._db.query("SELECT max(row) FROM checkpoints")
    assert kept[0] >= rows
    store.close()
    lines = [json.loads(text) for text in (hall / "log.jsonl").read_text().splitlines()]
    assert any(one.get("event") == "started" and one["twin"] == "robot" for one in lines)


def test_what_is_kept_can_be_taken_out_and_put_back(
    hall: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Twin(
        replace(read(site(hall).parent / "robot1d.toml"), store=StoreSpec(str(hall / "r.db")))
    ) as twin:
        chunks = list(Recorded.of(twin.spec.source[0], (hall / "run.csv",)).read())
        for chunk in chunks:
            twin.push(chunk)
        twin.going().rest()
        twin.store.backup(hall / "copy.db")

    def call(*words: object) -> int:
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        return int(ended.value.code or 0)

    toml, store = hall / "robot1d.toml", hall / "r.db"
    assert call("store", "verify", store) == 0
    for suffix in ("csv", "mcap"):
        out = hall / f"out.{suffix}"
        assert call("store", "export", toml, out, "--store", store, "--first", 10) == 0
    again = (hall / "out.csv").read_text().splitlines()
    assert again[0] == "t [s],v [m/s],x [m],task [1]"
    assert len(again) - 1 == sum((chunk.t >= 10**10).sum() for chunk in chunks)
    assert (hall / "out.mcap").read_bytes()[:5] == b"\x89MCAP"
    assert call("store", "export", toml, out, "--store", store, "--source", "no") == 2
    with closing(SqliteStore(store)):  # somebody works with it
        assert call("store", "restore", store, hall / "copy.db") == 75
    store.write_bytes(b"gone")
    assert call("store", "restore", store, hall / "nothing.db") == 2
    assert call("store", "restore", store, hall / "copy.db") == 0
    assert (hall / "r.db.before").read_bytes() == b"gone"
    assert call("store", "restore", store, hall / "copy.db") == 4
    with closing(SqliteStore(store)) as found:
        assert found.chunks == len(chunks) and found.verify() > 0
    assert "entries" in capsys.readouterr().out


def test_older_days_go_to_files_and_are_read_back(hall: Path) -> None:
    head, *lines = (hall / "run.csv").read_text().splitlines()
    cells = [line.split(",", 1) for line in lines[:60]]  # an hour for a second: two days and a half
    stretched = [f"{3600.0 * k},{rest}" for k, (_, rest) in enumerate(cells)]
    (hall / "run.csv").write_text("\n".join([head, *stretched]) + "\n")
    file = site(hall, "robot", speed=1e6)
    ask = "/api/v1/twins/robot/samples?source=log&limit=10000"
    with Served(file) as served:
        served.until(ended)
        before = served.ask(ask)[1]["chunks"]
        assert served.end() == 0
    file.write_text(file.read_text().replace("workers = 0", "workers = 0\ndays = 1"))
    with Served(file) as served:
        served.until(lambda _: any(
            event["kind"] == "archived" for event in
            served.ask("/api/v1/twins/robot/events")[1]["events"]
        ))  # fmt: skip
        assert served.ask(ask)[1]["chunks"] == before and len(before) == 20
        assert served.end() == 0
    (found,) = (hall / "store" / "robot.db.days" / "log").iterdir()
    with closing(SqliteStore(hall / "store" / "robot.db")) as store:
        assert len(list(store.read_chunks())) == 12 and store.verify() > 0
    found.write_bytes(found.read_bytes()[:-1])
    with pytest.raises(SystemExit, match="4"):
        main(["store", "verify", str(hall / "store" / "robot.db")])


HANGS = """import os, time
from evertwin import FunctionModel, Layout, Parameters
def step(x, u, dt, p):
    if os.path.exists("NOW"):
        time.sleep(3600)
    x1 = x[0] + dt * p[0] * u[0]
    return [x1], [x1]
position = Layout.of(x="m")
gain = Parameters.of(gain=(1.0, "1"))
model = FunctionModel(step, Layout.of(v="m/s"), position, position, gain)
"""


@first_of("removed", [True, False])
def test_a_model_that_never_comes_back_holds_up_nobody(hall: Path, removed: bool) -> None:
    """Nor its own page, a reload that removes it, or the stop; and it is told."""
    file = site(hall, "good", speed=5)
    now = hall / "now"
    (hall / "hang.py").write_text(HANGS.replace("NOW", str(now)))
    text = (hall / "robot1d.toml").read_text()
    model = 'kind = "python"\noptions = { file = "hang.py", name = "model" }'
    at = text.index("[model]")
    rest = text[text.index("\n[", at + 1) :]
    (hall / "hang.toml").write_text(f"{text[:at]}[model]\n{model}\n{rest}")
    entry = ENTRY.replace("robot1d.toml", "hang.toml").format(name="hang", speed=5)
    alone = file.read_text()
    file.write_text(alone + entry)
    with Served(file) as served:
        served.until(lambda status: status["twins"][1]["rows"] > 15)
        now.touch()
        served.until(lambda status: "not come back" in status["twins"][1]["why"], 60.0)
        began = time.monotonic()
        code, hung = served.ask("/api/v1/twins/hang")
        assert code == 200 and time.monotonic() - began < 5 and hung["parameters"]
        assert hung["condition"] == "check" and "hang.py:5 (step)" in hung["why"]
        assert hung["busy"] > 5 and served.twin("good")["condition"] != "check"
        before = served.twin("good")["rows"]
        served.until(lambda status, rows=before: status["twins"][0]["rows"] > rows)
        if removed:
            file.write_text(alone)
            began = time.monotonic()
            code, told = served.ask("/api/v1/reload", {})
            assert (code, told["stopped"]) == (200, ["hang"])
            assert time.monotonic() - began < 15
        began = time.monotonic()
        assert served.end() == 0 and time.monotonic() - began < 20
    assert "hang.py:5 (step)" in (hall / "log.jsonl").read_text()
