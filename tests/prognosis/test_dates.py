"""A history with dates is answered in dates: as they were written, or in the zone of the user."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.app.outlook.plan_text import label_text, plan_text
from evertwin.config import spec
from evertwin.errors import UsageError
from evertwin.prognosis.laws import Life, NotEnough
from evertwin.prognosis.laws.series.calendar import Calendar
from evertwin.prognosis.outlook.lives import Lives
from evertwin.prognosis.outlook.lone_series import Series, life_of_series
from evertwin.prognosis.outlook.upkeep import when_said

BEGUN = datetime(2025, 3, 1, 8, 0)


@pytest.fixture
def new_york(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "America/New_York")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def told(
    folder: Path, said: Callable[[datetime], str], head: str = "date",
    step: timedelta = timedelta(days=2), begun: datetime = BEGUN, *, today: bool = False,
) -> Lives:  # fmt: skip
    """A cell that falls by 0.005 a step from 1.9; it reaches 1.4 after 100 steps; 70 are known."""
    rng = np.random.default_rng(3)
    y = 1.9 - 0.005 * np.arange(70) + 0.001 * rng.standard_normal(70)
    rows = [f"{said(begun + k * step)},{value:.5f}" for k, value in enumerate(y)]
    file = folder / "cell.csv"
    file.write_text(f"{head},capacity\n" + "\n".join(rows) + "\n")
    return life_of_series(Series(file, 1.4, "below", from_today=today))


@pytest.mark.usefixtures("new_york")
def test_dates_without_a_zone_are_told_as_they_were_written(tmp_path: Path) -> None:
    found = told(tmp_path, lambda t: t.strftime("%Y-%m-%d"))
    text = str(found)
    life = found.components["capacity"].life
    assert isinstance(life, Life) and found.clock == "d"
    dates = life.document()["dates"]
    assert isinstance(dates, dict) and dates["now"] == "2025-07-17T00:00:00"
    end = datetime.fromisoformat(str(dates["median"]))
    assert abs((end - BEGUN).days - 200) < 8 and f"ends on {end:%Y-%m-%d}" in text
    assert "lives are counted from 2025-07-17" in text and "20286" not in text
    assert found.to_dict()["now_date"] == "2025-07-17T00:00:00"
    assert "these dates lie in the past: counted from the newest row" in text
    assert dates["past"] == ["not_before", "median", "interval80", "interval95"]


@pytest.mark.usefixtures("new_york")
@pytest.mark.parametrize(
    ("said", "head"),
    [
        (lambda t: t.replace(tzinfo=UTC).isoformat(), "time"),
        (lambda t: t.replace(tzinfo=UTC).astimezone(timezone(timedelta(hours=9))).isoformat(),
         "measured"),
        (lambda t: f"{t.replace(tzinfo=UTC).timestamp():.0f}", "t"),
        (lambda t: f"{t.replace(tzinfo=UTC).timestamp() * 1e3:.0f}", "timestamp"),
    ],
)  # fmt: skip
def test_moments_are_told_in_the_zone_of_the_user(
    tmp_path: Path, said: Callable[[datetime], str], head: str
) -> None:
    found = told(tmp_path, said, head, timedelta(minutes=20))
    assert found.clock == "h" and found.to_dict()["now_date"] == "2025-03-02T02:00:00-05:00"
    assert "counted from 2025-03-02 02:00 EST" in str(found)
    assert ("milliseconds" in str(found)) == (head == "timestamp")


def test_summer_time_moves_no_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    hours = Calendar("h", zoned=True)
    before = hours.at("2025-03-30T01:59+01:00")
    assert hours.said(before) == "2025-03-30 01:59 CET"
    assert hours.said(before + 1.0) == "2025-03-30 03:59 CEST"
    monkeypatch.undo()
    time.tzset()
    assert hours.iso(1e30) is None and hours.said(1e30) == "without end"


def test_a_life_is_counted_from_today_where_that_is_asked(tmp_path: Path) -> None:
    begun = datetime.now() - timedelta(days=150)  # it would end in 50 days, newest row 12 days old
    life = told(tmp_path, lambda t: t.isoformat(), begun=begun, today=True)
    one = life.components["capacity"]
    assert isinstance(one.life, Life) and one.life.interval80[0] < 50.0 < one.life.interval80[1]
    assert "its newest value is 12 d old" in str(life) and "days ago" not in str(life)
    assert one.life.gone == [] and "in the past" not in str(life)
    old = told(tmp_path, lambda t: t.isoformat(), today=True).components["capacity"].life
    assert isinstance(old, NotEnough) and "a newer value than that of 2025-07-17" in old.needs


def test_a_clock_without_dates_has_no_today(tmp_path: Path) -> None:
    (tmp_path / "h.csv").write_text("run,x\n" + "\n".join(f"{k},{k}" for k in range(9)))
    with pytest.raises(UsageError, match="--today: expected rows with dates"):
        life_of_series(Series(tmp_path / "h.csv", 20.0, from_today=True))


def test_a_limit_that_was_passed_is_dated(tmp_path: Path) -> None:
    rows = [f"2025-01-{1 + k:02d},{1 + 0.1 * k}" for k in range(20)]
    (tmp_path / "h.csv").write_text("date,x\n" + "\n".join(rows))
    found = life_of_series(Series(tmp_path / "h.csv", 2.45))
    assert "the limit was passed at 2025-01-16" in str(found)
    dates = found.components["x"].life.document()["dates"]
    assert isinstance(dates, dict) and dates["passed_at"] == "2025-01-16T00:00:00"


def test_what_is_said_to_a_plan_may_be_a_date(tmp_path: Path) -> None:
    rows = [f"2025-01-{1 + k:02d},{1 + 0.1 * k + 0.01 * (-1) ** k:.3f}" for k in range(20)]
    (tmp_path / "h.csv").write_text("date,wear\n" + "\n".join(rows))
    costs = {"wear": spec.CostSpec(failure=8000.0, maintenance=900.0)}
    twin = Twin(TwinSpec(
        "cart", spec.ModelSpec("robot1d"), folder=str(tmp_path),
        indicator=(spec.IndicatorSpec("wear", file="h.csv", limit=4.0),),
        prognosis=spec.PrognosisSpec(clock="d", components=costs),
    ))  # fmt: skip
    prospect = twin.prospect()
    after = when_said(prospect, "2025-01-26", itself=False)
    assert after == 6.0 and when_said(prospect, "6", itself=False) == 6.0
    twin.decide("wear", "confirmed", "the crane is there", after)
    (label,) = twin.prospect().history.labels
    assert label_text(label).startswith("at 2025-01-20 00:00: wear: confirmed for 2025-01-26 00:00")
    planned = twin.plan()
    assert planned.date(planned.items[0].after) == "2025-01-26"
    assert planned.to_csv().splitlines()[1].endswith(",2025-01-26")
    assert "wear: on 2025-01-26, after 6 d" in plan_text(planned)
    items: Any = planned.to_dict()["items"]
    assert items[0]["date"] == "2025-01-26" and items[0]["past"] is True
    later = replace(planned, now=Calendar("d", zoned=False).today())
    assert not later.gone(0.0) and not replace(planned, calendar=None).gone(-1.0)
    for wrong in ("soon", "26.01.2025"):
        with pytest.raises(UsageError, match=f"or a date as in 2027-03-01, got '{wrong}'"):
            when_said(prospect, wrong, itself=True)
    late = re.escape("2025-01-01 (first value) to 2025-02-08, got 2025-03-01")
    with pytest.raises(UsageError, match=late):
        twin.maintained("wear", "new", at=when_said(prospect, "2025-03-01", itself=True))
