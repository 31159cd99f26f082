"""What a recording says, roughly, of a mass on a spring: where its model starts from."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy

from evertwin.types import Float64, Vector

ROWS = 20_000
"""Rows that it is told from."""
SHARPEST, DULLEST = 0.005, 0.7
"""Damping ratios of what swings: more of it does not, and less is told by no recording."""
MEANS = (1, 2, 4, 8, 16, 32, 64)
"""Rows that means are taken of: a motion is told best by ten to thirty of them in a period."""
FEWEST = 40
"""Of such means."""
PLAIN = 0.7
"""Share of what is left without a cube of the place up to which one counts."""
TIMES = 3
"""Estimates, each with the run, or the place of rest, of the one before."""


Numbers: TypeAlias = Float64[np.ndarray, "numbers"]
Pole: TypeAlias = tuple[float, float]
"""Stiffness [1/s²] and damping [1/s]."""


class Oscillator(NamedTuple):
    """Numbers of d²y/dt² = gain u − stiffness d − hardening d³ − damping dy/dt, d = y − rest, in
    SI units.

    >>> Oscillator(2.0, 100.0, 0.5, 0.0, 0.0).stiffness
    100.0
    """

    gain: float
    stiffness: float
    damping: float
    hardening: float
    """0: none is told by the recording."""
    rest: float


def guess_oscillator(t: Vector, u: Vector, y: Vector) -> tuple[Oscillator | None, float]:
    """The oscillator whose free run is nearest to a recording, and the mean square by which it is
    off; None where nothing swings.

    Args:
        t: time of each row [s], (n,), rising.
        u: what drives, (n,).
        y: what answers, (n,).

    >>> t = np.arange(2000) * 0.01
    >>> u = np.repeat(np.sin(np.arange(40.0) ** 2), 50)
    >>> y = driven(9.0, 0.6, 0.01, u) * 9.0 + 1.0
    >>> found, off = guess_oscillator(t, u, y)
    >>> found is not None and round(found.stiffness, 2), off < 1e-9
    (9.0, True)
    """
    known = np.isfinite(t) & np.isfinite(u) & np.isfinite(y)
    t, u, y = (one[known][:ROWS] for one in (t, u, y))
    if len(t) < 2 * FEWEST or not (np.ptp(u) > 0.0 and np.ptp(y) > 0.0 and t[-1] > t[0]):
        return None, math.inf
    step = float(t[-1] - t[0]) / (len(t) - 1)
    even = t[0] + step * np.arange(len(t))
    u = u[np.searchsorted(t, even + 0.01 * step, "right") - 1]
    y = np.interp(even, t, y)
    poles = {pole: _left(pole, step, y, u)[1] for pole in _poles(step, u, y)}
    best = min(poles, key=lambda pole: poles[pole], default=None)
    if best is None or not math.isfinite(poles[best]):
        return None, math.inf
    pole, (gain, constant, *_), off = _nearest(best, step, y, u)
    rest, hardening = constant / pole[0], 0.0
    for _ in range(TIMES):  # cubes are of the place from where it rests, which they move
        its, (force, cube, constant, *_), left = _nearest(pole, step, y, u, (y - rest) ** 3)
        if hardening == 0.0 and not left < PLAIN**2 * off:
            break
        pole, gain, hardening, off, rest = its, force, -cube, left, constant / its[0]
    if not _swings(*pole, 1.1):
        return None, math.inf
    return Oscillator(float(gain), *pole, float(hardening), float(rest)), off


def driven(stiffness: float, damping: float, step: float, force: Vector) -> Vector:
    """Where a mass is that a force drives from rest; the force holds over a row."""
    into, weights, *_ = _filter(stiffness, damping, step)
    return np.asarray(scipy.signal.lfilter(into, weights, force))


def _filter(stiffness: float, damping: float, step: float) -> tuple[list[float], ...]:
    """Numerator, for a force, denominator, and numerators for a place and a speed at the start."""
    own = np.array([[0.0, 1.0, 0.0], [-stiffness, -damping, 1.0], [0.0, 0.0, 0.0]])
    (a, b, into), (c, d, speeding), _ = scipy.linalg.expm(own * step).tolist()
    weights = [1.0, -(a + d), a * d - b * c]
    return [0.0, into, b * speeding - d * into], weights, [1.0, -d], [0.0, b]


def _swings(stiffness: float, damping: float, clear: float = 1.0) -> bool:
    """Is the damping within its bounds, by a factor ``clear`` or more?"""
    ratio = 0.5 * damping / math.sqrt(stiffness) if stiffness > 0.0 else 0.0
    return SHARPEST * clear < ratio < DULLEST / clear


def _nearest(pole: Pole, step: float, y: Vector, *forces: Vector) -> tuple[Pole, Numbers, float]:
    """The pole, the numbers that are linear, and the mean square that is left."""
    begin = np.log(pole)
    around = begin + np.array([[0.0, 0.0], [0.01, 0.0], [0.0, 0.2]])
    options: Any = {"maxiter": 60, "initial_simplex": around}

    def off(logs: Numbers) -> float:
        return _left((math.exp(logs[0]), math.exp(logs[1])), step, y, *forces)[1]

    found = scipy.optimize.minimize(off, begin, method="Nelder-Mead", options=options).x
    own = math.exp(found[0]), math.exp(found[1])
    return own, *_left(own, step, y, *forces)


def _left(pole: Pole, step: float, y: Vector, *forces: Vector) -> tuple[Numbers, float]:
    """Numbers of forces, of a constant one, of place and speed at the start; and the mean square
    that is left."""
    if not _swings(*pole):
        return np.zeros(len(forces) + 3), math.inf
    _, weights, place, speed = _filter(*pole, step)
    pulse = np.zeros(len(y))
    pulse[0] = 1.0
    made = [driven(*pole, step, one) for one in (*forces, np.ones(len(y)))]
    made += [scipy.signal.lfilter(one, weights, pulse) for one in (place, speed)]
    columns = np.column_stack(made)
    size = np.linalg.norm(columns, axis=0) + 1e-300
    numbers = np.linalg.lstsq(columns / size, y, rcond=None)[0] / size
    return numbers, float(np.square(columns @ numbers - y).mean())


def _poles(step: float, u: Vector, y: Vector) -> Iterator[Pole]:
    """Stiffness and damping as differences of means say them; instruments, the run of a first
    estimate, keep noise out of them."""
    for rows in MEANS:
        count = len(y) // rows
        if count < FEWEST:
            return
        a, b = (one[: count * rows].reshape(count, rows).mean(axis=1) for one in (u, y))
        inputs = np.column_stack([a[2:], a[1:-1], a[:-2], np.ones(count - 2)])
        now, run = np.column_stack([b[1:-1], b[:-2], inputs]), b
        for _ in range(TIMES):
            told = np.column_stack([run[1:-1], run[:-2], inputs]).T
            numbers = np.linalg.lstsq(told @ now, told @ b[2:], rcond=None)[0]
            root = np.roots([1.0, *-numbers[:2]])[0]
            if not (root.imag and 0.0 < abs(root) < 1.0):
                break
            turn = np.log(root) / (rows * step)
            yield float(abs(turn) ** 2), float(-2.0 * turn.real)
            after = scipy.signal.lfilter([1.0], [1.0, *-numbers[:2]], inputs @ numbers[2:])
            run = np.concatenate([b[:2], after])
