"""Carts that do not do what they are told: rows of command and place, by name."""

from __future__ import annotations

import numpy as np

NOISE = 0.002
"""Of the measured place [m]."""


def cart(
    rng: np.random.Generator, gain: float = 1.0, lag: float = 0.0, dead: float = 0.0,
    rows: int = 1200,
) -> dict[str, np.ndarray]:  # fmt: skip
    """At 1 Hz. Commands hold for six rows, three of ten are zero.

    Args:
        rng: draws commands and noise.
        gain: speed for the speed that is commanded.
        lag: of the command, in rows, at most 1.
        dead: speed up to which it stands [m/s].
    """
    v = np.repeat(rng.uniform(0.02, 0.2, rows // 6) * (rng.random(rows // 6) > 0.3), 6)
    late = v.copy()
    late[1:] = (1 - lag) * v[1:] + lag * v[:-1]
    speed = np.where(late > dead, gain * late, 0.0)
    x = np.concatenate([[0.0], np.cumsum(speed)[:-1]]) + NOISE * rng.standard_normal(len(v))
    return {"t": np.arange(len(v), dtype=np.float64), "v": v, "x": x}
