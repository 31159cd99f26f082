"""What a recording says, roughly, of a mass that is pushed: where its model starts from."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.types import Float64, Vector

ROWS = 20_000
"""Rows that it is told from."""
STRETCHES = 60
"""Into which they are cut: over all of them the place of what nothing holds runs away."""
FEWEST = 20
"""Rows of a stretch, at least."""
RATES = 24
"""Dampings, and leaks, tried: from a hundredth of one per stretch to one per row."""
Stretches = Float64[np.ndarray, "stretches rows"]


class Mass(NamedTuple):
    """Numbers of d²y/dt² = gain u − damping dy/dt + constant, in SI units.

    >>> Mass(2.0, 0.5, 0.0).gain
    2.0
    """

    gain: float
    damping: float
    constant: float


def guess_mass(t: Vector, u: Vector, y: Vector) -> tuple[Mass | None, float]:
    """The mass whose runs over `STRETCHES` are nearest to a recording, and the mean square by which
    they are off, of that of a store's; None where too little moves.

    Of each damping the rest is linear: what the input and a constant do in all stretches, and place
    and speed at the start of each; a store has a level there alone.

    Args:
        t: time of each row [s], (n,), rising.
        u: what pushes, (n,).
        y: the place, (n,).

    >>> t = np.arange(4000) * 0.05
    >>> u = np.repeat(np.random.default_rng(0).normal(size=200), 20)
    >>> found, left = guess_mass(t, u, scipy.integrate.cumulative_trapezoid(
    ...     np.cumsum(0.05 * (2.0 * u - 0.3)), t, initial=0))
    >>> found is not None and f"{found.gain:.1f}", left < 0.01
    ('2.0', True)
    """
    known = np.isfinite(t) & np.isfinite(u) & np.isfinite(y)
    t, u, y = (one[known][:ROWS] for one in (t, u, y))
    rows = len(t) // STRETCHES
    if rows < FEWEST or not (np.ptp(u) > 0.0 and np.ptp(y) > 0.0 and t[-1] > t[0]):
        return None, math.inf
    step = float(t[-1] - t[0]) / (len(t) - 1)
    even = t[0] + step * np.arange(rows * STRETCHES)
    u = u[np.searchsorted(t, even + 0.01 * step, "right") - 1]
    pushed, seen = (one.reshape(STRETCHES, rows) for one in (u, np.interp(even, t, y)))
    found, least, store = None, math.inf, math.inf
    for rate in np.geomspace(0.01 / (rows * step), 1.0 / step, RATES).tolist():
        numbers, off = _left(rate, step, pushed, seen, order=2)
        if off < least:
            found, least = Mass(numbers[0], rate, numbers[1]), off
        store = min(store, _left(rate, step, pushed, seen, order=1)[1])
    return found, least / store if store > 0.0 else math.inf


def _left(
    rate: float, step: float, u: Stretches, y: Stretches, order: int
) -> tuple[tuple[float, float], float]:
    """Gain and constant, and the mean square that is left, of what forgets its speed at a ``rate``
    (order 2), or its level (1)."""
    decay, time = math.exp(-rate * step), step * np.arange(u.shape[1])
    part = -math.expm1(-rate * step) / rate
    forces = np.stack([u, np.ones_like(u)])
    driven = scipy.signal.lfilter([0.0, part], [1.0, -decay], forces)
    free = [np.exp(-rate * time)]
    if order == 2:
        moved = part * driven + (step - part) / rate * forces
        driven = np.concatenate([np.zeros((2, len(u), 1)), np.cumsum(moved, axis=2)], axis=2)
        driven, free = driven[:, :, :-1], [np.ones_like(time), -np.expm1(-rate * time) / rate]
    own = np.linalg.qr(np.column_stack(free))[0]  # what each stretch begins with
    *columns, rest = (
        (one - (one @ own) @ own.T).ravel() for one in (driven[0], driven[1], y)
    )  # fmt: skip
    table = np.column_stack(columns)
    size = np.linalg.norm(table, axis=0) + 1e-300
    gain, constant = np.linalg.lstsq(table / size, rest, rcond=None)[0] / size
    off = table @ np.array([gain, constant]) - rest
    return (float(gain), float(constant)), float(np.square(off).mean())
