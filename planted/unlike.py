"""Wear as no law of the predictor has it, in units, scales and noises of its own, drawn by seed.

    plateau     s/(k + s): slower and slower, the limit at 55 to 90 % of where it would end
    recovering  power law, a part of it healed at random moments, most of that for good
    cracking    da/ds ~ load^m·a^(m/2), the load drawn anew at random moments
    reloaded    a line whose slope is multiplied by 0.3 to 4, once to three times
    sleeping    nothing for 30 to 80 % of the life, then a power law
    stairs      jumps of random sizes at random moments, nothing between them
    bathtub     run-in, then a line, then faster and faster
    seasonal    a line under waves that nobody measures

A component is seen 60 to 300 times in its life (those of `planted/sudden.py`, at whose end much
happens in little time, up to 1,500 times) through noise that leans on the value before by 0 to
0.8; a standard deviation of 0.5 to 4 % of the way from new to the limit. Lives of one kind spread
by 35 % (log-normal) around one that is drawn from 10 to 100,000. Those of `planted/uneven.py` are
seen as is said there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planted.fresh import FRESH
from planted.sudden import ABRUPT, SUDDEN
from planted.uneven import UNEVEN, Seen, between
from planted.unseen import UNSEEN

FINE = 4000
"""Points of a life."""
SPREAD = 0.35


class Kind(NamedTuple):
    """A kind of machine: what all of its like have in common."""

    law: str
    life: float
    values: int
    new: float
    limit: float
    seen: Seen | None = None


class Stranger(NamedTuple):
    """One component from new to its end, where its level first passes the limit."""

    at: np.ndarray
    value: np.ndarray
    life: float


def kind_of(law: str, rng: np.random.Generator) -> Kind:
    """A kind of machine that wears by this law."""
    if law in UNEVEN:
        new = float(rng.normal(0.0, 3.0)) * between(0.1, 100.0, rng)
        way = between(0.01, 1000.0, rng) * float(rng.choice((-1.0, 1.0)))
        life, values = between(5.0, 1e6, rng), int(between(25.0, 1500.0, rng))
        return Kind(law, life, values, new, new + way, Seen.drawn(rng))
    new = float(rng.normal(0.0, 3.0))
    way = float(np.exp(rng.uniform(-3.0, 5.0)) * rng.choice((-1.0, 1.0)))
    life = float(np.exp(rng.uniform(np.log(10.0), np.log(1e5))))
    values = rng.integers(60, 300)
    if law in SUDDEN or law in ABRUPT:
        values = np.exp(rng.uniform(np.log(60.0), np.log(1500.0)))
    return Kind(law, life, int(values), new, new + way)


def stranger(kind: Kind, rng: np.random.Generator) -> Stranger:
    """One component of a kind."""
    every = {**LEVELS, **UNSEEN, **FRESH, **SUDDEN, **ABRUPT, **UNEVEN}
    level = every[kind.law](np.linspace(0.0, 4.0, 4 * FINE + 1), rng)
    if not (level >= 1.0).any():
        return stranger(kind, rng)
    end = int(np.argmax(level >= 1.0))
    if (seen := kind.seen) is not None:
        life = kind.life * float(np.exp(seen.spread * rng.standard_normal()))
        rows = seen.rows(kind.values, end, rng)
        read = seen.value(level[rows], rng)
        return Stranger(rows / end * life, kind.new + (kind.limit - kind.new) * read, life)
    rows = np.unique(np.round(np.linspace(0.0, 1.0, kind.values) * end).astype(int))
    life = kind.life * float(np.exp(SPREAD * rng.standard_normal()))
    lean, size = rng.uniform(0.0, 0.8), np.exp(rng.uniform(np.log(0.005), np.log(0.04)))
    noise = np.empty(len(rows))
    before = rng.standard_normal()
    for k in range(len(rows)):
        before = lean * before + np.sqrt(1.0 - lean**2) * rng.standard_normal()
        noise[k] = size * before
    value = kind.new + (kind.limit - kind.new) * (level[rows] + noise)
    return Stranger(rows / end * life, value, life)


def _plateau(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    k, top = rng.uniform(0.3, 1.5), 1.0 / rng.uniform(0.55, 0.9)
    return np.asarray(top * s / (k + s))


def _recovering(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    level = s ** rng.uniform(0.6, 1.6)
    for at in np.cumsum(rng.exponential(0.15, 40)):
        since = np.maximum(s - at, 0.0)
        back = rng.uniform(0.3, 1.0) * (1.0 - np.exp(-since / rng.uniform(0.02, 0.1)))
        level = level - np.where(s >= at, rng.uniform(0.01, 0.08) * (1.0 - back), 0.0)
    return np.asarray(level)


def _parts(s: np.ndarray, draw: Callable[[], float], rng: np.random.Generator) -> np.ndarray:
    """A factor that changes once to three times while the first two thirds of s pass."""
    out = np.full(len(s), draw())
    for at in np.sort(rng.uniform(0.1, 1.0, int(rng.integers(1, 4)))):
        out[s >= at] = draw()
    return out


def _cracking(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    m, start = rng.uniform(2.4, 4.5), rng.uniform(0.1, 0.5)
    p = m / 2.0 - 1.0
    pace = _parts(s, lambda: float(np.exp(rng.normal(0.0, 0.35))) ** (m / 2.0), rng)
    done = np.concatenate([[0.0], np.cumsum(pace[1:] * np.diff(s))])
    whole = start**-p
    left = np.maximum(whole - (whole - 1.0) * done, 1e-3)
    return np.asarray((np.minimum(left ** (-1.0 / p), 3.0) - start) / (1.0 - start))


def _reloaded(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    pace = _parts(s, lambda: float(np.exp(rng.uniform(np.log(0.3), np.log(4.0)))), rng)
    return np.asarray(np.concatenate([[0.0], np.cumsum(pace[1:] * np.diff(s))]))


def _sleeping(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    at = rng.uniform(0.3, 0.8)
    return np.asarray((np.maximum(s - at, 0.0) / (1.0 - at)) ** rng.uniform(0.8, 2.5))


def _stairs(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    many = rng.uniform(8.0, 25.0)
    times = np.cumsum(rng.exponential(1.0 / many, 400))
    sizes = rng.gamma(2.0, 0.5 / many, 400)
    return np.asarray(np.concatenate([[0.0], np.cumsum(sizes)])[np.searchsorted(times, s, "right")])


def _bathtub(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    first, late, sharp = rng.uniform(0.05, 0.2), rng.uniform(0.2, 0.5), rng.uniform(4.0, 10.0)
    last = late * np.expm1(np.minimum(sharp * s, 50.0)) / np.expm1(sharp)
    return np.asarray(first * (1.0 - np.exp(-s / 0.04)) + (1.0 - first - late) * s + last)


def _seasonal(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    turns, size = rng.uniform(2.0, 10.0), rng.uniform(0.02, 0.06)
    return np.asarray(s + size * np.sin(2.0 * np.pi * (turns * s + rng.uniform())))


LEVELS: dict[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "plateau": _plateau, "recovering": _recovering, "cracking": _cracking, "reloaded": _reloaded,
    "sleeping": _sleeping, "stairs": _stairs, "bathtub": _bathtub, "seasonal": _seasonal,
}  # fmt: skip
