"""Laws of every predicted life, for any history."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import DataError, UsageError
from evertwin.prognosis.laws import (
    Indicator,
    Life,
    Limit,
    Maintenance,
    NotEnough,
    Workload,
    first_of,
    predict_life,
)
from evertwin.prognosis.laws.series.life import LEVELS, quantiles
from evertwin.prognosis.laws.wear.hypotheses import LAWS
from evertwin.prognosis.outlook.lives import entry_of

SIZES = st.floats(min_value=-1e12, max_value=1e12, allow_nan=False)
STEPS = st.sampled_from([0.0, 0.0, 1e-6, 1.0, 1.0, 3.0, 1e6])


def sound(life: Life | NotEnough) -> None:
    """≥ 0, no NaN, quantiles that do not fall, probabilities that rise from 0 to at most 1."""
    if isinstance(life, NotEnough):
        assert life.needs
        return
    assert not np.isnan(life.remaining).any()
    assert (life.remaining >= 0.0).all()
    assert (life.remaining[1:] >= life.remaining[:-1]).all()
    low95, high95 = life.interval95
    low80, high80 = life.interval80
    assert low95 <= low80 <= life.median <= high80 <= high95
    assert low95 <= life.not_before <= life.median
    known = life.remaining[np.isfinite(life.remaining)]
    found = [life.probability_before(x) for x in np.linspace(0.0, 2.0 * known.max(initial=1.0), 9)]
    assert all(0.0 <= a <= b <= 1.0 for a, b in pairwise(found))


@st.composite
def histories(draw: st.DrawFn) -> Indicator:
    """Anything finite: repeated times, constant values, gaps, covariates, marks, outliers."""
    n = draw(st.integers(0, 30))
    steps = np.array(draw(st.lists(STEPS, min_size=n, max_size=n)))
    kind = draw(st.sampled_from(["any", "constant", "rising", "falling", "noisy"]))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    scale = draw(st.sampled_from([1e-9, 1.0, 1e9]))
    value = {
        "any": np.array(draw(st.lists(SIZES, min_size=n, max_size=n))),
        "constant": np.full(n, scale),
        "rising": scale * np.arange(n),
        "falling": -scale * np.arange(n) ** 2.0,
        "noisy": scale * rng.standard_normal(n),
    }[kind]
    if n and draw(st.booleans()):
        value[draw(st.integers(0, n - 1))] = draw(st.sampled_from([np.nan, 1e12, -1e12]))
    limit = Limit(draw(SIZES), draw(st.sampled_from(["above", "below"])))
    at = np.cumsum(steps) if n else np.zeros(0)
    marks = draw(st.lists(st.sampled_from([0.0, 2.0, 5.0]), max_size=2))
    kinds: Any = draw(st.sampled_from(["replaced", "adjusted", "failed"]))
    changes: dict[str, object] = {"maintenance": tuple(Maintenance(m, kinds) for m in marks)}
    if draw(st.booleans()):
        changes["covariates"] = {"load": rng.integers(0, 2, n).astype(float)}
    if draw(st.booleans()):
        changes["sigma"] = np.abs(rng.standard_normal(n))
    if draw(st.booleans()):
        changes["usage"] = np.cumsum(np.abs(rng.standard_normal(n)))
    return Indicator.of("x", "1", limit, at, value).with_(**changes)


@given(histories())
@settings(max_examples=250, deadline=None)
def test_any_history_gives_a_sound_answer(history: Indicator) -> None:
    sound(predict_life(history))


@given(histories(), st.sampled_from(LAWS))
@settings(max_examples=60, deadline=None)
def test_any_law_alone_gives_a_sound_answer(history: Indicator, law: str) -> None:
    sound(predict_life(history, (law,)))


@given(
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8),
    st.lists(st.floats(0.0, 1e9), min_size=1, max_size=8),
)
def test_quantiles_of_any_distribution_are_sound(share: list[float], nodes: list[float]) -> None:
    k = min(len(share), len(nodes))
    sound(Life("h", quantiles(np.sort(nodes[:k]), np.sort(share[:k]))))


@given(st.lists(st.floats(1.0, 1e3), min_size=1, max_size=4))
def test_the_first_component_ends_no_later_than_any(medians: list[float]) -> None:
    lives = [Life.of("h", LEVELS, 2.0 * m * LEVELS) for m in medians]
    machine = first_of(lives)
    sound(machine)
    for life in lives:
        assert machine.median <= life.median * (1.0 + 1e-9)
        for x in (0.3 * life.median, life.median):
            assert machine.probability_before(x) >= life.probability_before(x) - 2e-3


def test_two_like_components_fail_first_as_the_formula_says() -> None:
    one = Life.of("h", LEVELS, 100.0 * LEVELS)
    both = first_of([one, one])
    for x in (20.0, 50.0, 80.0):
        assert both.probability_before(x) == pytest.approx(1.0 - (1.0 - x / 100) ** 2, abs=3e-3)


def test_lives_in_different_units_have_no_first() -> None:
    with pytest.raises(UsageError, match="one unit"):
        first_of([Life.of("h", LEVELS, LEVELS), Life.of("run", LEVELS, LEVELS)])
    with pytest.raises(UsageError, match="one unit"):
        first_of([])


@pytest.mark.parametrize("remaining", [[-1.0, 2.0], [2.0, 1.0], [np.nan, 1.0]])
def test_a_life_that_cannot_be_is_refused(remaining: list[float]) -> None:
    with pytest.raises(UsageError, match="life"):
        Life.of("h", [0.1, 0.9], remaining)


def test_series_that_do_not_fit_are_refused() -> None:
    with pytest.raises(DataError, match="expected value of shape"):
        Indicator.of("x", "1", Limit(1.0), [0.0, 1.0], [1.0])
    with pytest.raises(DataError, match="do not fall"):
        Indicator.of("x", "1", Limit(1.0), [1.0, 0.0], [1.0, 2.0])
    with pytest.raises(UsageError, match="finite"):
        Limit(np.inf)
    with pytest.raises(UsageError, match="laws"):
        predict_life(Indicator.of("x", "1", Limit(9.0), np.arange(9.0), np.arange(9.0)), ("none",))


def test_the_document_holds_what_readers_need() -> None:
    t = np.arange(60.0)
    wear = Indicator.of("wear", "mm", Limit(1.0), t, 0.01 * t)
    noisy = wear.with_(value=wear.value + 0.005 * np.random.default_rng(0).standard_normal(60))
    entry = entry_of(noisy, predict_life(noisy), dates=(30.0, 60.0))
    assert {"indicator", "value", "limit", "law", "life", "probability_before"} <= set(entry)
    assert entry["life"].keys() >= {"median", "interval80", "interval95", "unit"}  # type: ignore[attr-defined]
    before = entry["probability_before"]
    assert isinstance(before, dict) and before["30"] < 0.5 < before["60"]
    short = entry_of(noisy, predict_life(noisy.until(3.0)))
    assert short["life"] == {
        "verdict": "not enough data",
        "needs": "at least 6 values at different times since the component was new or replaced, "
        "2 more than there are",
    }


def test_a_workload_turns_work_into_time() -> None:
    plan = Workload(np.array([0.0, 10.0, 20.0]), np.array([0.0, 10.0, 10.0]))
    assert plan.time_of(np.array([5.0, 10.0])).tolist() == [5.0, 10.0]
    assert plan.time_of(np.array([11.0, np.inf])).tolist() == [np.inf, np.inf]
    with pytest.raises(UsageError, match="workload"):
        Workload(np.array([0.0, 0.0]), np.array([0.0, 1.0]))


def test_half_the_work_gives_twice_the_time() -> None:
    rng = np.random.default_rng(1)
    work = np.cumsum(rng.uniform(0.5, 1.5, 80))
    value = 0.01 * work + 0.01 * rng.standard_normal(80)
    wear = Indicator.of("wear", "mm", Limit(1.5), np.arange(80.0), value).with_(usage=work)
    same = predict_life(wear)
    assert isinstance(same, Life)
    half = same.through(Workload.steady(0.5), wear.clock)
    assert half.median == pytest.approx(2.0 * (150.0 - work[-1]) / (work[-1] / 79), rel=0.15)
    assert same.median == pytest.approx((150.0 - work[-1]) / (work[-1] / 79), rel=0.15)
