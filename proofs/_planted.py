"""Planted degradations: six laws with random lives, exponents, noises. One truth per series.

A component lives about 1,000 cycles (log-normal, 30 %), is looked at 100 times in that life, starts
at 0 and ends at the limit 1. Noise of a value: 1 to 4 % of the limit, a quarter of that on Wiener
processes, none on gamma processes; a process spreads lives of one drift by 5 to 25 %.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LAWS = ("linear", "exponential", "power", "wiener", "gamma", "two-phase")
VALUES = 100
"""Values in a life; `PAST` more follow its end."""
PAST = 12
LIFE, SPREAD = 1000.0, 0.3


class Planted(NamedTuple):
    """One component from new to a little past its end."""

    at: np.ndarray
    value: np.ndarray
    life: float
    onset: float
    level: np.ndarray
    """Without noise."""


def plant(law: str, rng: np.random.Generator) -> Planted:
    """A series of ``law``; life ends where the level without noise passes 1."""
    life = LIFE * np.exp(SPREAD * rng.standard_normal())
    noise = rng.uniform(0.01, 0.04)
    if law in ("wiener", "gamma"):
        return _process(law, life, rng.uniform(0.05, 0.25), 0.25 * noise, rng)
    at = np.arange(1, VALUES + PAST + 1) / VALUES * life
    s, onset = at / life, 0.0
    if law == "linear":
        level = s
    elif law == "power":
        level = s ** np.exp(rng.uniform(np.log(0.5), np.log(3.0)))
    elif law == "exponential":
        c = rng.uniform(1.0, 5.0)
        level = np.expm1(c * s) / np.expm1(c)
    else:
        onset = rng.uniform(0.1, 0.4)
        u = np.maximum(s - onset, 0.0) / (1.0 - onset)
        c = rng.uniform(1.0, 4.0)
        level = u if rng.random() < 0.5 else np.expm1(c * u) / np.expm1(c)
    value = level + noise * rng.standard_normal(len(level))
    return Planted(at, value, life, onset * life, level)


def wiener(rng: np.random.Generator) -> tuple[Planted, float, float]:
    """(series, drift per cycle, variance per cycle) of a Wiener process; nearly no noise."""
    life, spread = LIFE * np.exp(SPREAD * rng.standard_normal()), rng.uniform(0.05, 0.25)
    series = _process("wiener", life, spread, 0.0025, rng)
    return series, 1.0 / life, spread**2 / life


def _process(
    law: str, mean_life: float, spread: float, noise: float, rng: np.random.Generator
) -> Planted:
    """Wiener or gamma increments on a grid of 1/5000 of the mean life; the first passage."""
    fine, dt = 20000, mean_life / 5000
    if law == "wiener":
        step = dt / mean_life + spread * np.sqrt(dt / mean_life) * rng.standard_normal(fine)
    else:
        step = rng.gamma(dt / mean_life / spread**2, spread**2, fine)
    path = np.cumsum(step)
    end = int(np.argmax(path >= 1.0)) + 1
    rows = (np.arange(1, VALUES + PAST + 1) / VALUES * end).astype(int) - 1
    value = path[rows] + (noise if law == "wiener" else 0.0) * rng.standard_normal(len(rows))
    return Planted((rows + 1) * dt, value, end * dt, 0.0, path[rows])
