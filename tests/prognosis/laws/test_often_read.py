"""Readings weigh by time: a line that is read more often lives as long."""

from __future__ import annotations

import time

import numpy as np
import pytest

from evertwin.prognosis.laws import Indicator, Life, Limit, predict_life
from planted.metrics import covers

LEFT = 0.2


def line(rows: int, seed: int, size: float = 0.05) -> Indicator:
    """A line from 2 to 4.5 of a limit of 5, with noise; a fifth of its span is left."""
    noise = size * np.random.default_rng([seed, rows]).standard_normal(rows)
    at = np.arange(rows) / rows
    return Indicator.of("wear", "mm", Limit(5.0), at, 2.0 + 2.5 * at + noise)


@pytest.mark.parametrize("rows", [300, 3_000, 10_000, 30_000])
def test_a_line_lives_as_long_however_often_it_is_read(rows: int) -> None:
    medians = []
    for seed in range(6):
        life = predict_life(line(rows, seed))
        assert isinstance(life, Life)
        assert covers(life.interval80, LEFT)
        medians.append(life.median / LEFT)
    assert 0.85 < np.mean(medians) < 1.15


@pytest.mark.parametrize("rows", [1_300, 1_500])
def test_a_rise_by_chance_among_many_readings_shortens_no_life(rows: int) -> None:
    lives = [predict_life(line(rows, seed, 0.12)) for seed in range(12)]
    medians = [life.median / LEFT for life in lives if isinstance(life, Life)]
    assert len(medians) == len(lives)
    assert min(medians) > 0.6 and 0.85 < np.mean(medians) < 1.15


def test_two_hundred_thousand_rows_are_answered_at_once() -> None:
    begin = time.perf_counter()
    life = predict_life(line(200_000, 0))
    assert time.perf_counter() - begin < 5.0
    assert isinstance(life, Life)
    assert 0.8 < life.median / LEFT < 1.2
