"""A rough search from many places: where the one from the start came nowhere near the rows.

What a start that is 25 times off leads to depends on where it lies: a force below the friction of
the start moves nothing, so nothing tells a step where to go, and a simulation that runs away tells
nothing at all. So the problem is looked at in many places of its bounds first, spread evenly over
the logarithm of each number (a Latin hypercube), on the first rows alone, and searched from those
that leave least, in the logarithm too: a step of a third is a third everywhere.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> rows = make_block(
...     t=np.arange(50) * 10**8, u=np.ones((50, 1)), y=0.02 * np.arange(50.0)[:, None])
>>> problem = Problem(Robot1D(), (rows,), ("gain",))
>>> scattered(problem, problem.start, lambda one, values: values[0] < 0.5).round(2).tolist()
[0.2]
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evertwin.fold import take
from evertwin.signals.sizes import rms
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.posing.settings import Settings
from evertwin.tuning.search.hypercube import layered
from evertwin.tuning.search.nonlinear import STOPPED, Objective, search
from evertwin.types import Bools, Vector

REACH = 30.0
"""Times the start, and its inverse: how far numbers are looked for inside the bounds."""
PLACES, KEPT, ROUNDS = 64, 3, 4
"""Looked at in each round, searched from, and rounds at most."""
ROWS = 4000
"""Rows that are looked at, the first of each recording, at least `FEWEST`."""
FEWEST = 20
EVALUATIONS, TOLERANCE = 60, 1e-4
"""Of a search that only has to end near a minimum."""


class Logarithmic(Objective):
    """The objective over the logarithm of all numbers that do not start at zero.

    >>> Logarithmic.__name__
    'Logarithmic'
    """

    def __init__(self, problem: Problem, settings: Settings, base: Vector) -> None:
        super().__init__(problem, settings, np.ones(len(base), dtype=np.bool_), base)

    def values(self, z: Vector) -> Vector:
        """All tuned parameters, at the logarithm of their multiple of the base, or beside it."""
        scaled = self.base != 0.0
        out = np.where(scaled, self.base * np.exp(z), self.base + z * self.sizes)
        return np.asarray(np.clip(out, *self.problem.bounds))

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """Of the logarithm, `REACH` squared at most; of what starts at zero its own."""
        low, high = super().bounds
        ends = _reach(self.problem, self.base, REACH**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.sort(np.log(np.stack(ends) / self.base), axis=0)
        scaled = self.base != 0.0
        return np.where(scaled, logs[0], low), np.where(scaled, logs[1], high)


def scattered(
    problem: Problem, values: Vector, enough: Callable[[Problem, Vector], bool]
) -> Vector:
    """Where searches from many places lead, (k,): the values that leave least of the first rows.

    Args:
        values: where another search has ended, (k,): as good as any place.
        enough: whether a problem's values end the rounds.
    """
    some = _first(problem)
    rough = replace(problem.settings, evaluations=EVALUATIONS, tolerance=TOLERANCE)
    own = np.array([name in problem.model.parameters.names for name in problem.names])
    best, best_left = values, _left(some, [values])[0]
    for round_ in range(ROUNDS):
        places = _places(problem, own, round_)
        order = np.argsort(_left(some, places), kind="stable")[:KEPT].tolist()
        found = [search(Logarithmic(some, rough, places[k]), "scattered") for k in order]
        ends = [one.values for one in found]
        for end, left in zip(ends, _left(some, ends), strict=True):
            if left < best_left:
                best, best_left = end, left
        if enough(some, best) or any(one.message.startswith(STOPPED) for one in found):
            break
    return best


def _first(problem: Problem) -> Problem:
    """The problem on the first rows of its recordings."""
    part = min(ROWS / sum(len(window.t) for window in problem.windows), 1.0)
    if part == 1.0:
        return problem
    counts = [max(math.ceil(part * len(window.t)), FEWEST) for window in problem.windows]
    windows = tuple(take(w, 0, n) for w, n in zip(problem.windows, counts, strict=True))
    return replace(problem, windows=windows)


def _reach(problem: Problem, base: Vector, reach: float) -> tuple[Vector, Vector]:
    """From where to where numbers with the sign of ``base`` (k,) are looked for: nearest zero,
    farthest from it."""
    low, high = problem.bounds
    near, far = np.where(base < 0.0, -high, low), np.where(base < 0.0, -low, high)
    size, sign = np.abs(base), np.sign(base)
    near, far = np.clip(near, size / reach, size), np.clip(far, size, size * reach)
    return sign * near, sign * far


def _places(problem: Problem, own: Bools, seed: int) -> list[Vector]:
    """Places of one round; what starts at zero stays there, and so does what a recording begins
    with."""
    base = problem.start
    (rng,) = np.random.default_rng([problem.settings.seed, seed]).spawn(1)
    spread = layered(rng, PLACES, len(base))
    near, far = _reach(problem, base, REACH)
    moves = own & (base != 0.0)
    ratio = np.where(moves, far, 1.0) / np.where(moves, near, 1.0)
    return list(np.where(moves, near * ratio**spread, base))


def _left(problem: Problem, places: list[Vector]) -> list[float]:
    """The logarithm of what each place leaves of the rows, all outputs together; infinite where a
    simulation runs away."""
    used, found = problem.rows.used, list[float]()
    rows = used.sum(axis=0)
    size = np.where(rows > 0, rms(np.where(used, problem.rows.y, np.nan)), 1.0)
    for r in problem.residuals_of(places):
        left = rms(np.where(used, r, np.nan))[rows > 0]
        least = 1e-9 * size[rows > 0] + 1e-300  # of exact data
        sound = np.isfinite(r[used]).all() and np.isfinite(left).all()
        found.append(float(rows[rows > 0] @ np.log(np.maximum(left, least))) if sound else np.inf)
    return found
