"""A drive that does not do what it is told: the truth that a robot's twin has to find out.

The speed controller cannot set movements below a start threshold (it stands still, or it clamps to
the threshold) and saturates at a cap; in between it is linear with a slope that is slightly off. It
settles with a first-order lag and is noisy. Speeds here are cm/s, as such controllers count them.

>>> dead = Drive(clamp=False)
>>> target(dead, np.array([3.0, 10.0, 20.0])).round(2).tolist()
[0.0, 9.9, 16.0]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.types import Float64, Vector


@dataclass(frozen=True)
class Drive:
    """Truth of one drive.

    >>> Drive().cap
    16.0
    """

    clamp: bool = True
    """Below the start threshold: the threshold itself (clamp) or no motion (dead zone)."""
    start: float = 6.0
    """Start threshold [cm/s]."""
    creep: float = 0.5
    """A clamped drive still stands below this command [cm/s]."""
    slope: float = 0.97
    offset: float = 0.2
    """[cm/s]"""
    cap: float = 16.0
    """Saturation [cm/s]."""
    lag: float = 0.05
    """Time constant [s]."""
    noise: float = 0.4
    """Standard deviation of the displacement per √s [cm]."""
    sensor: float = 0.2
    """Standard deviation of the measured position [cm]."""


@dataclass(frozen=True)
class Commands:
    """How commands are drawn: uniform over the range, each held for a while.

    >>> Commands(2, 6).integer
    True
    """

    shortest: int
    """Shortest and longest hold [s]."""
    longest: int
    integer: bool = True
    """Whole cm/s, or any speed."""
    highest: float = 20.0
    """[cm/s]"""


WORLDS: dict[str, tuple[Drive, Commands]] = {
    "w1": (Drive(clamp=True, lag=0.05, noise=0.4), Commands(2, 6)),
    "w2": (Drive(clamp=True, lag=0.2, noise=0.3), Commands(8, 16)),
    "w3": (Drive(clamp=False, lag=0.1, noise=0.2), Commands(8, 16)),
    "w4": (Drive(clamp=False, lag=0.15, noise=0.2), Commands(3, 8, integer=False)),
}
"""Four drives of a small transport robot."""


def target(drive: Drive, u: Vector) -> Vector:
    """Speed that the controller settles at under the command ``u`` [cm/s]."""
    linear = np.minimum(drive.slope * u + drive.offset, drive.cap)
    if not drive.clamp:
        return np.where(u <= drive.start, 0.0, linear)
    return np.where(u < drive.creep, 0.0, np.where(u < drive.start, drive.start, linear))


def commands(rng: np.random.Generator, how: Commands, n: int) -> Vector:
    """Commands for ``n`` seconds [cm/s], (n,)."""
    u = np.empty(n)
    k = 0
    while k < n:
        hold = int(rng.integers(how.shortest, how.longest + 1))
        highest = int(how.highest)
        u[k : k + hold] = (
            rng.integers(0, highest + 1) if how.integer else rng.uniform(0, how.highest)
        )
        k += hold
    return u


def sweep(how: Commands, each: int) -> Vector:
    """Every whole speed from 1 to the highest, each for ``each`` seconds [cm/s]."""
    return np.repeat(np.arange(1.0, how.highest + 1.0), each)


def positions(
    rng: np.random.Generator, drive: Drive, u: Float64[np.ndarray, " n"]
) -> tuple[Float64[np.ndarray, " n+1"], Float64[np.ndarray, " n+1"]]:
    """True and measured position after each second under the commands ``u`` [cm], (n + 1,) each.

    The lag is integrated exactly over the second.
    """
    decay = np.exp(-1.0 / drive.lag)
    aim = target(drive, u)
    x, v, place = np.zeros(len(u) + 1), 0.0, 0.0
    noise = drive.noise * rng.standard_normal(len(u))
    for k, goal in enumerate(aim):
        place += goal + (v - goal) * drive.lag * (1.0 - decay) + noise[k]
        v = goal + (v - goal) * decay
        x[k + 1] = place
    return x, x + drive.sensor * rng.standard_normal(len(x))
