"""The hall in which the robot drives: walls, clutter, tables on legs; and what a lidar sees of it.

The base drives rounds about the middle of a square of eight metres. A table is seen by its legs
alone: its plate lies above the beams.

>>> import mujoco
>>> model = mujoco.MjModel.from_xml_string(SCENE)
>>> data = mujoco.MjData(model)
>>> mujoco.mj_forward(model, data)
>>> ranges = Lidar(model).scan(data)
>>> len(ranges), bool(0.3 < ranges.min() < ranges.max() < 12.0)
(180, True)
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from evertwin.types import Float64, Vector

MIDDLE = 2.5
"""Where the middle of the hall lies ahead to the left of the start, y [m]."""
HALF = 4.0
BEAMS = 180
FARTHEST = 25.0
"""Range of the lidar [m]."""
HEIGHT = 0.15
"""Of the lidar above the base's middle [m]."""


def _box(name: str, x: float, y: float, size: tuple[float, float, float]) -> str:
    half = " ".join(f"{s / 2:g}" for s in size)
    return f'<geom name="{name}" type="box" pos="{x:g} {y:g} {size[2] / 2:g}" size="{half}"/>'


def _table(name: str, x: float, y: float) -> str:
    legs = "".join(
        f'<geom name="{name}.{dx:g}{dy:+g}" type="cylinder" pos="{x + dx:g} {y + dy:g} .35" '
        'size=".03 .35"/>'
        for dx in (-0.5, 0.5)
        for dy in (-0.3, 0.3)
    )
    return legs + f'<geom name="{name}.plate" type="box" pos="{x:g} {y:g} .72" size=".6 .4 .02"/>'


_WALLS = "".join(
    _box(f"wall{side:g}.x", side * HALF, MIDDLE, (0.1, 2 * HALF, 2.0))
    + _box(f"wall{side:g}.y", 0.0, MIDDLE + side * HALF, (2 * HALF, 0.1, 2.0))
    for side in (-1.0, 1.0)
)
_CLUTTER = (
    _box("box1", -3.4, -0.9, (0.8, 0.5, 0.9)) + _box("box2", 3.3, 5.9, (0.6, 0.9, 1.2))
    + _box("box3", 0.3, 2.9, (0.4, 0.7, 0.5)) + _box("box4", 3.6, 0.2, (0.3, 0.3, 1.6))
)  # fmt: skip
PEOPLE = 4
"""Who can walk in the hall, at most."""
PACE = 0.8
"""How fast they do [m/s]."""
_PEOPLE = "".join(
    f'<body name="person{k + 1}" mocap="true" pos="0 0 -20"><geom type="cylinder" size=".15 .9" '
    'contype="0" conaffinity="0"/></body>'
    for k in range(PEOPLE)
)
SCENE = f"""
<mujoco><option timestep="0.005" integrator="implicitfast"/>
<worldbody><geom type="plane" size="50 50 .1"/>
<body name="base" pos="0 0 0.1"><joint name="x" type="slide" axis="1 0 0"/>
<joint name="y" type="slide" axis="0 1 0"/><joint name="heading" type="hinge" axis="0 0 1"/>
<geom type="cylinder" size=".2 .1" mass="20" contype="0" conaffinity="0"/></body>
{_PEOPLE}{_WALLS}{_CLUTTER}{_table("table1", -1.0, 1.9)}{_table("table2", 0.2, 4.0)}
</worldbody></mujoco>
"""


class People:
    """Who walks in the hall, from place to place.

    >>> people = People(np.random.default_rng(1))
    >>> people.walk(2, 0.1).shape, bool(people.walk(0, 0.1)[0, 2] < -10)
    ((4, 3), True)
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._at, self._to = self.places(PEOPLE), self.places(PEOPLE)

    def places(self, count: int) -> Float64[np.ndarray, "n 2"]:
        """Anywhere in the hall, away from its walls [m], (count, 2)."""
        half = HALF - 0.8
        return np.asarray(self._rng.uniform(-half, half, (count, 2)) + np.array([0.0, MIDDLE]))

    def walk(self, count: int, dt: float) -> Float64[np.ndarray, "n 3"]:
        """Where the first ``count`` of them are after ``dt`` [m], (PEOPLE, 3); the others are below
        the floor."""
        way = self._to - self._at
        far = np.hypot(*way.T)
        there = far < PACE * dt
        self._at += PACE * dt * way / np.maximum(far, 1e-9)[:, None] * ~there[:, None]
        self._to[there] = self.places(int(there.sum()))
        height = np.where(np.arange(PEOPLE) < count, 0.9, -20.0)
        return np.column_stack([self._at, height])


class Lidar:
    """Beams all around, the first one ahead, then to the left. See the module for an example."""

    def __init__(self, model: Any) -> None:
        self._model = model
        self._base = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base")
        angle = 2.0 * np.pi * np.arange(BEAMS) / BEAMS
        self._beams = np.stack([np.cos(angle), np.sin(angle), np.zeros(BEAMS)], axis=1)

    def scan(self, data: Any) -> Vector:
        """Distances [m], (180,), without noise."""
        place = data.xpos[self._base] + (0.0, 0.0, HEIGHT)
        beams = self._beams @ data.xmat[self._base].reshape(3, 3).T
        hit, found = np.zeros(BEAMS, np.int32), np.zeros(BEAMS)
        mujoco.mj_multiRay(
            self._model, data, place, np.ascontiguousarray(beams).ravel(), None, 1, self._base, hit,
            found, None, BEAMS, FARTHEST,
        )  # fmt: skip
        return found
