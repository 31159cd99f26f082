"""Plans and alarms: against brute force, in windows, within a budget."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import UsageError
from evertwin.prognosis import Indicator, Life, Limit, NotEnough, Onset
from evertwin.prognosis.alarms import Alarm, alarm_of, within_budget
from evertwin.prognosis.factors import without_factors
from evertwin.prognosis.life import LEVELS
from evertwin.prognosis.planning import Cost, Decision, Plan, PlanItem, cheapest, decided, grouped


def life(low: float = 80.0, high: float = 120.0) -> Life:
    return Life.of("h", LEVELS, low + (high - low) * LEVELS)


def test_the_date_is_the_cheapest_of_simulated_fates() -> None:
    """Cost over time in use, both simulated, at each date: the plan's date is the best of them."""
    rng = np.random.default_rng(0)
    known, cost, age = life(), Cost(10_000.0, 1_000.0), 300.0
    lives = known.sample(100_000, rng)
    dates = np.arange(40.0, 121.0, 2.0)
    rates = []
    for date in dates:
        failed = lives < date
        paid = np.where(failed, cost.failure, cost.maintenance).mean()
        rates.append(paid / (age + np.minimum(lives, date).mean()))
    item = cheapest("gearbox", known, age, cost)
    assert item.after == pytest.approx(dates[int(np.argmin(rates))], abs=3.0)
    assert item.rate == pytest.approx(min(rates), rel=0.02)


def test_where_failure_is_cheap_it_runs_to_failure() -> None:
    item = cheapest("lamp", life(), 10.0, Cost(100.0, 100.0))
    assert item.after == np.inf and item.rate == item.rate_to_failure
    assert item.rate == pytest.approx(100.0 / 110.0, rel=1e-3)
    assert Plan("p", "h", (item,)).to_csv().splitlines()[1].startswith("lamp,,h,,1,0.909")


@settings(max_examples=40, deadline=None)
@given(
    st.floats(1.0, 1e4), st.floats(1.0, 1e4), st.floats(0.0, 1e3), st.floats(1.0, 100.0),
    st.floats(1.0, 100.0),
)  # fmt: skip
def test_a_plan_never_costs_more_than_running_to_failure(
    failure: float, maintenance: float, age: float, low: float, more: float
) -> None:
    item = cheapest("x", life(low, low + more), age, Cost(failure, maintenance))
    assert 0.0 <= item.probability <= 1.0 and item.after >= 0.0
    assert item.rate <= item.rate_to_failure * (1 + 1e-9)


def test_components_share_windows() -> None:
    cost = Cost(10_000.0, 1_000.0)
    items = grouped({"a": (life(), 300.0, cost), "b": (life(82.0, 118.0), 300.0, cost)}, 40.0, 10.0)
    assert [one.window for one in items] == [1, 1] and items[0].after == 50.0
    assert Plan("p", "h", items).windows() == {1: ("a", "b")}


def test_decisions_move_dates_and_cells_are_safe() -> None:
    item = cheapest("=cmd()", life(), 300.0, Cost(10_000.0, 1_000.0))
    said = {"=cmd()": Decision("confirmed", "ok", 60.0)}
    moved = decided((item,), said)[0]
    assert moved.after == 60.0 and moved.decision.verdict == "confirmed"
    cells = next(iter(list(csv.DictReader(io.StringIO(Plan("p", "h", (moved,)).to_csv())))))
    assert cells["component"] == "'=cmd()" and cells["decision"] == "confirmed"
    assert decided((item,), {}) == (item,)
    with pytest.raises(UsageError, match="maintenance cost above 0"):
        cheapest("x", life(), 1.0, Cost(1.0, 0.0))


def test_a_life_without_end_needs_no_date() -> None:
    never = Life.of("h", [0.5], [np.inf])
    assert cheapest("x", never, 1.0, Cost(10.0, 1.0)) == PlanItem(
        "x", "h", np.inf, 0.0, 0.0, 0.0, np.inf
    )


def test_each_alarm_has_reason_interval_evidence_and_action() -> None:
    known = Indicator.of("friction", "Nm", Limit(3.0), [0, 1], [1.0, 2.0])
    due = alarm_of("gearbox", known, life(5.0, 15.0), ahead=10.0, risk=0.1)
    assert due is not None and due.kind == "failure_due"
    assert "probability 0.50" in due.reason and due.interval == pytest.approx((6.0, 14.0))
    assert due.evidence["limit"] == 3.0 and "plan maintenance" in due.action
    assert alarm_of("gearbox", known, life(), ahead=10.0, risk=0.1) is None
    passed = alarm_of("gearbox", known, Life.of("h", [0.5], [0.0]), ahead=10.0, risk=0.1)
    assert passed is not None and passed.kind == "limit_passed"
    begun = NotEnough("six values", onset=Onset(3.0, 4.0, "above", 1e-4))
    warned = alarm_of("gearbox", known, begun, ahead=10.0, risk=0.1)
    assert warned is not None and warned.kind == "wear_begun" and "six values" in warned.action
    assert alarm_of("gearbox", known, NotEnough("six values"), ahead=10.0, risk=0.1) is None


def test_the_budget_of_a_day_holds() -> None:
    due = [Alarm(name, "failure_due", "r", (None, None), "a") for name in "cab"]
    urgent = Alarm("d", "limit_passed", "r", (None, None), "a")
    first = within_budget([*due, urgent], (), (), now=10.0, budget=2.0)
    assert [a.component for a in first.raised] == ["d", "a"] and len(first.held) == 2
    later = within_budget(due, (("a", "failure_due"),), (10.0, 10.0), now=10.5, budget=2.0)
    assert not later.raised and later.today == 2 and len(later.held) == 2
    tomorrow = within_budget(due, (("a", "failure_due"),), (10.0, 10.0), now=11.5, budget=2.0)
    assert [a.component for a in tomorrow.raised] == ["b", "c"]
    weekly = within_budget(due, (), (10.0,), now=12.0, budget=0.2)
    assert not weekly.raised and within_budget(due, (), (10.0,), 15.5, 0.2).today == 1


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.3, 0.5), st.floats(0.0, 0.05), st.integers(0, 10_000))
def test_a_factor_is_recovered_beside_growth(share: float, slope: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t, w = np.arange(60.0), rng.uniform(0.0, 1.0, 60)
    y = 10.0 * (1.0 + slope * t) * (1.0 + share * w)
    found, shares = without_factors(t, y, {"w": w}, {"w": 0.0})
    assert shares["w"] == pytest.approx(share, abs=1e-3)
    assert found == pytest.approx(10.0 * (1.0 + slope * t), rel=2e-3)
