"""Halls drawn by seed, with tables, boxes and people in them, for a camera.

Between the walls stand up to four of each, and posts that are nothing that is looked for. `views`
draws where a camera on a mobile base may be: away from all, at half a metre or so, mostly looking
at something; `marked` tells which things a picture shows, and where.

>>> scene = hall(np.random.default_rng(2))
>>> sorted({class_of(name) for name, _, _, _ in scene.things})
['box', 'person', 'post', 'table']
>>> marked(np.array([[-1, 0, 0], [-1, 0, 0]]), np.ones((2, 3)), ("box1",))
[Seen(name='box1', corners=(1, 0, 3, 2), pixels=4, distance=1.0)]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.types import Float64, Int64
from evertwin.worlds.camera import View
from evertwin.worlds.looks import CLASSES, class_of

LEAST = (6, 40)
"""What is fewer pixels wide or high, or has fewer pixels, is too small to be told."""
MOST = 4
"""Things of each class in a hall."""
CLEAR = 0.3
"""Between things, and between them and the camera [m]."""


class Hall(NamedTuple):
    """A drawn hall. See the module for an example."""

    xml: str
    """MJCF."""
    half: float
    """From its middle to its walls [m]."""
    things: tuple[tuple[str, float, float, float], ...]
    """Name, x, y, radius around it [m]."""


class Seen(NamedTuple):
    """A thing in a picture. See the module for an example."""

    name: str
    corners: tuple[int, int, int, int]
    """Left, upper, right, lower edge [pixels]."""
    pixels: int
    distance: float
    """Median of its pixels [m]."""

    @property
    def clear(self) -> bool:
        """Is it large enough to be told?"""
        left, upper, right, lower = self.corners
        return min(right - left, lower - upper) >= LEAST[0] and self.pixels >= LEAST[1]


def hall(rng: np.random.Generator) -> Hall:
    """A square hall of 6 to 12 m."""
    half, high = rng.uniform(3.0, 6.0), rng.uniform(2.0, 3.0)
    walls = "".join(
        f'<geom name="wall{k}" type="box" pos="{c * half} {s * half} {high / 2}" '
        f'size="{0.1 + abs(s) * half} {0.1 + abs(c) * half} {high / 2}"/>'
        for k, (c, s) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1)))
    )
    bodies, things = [], list[tuple[str, float, float, float]]()
    for label in (*CLASSES, "post"):
        for k in range(rng.integers(0, MOST + 1)):
            radius, geoms = {"box": _box, "person": _person, "table": _table, "post": _post}[label](
                rng
            )
            at = _free(rng, half - radius - 0.15, radius, things)
            if at is None:
                continue
            turn = rng.uniform(-np.pi, np.pi)
            things.append((f"{label}{k}", float(at[0]), float(at[1]), radius))
            bodies.append(
                f'<body name="{label}{k}" pos="{at[0]} {at[1]} 0" '
                f'quat="{np.cos(turn / 2)} 0 0 {np.sin(turn / 2)}">{geoms}</body>'
            )
    xml = (
        f'<mujoco><worldbody><geom type="plane" size="50 50 .1"/>{walls}{"".join(bodies)}'
        "</worldbody></mujoco>"
    )
    return Hall(xml, half, tuple(things))


def _free(
    rng: np.random.Generator,
    reach: float,
    radius: float,
    taken: Sequence[tuple[str, float, float, float]],
) -> Float64[np.ndarray, " 2"] | None:
    for _ in range(50):
        at = rng.uniform(-reach, reach, 2)
        if all(np.hypot(at[0] - x, at[1] - y) > radius + r + CLEAR for _, x, y, r in taken):
            return np.asarray(at)
    return None


def _box(rng: np.random.Generator) -> tuple[float, str]:
    length, width, high = rng.uniform(0.15, 0.45), rng.uniform(0.15, 0.45), rng.uniform(0.15, 0.85)
    geom = f'<geom type="box" pos="0 0 {high}" size="{length} {width} {high}"/>'
    return float(np.hypot(length, width)), geom


def _person(rng: np.random.Generator) -> tuple[float, str]:
    """A cylinder, of which half have a head."""
    radius, high = rng.uniform(0.12, 0.24), rng.uniform(0.7, 0.95)
    head = ""
    if rng.random() < 0.5:
        high -= 0.12
        head = f'<geom type="sphere" pos="0 0 {2 * high + 0.1}" size=".12"/>'
    return radius, f'<geom type="cylinder" pos="0 0 {high}" size="{radius} {high}"/>{head}'


def _table(rng: np.random.Generator) -> tuple[float, str]:
    length, width = rng.uniform(0.4, 0.9), rng.uniform(0.25, 0.5)
    high, leg, thick = rng.uniform(0.6, 0.85), rng.uniform(0.015, 0.045), rng.uniform(0.01, 0.03)
    inset = rng.uniform(0.0, 0.15) + leg
    legs = "".join(
        f'<geom type="cylinder" pos="{a * (length - inset)} {b * (width - inset)} '
        f'{high / 2 - thick}" size="{leg} {high / 2 - thick}"/>'
        for a in (-1, 1)
        for b in (-1, 1)
    )
    plate = f'<geom type="box" pos="0 0 {high - thick}" size="{length} {width} {thick}"/>'
    return float(np.hypot(length, width)), legs + plate


def _post(rng: np.random.Generator) -> tuple[float, str]:
    radius, high = rng.uniform(0.02, 0.05), rng.uniform(0.3, 1.2)
    return radius, f'<geom type="cylinder" pos="0 0 {high}" size="{radius} {high}"/>'


def view(scene: Hall, rng: np.random.Generator) -> View:
    """Where a camera may be."""
    at = _free(rng, scene.half - 0.4, 0.1, scene.things)
    at = np.zeros(2) if at is None else at
    heading = rng.uniform(-np.pi, np.pi)
    if scene.things and rng.random() < 0.8:
        _, x, y, _ = scene.things[rng.integers(len(scene.things))]
        heading = np.arctan2(y - at[1], x - at[0]) + rng.uniform(-0.5, 0.5)
    return View(np.append(at, rng.uniform(0.3, 0.9)), float(heading),
                rng.uniform(-0.3, 0.05), rng.normal(0.0, 0.02))  # fmt: skip


def marked(
    geom: Int64[np.ndarray, "h w"], ranges: Float64[np.ndarray, "h w"], names: Sequence[str]
) -> list[Seen]:
    """What of the classes a picture shows, however small, in the order of names.

    Args:
        geom: number of each pixel's geom; -1: none.
        ranges: of each pixel [m].
        names: of the thing that each geom is a part of.
    """
    number = {name: k for k, name in enumerate(sorted({*names}))}
    of = np.array([*(number[name] for name in names), -1])[geom]
    found = []
    for name, k in number.items():
        if class_of(name) not in CLASSES:
            continue
        rows, columns = np.nonzero(of == k)
        if not len(rows):
            continue
        corners = (int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1)
        found.append(Seen(name, corners, len(rows), float(np.median(ranges[rows, columns]))))
    return found
