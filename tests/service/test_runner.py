"""One twin of the service: its queue, its quarantine, its slow readers."""

from __future__ import annotations

import asyncio
import json
import math
import re
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi import WebSocket

from evertwin.backoff import Backoff
from evertwin.errors import StoreUnwritable, UsageError
from evertwin.fold import Chunk
from evertwin.service.health.condition import Condition
from evertwin.service.http.metrics import exposition
from evertwin.service.http.stream import stream
from evertwin.service.service import Service
from evertwin.service.site.site_plan import read_site
from evertwin.service.twin import runner as room
from evertwin.service.twin.process import Process
from evertwin.service.twin.runner import Runner
from evertwin.sources.live.contract import Health
from evertwin.store import SqliteStore
from planted.serving import TWINS, site
from planted.worlds import record_robot


class Fast:
    """A source that never waits."""

    name = "log"

    def __init__(self, count: int = 300) -> None:
        self.count, self.taken, self.closed = count, 0, False
        self.health = Health("up")

    def open(self) -> None:
        pass

    def resume(self, stamp: int, task: int = 0) -> None:
        pass

    def committed(self, chunk: Chunk) -> None:
        self.taken += len(chunk.t)

    def close(self) -> None:
        self.closed = True

    async def chunks(self) -> AsyncIterator[Chunk]:
        for k in range(self.count):
            if self.closed:
                return
            await asyncio.sleep(0)
            yield Chunk("log", np.array([k * 10**9]), np.array([[0.1, 0.1 * k]]))


def run(
    folder: Path, source: Fast, more: str, during: Callable[[Runner], Any], monkeypatch: Any
) -> Runner:
    """A runner while ``during`` looks at it."""
    file = site(folder, "robot")
    file.write_text(file.read_text().replace("workers = 0", f"workers = 0\n{more}"))
    monkeypatch.setattr(room, "open_live", lambda *_: source)

    async def go() -> Runner:
        (folder / "store").mkdir(exist_ok=True)
        plan = read_site(file).twins[0]
        one = Runner(plan, folder / "store", Process())
        await one.start()
        await during(one)
        await one.stop()
        return one

    return asyncio.run(go())


async def folded(runner: Runner, count: int) -> None:
    end = time.monotonic() + 20
    serial = -1  # what was folded is told a moment later
    while time.monotonic() < end and (
        runner.sources[0].taken + runner.dropped < count
        or runner.waiting
        or serial != runner.serial
    ):
        serial = runner.serial
        await asyncio.sleep(0.01)


