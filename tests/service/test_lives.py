"""Lives that a running twin tells of by itself."""

from __future__ import annotations

import asyncio
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from evertwin.fold import Event
from evertwin.service.health.condition import Condition
from evertwin.service.site.site_plan import read_site
from evertwin.service.twin import life_watch as lives
from evertwin.service.twin.life_watch import lived, tell_lives
from evertwin.service.twin.live_twin import AtWork
from evertwin.service.twin.process import Process
from evertwin.service.twin.questions import ROWS
from evertwin.service.twin.runner import Runner
from evertwin.store import Batch, Estimate
from tests.service.test_condition import SITE, TWIN, Beside

WORN = """
[store]
path = "store/cart.db"
[[indicator]]
name = "gain"
component = "gearbox"
parameter = "gain"
limit = 0.7
direction = "below"
[prognosis]
clock = "h"
"""


def placed(folder: Path) -> Any:
    (folder / "site.toml").write_text(SITE)
    (folder / "cart.toml").write_text(TWIN + WORN)
    (folder / "store").mkdir()
    return read_site(folder / "site.toml").twins[0]


def test_a_limit_that_is_passed_is_an_alarm_of_the_log_until_the_part_is_new(
    tmp_path: Path,
) -> None:
    plan = placed(tmp_path)
    with closing(AtWork(plan, tmp_path / "store")) as work:
        cart = Beside(work, 1)
        assert work.going.outcome[0] == "No rows yet."
        assert cart.drive(300, 1.0)["condition"] == "good"
        before = work.estimates
        worn = [
            Estimate(k, k * 3600 * 10**9, 1, "gain", v, v - 0.01, v + 0.01, "identifiable", 0, k)
            for k, v in enumerate((0.96, 0.91, 0.85, 0.81, 0.75, 0.69))
        ]
        work.twin._ledger.commit(Batch(worn))
        work._news()
        assert work.estimates == before + 6
        found = lived(work.spec, work.newest_blocks(ROWS))
        assert found["life"]["components"]["gearbox"]["life"]["median"] == 0.0
        for _, event in work.said(found["events"]).events:
            cart.condition.heard(event)
        told = cart.condition.told(failed=False)
        assert told["condition"] == "maintenance_required" and "limit" in told["why"]
        assert lived(work.spec, work.newest_blocks(ROWS))["events"] == ()  # it is told once
        new = {"kind": "maintained", "signal": "gearbox", "reason": "a new one"}
        cart.condition.heard({"number": 99, "row": 300, "time": 9, "evidence": {}, **new})
        assert cart.condition.told(failed=False)["condition"] == "good"
    assert isinstance(found["events"][0], Event)


def test_one_of_two_worn_parts_stays_an_alarm_when_the_other_is_new() -> None:
    condition = Condition({}, asked=True)
    for number, part in enumerate(("gearbox", "belt")):
        about = {"kind": "alarm", "signal": part, "reason": f"{part} is worn", "row": 0, "time": 1}
        condition.heard({"number": number, "evidence": {"kind": "limit_passed"}, **about})
    assert condition.told(failed=False)["why"] == "gearbox is worn; belt is worn"
    about = {"kind": "alarm_cleared", "signal": "belt", "reason": "", "row": 0, "time": 2}
    condition.heard({"number": 3, "evidence": {"kind": "limit_passed"}, **about})
    assert condition.told(failed=False)["why"] == "gearbox is worn"


def test_an_alarm_says_what_lives_say_until_it_is_called_false() -> None:
    condition = Condition({}, asked=True)
    about = {"kind": "alarm", "signal": "belt", "reason": "is 116 N", "row": 0, "time": 1}
    condition.heard({"number": 4, "evidence": {"kind": "failure_due"}, **about})
    condition.lived([{"component": "belt", "kind": "failure_due", "reason": "is 174 N"}])
    condition.lived([{"component": "gear", "kind": "failure_due", "reason": "is 3 N"}])
    assert condition.told(failed=False)["why"] == "is 174 N"
    said = {"event": 4, "verdict": "false alarm"}
    condition.heard({"number": 5, "kind": "labelled", "evidence": said, "row": 0, "time": 2})
    assert condition.told(failed=False)["condition"] == "good"


def test_lives_are_told_after_each_new_value(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lives, "AGAIN", 0.01)

    async def beside(runner: Any, job: Any) -> dict[str, Any]:
        return {"events": (), "life": {"asked": runner.work.estimates, "alarms": ()}}

    monkeypatch.setattr(lives, "beside", beside)

    async def heard() -> list[int]:
        runner, found = Runner(placed(tmp_path), tmp_path / "store", Process()), []
        monkeypatch.setattr(runner, "_out", lambda kind, said: found.append(said["asked"]))
        runner.work = type("Work", (), {"estimates": 0})()  # type: ignore[assignment]
        task = asyncio.create_task(tell_lives(runner))
        for count in (0, 2, 2, 3):
            assert runner.work is not None
            runner.work.estimates = count
            await asyncio.sleep(0.1)
        for number, kind in ((7, "suspected"), (8, "labelled"), (9, "rolled_back")):
            runner.events.append((number, {"kind": kind}))
            await asyncio.sleep(0.1)
        task.cancel()
        return found

    assert asyncio.run(heard()) == [2, 3, 3, 3], "also where what counts may have changed"
