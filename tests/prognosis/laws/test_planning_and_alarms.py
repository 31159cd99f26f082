"""Plans and alarms: against brute force, in windows, within a budget."""

from __future__ import annotations

import csv
import io
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import UsageError
from evertwin.prognosis.laws import Indicator, Life, Limit, NotEnough, Onset
from evertwin.prognosis.laws.plans.alarms import Alarm, alarm_of, has_cleared, within_budget
from evertwin.prognosis.laws.plans.planning import (
    Decision,
    Part,
    Plan,
    PlanItem,
    Stop,
    planned,
)
from evertwin.prognosis.laws.plans.renewal import Cost, Renewal, Windows
from evertwin.prognosis.laws.series.indicator import without_factors
from evertwin.prognosis.laws.series.life import LEVELS, interpolated


def cheapest(
    name: str, known: Life, age: float, cost: Cost, windows: Windows | None = None
) -> PlanItem:
    """The plan of one component."""
    return planned({name: Part(known, age, cost)}, windows)[0][0]


def after(parts: dict[str, Part], said: dict[str, Decision]) -> dict[str, Part]:
    """The parts with what the operator said."""
    return {n: p._replace(decision=said.get(n, p.decision)) for n, p in parts.items()}


def life(low: float = 80.0, high: float = 120.0) -> Life:
    return Life.of("h", LEVELS, low + (high - low) * LEVELS)


def test_the_date_is_the_cheapest_of_simulated_fates() -> None:
    """Cost over time in use, both simulated, at each date: the plan's date is the best of them."""
    rng = np.random.default_rng(0)
    known, cost, age = life(), Cost(10_000.0, 1_000.0), 300.0
    lives = interpolated(rng.random(100_000), LEVELS, known.remaining)
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
    parts = {"a": Part(life(), 300.0, cost), "b": Part(life(82.0, 118.0), 300.0, cost)}
    items, stops = planned(parts, Windows(10.0, 40.0))
    assert [one.window for one in items] == [1, 1] and items[0].after == 50.0
    assert stops == (Stop(50.0, ("a", "b"), 1, 0.0),)


@pytest.mark.parametrize("every", [0.001, 0.7, 1.0, 24.0])
def test_windows_are_searched_to_the_end_of_life(every: float) -> None:
    """However many windows there are until then: the free date's neighbour is never missed."""
    known, cost = life(6_000.0, 6_400.0), Cost(9_000.0, 900.0)
    free = cheapest("gear", known, 100.0, cost)
    item = cheapest("gear", known, 100.0, cost, Windows(0.0, every))
    near = Windows(0.0, every).near(np.array([free.after]))
    rates = Renewal.of(known, 100.0, cost).rate(near)
    assert item.after == near[int(np.argmin(rates))] and item.rate >= free.rate
    assert item.window == round(item.after / every)


@settings(max_examples=40, deadline=None)
@given(
    st.floats(1.0, 1e6), st.floats(1.0, 1e4), st.floats(0.0, 1e3), st.floats(0.3, 3.0),
    st.floats(0.3, 1.0),
)  # fmt: skip
def test_the_free_date_is_the_cheapest_of_all(
    failure: float, maintenance: float, age: float, bend: float, ends: float
) -> None:
    """Lives that may never end too: no date of a fine grid, and no failure, is cheaper."""
    remaining = np.where(ends >= LEVELS, 20.0 + 100.0 * LEVELS**bend, np.inf)
    renewal = Renewal.of(Life.of("h", LEVELS, remaining), age, Cost(failure, maintenance))
    rate = renewal.best()[1]
    assert rate <= renewal.to_failure * (1 + 1e-9)
    assert rate <= float(renewal.rate(np.linspace(0.0, 130.0, 4001)).min()) * (1 + 1e-9)


def test_the_date_between_two_quantiles_has_its_closed_form() -> None:
    """An even life of 100 h, new, failure 10 times as dear: 4.5·y² + y = 1 with y = T / 100 h."""
    even = Life.of("h", LEVELS, 100.0 * LEVELS)
    item = cheapest("x", even, 0.0, Cost(9_000.0, 900.0))
    y = (np.sqrt(19.0) - 1.0) / 9.0
    assert item.after == pytest.approx(100.0 * y, rel=1e-6)
    assert item.rate == pytest.approx(9.0 * (1.0 + 9.0 * y) / (y - y * y / 2.0), rel=1e-6)


