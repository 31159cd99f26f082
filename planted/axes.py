"""Axes with one effect that no textbook law has, by other formulas than the library's.

Scale, motion, rate and noise are drawn anew per seed. What a textbook axis has too (the mass, the
dry friction, a constant force …) is known beside what a fit of the true form would make of it, so
that an interval can be held against both.

>>> one = drawn("film", 3)
>>> sorted(one.truth), sorted(one.columns)
(['Fc', 'mass', 'offset'], ['acceleration', 'force', 'position', 'speed', 't'])
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

Column = np.ndarray
SHARED = ("mass", "Fv", "Fc", "offset")


class Motion(NamedTuple):
    """A recording's motion; ``top`` and ``way``: its largest speed and the way it covers."""

    t: Column
    q: Column
    v: Column
    a: Column
    top: float
    way: float


@dataclass(frozen=True)
class Axis:
    """One drawn axis."""

    columns: Mapping[str, Column]
    truth: Mapping[str, float]
    """What the textbook form means by the same name."""
    own: Mapping[str, float]
    """Half width of the 95 % interval that a fit of the true form would have."""
    top: float
    """Largest speed."""


Effect = Callable[[Motion, np.random.Generator], tuple[Column, tuple[str, ...]]]
"""(motion, generator) → (force per unit of dry friction, what the textbook form shares)."""


