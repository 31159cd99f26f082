"""Looks that no detector was trained on: other lamps and other patterns than the library draws.

`evertwin.worlds.looks` draws white-ish lamps that shine all around, and checks, stripes and mottle.
Here are coloured spot lights, and rings as of wood, dots, bricks and slow gradients.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.worlds.camera import Lamp, Look, Material
from evertwin.worlds.looks import names


def rings(at: np.ndarray) -> np.ndarray:
    """Of a trunk, a little wavy."""
    r = np.hypot(at[:, 1] + 0.2 * np.sin(2 * at[:, 0]), at[:, 2])
    return (2 * r) % 1.0


def dots(at: np.ndarray) -> np.ndarray:
    """Balls in a lattice."""
    off = at - np.rint(at)
    return ((off * off).sum(axis=1) < 0.1).astype(float)


def bricks(at: np.ndarray) -> np.ndarray:
    """Joints between stones, every other row shifted."""
    row = np.floor(2 * at[:, 2] + 1e-3)
    joint = ((2 * at[:, 2]) % 1 < 0.15) | ((at[:, 0] + at[:, 1] + 0.5 * row) % 1 < 0.08)
    return joint.astype(float)


def gradient(at: np.ndarray) -> np.ndarray:
    """From one colour to the other over a metre or two."""
    return np.clip(0.5 + 0.3 * (at @ np.array([0.5, -0.4, 0.7])), 0.0, 1.0)


def unlike(model: Any, half: float, rng: np.random.Generator) -> Look:
    """A look of other families; ``half``: from the middle of the room to its walls [m]."""
    materials: dict[tuple[str, int], Material] = {}
    keys = list(zip(names(model), map(int, model.geom_type), strict=True))
    for key in keys:
        pattern = (rings, dots, bricks, gradient)[rng.integers(4)]
        colour, other = rng.beta(0.8, 0.8, (2, 3))
        materials.setdefault(key, Material(colour, other, pattern, rng.uniform(0.1, 0.6)))
    lamps = [
        Lamp(np.append(rng.uniform(-1, 1, 2) * half, rng.uniform(2.0, 3.5)), 9.0 * rng.random(3),
             np.append(rng.uniform(-1, 1, 2) * half, 0.0), rng.uniform(2.0, 12.0))
        for _ in range(rng.integers(1, 5))
    ]  # fmt: skip
    return Look([materials[key] for key in keys], tuple(lamps), ambient=rng.uniform(0.15, 0.5),
                sky=rng.uniform(0.0, 1.0), exposure=rng.uniform(0.15, 0.5), gamma=2.2,
                blur=rng.uniform(0.0, 0.6), grain=rng.uniform(0.0, 0.04))  # fmt: skip
