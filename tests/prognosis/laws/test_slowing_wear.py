"""Wear that slows down: not told short, and no alarm while far more than its lead may be left."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.prognosis.laws import Indicator, Life, Limit, NotEnough, find_onset, predict_life
from evertwin.prognosis.laws.plans.alarms import FAR, RELEASE, accepted, alarm_of, has_cleared
from evertwin.prognosis.laws.predict import slows
from evertwin.prognosis.laws.series.scaled import Problem, scaled
from evertwin.prognosis.laws.wear.alone import Pace, pace_of


def creeping(seed: int, limit: float, now: float = 1.0) -> Indicator:
    """A belt that loses much of its tension at first, less and less later on."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, now, 150)
    tension = 1.0 - 0.3 * (1.0 - np.exp(-t / 0.15)) - 0.05 * np.log1p(t / 0.1)
    value = 400.0 * tension + rng.normal(0.0, 2.0, len(t))
    return Indicator.of("tension", "N", Limit(limit, "below"), 1000.0 * t, value)


def test_a_healthy_belt_that_creeps_is_told_no_near_end() -> None:
    near = []
    for seed in range(6):
        for now in (0.5, 0.7, 0.9):
            history = creeping(seed, 180.0, now)
            life = predict_life(history)
            alarm = alarm_of("belt", history, life, None, 0.1)
            assert alarm is None or alarm.kind == "wear_begun"
            near.append(isinstance(life, Life) and life.quantile(0.9) < 3000.0 * now)
    assert np.mean(near) < 0.1, "it goes on for more than ten times its age"


def test_where_it_is_not_told_the_reason_names_both_paces() -> None:
    newest = Life.of("h", [0.1, 0.5, 0.9], [30.0, 40.0, 50.0])
    said = slows(newest, Pace(np.log(100.0), np.inf, np.log(2000.0)))
    assert said is not None and "0.4 times as long" in said.reason and "20 times" in said.reason
    assert slows(newest, Pace(np.log(100.0), np.inf)) is None


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_newest_values_that_rush_are_not_told_to_slow_down(scale: float) -> None:
    t = np.arange(120.0)
    slow = np.sqrt(t) / 20.0 + 0.004 * np.random.default_rng(0).standard_normal(120)
    for rush, told in ((0.0, True), (0.3, False)):
        y = scale * (slow + rush * (np.maximum(t - 115.0, 0.0) / 4.0))
        problem = scaled(Indicator.of("wear", "mm", Limit(scale), t, y), most=0)
        assert isinstance(problem, Problem)
        assert np.isfinite(pace_of(problem).slowing) == told


@pytest.mark.parametrize("seed", range(3))
def test_noise_that_lasts_does_not_hide_a_level_this_side_of_the_limit(seed: int) -> None:
    rng, y = np.random.default_rng(seed), np.zeros(172)
    for k in range(1, len(y)):
        y[k] = 0.6 * y[k - 1] + 0.04 * rng.standard_normal()
    t = np.arange(172.0)
    y += 2.0 + 2.2 * (1.0 - np.exp(-t / 36.0))
    life = predict_life(Indicator.of("vibration", "mm/s", Limit(4.5), t, y))
    assert isinstance(life, NotEnough) or not np.isfinite(life.interval80[1])


@pytest.mark.parametrize("power", [0.3, 0.5, 1.0, 2.0])
def test_the_power_of_growth_is_followed_to_the_limit(power: float) -> None:
    t = np.linspace(0.0, 60.0, 241)
    problem = scaled(Indicator.of("wear", "mm", Limit(1.0), t, (t / 100.0) ** power), most=0)
    assert isinstance(problem, Problem)
    assert np.exp(pace_of(problem).slowing) == pytest.approx(40.0, rel=0.35)


def test_an_alarm_waits_while_far_more_may_be_left() -> None:
    worn = Indicator.of("friction", "Nm", Limit(3.0), [0, 1], [1.0, 2.0])
    sure = Life.of("h", [0.05, 0.3, 0.95], [5.0, 10.0, 45.0])
    doubtful = Life.of("h", [0.05, 0.3, 0.5, 0.95], [5.0, 10.0, 60.0, 400.0])
    assert sure.risk_before(10.0) == doubtful.risk_before(10.0)
    assert alarm_of("gear", worn, sure, 10.0, 0.1) is not None
    assert alarm_of("gear", worn, doubtful, 10.0, 0.1) is None
    assert alarm_of("gear", worn, doubtful, 10.0, 0.02) is not None, "who accepts less is told"
    assert doubtful.probability_before(FAR * 10.0) < accepted(doubtful, 10.0, 0.1)
    stands = alarm_of("gear", worn, doubtful, 10.0, RELEASE * 0.1)
    assert stands is not None and not has_cleared("failure_due", doubtful, stands)


def test_wear_by_logarithms_has_begun_where_its_values_have_gone_some_way_too() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(300.0)
    level = np.exp(np.interp(t, [0.0, 200.0, 300.0], [0.0, 0.0, 0.21]))
    shaken = level * np.exp(rng.normal(0.0, 0.02, 300))
    plain = Indicator.of("rms", "g", Limit(3.0), t, shaken)
    logs = plain.with_(value=np.log(shaken), limit=Limit(float(np.log(3.0))), ratio=True)
    assert find_onset(logs.with_(ratio=False)) is not None
    assert find_onset(logs) is None, "a tenth of the way from 1 to 3 is no wear"
