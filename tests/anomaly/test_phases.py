"""Phases by the values of channels, and by the time since a task began."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.anomaly import Regimes, TaskSteps
from evertwin.errors import UsageError


def test_few_levels_become_one_phase_each() -> None:
    heater, fan = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.5, 1.0, 1.0])
    regimes = Regimes.found(np.column_stack([heater, fan]), bins=8)
    assert regimes.count == 6
    assert len(set(regimes.of(np.column_stack([heater, fan])).tolist())) == 4


def test_a_continuous_channel_is_cut_into_equal_shares() -> None:
    values = np.random.default_rng(0).normal(size=(8000, 1))
    regimes = Regimes.found(values, bins=8)
    shares = np.bincount(regimes.of(values)) / 8000
    assert shares == pytest.approx(np.full(8, 0.125), abs=0.001)


@given(st.lists(st.floats(-10, 10), min_size=1, max_size=30), st.integers(1, 6))
def test_every_known_value_has_a_phase_below_the_count(values: list[float], bins: int) -> None:
    column = np.array(values)[:, None]
    regimes = Regimes.found(column, bins)
    phase = regimes.of(column)
    assert regimes.count <= bins
    assert ((phase >= 0) & (phase < regimes.count)).all()


def test_unknown_values_have_no_phase() -> None:
    assert Regimes(((0.0,),)).of(np.array([[np.nan]])).tolist() == [-1]


def test_misuse_is_refused() -> None:
    with pytest.raises(UsageError, match="increasing"):
        Regimes(((1.0, 0.0),))
    with pytest.raises(UsageError, match="finite"):
        Regimes.found(np.full((2, 1), np.nan), 3)


def test_what_lasts_longer_stays_in_the_last_step() -> None:
    t = 7 + np.arange(5) * 10**9
    assert TaskSteps(duration=2.0, parts=4).of(t, 7).tolist() == [0, 2, 3, 3, 3]
    assert TaskSteps(duration=1.0, parts=1).of(t, 7).tolist() == [0] * 5
