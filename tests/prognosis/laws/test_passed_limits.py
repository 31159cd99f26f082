"""Limits that are passed, and work ahead without recorded usage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.config.prognosis import IndicatorSpec
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.laws import Indicator, Life, Limit, Workload, predict_life
from evertwin.prognosis.outlook.lives import ComponentLife, Lives, entry_of


def wear(value: np.ndarray) -> Indicator:
    return Indicator.of("wear", "mm", Limit(1.0), np.arange(float(len(value))), value)


def test_a_passed_limit_is_told_with_its_moment_in_the_document() -> None:
    rng = np.random.default_rng(1)
    y = np.minimum(0.02 * np.arange(90.0), 1.15) + 0.002 * rng.standard_normal(90)
    life = predict_life(wear(y))
    assert isinstance(life, Life)
    assert life.median == 0.0 and life.interval95 == (0.0, 0.0)
    assert life.passed is not None and 50.0 <= life.passed <= 51.0
    told = entry_of(wear(y), life)["life"]
    assert isinstance(told, dict) and told["passed_at"] == life.passed


def test_a_level_that_was_always_beyond_its_limit_is_passed_and_not_calm() -> None:
    y = 1.2 + 0.01 * np.random.default_rng(2).standard_normal(60)
    life = predict_life(wear(y))
    assert isinstance(life, Life) and life.passed == 0.0


def test_one_value_beyond_the_limit_is_no_passage() -> None:
    y = 0.01 * np.arange(60.0) + 0.01 * np.random.default_rng(4).standard_normal(60)
    y[30] = 1.3
    life = predict_life(wear(y))
    assert isinstance(life, Life) and life.passed is None and life.median > 20.0


@pytest.mark.parametrize("few", [1, 2])
def test_newest_values_beyond_the_limit_lengthen_no_life_and_are_said(few: int) -> None:
    for seed in range(6):
        y = 0.01 * np.arange(60.0 + few) + 0.01 * np.random.default_rng(seed).standard_normal(
            60 + few
        )
        y[-few:] = 1.5
        own, before = wear(y), wear(y[:-few]).seen_at(59.0 + few)
        life, without = predict_life(own), predict_life(before)
        assert isinstance(life, Life) and isinstance(without, Life)
        assert life.passed is None and np.all(life.remaining <= without.remaining)
        rule = IndicatorSpec("wear", parameter="wear", limit=1.0)
        one = ComponentLife("wear", rule, own, life, life, Formula.parse("1"))
        first = str(Lives("m", "run", {"wear": one}, None)).splitlines()[0]
        assert "beyond the limit" in first and f"{3 - few} more in a row" in first
        assert not replace(one, indicator=before).held_back


def test_twice_the_work_ahead_halves_the_life_without_usage() -> None:
    y = 0.01 * np.arange(60.0) + 0.01 * np.random.default_rng(4).standard_normal(60)
    before = predict_life(wear(y))
    assert isinstance(before, Life)
    once, twice = (before.through(Workload.steady(x), before.unit) for x in (1.0, 2.0))
    assert once.median == pytest.approx(before.median)
    assert twice.median == pytest.approx(0.5 * once.median)
