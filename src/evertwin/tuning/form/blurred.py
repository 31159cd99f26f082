"""Numbers that the noise of inputs leads astray: an acceleration that is half noise halves a mass.

Least squares take inputs for exact. Noise of one makes its column larger than what the machine did,
so that its number is told too small, whatever the number of rows, and others make up for it; and a
derivative is little but noise where a place is coarse. So the normal equations are taken again with
as much noise added as the inputs have: what that changes, they hold once already, and are told
without it (J. R. Cook and L. A. Stefanski 1994, on the equations instead of the numbers, which is
exact for columns that are linear in an input). Values stay, as those that predict best by inputs
as noisy as these; the interval holds both. Where the noise is most of what tells a number, how much
it is decides on it, and nothing is told. With the same equations it is counted what derivatives
from row to row make too small of motion that is fast beside the rows.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.drive import DriveForce
>>> from evertwin.tuning import solve
>>> rng, t = np.random.default_rng(0), np.arange(4000) * 0.01
>>> v, a = np.sin(3 * t), 3 * np.cos(3 * t)
>>> y = (5.0 * a + rng.normal(0.0, 0.2, 4000))[:, None]
>>> noise = [np.stack([0 * t, rng.normal(0.0, 1.0, 4000)], axis=1) for _ in range(4)]
>>> u = np.stack([v, a], axis=1) + noise.pop()
>>> told = Drawn(u, noise)
>>> problem = Problem(DriveForce(), (make_block(t=(t * 1e9).astype(int), u=u, y=y),), ("mass",))
>>> plain = solve(problem)
>>> both = plain, blurred(problem, plain, told)
>>> [low < 5.0 < high for low, high in (fit.interval("mass") for fit in both)]
[False, True]
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.tuning.intervals.assemble import sizes_of, student
from evertwin.tuning.intervals.fit import Amend, Fit
from evertwin.tuning.intervals.identifiability import grade
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Float64, Inputs, Vector

UNSURE = 0.2
"""Part by which the variance of an input's noise may be another than it is told."""
LEAST = 0.1
"""Part of what rows tell that has to be left without the noise for a number to be told by it."""
LOADS = 0.02
"""Part of a number's variance from which on what hides there hides the number."""
PARTS = 40
"""Stretches of rows that are compared for what a number scatters by."""
TINY = 1e-10
"""Beside what rows tell: keeps numbers that trade with each other exactly."""
MORE = 1.5
"""Times the interval from which on it is said why it is so wide."""


HIDDEN = (
    "cannot be told from these data: what tells it is mostly noise of the inputs (derivatives of "
    "a measured place): a lower [filter] cutoff, or a better measurement"
)
SHIFTS = "noise of the inputs leads it astray: without it, {:.4g} to {:.4g}"


class Drawn(NamedTuple):
    """What inputs may have been.

    >>> Drawn(np.zeros((1, 2)), ()).noise
    ()
    """

    u: Inputs
    """The inputs as they are likeliest, (n, nu)."""
    noise: Sequence[Inputs]
    """Draws of what they scatter by, (n, nu) each."""


class _Equations(NamedTuple):
    """The normal equations of each stretch of rows."""

    squares: Float64[np.ndarray, "parts k k"]
    sides: Float64[np.ndarray, "parts k"]

    def at(self, change: Vector) -> Float64[np.ndarray, "parts k"]:
        """The right-hand sides at values moved by ``change``."""
        return np.asarray(self.sides - self.squares @ change)


def blurred(problem: Problem, fit: Fit, drawn: Drawn | None) -> Fit:
    """The fit with intervals that hold though inputs are noisy. Values stay.

    Args:
        problem: what was tuned; of a model that is not linear the fit comes back as it is.
        fit: its outcome.
        drawn: what its inputs may have been; None: they are exact.
    """
    free = np.array([verdict != "not" for verdict in fit.verdict])
    if drawn is None or not (problem.static and free.any() and fit.converged):
        return fit
    (u, noise), near = drawn, problem.tuning(tuple(np.array(fit.names)[free].tolist()))
    here, was = (_equations(near, fit, free, one) for one in (u, problem.rows.u))
    if not (here.squares.sum(axis=0).diagonal() > 0).all():
        return fit
    there = here if not len(noise) else _mean(
        _equations(near, fit, free, u + sign * e) for e in noise for sign in (1.0, -1.0)
    )  # fmt: skip
    # what a fit leaves of its sides, its prior holds against
    (low, high), hidden = _told(here, there, near.information, was.sides.sum(axis=0))
    scale = sizes_of(near, near.sensitivity(fit.values[free]), fit.values[free])
    return fit.amended({
        k: Amend((-np.inf, np.inf), "weak", (HIDDEN,)) if hidden[j]
        else _widened(fit, k, (low[j], high[j]), scale[j])
        for j, k in enumerate(np.flatnonzero(free).tolist())
    })  # fmt: skip


