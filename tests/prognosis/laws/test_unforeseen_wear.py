"""Wear that no law foretells, limits that are passed, and work ahead without recorded usage."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.prognosis.laws import Indicator, Life, Limit, Workload, predict_life
from evertwin.prognosis.laws.unforeseen import ending, foretold, probability
from evertwin.prognosis.lives import entry_of


def wear(value: np.ndarray) -> Indicator:
    return Indicator.of("wear", "mm", Limit(1.0), np.arange(float(len(value))), value)


def test_independent_errors_of_one_spread_are_not_called_unforeseen() -> None:
    weights = [probability(np.random.default_rng(k).standard_normal(80), 2) for k in range(100)]
    assert np.mean(weights) < 0.08
    assert np.mean(np.array(weights) > 0.5) <= 0.02


@pytest.mark.parametrize("kind", ["spread", "lean"])
def test_errors_that_a_law_would_not_leave_are_called_unforeseen(kind: str) -> None:
    found = []
    for k in range(40):
        z = np.random.default_rng(k).standard_normal(120)
        if kind == "spread":
            z[70:100] *= 4.0
        else:
            for i in range(1, 120):
                z[i] += 0.7 * z[i - 1]
        found.append(probability(z, 2))
    assert np.mean(np.array(found) > 0.5) > 0.9


def test_foretold_is_the_student_product() -> None:
    z = np.random.default_rng(3).standard_normal(30)
    total = 0.0
    for i in range(10, 30):
        n, s = i - 2, float(np.mean(z[2:i] ** 2))
        from_law = np.array([0.0, z[i] / np.sqrt(s)])
        shape = (1.0 + from_law**2 / n) ** (-0.5 * (n + 1))
        grid = np.linspace(-400.0, 400.0, 400001)
        whole = np.trapezoid((1.0 + grid**2 / n) ** (-0.5 * (n + 1)), grid)
        total += np.log(shape[1] / whole / np.sqrt(s))
    assert foretold(z, 2, 0.0, 1.0) == pytest.approx(total, abs=1e-3)


def test_life_ends_no_later_than_the_laws_say() -> None:
    law = np.linspace(0.0, 1.0, 50)
    for weight in (0.0, 0.3, 1.0):
        found = ending(law, np.linspace(0.0, 0.6, 50), weight)
        assert np.all(found >= law - 1e-15) and np.all(np.diff(found) >= 0.0)
        assert found[-1] == 1.0


def test_a_series_that_wanders_after_its_onset_keeps_an_early_end_possible() -> None:
    rng = np.random.default_rng(5)
    y = 0.01 * rng.standard_normal(160)
    y[80:] += (
        0.25
        + 0.0015 * np.arange(80)
        + 0.05 * np.sin(np.arange(80) / 4.0) * (1.0 + np.arange(80) / 40.0)
    )
    life = predict_life(wear(y))
    assert isinstance(life, Life) and life.onset is not None
    steady = predict_life(wear(0.004 * np.arange(160.0) + 0.01 * rng.standard_normal(160)))
    assert isinstance(steady, Life)
    assert life.interval95[0] / life.median < 0.2 < steady.interval95[0] / steady.median


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


def test_twice_the_work_ahead_halves_the_life_without_usage() -> None:
    y = 0.01 * np.arange(60.0) + 0.01 * np.random.default_rng(4).standard_normal(60)
    before = predict_life(wear(y))
    assert isinstance(before, Life)
    once, twice = (before.through(Workload.steady(x), before.unit) for x in (1.0, 2.0))
    assert once.median == pytest.approx(before.median)
    assert twice.median == pytest.approx(0.5 * once.median)
