"""A swing about the trend that stays bounded is noise; wear that wanders is none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from evertwin.prognosis.laws import Indicator, Limit
from evertwin.prognosis.laws.plans.alarms import alarm_of
from evertwin.prognosis.laws.series.swing import period_of, without_swing

from .test_predicted_life import told

DAYS = 42


def hourly(swing: float, seed: int) -> Indicator:
    """Straight wear to 1 within `DAYS`, read each hour, with a swing over the day; half of it."""
    rng = np.random.default_rng(seed)
    at = np.arange(12.0 * DAYS) / 24.0
    value = at / DAYS + swing * np.sin(2.0 * np.pi * (at + rng.random()))
    value += 0.005 * rng.standard_normal(len(at))
    return Indicator.of("dp", "mbar", Limit(1.0), at, value).with_(clock="d")


@pytest.mark.parametrize("swing", [0.005, 0.02])
def test_a_swing_over_the_day_does_not_shorten_a_life(swing: float) -> None:
    for seed in range(6):
        own = hourly(swing, seed)
        life = told(own)
        assert life.median == pytest.approx(0.5 * DAYS, rel=0.1)
        assert alarm_of("filter", own, life, None, 0.05) is None


def wandering(rng: np.random.Generator) -> np.ndarray:
    return np.linspace(0.0, 0.5, 500) + 0.1 * np.cumsum(rng.standard_normal(500)) / np.sqrt(500)


def scattering(rng: np.random.Generator) -> np.ndarray:
    return np.linspace(0.0, 0.5, 500) + 0.01 * rng.standard_normal(500)


def growing_late(rng: np.random.Generator) -> np.ndarray:
    return np.linspace(0.0, 0.9, 500) ** 6 + 0.01 * rng.standard_normal(500)


@pytest.mark.parametrize("course", [wandering, scattering, growing_late])
def test_wear_that_wanders_scatters_or_bends_is_no_swing(
    course: Callable[[np.random.Generator], np.ndarray],
) -> None:
    found = [period_of(course(np.random.default_rng(seed))) for seed in range(20)]
    assert sum(rows > 0 for rows in found) <= 1


def test_means_over_a_swing_keep_the_moment_they_are_seen_from() -> None:
    own = hourly(0.02, 0).seen_at(30.0)
    calm = without_swing(own)
    assert len(calm.at) < 25 and calm.at[-1] == 30.0 and calm.origin == 0.0
    trend = calm.value[:-1] - calm.at[:-1] / DAYS
    assert np.abs(trend).max() < 0.01


def test_what_never_changes_does_not_swing() -> None:
    assert period_of(np.full(240, 50.0)) == 0
