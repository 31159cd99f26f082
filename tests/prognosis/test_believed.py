"""What tells of wear: versions that went live and fits that nothing speaks against."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import (
    IndicatorSpec,
    ModelSpec,
    ParameterSpec,
    PredictionSpec,
    StoreSpec,
)
from evertwin.fold import Answer, Event
from evertwin.ledger import Label
from evertwin.models import Parameters
from evertwin.models.form import Form, Version
from evertwin.prognosis.histories.believed import believed
from evertwin.prognosis.laws.plans.alarms import alarm_of
from evertwin.prognosis.laws.series.indicator import Indicator, Limit
from evertwin.prognosis.laws.series.life import LEVELS, Life
from evertwin.prognosis.outlook.alarm_log import called_false
from evertwin.store import Batch, Estimate, SqliteStore
from planted.draws import first_of

SLOPE, LIMIT = 2.6, 3.4
ALIKE = "a sensor of y that is off by +40 % at row 90 would look the same"


def line(x: Any, u: Any, dt: float, p: Any) -> Any:
    return x, [p[0] + p[1] * u[0]]


def twin() -> Twin:
    model = FunctionModel(
        line, Layout.of(u="1"), Layout.of(y="W"),
        parameters=Parameters.of(c0=(1.0, "W"), c1=(SLOPE, "W")),
    )  # fmt: skip
    free = {name: ParameterSpec(editable=True) for name in ("c0", "c1")}
    spec = TwinSpec(
        "belt", ModelSpec("given", {}, free), prediction=PredictionSpec(horizon=0.1),
        anomaly=AnomalySpec(requirement=0.3, relative=False, unit="W"),
        indicator=(IndicatorSpec("slope", component="belt", parameter="c1", limit=LIMIT),),
        store=StoreSpec(path=":memory:"),
    )  # fmt: skip
    return Twin(spec, model)


def rows(seed: int, *, sensor: tuple[int, int, float] = (0, 0, 1.0), worn: float = 1.0) -> dict:
    """A power by speed; its meter reads some rows ``sensor[2]`` times as large, or the slope grows
    at row 3000 for good."""
    rng, n = np.random.default_rng(seed), 9000
    at = np.arange(n)
    u = 1.5 + np.sin(at * 0.07 + rng.uniform(0, 6)) + 0.4 * np.sin(at * 0.031)
    y = 1.4 + SLOPE * np.where(at >= 3000, worn, 1.0) * u
    first, last, factor = sensor
    y[first:last] *= factor
    return {"t": at * 0.01, "u": u, "y": y + 0.05 * rng.normal(size=n)}


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("factor", [1.5, 0.6])
def test_what_a_sensor_said_is_no_wear(seed: int, factor: float) -> None:
    with twin() as belt:
        belt.run(rows(seed, sensor=(3000, 5000, factor)))
        lives = belt.life()
        known = lives.components["belt"].indicator.value
        assert belt.champion.values[1] == pytest.approx(SLOPE, rel=0.05)
        assert len(known) and np.abs(known / SLOPE - 1.0).max() < 0.05
        assert not lives.alarms
        told = [one for one in believed(belt.store) if one.against]
    assert not told or any("does not count" in note for note in lives.notes)


@pytest.mark.parametrize("seed", [1])
def test_wear_of_the_same_size_is_told(seed: int) -> None:
    with twin() as belt:
        belt.run(rows(seed, worn=1.5))
        known = belt.life().components["belt"].indicator
        first = next(e.row for e in belt.events if e.kind == "tuned" and e.row > 3000)
    assert known.value[-1] == pytest.approx(1.5 * SLOPE, rel=0.05)
    assert first < 3400


@first_of("seed", [6, 11])
def test_wear_is_told_after_an_input_was_in_another_unit(seed: int) -> None:
    rng, at = np.random.default_rng(seed), np.arange(9000)
    slope, c0 = rng.uniform(1.0, 20.0), rng.uniform(-1.0, 3.0)
    noise = rng.uniform(0.01, 0.04) * slope
    mean, pace, begin, size = (
        rng.uniform(*x) for x in ((0.2, 1.6), (0.03, 0.12), (0, 6), (0.5, 1))
    )
    u = mean + size * np.sin(at * pace + begin) + 0.4 * np.sin(0.031 * at)
    y = c0 + slope * np.where(at >= 6500, 1.3, 1.0) * u + noise * rng.normal(size=9000)
    factor, until = rng.choice([25.4, 1 / 25.4, 39.37, 1 / 39.37]), int(rng.integers(3500, 5500))
    read = np.where((at >= 3000) & (at < until), factor * u, u)
    whole = twin().spec
    spec = replace(
        whole, anomaly=replace(whole.anomaly, requirement=6 * noise),
        indicator=(replace(whole.indicator[0], limit=1.5 * slope),),
    )  # fmt: skip
    model = FunctionModel(
        line, Layout.of(u="m/s"), Layout.of(y="W"),
        parameters=Parameters.of(c0=(0.8 * c0, "W"), c1=(0.95 * slope, "W s/m")),
    )  # fmt: skip
    with Twin(spec, model) as belt:
        belt.run({"t": at * 0.01, "u": read, "y": y})
        known = belt.life().components["belt"].indicator.value
    assert known[-1] == pytest.approx(1.3 * slope, rel=0.05)


class Log:
    """A store that is written by hand: one run."""

    def __init__(self) -> None:
        self.store, self.number = SqliteStore(":memory:"), 0
        self.say(Event(0, 0, "started", "", "run 1"))

    def say(self, *records: object) -> None:
        row = max(getattr(one, "row", 0) for one in records)
        self.store.commit(Batch(list(records), run=1, row=row))  # type: ignore[arg-type]

    def fit(self, row: int, value: float, *, caveat: str = "", against: str = "") -> int:
        """A fit with its candidate; the number of that."""
        self.number += 1
        reason = "; ".join(filter(None, ("tuned c", caveat)))
        version = Version(self.number, Form(), ("c",), (value,), 0, reason, row)
        said = [{"kind": "normal", "signal": "", "reason": reason, "evidence": {}}]
        fit = {"parameters": {"c": {"value": value}}, "outputs": {}}
        content = {"events": said, "fit": fit, "candidate": {"reason": reason}, "row": row}
        one = Estimate(row, 10 * row, 0, "c", value, value - 1.0, value + 1.0, elapsed=row)
        answer = Answer(self.number, 0, content | ({"against": against} if against else {}))
        self.say(version, answer, one, Event(row, 10 * row, "normal", "", reason))
        return self.number

    def switch(self, row: int, kind: str, number: int, **evidence: object) -> None:
        self.say(Event(row, row, kind, "", f"to {number}", {"version": number, **evidence}))

    @property
    def values(self) -> list[float]:
        return [one.estimates[0].value for one in believed(self.store) if one.counts]


def test_numbers_in_doubt_wait_until_their_version_is_live() -> None:
    log = Log()
    log.fit(100, 10.0)
    number = log.fit(200, 15.0, against="after tuning y still depends on u")
    assert log.values == [10.0]
    log.switch(300, "promoted", number)
    assert log.values == [10.0, 15.0]


def test_a_trial_that_is_lost_takes_its_numbers_along() -> None:
    log = Log()
    numbers = [log.fit(100, 10.0), log.fit(200, 11.0)]
    for number, gain in zip(numbers, (0.04, -0.6), strict=True):
        why = {"version": number, "gain": gain}
        log.say(Event(300, 300, "rejected", "", "is not better", why))
    assert log.values == [10.0], "to gain little is not to be wrong"


@pytest.mark.parametrize(
    ("kind", "evidence", "left"),
    [("rolled_back", {"since": 900}, [10.0]), ("promoted", {}, [10.0]),
     ("rolled_back", {}, [10.0])],
)  # fmt: skip
def test_what_went_back_by_itself_was_the_sensor_that_looked_the_same(
    kind: str, evidence: dict[str, object], left: list[float]
) -> None:
    log = Log()
    first = log.fit(100, 10.0)
    log.switch(150, "promoted", first)
    worn = log.fit(200, 15.0, caveat=ALIKE)
    assert log.values == [10.0]
    log.switch(300, "promoted", worn)
    told = believed(log.store)
    assert log.values == [10.0, 15.0] and told[-1].alike == (ALIKE,)
    log.fit(400, 15.1)
    assert believed(log.store)[-1].alike == (ALIKE,), "until somebody says which it is"
    log.switch(1000, kind, first, **evidence)
    assert log.values[:1] == left and 15.0 not in log.values


def test_what_was_repaired_had_been_worn() -> None:
    log = Log()
    first = log.fit(100, 10.0)
    log.switch(150, "promoted", first)
    log.switch(300, "promoted", log.fit(200, 15.0, caveat=ALIKE))
    log.say(Event(350, 350, "maintained", "belt", "greased", {"kind": "adjusted", "at": 1.0}))
    log.switch(400, "rolled_back", first, since=360)
    assert log.values == [10.0, 15.0, 10.0], "what is live again tells what the machine is now"


def test_rows_of_a_sensor_leave_and_come_back_where_that_is_refuted() -> None:
    log = Log()
    log.fit(100, 10.0)
    log.fit(400, 15.0)
    log.say(Event(500, 500, "abnormal", "y", "y looks off", {"number": 1.0, "since": 300}))
    assert log.values == [10.0]
    assert believed(log.store)[-1].by == "y"
    log.say(Event(700, 700, "normal", "y", "in doubt no longer", {"doubt": "y"}))
    assert log.values == [10.0, 15.0]


def test_a_named_cause_ends_the_doubt() -> None:
    log = Log()
    log.switch(300, "promoted", log.fit(200, 15.0, caveat=ALIKE))
    log.say(Event(400, 400, "labelled", "", "friction", {"verdict": "cause", "event": 1}))
    assert log.values == [15.0] and believed(log.store)[-1].alike == ()


def test_what_moves_on_by_far_more_than_was_in_doubt_is_the_machine() -> None:
    log = Log()
    log.switch(150, "promoted", log.fit(100, 10.0))
    log.switch(300, "promoted", log.fit(200, 11.0, caveat=ALIKE))
    for row, value in ((400, 11.2), (500, 15.0)):
        log.fit(row, value)
    newest = believed(log.store)[-2:]
    assert [one.beyond for one in newest] == [set(), {"c"}]


def test_a_false_alarm_ends_what_it_was_raised_on() -> None:
    with twin() as belt:
        estimate = Estimate(90, 90, 0, "c1", LIMIT + 0.2, 3.5, 3.7)
        grown = [
            replace(estimate, row=k, time=k, elapsed=k * 10**9, value=2.6 + 0.15 * k, task=k)
            for k in range(7)
        ]
        belt.store.commit(Batch(grown))
        due = belt.life()
        assert [one.kind for one in due.alarms] == ["limit_passed"]
        number = next(
            entry.number for entry in belt.store.entries(kinds=("event",))
            if belt.store.record(entry).kind == "alarm"  # type: ignore[union-attr]
        )  # fmt: skip
        belt.label(Label(number, "false alarm", "the sensor was wrong"))
        assert called_false(belt.store, "belt") == (pytest.approx(3.5),)
        again = belt.life()
        assert not again.alarms
        assert 3.5 not in again.components["belt"].indicator.value
        assert len([e for e in belt.events if e.kind == "alarm"]) == 1


@pytest.mark.parametrize(("kind", "over"), [("alarm", True), ("normal", True), ("abnormal", False)])
def test_who_calls_what_was_learned_true_says_that_it_is_the_machine(kind: str, over: bool) -> None:
    log = Log()
    log.switch(300, "promoted", log.fit(200, 15.0, caveat=ALIKE))
    assert believed(log.store)[-1].alike == (ALIKE,)
    log.say(Event(400, 400, "labelled", "", "", {"verdict": "true", "event": 1, "kind": kind}))
    assert believed(log.store)[-1].alike == (() if over else (ALIKE,))


def test_a_limit_that_is_passed_is_raised_with_what_would_look_the_same() -> None:
    """Somebody has to look either way; what is ahead waits until it is said which it is."""
    belt = Indicator.of("slope", "W", Limit(3.0), [0, 1], [1.0, 3.5])
    over, ahead = Life.of("h", LEVELS, 0.0 * LEVELS), Life.of("h", LEVELS, LEVELS)
    plain, doubted = (alarm_of("belt", belt, over, 5.0, 0.1, alike) for alike in ((), (ALIKE,)))
    assert plain and doubted and doubted.kind == plain.kind == "limit_passed"
    assert doubted.reason == f"{plain.reason}; {ALIKE}" and "sensor" in doubted.action
    assert doubted.evidence == plain.evidence | {"doubt": [ALIKE]}
    assert alarm_of("belt", belt, ahead, 5.0, 0.1) and not alarm_of(
        "belt", belt, ahead, 5.0, 0.1, (ALIKE,)
    )
