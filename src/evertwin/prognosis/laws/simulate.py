"""Simulated lives: any law of wear as a rate, all samples at once.

The closed forms of `passage` hold for wear that runs on a clock. A rate that
depends on the level, on a plan of loads or on a simulation of the machine has none: then samples of
the level go forward in steps,

    x ← x + rate(x, t)·Δt + σ·√Δt·ε,

all in one array, until each passed the limit. Between two levels below the limit a Brownian path
passes it with probability exp(−2(L − x)(L − x′)/(σ²Δt)), which is drawn as well, so that steps need
not be small. A sample that did not pass within the horizon lives for ever.

>>> rng = np.random.default_rng(0)
>>> start = np.zeros(1000)
>>> lives = simulate_lives(lambda x, t: 0.01 + 0.0 * x, start, 1.0, Steps(1.0, 400.0, 0.01), rng)
>>> bool(98.0 < np.median(lives) < 102.0)
True

Source: Gobet, "Weak approximation of killed diffusion using Euler schemes" (2000), for the bridge.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.types import Float64

__all__ = ["Rate", "Steps", "simulate_lives"]

Rate = Callable[[Float64[np.ndarray, " n"], float], Float64[np.ndarray, " n"]]
"""rate(levels of the samples that still live, time from now) -> growth per time."""


class Steps(NamedTuple):
    """How to go forward.

    >>> Steps(1.0, 100.0).noise
    0.0
    """

    length: float
    """Δt."""
    horizon: float
    noise: float = 0.0
    """σ: standard deviation of the growth over a unit of time."""


def simulate_lives(
    rate: Rate, start: Float64[np.ndarray, " n"], limit: float, steps: Steps,
    rng: np.random.Generator,
) -> Float64[np.ndarray, " n"]:  # fmt: skip
    """Remaining life of each sample; infinite beyond the horizon.

    Raises `UsageError` for a step or a horizon that is not above 0, or noise below 0.

    Args:
        rate: growth per time; takes and gives arrays over living samples. A rate with parameters
            per sample must not depend on which samples still live: give them through the level.
        start: levels now; wear grows towards ``limit``.
        limit: where life ends.
        steps: step, horizon and noise.
        rng: source of the noise.
    """
    if not (steps.length > 0.0 and steps.horizon > 0.0 and steps.noise >= 0.0):
        raise UsageError(f"simulate: expected a step and a horizon above 0 and noise ≥ 0: {steps}")
    life = np.full(len(start), np.inf)
    life[start >= limit] = 0.0
    alive = np.flatnonzero(start < limit)
    x = start[alive].copy()
    dt, spread = steps.length, steps.noise * np.sqrt(steps.length)
    for k in range(int(np.ceil(steps.horizon / dt))):
        if not len(alive):
            break
        new = x + rate(x, k * dt) * dt
        if spread > 0.0:
            new += spread * rng.standard_normal(len(new))
        passed = new >= limit
        share = np.where(passed, (limit - x) / np.maximum(new - x, 1e-300), 0.5)
        if spread > 0.0:
            touch = np.exp(-2.0 * (limit - x) * np.maximum(limit - new, 0.0) / spread**2)
            passed |= rng.random(len(new)) < touch
        if passed.any():
            life[alive[passed]] = (k + np.clip(share[passed], 0.0, 1.0)) * dt
            alive, new = alive[~passed], new[~passed]
        x = new
    return life
