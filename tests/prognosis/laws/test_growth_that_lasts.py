"""Growth that has ended, comes and goes, or tends to a level; readings that crowd, and gaps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from evertwin.prognosis.laws import (
    Fleet,
    Indicator,
    Life,
    Limit,
    NotEnough,
    learn,
    predict_life,
)
from evertwin.prognosis.laws.plans.alarms import alarm_of
from planted.metrics import covers

SEEDS = 8


def rows(t: np.ndarray, y: np.ndarray, limit: float) -> Indicator:
    """A series with its limit, below where it falls."""
    side = "above" if limit > y[0] else "below"
    return Indicator.of("wear", "mm", Limit(limit, side), t, y).with_(clock="d")  # type: ignore[arg-type]


def alarmed(history: Indicator, fleet: Fleet | None = None) -> bool:
    return alarm_of("part", history, predict_life(history, fleet=fleet), None, 0.1) is not None


def run_in(rng: np.random.Generator) -> Indicator:
    d = np.arange(1000.0)
    return rows(d, 0.15 + 0.06 * (1.0 - np.exp(-d / 25.0)) + rng.normal(0.0, 0.006, 1000), 0.3)


def one_step(rng: np.random.Generator) -> Indicator:
    d = np.arange(1000.0)
    return rows(d, 0.14 + 0.04 * (d > 100.0) + rng.normal(0.0, 0.006, 1000), 0.3)


def season(rng: np.random.Generator) -> Indicator:
    d = np.arange(1100.0)
    year = np.sin(2.0 * np.pi * (d + rng.uniform(0.0, 365.0)) / 365.0)
    return rows(d, 0.15 + 0.02 * year + rng.normal(0.0, 0.008, 1100), 0.3)


@pytest.mark.parametrize(
    ("healthy", "said"),
    [(run_in, "flat since"), (one_step, "flat since"), (season, "comes and goes")],
)
def test_growth_that_is_over_tells_no_life(
    healthy: Callable[[np.random.Generator], Indicator], said: str
) -> None:
    answers = []
    for seed in range(SEEDS):
        history = healthy(np.random.default_rng(seed))
        answers.append(predict_life(history))
        assert not alarmed(history)
    assert all(isinstance(one, NotEnough) for one in answers)
    assert any(said in one.reason for one in answers if isinstance(one, NotEnough))


def test_growth_that_slows_down_before_the_limit_has_no_end() -> None:
    ended = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        h = np.arange(0.0, 24000.0, 100.0)
        level, pace = rng.uniform(72.0, 77.0), rng.uniform(3000.0, 7000.0)
        light = level + (100.0 - level) * np.exp(-h / pace) + rng.normal(0.0, 0.4, len(h))
        life = predict_life(rows(h, light, 70.0))
        ended += isinstance(life, Life) and bool(np.isfinite(life.interval80[1]))
    assert ended <= 1


def steady(seed: int) -> tuple[np.ndarray, float, np.random.Generator]:
    """(days until 0.7 of a life, the life, a generator); wear grows from 2 to 10 mm in it."""
    rng = np.random.default_rng(seed)
    life = float(rng.uniform(300.0, 700.0))
    return np.arange(0.0, 0.7 * life), life, rng


@pytest.mark.parametrize("every", [2, 10])
def test_readings_weigh_by_time(every: int) -> None:
    held = 0
    for seed in range(SEEDS):
        t, life, rng = steady(seed)
        t = np.r_[t[::every], t[-1] + 0.2 * np.arange(1.0, 31.0)]
        told = predict_life(rows(t, 2.0 + 8.0 * t / life + rng.normal(0.0, 0.15, len(t)), 10.0))
        held += isinstance(told, Life) and covers(told.interval80, life - float(t[-1]))
    assert held == SEEDS


def test_a_gap_is_no_rush() -> None:
    off = []
    for seed in range(SEEDS):
        t, life, rng = steady(seed)
        t = t[(t < 0.45 * life) | (t > 0.65 * life)]
        told = predict_life(rows(t, 2.0 + 8.0 * t / life + rng.normal(0.0, 0.15, len(t)), 10.0))
        assert isinstance(told, Life) and covers(told.interval80, life - float(t[-1]))
        off.append(abs(np.log(told.median / (life - t[-1]))))
    assert np.mean(off) < 0.2


def test_slow_growth_after_a_run_in_goes_on() -> None:
    for seed in range(SEEDS):
        t, life, rng = steady(seed)
        level = 0.1 * (1.0 - np.exp(-t / (0.05 * life))) + 0.2 * t / life
        told = predict_life(rows(t, level + rng.normal(0.0, 0.006, len(t)), 0.3))
        assert isinstance(told, Life) and covers(told.interval80, life - float(t[-1]))


def bearing(rng: np.random.Generator) -> Indicator:
    """Flat, at a level of its own, for nearly all of its life."""
    life, level = rng.uniform(600.0, 1600.0), rng.uniform(0.08, 0.14)
    h = np.arange(0.0, 1.1 * life)
    late = np.maximum(h / life - 0.95, 0.0) / 0.05
    grown = level * (1.0 + 0.15 * np.expm1(3.2 * np.minimum(late, 2.0)))
    return rows(h, grown * np.exp(rng.normal(0.0, 0.06, len(h))), 0.4)


def test_like_machines_alarm_no_one_that_is_flat_and_young() -> None:
    young = old = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        fleet = learn([bearing(rng) for _ in range(7)])
        for _ in range(3):
            one = bearing(rng)
            life = float(one.at[-1]) / 1.1
            young += alarmed(one.until(0.3 * life), fleet)
            old += alarmed(one.until(0.99 * life), fleet)
    assert young == 0
    assert old >= 0.75 * 3 * SEEDS
