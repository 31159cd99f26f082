"""More wear as no law of the predictor has it, written before its laws for plateaus and cracks.

logistic     slow, fast, slow again; the limit at 60 to 95 % of where it would end
logarithmic  log(1 + s/k)
cascading    jumps whose rate grows with every jump
geometric    a geometric random walk with drift
fraying      1 − (1 − s)^q, q 0.15 to 0.5: most of the way at the very end
shuttled     a line while at work, next to nothing while not, in turns of random length
patched      a power law that is set back by a fifth to a half, once to three times, untold
drifting     a line seen through a sensor that wanders slowly
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np


def _logistic(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    steep, middle, top = rng.uniform(4.0, 12.0), rng.uniform(0.2, 0.7), 1.0 / rng.uniform(0.6, 0.95)
    begin = 1.0 / (1.0 + np.exp(steep * middle))
    level = 1.0 / (1.0 + np.exp(-steep * (s - middle)))
    return np.asarray(top * (level - begin) / (1.0 - begin))


def _logarithmic(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    k = np.exp(rng.uniform(np.log(0.03), np.log(0.5)))
    return np.asarray(np.log1p(s / k) / np.log1p(1.0 / k))


def _cascading(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    rate, more = rng.uniform(4.0, 10.0), rng.uniform(0.05, 0.2)
    at, level, now, risen = [0.0], [0.0], 0.0, 0.0
    while now < 4.0 and risen < 1.5:
        now += rng.exponential(1.0 / (rate * (1.0 + more * len(at))))
        risen += rng.gamma(2.0, 0.5) / (2.5 * rate)
        at.append(now)
        level.append(risen)
    return np.asarray(np.array(level)[np.searchsorted(np.array(at), s, "right") - 1])


def _geometric(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    start, spread = rng.uniform(0.05, 0.4), rng.uniform(0.1, 0.5)
    step = float(s[1] - s[0])
    walk = np.cumsum(spread * np.sqrt(step) * rng.standard_normal(len(s)))
    whole = start * np.exp(-np.log(start) * s + walk - walk[0])
    return np.asarray((whole - start) / (1.0 - start))


def _fraying(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(1.0 - np.maximum(1.0 - s, 0.0) ** rng.uniform(0.15, 0.5))


def _shuttled(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    turns = np.cumsum(rng.exponential(rng.uniform(0.05, 0.2), 400))
    works = (np.searchsorted(turns, s) + int(rng.integers(0, 2))) % 2 == 0
    pace = np.where(works, 2.0, rng.uniform(0.0, 0.2))
    return np.asarray(np.concatenate([[0.0], np.cumsum(pace[1:] * np.diff(s))]))


def _patched(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    level = s ** rng.uniform(0.7, 2.0)
    for at in np.sort(rng.uniform(0.2, 0.9, int(rng.integers(1, 4)))):
        here = float(np.interp(at, s, level))
        level = level - np.where(s >= at, rng.uniform(0.2, 0.5) * here, 0.0)
    return np.asarray(level)


def _drifting(s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    size, lasting = rng.uniform(0.02, 0.06), rng.uniform(0.05, 0.3)
    keep = np.exp(-float(s[1] - s[0]) / lasting)
    new = np.sqrt(1.0 - keep * keep) * rng.standard_normal(len(s))
    off, wander = np.empty(len(s)), 0.0
    for k in range(len(s)):
        wander = keep * wander + new[k]
        off[k] = wander
    return np.asarray(s + size * (off - off[0]))


UNSEEN: Mapping[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "logistic": _logistic, "logarithmic": _logarithmic, "cascading": _cascading,
    "geometric": _geometric, "fraying": _fraying, "shuttled": _shuttled, "patched": _patched,
    "drifting": _drifting,
}  # fmt: skip
