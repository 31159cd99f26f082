"""Tables as bodies of a MuJoCo world: four legs that stand on the floor, and a plate on them.

What a lidar does not see is said by whoever asks: how high the plate lies, and how far it juts out
over the legs. A machine that fits under the plate then meets the legs, a higher one the plate.

>>> text = bodies([("table1", np.array([1.0, 2.0, 0.0, 1.2, 0.7]), 0.03)], Plate())
>>> text.count("cylinder"), text.count('type="box"')
(4, 1)

A model that takes tables as its inputs has six numbers for each place where one may stand; a length
of 0 says that none does.

>>> table_channels(2)[5:7]
('table1.leg', 'table2.x')
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from evertwin.signals.planar import compose
from evertwin.types import Float64

THICK = 0.03
"""Of a plate [m]."""
SIDES = ((1, 1), (-1, 1), (-1, -1), (1, -1))
MOST_TABLES = 32
"""Places for tables at most."""
UNITS = {"x": "m", "y": "m", "heading": "rad", "length": "m", "width": "m", "leg": "m"}
"""Numbers of a table and their units: length and width are around the legs, ``leg`` is a radius."""


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


class Part(NamedTuple):
    """A piece of a table.

    >>> next(parts(np.array([0.0, 0.0, 0.0, 1.2, 0.7]), 0.03, Plate())).kind
    'cylinder'
    """

    kind: str
    """``cylinder`` or ``box``."""
    at: tuple[float, float, float]
    """Its middle on the table [m]."""
    size: tuple[float, ...]
    """Radius and half height, or half of each side [m]."""


def table_channels(places: int) -> tuple[str, ...]:
    """Names of the numbers of so many tables."""
    return tuple(f"table{k + 1}.{name}" for k in range(places) for name in UNITS)


def tables_of(inputs: Iterable[str]) -> int:
    """Places for tables that the inputs of a model have.

    >>> tables_of(("v", *table_channels(2)))
    2
    """
    known = set(inputs)
    return sum(f"table{k + 1}.x" in known for k in range(MOST_TABLES))


def parts(shape: Float64[np.ndarray, " 5"], radius: float, plate: Plate) -> Iterator[Part]:
    """The pieces of a table of a shape (x, y, heading, length, width around the legs)."""
    thick = plate.height if plate.solid else THICK
    under = 0.5 * (plate.height - THICK)
    u, v = (float(0.5 * one - radius) for one in shape[3:])
    for side, across in () if plate.solid else SIDES:
        yield Part("cylinder", (side * u, across * v, under), (radius, under))
    half = (float(0.5 * one + plate.overhang) for one in shape[3:])
    yield Part("box", (0.0, 0.0, plate.height - 0.5 * thick), (*half, 0.5 * thick))


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
        lines.append(
            f'    <body name="{name}" pos="{x:.4f} {y:.4f} 0" '
            f'quat="{np.cos(turn / 2):.6f} 0 0 {np.sin(turn / 2):.6f}">'
        )
        for kind, at, size in parts(shape, radius, plate):
            pos, sizes = (" ".join(f"{one:.4f}" for one in some) for some in (at, size))
            lines.append(f'      <geom type="{kind}" pos="{pos}" size="{sizes}"/>')
        lines.append("    </body>")
    return "\n".join([*lines, "  </worldbody>", "</mujoco>", ""])