@pytest.mark.parametrize("full", ["wait", "drop"])
def test_a_full_queue_waits_or_drops_and_counts(
    tmp_path: Path, full: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = Fast()
    one = run(tmp_path, source, f'queue = 5\nfull = "{full}"', lambda r: folded(r, 300),
              monkeypatch)  # fmt: skip
    assert source.taken + one.dropped == 300
    assert (one.dropped > 0) == (full == "drop") and source.closed and one.state == "stopped"


def test_what_is_stored_is_acknowledged_while_a_fold_takes_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, go_on = Fast(100), threading.Event()

    async def slow(one: Runner) -> None:
        assert one.work is not None
        fold = one.work.fold

        def waits(kept: Any) -> Any:
            go_on.wait(20.0)
            return fold(kept)

        one.work.fold = waits  # type: ignore[method-assign]
        end = time.monotonic() + 20
        while source.taken < 100 and time.monotonic() < end:
            await asyncio.sleep(0.01)
        assert source.taken == 100 and one.row == 0 and len(one.durable) == 100
        assert sum(len(chunk.t) for chunk in one.reader.samples("log", 0, 10**12)) == 100
        go_on.set()
        while one.row < 100 and time.monotonic() < end:
            await asyncio.sleep(0.01)
        assert one.row == 100

    run(tmp_path, source, "", slow, monkeypatch)


class Set(Fast):
    """Its machine's clock was set."""

    clock: tuple[int, ...] | None = None

    def go_on(self, clock: tuple[int, ...]) -> None:
        self.clock = clock

    async def chunks(self) -> AsyncIterator[Chunk]:
        async for chunk in super().chunks():
            now_and_then = int(chunk.t[0]) % 3 == 0
            yield chunk._replace(clock=(600 * 10**9, -5, 1) if now_and_then else None)


def test_a_restart_goes_on_with_the_clock_that_was_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for source, clock in ((Set(11), (600 * 10**9, -5, 1)), (Fast(11), None)):
        folder = tmp_path / type(source).__name__
        folder.mkdir()
        run(folder, source, "", lambda r: folded(r, 11), monkeypatch)
        again = Set(0)

        async def nothing(_: Runner) -> None:
            pass

        run(folder, again, "", nothing, monkeypatch)
        assert again.clock == clock


def test_prometheus_hears_of_conditions_and_alarms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []

    async def suspects(one: Runner) -> None:
        await folded(one, 300)
        one.condition = Condition({"log": math.inf}, asked=True)
        one.condition.came("log")
        known = Service(site(tmp_path, "robot"))
        known.runners = {"robot": one}
        said.append(exposition(known).decode())
        reason = {"number": 7, "kind": "suspected", "reason": "x is off", "row": 4000, "time": 4}
        one.condition.heard(reason)
        said.append(exposition(known).decode())

    run(tmp_path, Fast(), "", suspects, monkeypatch)
    for text, alarm in zip(said, (0, 1), strict=True):
        assert f'evertwin_twin_alarm{{twin="robot"}} {alarm}.0' in text
        every = re.findall(r'evertwin_twin_condition{condition="(.*)",twin="robot"} (.)', text)
        assert len(every) == 6 and dict(every)["out_of_specification"] == str(alarm)
        assert sum(int(on) for _, on in every) == 1


def test_what_the_machine_calls_uncertain_stands_in_the_headline(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[dict[str, Any]] = []

    async def status(one: Runner) -> None:
        await folded(one, 11)
        for count in (0, 4):
            noted = {"x: uncertain": count, "came late": 9}
            one.sources[0].health = Health("up", received=11, noted=noted)  # type: ignore[misc]
            told.append(one.status())

    run(tmp_path, Fast(11), "", status, monkeypatch)
    assert "uncertain" not in told[0]["headline"]
    assert told[1]["headline"].endswith("calls 36 % of the samples of x uncertain.")
    assert round(told[1]["sources"]["log"]["uncertain"]["x"], 3) == 0.364


@pytest.mark.parametrize(("asked", "why"), [(True, "too few rows"), (False, "asks for no largest")])
def test_no_twin_is_good_that_was_never_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: bool, why: str
) -> None:
    text = (TWINS / "robot1d.toml").read_text()
    (tmp_path / "twins").mkdir()
    (tmp_path / "twins" / "robot1d.toml").write_text(
        text if asked else text.replace('requirement = "1 cm"\n', "")
    )
    monkeypatch.setattr("planted.serving.TWINS", tmp_path / "twins")
    told: list[dict[str, Any]] = []

    async def status(one: Runner) -> None:
        await folded(one, 11)
        told.append(one.status())

    run(tmp_path, Fast(11), "", status, monkeypatch)
    assert told[0]["condition"] == "unjudged" and why in told[0]["why"]


def test_a_model_that_breaks_ends_its_twin_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def broken(one: Runner) -> None:
        def fold(kept: object) -> None:
            raise ZeroDivisionError("a plug-in's")

        one.work.fold = fold  # type: ignore[method-assign, assignment, union-attr]
        end = time.monotonic() + 10
        while one.state == "running" and time.monotonic() < end:
            await asyncio.sleep(0.01)
        with pytest.raises(UsageError, match="quarantined"):
            await one.ask(lambda work: work.row)
        assert one.status()["condition"] == "failure"

    one = run(tmp_path, Fast(), "", broken, monkeypatch)
    assert one.state == "quarantined" and one.reason == "ZeroDivisionError: a plug-in's"


class Socket(WebSocket):
    """A reader that takes its time."""

    def __init__(self, after: str) -> None:
        self.after = after
        self.scope = {"subprotocols": [], "state": {"still": lambda: len(self.told) < 8}}
        self.told: list[dict[str, Any]] = []
        self.code = 0

    @property
    def query_params(self) -> Any:
        return self

    def getlist(self, key: str) -> list[str]:
        return ["robot"]

    def get(self, key: str, default: str = "") -> str:
        return self.after

    async def accept(self, *_: object) -> None:
        pass

    async def receive_text(self) -> str:
        await asyncio.Event().wait()
        return ""

    async def send_text(self, text: str) -> None:
        self.told.append(json.loads(text))
        await asyncio.sleep(0.02)

    async def close(self, code: int = 1000, reason: str | None = None) -> None:
        self.code = code


def test_a_slow_reader_gets_the_newest_and_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = Service(site(tmp_path, "robot"))
    socket = Socket("robot:0")

    async def watched(one: Runner) -> None:
        await folded(one, 100)
        monkeypatch.setattr(one, "_take", lambda said: None)  # its own rows would come between
        service.runners = {"robot": one}
        one.serial, one.rows = 5, type(one.rows)([(1, {"row": [1]})], maxlen=4)
        serving = asyncio.create_task(stream(socket, service))  # type: ignore[arg-type]
        for serial in range(6, 400):
            one.serial = serial
            one.rows.append((serial, {"row": [serial]}))
            for listener in service.process.listeners:
                listener.set()
            await asyncio.sleep(0.001)
        await asyncio.wait_for(serving, 10)

    run(tmp_path, Fast(100), "", watched, monkeypatch)
    rows = [one for one in socket.told if one["type"] == "rows"]
    seen = [one["rows"]["row"][0] for one in rows]
    assert seen == sorted(set(seen)) and sum(one["missed"] for one in rows) > 10
    for before, one in pairwise(rows):
        assert one["rows"]["row"][0] - before["rows"]["row"][0] - 1 == one["missed"]
    assert socket.code == 4401  # its token was no longer one
    assert not service.process.listeners


def test_silence_is_stale_and_alarms_are_told() -> None:
    condition = Condition({"log": math.inf}, stale=0.01)
    condition.came("log")
    assert not condition.told(failed=False)["stale"]
    time.sleep(0.02)
    assert condition.told(failed=False)["condition"] == "check"
    condition.came("log")
    condition.heard({"kind": "alarm", "reason": "a worn joint"})
    assert condition.told(failed=False)["why"] == "a worn joint"
    condition.heard({"kind": "alarm_cleared", "reason": ""})
    assert condition.told(failed=False)["condition"] == "good"


def test_a_twin_whose_disk_was_full_goes_on_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Also where it is full again when it is tried: then later; the log has it once."""
    record_robot(tmp_path / "run.csv", "--light", "--world", "w3", "--seconds", "20", "--seed", "3")
    file, full = site(tmp_path, "robot", speed=60), [True]
    keep, opening = room.AtWork.keep, room.AtWork.__init__

    def refused(self: Any, chunks: Any) -> Any:
        if full[0] and self.row > 3:
            raise StoreUnwritable("robot.db: database or disk is full")
        return keep(self, chunks)

    def not_opened(self: Any, *given: Any) -> None:
        if full[0] and opened:
            full[0] = len(opened) < 2
            opened.append(self)
            raise StoreUnwritable("robot.db: database or disk is full")
        opened.append(self)
        opening(self, *given)

    opened: list[Any] = []
    monkeypatch.setattr(room, "Backoff", lambda *_: Backoff(0.01, 0.1))
    monkeypatch.setattr(room.AtWork, "keep", refused)
    monkeypatch.setattr(room.AtWork, "__init__", not_opened)

    async def lives() -> dict[str, Any]:
        service = Service(file)
        await service.start()
        try:
            async with asyncio.timeout(25):
                while service.runners["robot"].status()["state"] != "ended":
                    await asyncio.sleep(0.05)
            return service.runners["robot"].status()
        finally:
            await service.stop()

    with caplog.at_level("INFO", "evertwin.service"):
        status = asyncio.run(lives())
    assert status["rows"] > 15 and len(opened) == 4
    lines = [record.message for record in caplog.records if record.name == "evertwin.service"]
    assert sum("quarantined: robot.db" in line for line in lines) == 1, lines
    with closing(SqliteStore(tmp_path / "store" / "robot.db", read_only=True)) as store:
        stamps = np.concatenate([chunk.t for chunk in store.samples("log", -1, 2**62)])
    said = len((tmp_path / "run.csv").read_text().splitlines()) - 1
    assert len(stamps) == len(np.unique(stamps)) == said


def test_a_model_that_hangs_is_put_into_quarantine_and_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record_robot(tmp_path / "run.csv", "--light", "--world", "w3", "--seconds", "5", "--seed", "2")
    monkeypatch.setattr(room, "HANGS", 0.2)
    back = threading.Event()

    async def during(one: Runner) -> None:
        one.lane.submit(back.wait)
        one.watch()
        assert one.state == "running"  # not yet
        await asyncio.sleep(0.5)
        one.watch()

    began = time.monotonic()
    one = run(tmp_path, Fast(20), "", during, monkeypatch)
    assert time.monotonic() - began < 20
    assert one.state == "quarantined" and "not come back for" in one.reason
    assert "threading.py" in one.reason and "(wait)" in one.reason
    back.set()
    one.lane._thread.join(10.0)  # its store is let go