def plain(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Nothing more."""
    return np.zeros_like(m.v), SHARED


def film(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """A film that thins: friction by a power of the speed, no viscous part."""
    power, size = rng.uniform(0.3, 0.8), rng.uniform(0.3, 1.5)
    return size * np.sign(m.v) * np.abs(m.v / m.top) ** power, ("mass", "Fc", "offset")


def creep(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Sticks at creep speed."""
    at, size = m.top * rng.uniform(0.03, 0.2), rng.uniform(0.2, 1.0)
    return size * np.sign(m.v) / (1.0 + (m.v / at) ** 2), SHARED


def saturating(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Viscous friction that levels off."""
    at, size = m.top * rng.uniform(0.2, 1.0), rng.uniform(0.5, 2.0)
    return size * m.v / (at + np.abs(m.v)), ("mass", "Fc", "offset")


def drag(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Air: the square of the speed."""
    return rng.uniform(0.3, 1.5) * m.v * np.abs(m.v) / m.top**2, SHARED


def one_way(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Oil that resists backward motion more."""
    return np.where(m.v < 0.0, rng.uniform(0.2, 0.8) * m.v / m.top, 0.0), ("mass", "Fc", "offset")


def bent(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Tighter at some places."""
    turns, phase = rng.uniform(0.7, 4.0), rng.uniform(0.0, 6.28)
    place = np.sin(2 * np.pi * turns * m.q / m.way + phase)
    return rng.uniform(0.1, 0.4) * place * np.sign(m.v), SHARED


def spring(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """A spring whose force grows with the cube of the way."""
    pulls = rng.uniform(0.3, 1.0) * ((2.0 * m.q / m.way) + (2.0 * m.q / m.way) ** 3)
    return pulls, ("mass", "Fv", "Fc")


def ripple(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Cogging along the way."""
    turns, phase = rng.uniform(3.0, 20.0), rng.uniform(0.0, 6.28)
    return rng.uniform(0.1, 0.5) * np.sin(2 * np.pi * turns * m.q / m.way + phase), SHARED


def warming(m: Motion, rng: np.random.Generator) -> tuple[Column, tuple[str, ...]]:
    """Dry friction that falls while the machine warms up."""
    fades = np.exp(-m.t / (m.t[-1] * rng.uniform(0.2, 1.0)))
    return rng.uniform(0.2, 0.6) * fades * np.sign(m.v), ("mass", "Fv", "offset")


EFFECTS: Mapping[str, Effect] = {
    "plain": plain, "film": film, "creep": creep, "saturating": saturating, "drag": drag,
    "one_way": one_way, "bent": bent, "spring": spring, "ripple": ripple, "warming": warming,
}  # fmt: skip


def motion(rng: np.random.Generator) -> Motion:
    """Moves between random places at random speeds, some at creep speed; both ways."""
    rate, seconds = float(rng.choice([50, 100, 200])), rng.uniform(30.0, 60.0)
    top = 10.0 ** rng.uniform(-2.0, 0.5)
    t = np.arange(0.0, seconds, 1.0 / rate)
    v = np.zeros(len(t))
    at, sign = 0, 1.0
    while at < len(t):
        part = max(round(rng.uniform(0.8, 3.0) * rate), 4)
        v[at : at + part] = sign * top * 10.0 ** rng.uniform(-1.5, 0.0)
        at, sign = at + part, -sign
    width = max(round(rng.uniform(0.1, 0.3) * rate), 3)
    window = scipy.signal.windows.hann(2 * width + 1)
    v = np.convolve(v, window / window.sum(), "same")
    q = scipy.integrate.cumulative_trapezoid(v, t, initial=0.0)
    q -= 0.5 * (q.max() + q.min())
    return Motion(t, q, v, np.gradient(v, t), float(np.abs(v).max()), float(np.ptp(q)))


def drawn(effect: str, seed: int) -> Axis:
    """An axis of one seed."""
    rng = np.random.default_rng([sum(map(ord, effect)), seed])
    m, dry = motion(rng), 10.0 ** rng.uniform(0.0, 2.5)
    more, shared = EFFECTS[effect](m, rng)
    numbers = {
        "mass": dry * rng.uniform(0.5, 3.0) / float(np.abs(m.a).max()),
        "Fv": dry * rng.uniform(0.2, 1.5) / m.top if "Fv" in shared else 0.0,
        "Fc": dry, "offset": dry * rng.uniform(0.05, 0.3) * float(rng.choice([-1.0, 1.0])),
    }  # fmt: skip
    textbook = {"mass": m.a, "Fv": m.v, "Fc": np.sign(m.v), "offset": np.ones_like(m.v)}
    force = dry * more + sum(numbers[name] * column for name, column in textbook.items())
    noise = dry * 10.0 ** rng.uniform(-2.0, -0.8)
    memory = rng.choice([0.0, 0.8])
    white = noise * rng.standard_normal(len(m.t)) * np.sqrt(1.0 - memory**2)
    force += scipy.signal.lfilter([1.0], [1.0, -memory], white)
    known = ("mass", *(n for n in ("Fv", "Fc", "offset") if n in shared or n != "Fv"))
    rows = np.stack([*(textbook[name] for name in known), *([dry * more] if more.any() else [])], 1)
    spread = np.sqrt(np.linalg.inv(rows.T @ rows).diagonal() * (1.0 + memory) / (1.0 - memory))
    own = dict(zip(known, (1.96 * noise * spread).tolist(), strict=False))
    columns = {"t": m.t, "position": m.q, "speed": m.v, "acceleration": m.a, "force": force}
    return Axis(columns, {n: numbers[n] for n in shared}, {n: own[n] for n in shared}, m.top)


def kept(how: str, rows: int, seed: int) -> np.ndarray:
    """Which rows of a recording are left: "random 5 %", "bursts" and "gap" are lost, or several.

    >>> int(kept("gap", 1000, 0).sum()), bool(kept("random 20 %, bursts", 1000, 0)[:2].all())
    (900, True)
    """
    rng, stays = np.random.default_rng([7, seed]), np.ones(rows, dtype=np.bool_)
    for one in how.split(", "):
        if one.startswith("random"):
            stays &= rng.random(rows) > float(one.split()[1]) / 100.0
        elif one == "bursts":
            for start in rng.integers(10, rows - 60, 12).tolist():
                stays[start : start + rng.integers(5, 50)] = False
        else:
            start = int(rng.integers(rows // 4, rows // 2))
            stays[start : start + rows // 10] = False
    stays[:2] = True
    return stays
