"""Values that scatter by a share of themselves: near the limit they scatter far less."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.prognosis.laws import Indicator, Life, Limit, NotEnough, predict_life
from evertwin.prognosis.laws.series.proportional import by_share


def insulation(seed: int, rows: int = 60, seen: float = 0.9) -> Indicator:
    """Falls from 500 to 5 MΩ over 1,000 d by a constant share, by 20 % up and down; seen so far."""
    rng = np.random.default_rng(seed)
    at = np.sort(rng.uniform(0.0, 1000.0 * seen, rows))
    value = 500.0 * np.exp(np.log(0.01) * at / 1000.0 + 0.2 * rng.standard_normal(rows))
    return Indicator.of("R", "MΩ", Limit(5.0, "below"), at, value).with_(clock="d")


def test_what_falls_by_shares_is_not_over_before_its_limit() -> None:
    held = 0
    for seed in range(8):
        life = predict_life(insulation(seed))
        assert isinstance(life, Life) and life.passed is None
        low, high = life.interval80
        held += low <= 1000.0 - insulation(seed).at[-1] <= high
    assert held >= 6


@pytest.mark.parametrize("seed", range(4))
def test_even_scatter_near_zero_and_influences_stay_as_they_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(80.0)
    even = Indicator.of("wear", "mm", Limit(100.0), t, 10.0 + t + rng.standard_normal(80))
    new = Indicator.of("VB", "um", Limit(300.0), t, (3.0 * t + 1.0) * (1.0 + 0.1 * rng.random(80)))
    warm = insulation(seed).with_(covariates={"warm": rng.random(60)})
    assert not any(by_share(one).ratio for one in (even, new, warm))
    assert not by_share(insulation(seed).with_(limit=Limit(-5.0, "below"))).ratio


def test_what_is_missing_is_told_as_a_factor() -> None:
    rng = np.random.default_rng(0)
    value = 20.0 * np.exp(0.15 * rng.standard_normal(200)) * np.linspace(1.0, 1.3, 200)
    value[:3] *= (4.0, 0.2, 5.0)  # looser contacts
    life = predict_life(Indicator.of("R", "mΩ", Limit(100.0), np.arange(200.0), value))
    assert isinstance(life, NotEnough) and "stands out: a factor of 1." in life.needs


@pytest.mark.parametrize("seed", range(4))
def test_newest_values_on_the_sound_side_end_no_life(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(100.0)
    value = 60.0 + 0.3 * t + 9.0 * rng.standard_normal(100)
    value[-12:-6] = 110.0 + rng.random(6)
    value[-6:] = 92.0 + rng.random(6)
    told = predict_life(Indicator.of("x", "1", Limit(100.0), t, value))
    assert isinstance(told, NotEnough) or told.passed is None