def _widened(fit: Fit, k: int, by: tuple[float, float], size: float) -> Amend:
    """A number whose value would change ``by`` so much, at least and at most, without the noise."""
    value, (low, high) = float(fit.values[k]), fit.interval95[k].tolist()
    ends = min(low, value + by[0]), max(high, value + by[1])
    (word,), (wide,) = grade([""], np.array([(ends[1] - ends[0]) / 2.0 / size]))
    if word == "identifiable" and ends[0] <= 0.0 <= ends[1] and not low <= 0.0 <= high:
        word, wide = "weak", "not told from zero"
    if ends[1] - ends[0] < MORE * (high - low) and word == "identifiable":
        return Amend(ends)
    said = SHIFTS.format(value + by[0], value + by[1])
    return Amend(ends, "" if word == "identifiable" else "weak", (said, wide))


def _equations(problem: Problem, fit: Fit, free: np.ndarray, u: Inputs) -> _Equations:
    """With other inputs, on the same rows."""
    values = fit.values[free]
    other = replace(problem, prior=problem.parameters.with_values(
        dict(zip(fit.names, fit.values.tolist(), strict=True))))  # fmt: skip
    other.__dict__["rows"] = replace(problem.rows, u=u)
    r, columns = other.residuals(values), other.jacobian(values)
    used = problem.rows.used & np.isfinite(r) & np.isfinite(columns).all(axis=2)
    columns = np.where(used[:, :, None], columns, 0.0) / fit.noise[:, None]
    r = np.where(used, r, 0.0) / fit.noise
    edges = np.linspace(0, len(r), PARTS + 1).astype(np.int64)
    pairs = [(columns[a:b].reshape(-1, len(values)), r[a:b].ravel()) for a, b in pairwise(edges)]
    return _Equations(np.stack([a.T @ a for a, _ in pairs]), np.stack([a.T @ b for a, b in pairs]))


def _mean(every: Iterable[_Equations]) -> _Equations:
    """Of draws."""
    total, count = None, 0
    for one in every:
        total = one if total is None else _Equations(*map(np.add, total, one))
        count += 1
    assert total is not None
    return _Equations(total.squares / count, total.sides / count)


def _told(
    here: _Equations, there: _Equations, prior: Vector, rest: Vector
) -> tuple[tuple[Vector, Vector], np.ndarray]:
    """((least, most) by which values change without the noise, (k,) each; which are hidden).

    Args:
        there: with as much noise added as there is.
        prior: information of each value, (k,).
        rest: of the sides, that the fit leaves, (k,).
    """
    square = here.squares.sum(axis=0)
    size = np.sqrt(square.diagonal())
    base = (square + np.diag(prior)) / np.outer(size, size) + TINY * np.eye(len(size))
    more = (there.squares.sum(axis=0) - square) / np.outer(size, size)
    ends = []
    for part in (1.0 - UNSURE, 1.0, 1.0 + UNSURE):
        # of each direction what is left without the noise
        left, vectors = scipy.linalg.eigh(base - part * more, base)
        inverse = (vectors / np.maximum(left, LEAST)) @ vectors.T / np.outer(size, size)
        change = inverse @ ((1.0 + part) * here.sides - part * there.sides).sum(axis=0)
        pull = (1.0 + part) * here.at(change) - part * there.at(change)
        scatter = np.sqrt(np.square((pull - pull.mean(axis=0)) @ inverse).sum(axis=0))
        half = student(np.array([PARTS - 1.0]))[0] * scatter
        ends += [change - half, change + half]
    loads = np.square(vectors)
    hidden = loads[:, left < LEAST].sum(axis=1) > LOADS * loads.sum(axis=1)
    return (np.min(ends, axis=0), np.max(ends, axis=0)), hidden