def test_cheap_failures_are_run_into_though_life_may_never_end() -> None:
    unbounded = Life.of("h", LEVELS, np.where(LEVELS > 0.7, np.inf, 50.0 + 200.0 * LEVELS))
    item = cheapest("lamp", unbounded, 0.0, Cost(100.0, 900.0))
    assert item.after == np.inf and item.probability == pytest.approx(0.7)
    assert item.rate == item.rate_to_failure == pytest.approx(0.709, abs=1e-3)


@pytest.mark.parametrize("ratio", [10.0, 200.0, 1e4, 1e6])
def test_a_life_that_surely_lasts_is_used_whatever_a_failure_costs(ratio: float) -> None:
    known = Life.of("h", LEVELS, 20.0 + 100.0 * LEVELS**2)
    assert 19.9 < cheapest("x", known, 200.0, Cost(900.0 * ratio, 900.0)).after < 20.0
    even = Life.of("h", LEVELS, 100.0 * LEVELS)
    assert even.probability_before(0.05) == pytest.approx(0.0005) and even.steepness == 1.0


def test_a_life_that_is_over_is_due_now_without_warnings() -> None:
    over = Life.of("h", LEVELS, 0.0 * LEVELS)
    with np.errstate(all="raise"):
        new, old = (cheapest("x", over, age, Cost(9_000.0, 900.0)) for age in (0.0, 40.0))
    assert new.after == old.after == 0.0 and new.probability == 1.0 and "over" in new.note
    assert new.rate == np.inf and old.rate == pytest.approx(9_000.0 / 40.0)


def test_a_window_that_comes_too_late_is_told() -> None:
    item = cheapest("x", life(15.0, 19.0), 10.0, Cost(9_000.0, 900.0), Windows(100.0, 5.0))
    assert "no window comes in time: the first is in 100 h" in item.note
    assert "within 17" in item.note and "after 14.98 h" in item.note
    assert not cheapest("x", life(), 10.0, Cost(9_000.0, 900.0), Windows(10.0, 5.0)).note


def test_moved_dates_have_their_own_probability_and_cost() -> None:
    known, cost, windows = life(), Cost(10_000.0, 1_000.0), Windows(0.0, 5.0)
    parts = {"=cmd()": Part(known, 300.0, cost)}
    first = planned(parts, windows)[0][0]
    at = {"confirmed": 60.0, "postponed": 101.0, "declined": first.after}
    for verdict, until in at.items():
        said = {"=cmd()": Decision(verdict, "ok", until)}  # type: ignore[arg-type]
        moved = planned(after(parts, said), windows)[0][0]
        assert moved.after == {"postponed": 105.0}.get(verdict, until)
        assert moved.probability == pytest.approx(known.probability_before(moved.after), abs=1e-5)
        rate = Renewal.of(known, 300.0, cost).rate(np.array([moved.after]))[0]
        assert moved.rate == pytest.approx(rate) and moved.decision.verdict == verdict
        assert moved.window == moved.after / 5.0
    off = planned(after(parts, {"=cmd()": Decision("confirmed", "ok", 61.0)}), windows)[0][0]
    assert off.window is None
    gone = planned(after(parts, {"=cmd()": Decision("confirmed", "ok", -3.0)}), windows)[0][0]
    assert gone.after == 0.0 and "passed 3 h ago" in gone.note
    late = planned(after(parts, {"=cmd()": Decision("postponed", "ok", 150.0)}))[0][0]
    assert late.after == 150.0 and late.probability == 1.0 and late.rate == late.rate_to_failure
    assert "likely (100%)" in late.note
    cells = next(iter(csv.DictReader(io.StringIO(Plan("p", "h", (off,)).to_csv()))))
    assert cells["component"] == "'=cmd()" and cells["decision"] == "confirmed"
    with pytest.raises(UsageError, match=r"plan of x: .* maintenance cost above 0"):
        cheapest("x", known, 1.0, Cost(1.0, 0.0))


def test_a_life_without_end_needs_no_date() -> None:
    never = Life.of("h", [0.5], [np.inf])
    assert cheapest("x", never, 1.0, Cost(10.0, 1.0)) == PlanItem(
        "x", "h", np.inf, 0.0, 0.0, 0.0, np.inf
    )


