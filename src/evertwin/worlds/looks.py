"""What worlds look like, drawn anew each time: domain randomisation of light and texture.

A detector that has seen one light and one table learns these; one that has seen many, what they
have in common (Tobin et al., IROS 2017). `plain` is one look; `drawn` draws colours, patterns,
lamps, exposure, blur and noise.

>>> import mujoco
>>> model = mujoco.MjModel.from_xml_string(
...     '<mujoco><worldbody><geom type="plane" size="9 9 .1"/>'
...     '<geom name="table1.plate" type="box" pos="3 0 .7" size=".5 .5 .02"/></worldbody></mujoco>')
>>> names(model)
('', 'table1')
>>> len(plain(model, 4.0).materials), len(drawn(model, 4.0, np.random.default_rng(1)).lamps) > 0
(2, True)
"""

from __future__ import annotations

import re
from typing import Any

import mujoco
import numpy as np

from evertwin.types import Float64, Vector
from evertwin.worlds.camera import Lamp, Look, Material, Pattern, Points

CLASSES = ("box", "person", "table")
"""What is looked for."""
_PLAIN = {
    "box": (0.55, 0.55, 0.6), "person": (0.15, 0.25, 0.6), "table": (0.55, 0.35, 0.15),
    "wall": (0.8, 0.8, 0.75), "": (0.4, 0.42, 0.4),
}  # fmt: skip


def names(model: Any) -> tuple[str, ...]:
    """The thing that each geom is a part of: its own name up to a point, else its body's.

    What is named ``table2.leg`` or stands in a body ``table2`` is a part of ``table2``.
    """

    def name(kind: Any, number: int) -> str:
        return (mujoco.mj_id2name(model, kind, number) or "").partition(".")[0]

    geoms = (name(mujoco.mjtObj.mjOBJ_GEOM, k) for k in range(model.ngeom))
    return tuple(
        own or (name(mujoco.mjtObj.mjOBJ_BODY, int(body)) if body else "")
        for own, body in zip(geoms, model.geom_bodyid, strict=True)
    )


def class_of(name: str) -> str:
    """The class of a thing: its name without the number.

    >>> class_of("table12")
    'table'
    """
    return re.sub(r"[\d_]+$", "", name)


def plain(model: Any, half: float, middle: tuple[float, float] = (0.0, 0.0)) -> Look:
    """One look for all worlds: each class has its colour; a white lamp under the ceiling.

    Args:
        model: of MuJoCo.
        half: from the middle of the room to its walls [m].
        middle: of the room [m].
    """
    of = [class_of(name) for name in names(model)]
    materials = [Material(np.array(_PLAIN.get(one, _PLAIN["wall"]))) for one in of]
    lamp = Lamp(np.array([middle[0] + 0.2 * half, middle[1] + 0.3 * half, 2.4]), np.full(3, 2.5))
    return Look(materials, (lamp,), grain=0.01)


def drawn(
    model: Any, half: float, rng: np.random.Generator, middle: tuple[float, float] = (0.0, 0.0)
) -> Look:
    """A look drawn anew; see `plain`."""
    materials: dict[tuple[str, int], Material] = {}
    for key in zip(names(model), (int(kind) for kind in model.geom_type), strict=True):
        materials.setdefault(key, _material(rng))
    lamps = tuple(
        Lamp(np.append(rng.uniform(-0.9, 0.9, 2) * half + middle, rng.uniform(1.6, 2.6)),
             rng.uniform(0.5, 4.0) * rng.uniform(0.6, 1.0, 3))
        for _ in range(rng.integers(1, 4))
    )  # fmt: skip
    return Look(
        [materials[key] for key in zip(names(model), map(int, model.geom_type), strict=True)],
        lamps, ambient=rng.uniform(0.05, 0.8), sky=rng.uniform(0.0, 1.0),
        exposure=float(np.exp(rng.uniform(np.log(0.12), np.log(0.6)))), gamma=rng.uniform(1.5, 2.6),
        blur=rng.uniform(0.0, 0.8), vignette=rng.uniform(0.0, 0.5), grain=rng.uniform(0.0, 0.04),
    )  # fmt: skip


def _material(rng: np.random.Generator) -> Material:
    colour, other = (_colour(rng) for _ in range(2))
    pattern: Pattern | None = (None, checks, stripes, mottled)[rng.integers(4)]
    if pattern is mottled:
        shift = rng.uniform(0, 100, 3)
        pattern = lambda at: mottled(at + shift)  # noqa: E731
    faint = rng.uniform(0.1, 1.0)
    return Material(
        colour, colour + faint * (other - colour), pattern,
        float(np.exp(rng.uniform(np.log(0.08), np.log(0.8)))),
    )  # fmt: skip


def _colour(rng: np.random.Generator) -> Vector:
    """Of any brightness, half of them nearly grey."""
    grey, tint = rng.uniform(0.05, 0.95), rng.uniform(0.0, 1.0, 3)
    strong = rng.uniform(0.0, 0.25) if rng.random() < 0.5 else rng.uniform(0.25, 1.0)
    return np.asarray(grey + strong * (tint - grey))


def checks(at: Points) -> Vector:
    """Cubes of two colours."""
    return np.asarray(np.floor(at + 1e-3).sum(axis=1) % 2)


def stripes(at: Points) -> Vector:
    """Waves along a slanted axis."""
    return np.asarray(0.5 + 0.5 * np.sin(2 * np.pi * (at @ np.array([0.6, 0.7, 0.4]))))


def mottled(at: Points) -> Vector:
    """Noise between the whole numbers (Perlin's value noise), of two sizes."""
    return 0.65 * _noise(at) + 0.35 * _noise(2.7 * at + 17.0)


def _noise(at: Points) -> Vector:
    low = np.floor(at).astype(np.int64)
    share = at - low
    share = share * share * (3 - 2 * share)
    out = np.zeros(len(at))
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(corner, share, 1 - share).prod(axis=1)
        out += weight * _hash(low + np.array(corner))
    return out


def _hash(cell: np.ndarray) -> Float64[np.ndarray, " n"]:
    """0 to 1, for each cell its own."""
    mixed = cell.astype(np.uint64) @ np.array([73856093, 19349663, 83492791], np.uint64)
    mixed = (mixed ^ (mixed >> np.uint64(13))) * np.uint64(0x9E3779B97F4A7C15)
    return np.asarray((mixed >> np.uint64(40)) / float(1 << 24))
