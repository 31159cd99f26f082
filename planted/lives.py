"""Planted degradations with random lives, exponents, noises. One truth per series.

A component lives about 1,000 cycles (log-normal, 30 %), is looked at 100 times in that life, starts
at 0 and ends at the limit 1. Noise of a value: 1 to 4 % of the limit, a quarter of that on Wiener
processes, none on gamma processes, all of it on noisy gamma processes; a process spreads lives of
one drift by 5 to 25 %.

`STRANGERS` follow none of the laws that the predictor knows:

    crack         da/ds ~ a^(m/2) (Paris), m from 2.5 to 4, from 10 to 40 % of the limit: it grows
                  without bound soon after the limit
    logistic      from 2 to 10 % of the limit towards 1.15 to 2 limits, in an S
    saturating    A·(1 − e^(−ks)), A 1.15 to 2 limits: slower and slower
    late          a line that becomes 3 to 10 times as steep at 60 to 90 % of the life
    regeneration  s^0.7 to s^1.5, and about eight times a life 2 to 6 % of the limit are recovered
                  and lost again within a few values, as in a cell that rested
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LAWS = ("linear", "exponential", "power", "wiener", "gamma", "two-phase", "noisy gamma")
STRANGERS = ("crack", "logistic", "saturating", "late", "regeneration")
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
    """A series of one of `LAWS` or `STRANGERS`; life ends where its level first passes 1."""
    if law in STRANGERS:
        return _plant_stranger(law, rng)
    life = LIFE * np.exp(SPREAD * rng.standard_normal())
    noise = rng.uniform(0.01, 0.04)
    seen = {"wiener": 0.25 * noise, "gamma": 0.0, "noisy gamma": noise}
    if law in seen:
        return _process(law, life, rng.uniform(0.05, 0.25), seen[law], rng)
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
    value = path[rows] + noise * rng.standard_normal(len(rows))
    return Planted((rows + 1) * dt, value, end * dt, 0.0, path[rows])


def _plant_stranger(kind: str, rng: np.random.Generator) -> Planted:
    life = LIFE * np.exp(SPREAD * rng.standard_normal())
    noise = rng.uniform(0.01, 0.04)
    s = np.arange(1, VALUES + PAST + 1) / VALUES
    if kind == "regeneration":
        s, level = _regenerating(rng)
    else:
        level = _stranger(kind, np.minimum(s, 2.0 - s), rng)
        level = np.where(s > 1.0, 2.0 - level, level)  # past its end mirrored: a crack has none
    value = level + noise * rng.standard_normal(len(level))
    return Planted(s * life, value, life, 0.0, level)


def _stranger(kind: str, s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The level at shares ``s`` of the life, 1 at most."""
    if kind == "crack":
        p, start = rng.uniform(2.5, 4.0) / 2.0 - 1.0, rng.uniform(0.1, 0.4)
        whole = start**-p
        return np.asarray((whole - (whole - 1.0) * s) ** (-1.0 / p))
    top = rng.uniform(1.15, 2.0)
    if kind == "logistic":
        start = rng.uniform(0.02, 0.1)
        rise = ((top - start) / (start * (top - 1.0))) ** s
        return np.asarray(top * start * rise / (top + start * (rise - 1.0)))
    if kind == "saturating":
        return np.asarray(top * (1.0 - (1.0 - 1.0 / top) ** s))
    at, steep = rng.uniform(0.6, 0.9), rng.uniform(3.0, 10.0)
    level = s + (steep - 1.0) * np.maximum(s - at, 0.0)
    return np.asarray(level / (1.0 + (steep - 1.0) * (1.0 - at)))


def _regenerating(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(shares of the life, level): a bent line from which some is recovered for a while."""
    fine = np.linspace(0.0, 2.0, 8001)
    wear = fine ** rng.uniform(0.7, 1.5)
    for at in np.cumsum(rng.exponential(1.0 / 8.0, 32)):
        since = fine - at
        lost = np.exp(-np.maximum(since, 0.0) / rng.uniform(0.02, 0.04))
        wear -= np.where(since >= 0.0, rng.uniform(0.02, 0.06) * lost, 0.0)
    end = int(np.argmax(wear >= 1.0))
    rows = np.round(np.arange(1, VALUES + PAST + 1) / VALUES * end).astype(int)
    return fine[rows] / fine[end], wear[rows]
