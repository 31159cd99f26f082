"""Wear that is calm for most of a life and ends soon after it begins, or begins anew.

`SUDDEN` is what a life told alone is measured on (`python -m proofs.alone`):

asleep       next to nothing until 70 to 99 % of the life, then a power law
bent down    a line, from there on 5 to 60 times as steep
overloaded   a power law whose load grows to 4 to 40 times there
runaway      grows by its own power without bound, as a crack that begins there
spalling     jumps that come faster and faster, from there on
healing      rises in waves: what is torn is rolled flat again

`ABRUPT` is what nothing here was measured on:

second knee  bends twice, each time to 3 to 8 times the slope
aging        a power of the age of 8 to 60
snapping     most of a line, then the rest within 0.3 to 3 % of the life
worn through a coating wears off, what lies below wears 8 to 50 times as fast
wandering    a random walk with drift, from 70 to 97 % of the life on
stepping     two to five large steps in the last 2 to 25 %
breaking in  a logistic step of 0.3 to 3 % of the life near its end
shooting     an exponential of 10 to 60 lives
third stage  creep: slower, steady, then faster and faster
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

Level = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """Evenly drawn on a logarithmic scale."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _since(s: np.ndarray, rng: np.random.Generator, last: float = 0.01) -> np.ndarray:
    """0 until ``last`` to 30 % of the life are left, 1 at its end."""
    left = _between(last, 0.3, rng)
    return np.asarray(np.maximum(s - 1.0 + left, 0.0) / left)


def _asleep(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(rng.uniform(0.0, 0.1) * s + _since(s, rng) ** rng.uniform(0.7, 3.0))


def _bent_down(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    left = _between(0.01, 0.3, rng)
    return np.asarray(s + (_between(5.0, 60.0, rng) - 1.0) * np.maximum(s - 1.0 + left, 0.0))


def _overloaded(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    left = _between(0.02, 0.3, rng)
    done = s + (_between(4.0, 40.0, rng) - 1.0) * np.maximum(s - 1.0 + left, 0.0)
    return np.asarray(done ** rng.uniform(0.6, 1.6))


def _runaway(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    x, p, start = _since(s, rng, 0.02), rng.uniform(1.0, 4.0), rng.uniform(0.05, 0.3)
    left = np.maximum(start**-p * (1.0 - x) + x, 1e-3)
    grown = (np.minimum(left ** (-1.0 / p), 3.0) - start) / (1.0 - start)
    return np.asarray(rng.uniform(0.0, 0.2) * np.minimum(s, 1.0) + grown)


def _spalling(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    x, many = _since(s, rng, 0.02), rng.uniform(4.0, 20.0)
    times = np.cumsum(rng.exponential(1.0 / many, 200) / (1.0 + 0.05 * np.arange(200)))
    risen = np.concatenate([[0.0], np.cumsum(rng.gamma(1.5, 1.0 / 1.5 / many, 200))])
    return np.asarray(rng.uniform(0.0, 0.15) * s + risen[np.searchsorted(times, x, "right")])


def _healing(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    x, size, turns = _since(s, rng, 0.02), rng.uniform(0.05, 0.25), rng.uniform(0.7, 3.0)
    calm = rng.uniform(0.0, 0.15) * s
    return np.asarray(calm + x ** rng.uniform(0.8, 2.0) + size * np.sin(2.0 * np.pi * turns * x))


def _second_knee(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    left, k = _between(0.05, 0.4, rng), _between(3.0, 8.0, rng)
    later = left * rng.uniform(0.1, 0.7)
    one, two = (np.maximum(s - 1.0 + x, 0.0) for x in (left, later))
    return np.asarray(s + (k - 1.0) * (one + k * two))


def _aging(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(rng.uniform(0.0, 0.3) * s + np.minimum(s, 1.1) ** _between(8.0, 60.0, rng))


def _snapping(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    left = _between(0.003, 0.03, rng)
    base = rng.uniform(0.3, 0.8) * s ** rng.uniform(0.7, 1.5)
    return np.asarray(base + rng.uniform(0.6, 1.2) * np.maximum(s - 1.0 + left, 0.0) / left)


def _worn_through(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    left, soft = _between(0.03, 0.25, rng), _between(0.003, 0.03, rng)
    below = soft * np.logaddexp(0.0, (s - 1.0 + left) / soft)
    return np.asarray(rng.uniform(0.2, 1.0) * s + _between(8.0, 50.0, rng) * below)


def _wandering(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    x = _since(s, rng, 0.03)
    steps = np.sqrt(np.diff(x, prepend=0.0)) * rng.standard_normal(len(x))
    return np.asarray(rng.uniform(0.0, 0.2) * s + x + rng.uniform(0.1, 0.4) * np.cumsum(steps))


def _stepping(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    left, many = _between(0.02, 0.25, rng), int(rng.integers(2, 6))
    level = rng.uniform(0.05, 0.4) * s + 8.0 * np.maximum(s - 1.0, 0.0)
    for at in 1.0 - left * rng.random(many):
        level = level + np.where(s >= at, rng.uniform(0.5, 1.5) / many, 0.0)
    return np.asarray(level)


def _breaking_in(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    left, width = _between(0.01, 0.15, rng), _between(0.003, 0.03, rng)
    step = 1.0 / (1.0 + np.exp(-np.clip((s - 1.0 + left) / width, -500.0, 500.0)))
    line = rng.uniform(0.1, 0.4) * s + 3.0 * np.maximum(s - 1.0, 0.0)
    return np.asarray(line + rng.uniform(0.8, 1.2) * step)


def _shooting(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    last = np.exp(np.minimum(_between(10.0, 60.0, rng) * (s - 1.0), 3.0))
    return np.asarray(rng.uniform(0.0, 0.3) * s + last)


def _third_stage(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    first = rng.uniform(0.05, 0.2) * (1.0 - np.exp(-s / 0.1)) + rng.uniform(0.1, 0.4) * s
    last = np.expm1(np.minimum(rng.uniform(2.0, 5.0) * _since(s, rng), 9.0)) / 50.0
    return np.asarray(first + last)


SUDDEN: Mapping[str, Level] = {
    "asleep": _asleep, "bent down": _bent_down, "overloaded": _overloaded, "runaway": _runaway,
    "spalling": _spalling, "healing": _healing,
}  # fmt: skip
ABRUPT: Mapping[str, Level] = {
    "second knee": _second_knee, "aging": _aging, "snapping": _snapping,
    "worn through": _worn_through, "wandering": _wandering, "stepping": _stepping,
    "breaking in": _breaking_in, "shooting": _shooting, "third stage": _third_stage,
}  # fmt: skip
