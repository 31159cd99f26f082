"""Wear that is seen as it is in a workshop: few rows or many, at odd times, by uneven noise.

gompertz     slow, fast, slow again, not alike on both sides
pitting      nothing for a while, then a root of time
cell         a root of time and a high power, a part of it back after rests
run in       falls first, then a power law
lubed        a power law in saw teeth: what is greased runs more freely for a while
stages       three to five rates, each higher than the one before
loaded       a line whose slope wanders by a factor
season       a rate that goes up and down with the time of year
clogging     s/(1 − c·s)
multiplied   grows by what it is, by a random walk
broken steps slows down; steps of a tenth to two fifths of the way
eased        a line that is less steep from some moment on

A component is seen 25 to 1,500 times in its life. Of half of the kinds the rows are at random
times, of half the noise grows with the wear; two in five have noise of heavy tails, one in five a
coarse resolution. Lives of one kind spread by 10 to 50 %.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

Level = Callable[[np.ndarray, np.random.Generator], np.ndarray]


class Seen(NamedTuple):
    """How components of a kind are seen."""

    lean: float
    """Of a noise on the one before."""
    size: float
    """Of the noise, as a share of the way to the limit."""
    grows: float
    """How much more noise there is at the limit."""
    tails: bool
    anytime: bool
    coarse: bool
    spread: float
    """Of the logarithms of lives."""

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Seen:
        """A way of seeing."""
        grows = float(rng.uniform(0.0, 2.0)) if rng.random() < 0.5 else 0.0
        tails, anytime, coarse = (bool(rng.random() < p) for p in (0.4, 0.5, 0.2))
        lean, spread = float(rng.uniform(0.0, 0.9)), float(rng.uniform(0.1, 0.5))
        return cls(lean, between(0.003, 0.05, rng), grows, tails, anytime, coarse, spread)

    def rows(self, count: int, end: int, rng: np.random.Generator) -> np.ndarray:
        """Points of the life, up to its end, at which there is a row."""
        share = np.linspace(0.0, 1.0, count)
        if self.anytime:
            share = np.sort(rng.uniform(0.0, 1.0, count))
        return np.unique(np.round(share * end).astype(int))

    def value(self, level: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """What is read at each level."""
        new = rng.standard_t(3, len(level)) / 1.7 if self.tails else rng.standard_normal(len(level))
        off, before = np.empty(len(level)), float(rng.standard_normal())
        for k in range(len(level)):
            before = self.lean * before + np.sqrt(1.0 - self.lean**2) * float(new[k])
            off[k] = before
        read = level + self.size * (1.0 + self.grows * np.clip(level, 0.0, 1.5)) * off
        return np.round(read / self.size) * self.size if self.coarse else read


def between(low: float, high: float, rng: np.random.Generator) -> float:
    """Evenly drawn on a logarithmic scale."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _summed(pace: np.ndarray, s: np.ndarray) -> np.ndarray:
    return np.asarray(np.concatenate([[0.0], np.cumsum(pace[1:] * np.diff(s))]))


def _gompertz(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    b, c, top = rng.uniform(3.0, 8.0), rng.uniform(2.5, 7.0), 1.0 / rng.uniform(0.6, 0.93)
    whole = np.exp(-b * np.exp(-c * s)) - np.exp(-b)
    return np.asarray(top * whole / (1.0 - np.exp(-b)))


def _pitting(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    at = rng.uniform(0.0, 0.4)
    return np.asarray((np.maximum(s - at, 0.0) / (1.0 - at)) ** rng.uniform(0.3, 0.8))


def _cell(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    part = rng.uniform(0.2, 0.6)
    level = part * np.sqrt(s) + (1.0 - part) * s ** between(3.0, 15.0, rng)
    for at in np.cumsum(rng.exponential(0.12, 40)):
        since = np.maximum(s - at, 0.0)
        back = rng.uniform(0.005, 0.05) * np.exp(-since / rng.uniform(0.01, 0.06))
        level = level - np.where(s >= at, back, 0.0)
    return np.asarray(level)


def _run_in(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    first = rng.uniform(0.05, 0.4) * np.exp(-s / rng.uniform(0.01, 0.1))
    return np.asarray(first + s ** rng.uniform(0.8, 3.0))


def _lubed(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    level, turn = s ** rng.uniform(0.8, 2.0), (s / rng.uniform(0.08, 0.3)) % 1.0
    freely = 1.0 - rng.uniform(0.1, 0.4) + rng.uniform(0.1, 0.4) * turn
    return np.asarray(level * freely + 0.02 * turn)


def _stages(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    many = int(rng.integers(3, 6))
    begins = np.sort(rng.uniform(0.0, 1.0, many - 1))
    pace = np.cumsum(np.exp(rng.normal(0.0, 1.0, many)))[np.searchsorted(begins, s)]
    return np.asarray(_summed(pace, s) / (float(np.sum(pace[s <= 1.0])) * float(s[1] - s[0])))


def _loaded(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    keep = float(np.exp(-float(s[1] - s[0]) / between(0.03, 0.4, rng)))
    size, now = rng.uniform(0.3, 1.0), float(rng.standard_normal())
    new, wander = np.sqrt(1.0 - keep**2) * rng.standard_normal(len(s)), np.empty(len(s))
    for k in range(len(s)):
        now = keep * now + float(new[k])
        wander[k] = now
    return _summed(np.exp(size * wander - size**2 / 2.0), s)


def _season(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    wave = np.sin(2.0 * np.pi * (rng.uniform(1.0, 6.0) * s + rng.uniform()))
    return _summed(np.exp(rng.uniform(0.5, 2.0) * wave), s)


def _clogging(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    c = rng.uniform(0.5, 0.97)
    return np.asarray(s * (1.0 - c) / np.maximum(1.0 - c * s, 1e-3))


def _multiplied(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    walk = np.cumsum(rng.standard_normal(len(s))) * np.sqrt(float(s[1] - s[0]))
    k = rng.uniform(2.0, 5.0)
    return np.asarray(np.expm1(k * s + rng.uniform(0.1, 0.6) * walk) / np.expm1(k))


def _broken_steps(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    level = 0.1 * s + rng.uniform(0.3, 0.8) * (1.0 - np.exp(-s / rng.uniform(0.1, 0.6)))
    for at in rng.uniform(0.3, 1.05, int(rng.integers(1, 4))):
        level = level + np.where(s >= at, rng.uniform(0.1, 0.4), 0.0)
    return np.asarray(level)


def _eased(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    at = rng.uniform(0.2, 0.8)
    return np.asarray(np.minimum(s, at) + rng.uniform(0.1, 0.6) * np.maximum(s - at, 0.0))


UNEVEN: Mapping[str, Level] = {
    "gompertz": _gompertz, "pitting": _pitting, "cell": _cell, "run in": _run_in, "lubed": _lubed,
    "stages": _stages, "loaded": _loaded, "season": _season, "clogging": _clogging,
    "multiplied": _multiplied, "broken steps": _broken_steps, "eased": _eased,
}  # fmt: skip