def machine(seed: int) -> dict[str, Part]:
    """Two or three components that wear at their own pace."""
    rng = np.random.default_rng(seed)
    return {
        f"part{k}": Part(
            life(low := rng.uniform(5.0, 60.0), low + rng.uniform(5.0, 60.0)),
            rng.uniform(0.0, 100.0), Cost(10 ** rng.uniform(3.0, 5.0), rng.uniform(50.0, 900.0)),
        )
        for k in range(2 + seed % 2)
    }  # fmt: skip


def fate(part: Part, date: float) -> tuple[float, float]:
    """Probability of a failure before a date, and the mean time in use, from the definition."""
    end = min(date, float(part.life.remaining[-1]))
    grid = np.linspace(0.0, end, 401)
    lasting = [1.0 - part.life.probability_before(t) for t in grid]
    failed = part.life.probability_before(date) if date < np.inf else 1.0
    return failed, part.age + float(np.trapezoid(lasting, grid))


@pytest.mark.parametrize("seed", range(6))
def test_of_all_choices_of_dates_the_plan_takes_the_cheapest(seed: int) -> None:
    visit, parts = (100.0, 600.0)[seed // 2 % 2], machine(seed)
    dates = [*np.arange(0.0, 121.0, 8.0).tolist(), np.inf]
    fates = {(name, date): fate(parts[name], date) for name in parts for date in dates}

    def paid(name: str, date: float, stop: float) -> float:
        failed, cost = fates[name, date][0], parts[name].cost
        return cost.failure * failed + (cost.maintenance + stop) * (1.0 - failed)

    rates = {n: min(paid(n, d, visit) / fates[n, d][1] for d in dates if fates[n, d][1] > 0.0)
             for n in parts}  # fmt: skip
    single = {(n, d): paid(n, d, 0.0) - rates[n] * fates[n, d][1] for n, d in fates}

    def total(chosen: tuple[float, ...]) -> float:
        cost = sum(single[pair] for pair in zip(parts, chosen, strict=True))
        for date in {d for d in chosen if d < np.inf}:
            done = [fates[n, d][0] for n, d in zip(parts, chosen, strict=True) if d == date]
            cost += visit * (1.0 - float(np.prod(done)))
        return cost

    best = min(total(chosen) for chosen in itertools.product(dates, repeat=len(parts)))
    items, stops = planned(parts, Windows(0.0, 8.0), visit)
    found = {one.component: one.after for one in items}
    assert total(tuple(found[name] for name in parts)) == pytest.approx(best, abs=0.01 * visit)
    assert sum(stop.saving for stop in stops) == pytest.approx(-best, abs=0.02 * visit)


def test_a_common_stop_saves_its_cost_and_decisions_bind_it() -> None:
    cost = Cost(10_000.0, 1_000.0)
    parts = {"a": Part(life(), 300.0, cost), "b": Part(life(90.0, 120.0), 300.0, cost),
             "c": Part(life(300.0, 400.0), 20.0, cost)}  # fmt: skip
    single = planned(parts)[1]
    assert [len(stop.components) for stop in single] == [1, 1, 1]
    items, stops = planned(parts, visit=300.0)
    assert [stop.components for stop in stops] == [("a", "b"), ("c",)]
    assert 200.0 < stops[0].saving <= 300.0 and stops[1].saving == pytest.approx(0.0)
    assert items[0].after == items[1].after == stops[0].after
    alone = cheapest("a", parts["a"].life, 300.0, Cost(10_000.0, 1_300.0))
    shared = Renewal.of(parts["a"].life, 300.0, Cost(10_000.0, 1_150.0))
    assert items[0].rate == pytest.approx(float(shared.rate(np.array([items[0].after]))[0]), 1e-3)
    assert items[0].rate < alone.rate
    fixed = planned(after(parts, {"b": Decision("confirmed", "", 80.0)}), visit=300.0)[1]
    assert fixed[0] == Stop(80.0, ("a", "b"), None, fixed[0].saving) and fixed[0].saving > 200.0
    apart = planned(after(parts, {"b": Decision("declined")}), visit=300.0)[1]
    assert [stop.components for stop in apart] == [("a",), ("c",)]
    rows = list(csv.DictReader(io.StringIO(Plan("p", "h", items, {}, stops).to_csv())))
    assert [row["stop"] for row in rows] == ["1", "1", "2"]
    assert float(rows[0]["stop_saving"]) == pytest.approx(stops[0].saving, rel=1e-4)


def test_each_alarm_has_reason_interval_evidence_and_action() -> None:
    known = Indicator.of("friction", "Nm", Limit(3.0), [0, 1], [1.0, 2.0])
    due = alarm_of("gearbox", known, life(5.0, 15.0), ahead=10.0, risk=0.1)
    assert due is not None and due.kind == "failure_due"
    assert "probability 0.50" in due.reason and due.interval == pytest.approx((6.0, 14.0))
    assert due.evidence["limit"] == 3.0 and "plan maintenance" in due.action
    assert alarm_of("gearbox", known, life(), ahead=10.0, risk=0.1) is None
    passed = alarm_of("gearbox", known, Life.of("h", [0.5], [0.0]), ahead=10.0, risk=0.1)
    assert passed is not None and passed.kind == "limit_passed"
    begun = NotEnough("six values", onset=Onset(3.0, 4.0))
    warned = alarm_of("gearbox", known, begun, ahead=10.0, risk=0.1)
    assert warned is not None and warned.kind == "wear_begun" and "six values" in warned.action
    assert alarm_of("gearbox", known, NotEnough("six values"), ahead=10.0, risk=0.1) is None


def test_the_budget_of_a_day_holds() -> None:
    due = [Alarm(name, "failure_due", "r", (None, None), "a") for name in "cab"]
    first = within_budget(due, (), (), now=10.0, budget=2.0)
    assert [a.component for a in first.raised] == ["a", "b"] and len(first.held) == 1
    told = [("failure_due", 10.0)] * 2
    later = within_budget(due, (("a", "failure_due"),), told, now=10.5, budget=2.0)
    assert not later.raised and later.today == 2 and len(later.held) == 2
    tomorrow = within_budget(due, (("a", "failure_due"),), told, now=11.5, budget=2.0)
    assert [a.component for a in tomorrow.raised] == ["b", "c"]
    weekly = within_budget(due, (), told[:1], now=12.0, budget=0.2)
    assert not weekly.raised and within_budget(due, (), told[:1], 15.5, 0.2).today == 1


def test_a_passed_limit_is_never_held_back_and_takes_no_room() -> None:
    passed = [Alarm(name, "limit_passed", "r", (None, None), "a") for name in "xyz"]
    due = Alarm("a", "failure_due", "r", (None, None), "a")
    for budget in (0.1, 1.0):
        found = within_budget([due, *passed], (), (), now=10.0, budget=budget)
        assert [a.component for a in found.raised] == ["x", "y", "z", "a"] and not found.held
        assert found.today == 4
    later = within_budget([due], (), [("limit_passed", 10.0)] * 3, now=10.0, budget=1.0)
    assert later.raised == (due,)
    full = within_budget(passed[:1], (), [("failure_due", 10.0)], now=10.0, budget=1.0)
    assert full.raised == (passed[0],)


def test_what_has_cleared() -> None:
    due = Alarm("a", "failure_due", "r", (None, None), "a")
    onset = NotEnough("six values", onset=Onset(3.0, 4.0))
    assert has_cleared("limit_passed", life(), due) and not has_cleared("failure_due", life(), due)
    assert has_cleared("failure_due", life(), None)
    assert not has_cleared("failure_due", onset, None), "not known is not cleared"
    assert has_cleared("wear_begun", NotEnough("six values"), None)
    assert not has_cleared("wear_begun", onset, None) and not has_cleared(
        "wear_begun", life(), None
    )


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.3, 0.5), st.floats(0.0, 0.05), st.integers(0, 10_000))
def test_a_factor_is_recovered_beside_growth(share: float, slope: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t, w = np.arange(60.0), rng.uniform(0.0, 1.0, 60)
    y = 10.0 * (1.0 + slope * t) * (1.0 + share * w)
    found, shares = without_factors(t, y, {"w": w}, {"w": 0.0})
    assert shares["w"] == pytest.approx(share, abs=1e-3)
    assert found == pytest.approx(10.0 * (1.0 + slope * t), rel=2e-3)
