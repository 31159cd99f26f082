"""Tables as bodies of a MuJoCo world: four legs that stand on the floor, and a plate on them.

What a lidar does not see is said by whoever asks: how high the plate lies, and how far it juts out
over the legs. A machine that fits under the plate then meets the legs, a higher one the plate.

>>> text = bodies([("table1", np.array([1.0, 2.0, 0.0, 1.2, 0.7]), 0.03)], Plate())
>>> text.count("cylinder"), text.count('type="box"')
(4, 1)
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from evertwin.signals.planar import compose
from evertwin.types import Float64

THICK = 0.03
"""Of a plate [m]."""
SIDES = ((1, 1), (-1, 1), (-1, -1), (1, -1))


class Plate(NamedTuple):
    """What is said of the plates.

    >>> Plate().height
    0.72
    """

    height: float = 0.72
    """Of the plate's upper side [m]."""
    overhang: float = 0.0
    """Over the legs, on each side [m]."""
    solid: bool = False
    """A box down to the floor in place of legs and plate."""


def bodies(
    tables: Iterable[tuple[str, Float64[np.ndarray, " 5"], float]], plate: Plate,
    origin: Float64[np.ndarray, " 3"] | None = None,
) -> str:  # fmt: skip
    """An MJCF file of static bodies, to be named by ``<include file="…"/>`` in a world.

    Args:
        tables: name, shape (x, y, heading, length, width around the legs), radius of the legs.
        plate: what a lidar does not see.
        origin: pose of the map's origin in the world; None: the same.
    """
    lines = ["<mujoco>", "  <worldbody>"]
    for name, shape, radius in tables:
        pose = shape[:3] if origin is None else compose(origin, shape[:3])
        x, y, turn = (float(one) for one in pose)
        half = 0.5 * shape[3:] + plate.overhang
        lines.append(
            f'    <body name="{name}" pos="{x:.4f} {y:.4f} 0" '
            f'quat="{np.cos(turn / 2):.6f} 0 0 {np.sin(turn / 2):.6f}">'
        )
        thick = plate.height if plate.solid else THICK
        legs = () if plate.solid else SIDES
        under = 0.5 * (plate.height - THICK)
        for side, across in legs:
            u, v = (0.5 * one - radius for one in shape[3:])
            lines.append(
                f'      <geom type="cylinder" pos="{side * u:.4f} {across * v:.4f} {under:.4f}" '
                f'size="{radius:.4f} {under:.4f}"/>'
            )
        lines.append(
            f'      <geom type="box" pos="0 0 {plate.height - 0.5 * thick:.4f}" '
            f'size="{half[0]:.4f} {half[1]:.4f} {0.5 * thick:.4f}"/>'
        )
        lines.append("    </body>")
    return "\n".join([*lines, "  </worldbody>", "</mujoco>", ""])
