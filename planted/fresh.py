"""Wear drawn after the predictor's last change: nothing in it was chosen with these in view.

knee         a line, then from 60 to 95 % of the life 5 to 15 times as steep
relapsing    slows down towards a level, then begins anew, twice to four times
fatigued     1 − (1 − s)^(1/(1 + m)) by accumulated damage, stiffness lost early and at the end
tempered     a root of time under load that rises all the while
bursting     calm, with short bursts in which most of the wear happens
sagging      falls back below new by up to 15 % of the way first, then a power law
two rates    the sum of a saturating and an accelerating part
diffusing    the error function's complement: nothing for long, then nearly straight
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import scipy


def _knee(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    at, steep = rng.uniform(0.6, 0.95), rng.uniform(5.0, 15.0)
    return np.asarray(s + (steep - 1.0) * np.maximum(s - at, 0.0))


def _relapsing(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    level, begins = np.zeros(len(s)), np.sort(rng.uniform(0.1, 0.9, int(rng.integers(1, 4))))
    for begin in (0.0, *begins):
        since = np.maximum(s - begin, 0.0)
        level = level + rng.uniform(0.3, 1.0) * (1.0 - np.exp(-since / rng.uniform(0.1, 0.4)))
    return np.asarray(level / rng.uniform(0.75, 0.95) / level[len(s) // 4])


def _fatigued(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    m, early = rng.uniform(1.0, 4.0), rng.uniform(0.0, 0.3)
    damage = 1.0 - np.maximum(1.0 - s, 0.0) ** (1.0 / (1.0 + m))
    level = early * (1.0 - np.exp(-s / 0.05)) + (1.0 - early) * damage
    return np.asarray(level / level[len(s) // 4])


def _tempered(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    load = 1.0 + rng.uniform(0.5, 4.0) * s ** rng.uniform(1.0, 3.0)
    done = np.concatenate([[0.0], np.cumsum(load[1:] ** rng.uniform(1.0, 3.0) * np.diff(s))])
    return np.asarray((done / done[len(s) // 4]) ** rng.uniform(0.4, 0.8))


def _bursting(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    pace = np.full(len(s), rng.uniform(0.1, 0.5))
    for at in np.cumsum(rng.exponential(rng.uniform(0.08, 0.25), 60)):
        pace[(s >= at) & (s < at + rng.uniform(0.01, 0.05))] += rng.uniform(2.0, 10.0)
    return np.asarray(np.concatenate([[0.0], np.cumsum(pace[1:] * np.diff(s))]))


def _sagging(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    down, over = rng.uniform(0.02, 0.15), rng.uniform(0.05, 0.2)
    return np.asarray((1.0 + down) * s ** rng.uniform(0.8, 2.5) - down * (1.0 - np.exp(-s / over)))


def _two_rates(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    part, sharp = rng.uniform(0.2, 0.7), rng.uniform(2.0, 8.0)
    slowing = 1.0 - np.exp(-s / rng.uniform(0.05, 0.4))
    return np.asarray(part * slowing + (1.0 - part) * np.expm1(sharp * s) / np.expm1(sharp))


def _diffusing(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    k = rng.uniform(0.5, 2.0)
    whole = scipy.special.erfc(k / np.sqrt(np.maximum(s, 1e-6)))
    return np.asarray(whole / scipy.special.erfc(k))


FRESH: Mapping[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "knee": _knee, "relapsing": _relapsing, "fatigued": _fatigued, "tempered": _tempered,
    "bursting": _bursting, "sagging": _sagging, "two rates": _two_rates, "diffusing": _diffusing,
}  # fmt: skip
