"""What the operator says and does, and alarms, through the log of a twin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config import read, spec
from evertwin.errors import ConfigError, UsageError
from evertwin.fold import Event
from evertwin.prognosis.laws import Life, NotEnough
from evertwin.prognosis.laws.plans.alarms import Alarm
from evertwin.prognosis.outlook.alarm_log import alarmed, time_ahead
from evertwin.prognosis.outlook.lives import Lives
from evertwin.store import Batch, Estimate

from .test_lives_of_a_twin import GEARBOX, cart

COSTS = {"gearbox": spec.CostSpec(2500.0, 900.0)}


def worn(twin: Twin, runs: int = 14, start: int = 0, stamp: int = 0) -> None:
    """Fits as the twin keeps them: the gain falls by 1 % a run of 20 s; runs begin at ``stamp``."""
    second = 10**9
    for run in range(start, start + runs):
        value = 1.0 - 0.01 * run + 2e-4 * (-1) ** run
        when = stamp * (run + 1) + 15 * second
        counts = (0, 15 * second, run, 20 * second * run)
        twin.store.commit(Batch([Estimate(150, when, 0, "gain", value, value - 1e-3, value + 1e-3,
                                    "identifiable", *counts)]))  # fmt: skip


def planned(**more: Any) -> Twin:
    twin = cart(prognosis=spec.PrognosisSpec(components=COSTS, windows=5.0, **more))
    worn(twin)
    return twin


def test_a_plan_keeps_what_the_operator_says() -> None:
    twin = planned()
    item = twin.plan().items[0]
    life = twin.life().components["gearbox"].life
    assert isinstance(life, Life) and item.after == 10.0 and item.window == 2
    event = twin.decide("gearbox", "postponed", "spare part late", after=17.0)
    assert event.kind == "postponed" and event.evidence["now"] == 14.0
    assert event.evidence["at"] == 31.0 and event.time == 15 * 10**9
    moved = twin.plan().items[0]
    assert moved.after == 20.0 and moved.window == 4
    assert moved.probability == pytest.approx(life.probability_before(20.0), abs=2e-3)
    assert moved.probability > 0.5 and moved.rate > 1.15 * item.rate
    worn(twin, 2, start=14)
    assert twin.plan().items[0].after == 15.0, "17 runs ahead, two runs ago"
    twin.decide("gearbox", "declined", "is rebuilt anyway")
    assert twin.plan().items[0].decision.verdict == "declined"
    twin.maintained("gearbox", "replaced")
    assert not twin.plan().items and "gearbox" in twin.plan().without


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (("declined", " "), "expected a reason"),
        (("confirmed", "x", float("nan")), "0 or more"),
        (("confirmed", "x", float("inf")), "0 or more"),
        (("confirmed", "x", -5.0), "0 or more on the plan's clock \\(run\\), got -5"),
        (("postponed", "x"), "until when"),
        (("postponed", "x", 3.0), "planned after 10 run from now: expected a later time, got 3"),
        (("declined", "x", 3.0), "expected no time"),
        (("withdrawn", "x"), "nothing was said or done to 'gearbox'; .* none"),
    ],
)
def test_what_cannot_be_said_is_refused(said: tuple[Any, ...], message: str) -> None:
    twin = planned()
    before = len(twin.events)
    with pytest.raises(UsageError, match=message):
        twin.decide("gearbox", *said)
    assert len(twin.events) == before
    with pytest.raises(UsageError, match="no planned date of 'motor'"):
        twin.decide("motor", "declined", "why")


@pytest.mark.parametrize("at", [float("nan"), 1e9, -3.0, 0.5, 15.5])
def test_maintenance_is_done_between_the_first_value_and_the_next(at: float) -> None:
    twin = planned()
    with pytest.raises(UsageError, match="1 \\(first value\\) to 15 run"):
        twin.maintained("gearbox", "new", at=at)
    with pytest.raises(UsageError, match="no component 'motor'"):
        twin.maintained("motor", "replaced")
    twin.maintained("gearbox", "new", at=5.0)
    assert len(twin.life().components["gearbox"].indicator.since_replaced().value) == 10


def test_the_newest_word_is_withdrawn_and_stays_in_the_log() -> None:
    twin = planned()
    twin.decide("gearbox", "postponed", "late", after=17.0)
    twin.maintained("gearbox", "by mistake")
    assert not twin.plan().items
    twin.decide("gearbox", "withdrawn", "wrong machine")
    assert twin.plan().items[0].after == 20.0, "the word before holds again"
    twin.decide("gearbox", "withdrawn", "part came")
    assert twin.plan().items[0].after == 10.0
    found = twin.prospect().history.labels
    assert [(one.verdict, one.state) for one in found] == [
        ("postponed", "withdrawn"), ("replaced", "withdrawn")
    ]  # fmt: skip
    with pytest.raises(UsageError, match="nothing was said or done"):
        twin.decide("gearbox", "withdrawn", "again")


def test_labels_that_cannot_be_read_are_told_and_can_be_withdrawn() -> None:
    twin = planned()
    for kind, more in (("confirmed", {}), ("maintained", {"kind": "replaced"})):
        event = Event(0, 0, kind, "gearbox", "x", {"clock": "run", "at": float("nan"), **more})
        twin.store.commit(Batch([event]))
    hours = {"clock": "h", "at": 3.0}
    twin.store.commit(Batch([Event(0, 0, "confirmed", "gearbox", "y", hours)]))
    plan = twin.plan()
    assert plan.items[0].after == 10.0 and len(plan.notes) == 3
    assert "confirmed (x) was left out, its time is no number" in plan.notes[0]
    assert "kept on the clock h, not run" in plan.notes[2]
    assert set(plan.notes) <= set(twin.life().notes)
    for _ in range(3):
        twin.decide("gearbox", "withdrawn", "written by mistake")
    assert not twin.plan().notes


def test_alarms_are_raised_once_and_within_the_budget() -> None:
    rules = (GEARBOX, replace(GEARBOX, name="gain2", component="coupling"))
    twin = cart(*rules, prognosis=spec.PrognosisSpec(ahead="30 run"))
    worn(twin)
    first = twin.life()
    assert len(first.alarms) == 1 and len(first.held) == 1 and first.alarms_today == 1
    held = first.held[0]
    assert f"{held.component}: failure due: {held.reason}" in str(first)
    again = twin.life()
    raised = [e for e in twin.events if e.kind == "alarm"]
    assert len(raised) == 1 and again.alarms_today == 1 and len(again.held) == 1
    assert raised[0].evidence["action"] == first.alarms[0].action
    worn(twin, 1, start=14)
    assert not twin.life().held, "recordings that begin at zero: each run is a day"
    assert [e.signal for e in twin.events if e.kind == "alarm"] == ["coupling", "gearbox"]


def test_a_lead_is_a_time_or_a_share_of_the_whole_life() -> None:
    found = cart()
    worn(found)
    one = found.life().components["gearbox"]
    assert isinstance(one.life, Life)
    whole = one.age + one.life.median
    share = time_ahead(spec.PrognosisSpec(ahead="25 %"), one)
    assert share == pytest.approx(0.25 * whole)
    assert time_ahead(spec.PrognosisSpec(ahead="30 runs"), one) == 30.0
    assert time_ahead(spec.PrognosisSpec(clock="h", ahead="2 d"), one) == 48.0
    assert time_ahead(spec.PrognosisSpec(), one) is None
    assert time_ahead(spec.PrognosisSpec(ahead="25 %"), replace(one, life=NotEnough("x"))) is None


@pytest.mark.parametrize("written", ["20", 20, "3 h", "20 cycle", "100 %", "-5 run", "soon"])
def test_a_lead_that_may_be_either_is_asked_back(tmp_path: Path, written: object) -> None:
    shown = f'"{written}"' if isinstance(written, str) else written
    file = tmp_path / "w.toml"
    file.write_text(f'schema = 1\nname = "w"\nmodel.kind = "robot1d"\nprognosis.ahead = {shown}\n')
    with pytest.raises(ConfigError, match=r"w\.toml:4: .*ahead: expected"):
        read(file)


def test_stamps_tell_the_day_where_they_rise() -> None:
    rules = (GEARBOX, replace(GEARBOX, name="gain2", component="coupling"))
    twin = cart(*rules, prognosis=spec.PrognosisSpec(ahead="30 run"))
    hour = 3600 * 10**9
    worn(twin, 14, stamp=hour)
    assert len(twin.life().held) == 1
    worn(twin, 4, start=14, stamp=hour)
    assert len(twin.life().held) == 1, "the same day"
    worn(twin, 1, start=40, stamp=hour)
    assert not twin.life().held, "the next day"


def test_what_cleared_and_returns_is_raised_again() -> None:
    rule = spec.PrognosisSpec(ahead="30 run", alarms=100.0)
    twin = cart(prognosis=rule)
    worn(twin)
    due = twin.life()
    gearbox = due.components["gearbox"]

    def look(probability: float) -> list[str]:
        """A look at which a failure within the time ahead has this probability."""
        level = np.array([0.0, probability, 1.0]) if 0.0 < probability < 1.0 else np.array([0.5])
        ends = np.array([1.0, 30.0, 100.0]) if len(level) == 3 else np.array([1e3])
        life = Life.of("run", level, ends)
        one = replace(gearbox, life=life)
        told = () if probability <= rule.risk else due.alarms
        lives = Lives("cart", "run", {"gearbox": one}, None, told)
        _, events = alarmed(twin.store, lives, rule)
        for event in events:
            twin.store.commit(Batch([event]))
        return [event.kind for event in events]

    assert look(0.3) == [], "raised already"
    assert look(0.07) == [], "still above half of the accepted risk"
    assert look(0.3) == []
    assert look(0.02) == ["alarm_cleared"] and look(0.02) == []
    assert look(0.3) == ["alarm"] and look(0.3) == []


def test_a_passed_limit_is_told_over_the_budget() -> None:
    twin = cart(prognosis=spec.PrognosisSpec(alarms=0.1))
    worn(twin)
    lives = twin.life()
    passed = Alarm("gearbox", "limit_passed", "it is", (0.0, 0.0), "maintain gearbox now")
    shown, events = alarmed(twin.store, replace(lives, alarms=(passed,)), twin.prospect().rule)
    assert shown.alarms == (passed,) and not shown.held and len(events) == 1
