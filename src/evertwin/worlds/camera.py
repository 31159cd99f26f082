"""A camera without a display: rays through MuJoCo's own ray functions, then light, colour, noise.

`traced` asks what each pixel sees; `shaded` makes a picture of it. Surfaces scatter light evenly
(Lambert, 1760): of a surface of albedo ρ with normal n a lamp of strength I, at a distance d along
l, shows ρ I max(n·l, 0) / (1 + d²/4) where no ray from the lamp meets something else first; from
all sides comes the ambient light. The camera exposes by the mean of what it sees, as cameras do; a
power law makes grey levels of it. The lens blurs and darkens its corners; the sensor adds noise
that grows with the square root of the light, and some that does not.

>>> import mujoco
>>> model = mujoco.MjModel.from_xml_string(
...     '<mujoco><worldbody><geom type="plane" size="9 9 .1"/>'
...     '<geom name="box1" type="box" pos="3 0 .5" size=".5 .5 .5"/></worldbody></mujoco>')
>>> data = mujoco.MjData(model)
>>> mujoco.mj_forward(model, data)
>>> seen = traced(model, data, View(np.array([0.0, 0.0, 0.5]), 0.0), Lens(32, 24))
>>> seen.geom.shape, sorted({int(one) for one in seen.geom.ravel()})
((24, 32), [-1, 0, 1])
>>> grey = Material(np.full(3, 0.5))
>>> look = Look((grey, grey), (Lamp(np.array([0.0, 1.0, 2.5]), np.ones(3)),))
>>> shaded(model, data, seen, look, np.random.default_rng(1)).shape
(24, 32, 3)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy import ndimage

from evertwin.types import Bools, Float64, Int64, Vector

FARTHEST = 60.0
"""What lies farther is not seen [m]."""
SKIN = 0.01
"""A surface does not stand in its own light up to here [m]."""
Points = Float64[np.ndarray, "n 3"]
Pattern = Callable[[Points], Vector]
"""Of places on a thing, in its own frame and in units of the pattern: 0 (its colour) to 1 (the
other)."""


class Lens(NamedTuple):
    """A pinhole: pixels, and the angle over the width [rad]. See the module for an example."""

    width: int = 128
    height: int = 96
    field: float = 1.4


class View(NamedTuple):
    """Where a camera is [m], and where it looks: heading, pitch (up is positive), roll [rad]. See
    the module for an example."""

    place: Float64[np.ndarray, " 3"]
    heading: float
    pitch: float = 0.0
    roll: float = 0.0


class Material(NamedTuple):
    """Colours (red, green, blue, 0 to 1) of a thing; ``size``: of its pattern [m]. See the module
    for an example."""

    colour: Float64[np.ndarray, " 3"]
    other: Float64[np.ndarray, " 3"] | None = None
    pattern: Pattern | None = None
    size: float = 0.3


class Lamp(NamedTuple):
    """A lamp at a place [m]; one with an ``aim`` [m] shines there alone: by the cosine to the
    power ``narrow``. See the module for an example."""

    place: Float64[np.ndarray, " 3"]
    colour: Float64[np.ndarray, " 3"]
    """Its strength in each colour."""
    aim: Float64[np.ndarray, " 3"] | None = None
    narrow: float = 2.0


class Look(NamedTuple):
    """What a world looks like, and what the camera makes of it. See the module for an example."""

    materials: Sequence[Material]
    """Of each geom."""
    lamps: tuple[Lamp, ...]
    ambient: float = 0.3
    sky: float = 0.6
    """Grey of what is farther than all."""
    exposure: float = 0.35
    """Mean of the picture, of the full light, before lens and sensor."""
    gamma: float = 2.2
    blur: float = 0.0
    """Standard deviation [pixels]."""
    vignette: float = 0.0
    """Share of the light that the corners lose."""
    grain: float = 0.0
    """Standard deviation of the noise at half of the full light, of which 1 is all."""


class Traced(NamedTuple):
    """What each pixel sees.

    >>> one = np.ones((1, 1))
    >>> Traced(one.astype(int), one, np.zeros((1, 3)), np.zeros((1, 3))).range.tolist()
    [[1.0]]
    """

    geom: Int64[np.ndarray, "h w"]
    """Number of the geom; -1: none."""
    range: Float64[np.ndarray, "h w"]
    """Distance [m]; infinity: none."""
    place: Points
    """Of what is seen, (h·w, 3) [m]; where none is, the camera's own."""
    normal: Points
    """Towards the camera."""


def rays(view: View, lens: Lens) -> Points:
    """Unit vectors through the middle of each pixel, row by row from the upper left."""
    reach = np.tan(lens.field / 2)
    across = (np.arange(lens.width) + 0.5) / lens.width * 2 - 1
    down = ((np.arange(lens.height) + 0.5) * 2 - lens.height) / lens.width
    u, v = np.meshgrid(-reach * across, -reach * down)
    own = np.stack([np.ones_like(u), u, v], axis=-1).reshape(-1, 3)
    own /= np.sqrt((own * own).sum(axis=1, keepdims=True))
    (ch, cp, cr), (sh, sp, sr) = (
        f([view.heading, view.pitch, view.roll]) for f in (np.cos, np.sin)
    )
    turn = (
        np.array([[ch, -sh, 0], [sh, ch, 0], [0, 0, 1]])
        @ np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    return np.asarray(own @ turn.T)


def _cast(
    model: Any, data: Any, start: Float64[np.ndarray, " 3"], ways: Points, but: int
) -> tuple[Int64[np.ndarray, " n"], Float64[np.ndarray, " n"], Points]:
    """What rays from one place meet first: geom, distance (infinity: nothing), normal."""
    n = len(ways)
    geom, far, normal = np.full(n, -1, np.int32), np.zeros(n), np.zeros(3 * n)
    mujoco.mj_multiRay(model, data, start, np.ascontiguousarray(ways).ravel(), None, 1, but, geom,
                       far, normal, n, FARTHEST)  # fmt: skip
    return geom.astype(np.int64), np.where(geom < 0, np.inf, far), normal.reshape(n, 3)


def traced(model: Any, data: Any, view: View, lens: Lens, but: int = -1) -> Traced:
    """What the pixels see of a world whose kinematics are told; ``but``: a body that is not seen,
    such as the camera's own."""
    ways = rays(view, lens)
    geom, far, normal = _cast(model, data, view.place, ways, but)
    place = view.place + np.where(np.isfinite(far), far, 0.0)[:, None] * ways
    away = (normal * ways).sum(axis=1) > 0
    normal[away] *= -1.0
    shape = lens.height, lens.width
    return Traced(geom.reshape(shape), far.reshape(shape), place, normal)


def shaded(model: Any, data: Any, seen: Traced, look: Look, rng: np.random.Generator) -> np.ndarray:
    """The picture, (h, w, 3) uint8."""
    geom, met = seen.geom.ravel(), seen.geom.ravel() >= 0
    light = np.full(seen.place.shape, look.ambient)
    for lamp in look.lamps:
        light += _lit(model, data, seen, met, lamp)
    shown = _albedo(data, seen, geom, look.materials) * light
    shown[~met] = look.sky
    picture = look.exposure / max(float(shown.mean()), 1e-3) * shown.reshape(*seen.geom.shape, 3)
    if look.blur > 0:
        picture = ndimage.gaussian_filter(picture, (look.blur, look.blur, 0))
    if look.vignette > 0:
        y, x = (np.linspace(-1, 1, n) for n in picture.shape[:2])
        picture *= (1 - look.vignette * (x[None, :] ** 2 + y[:, None] ** 2) / 2)[..., None]
    if look.grain > 0:
        strength = look.grain * np.sqrt(np.clip(picture, 0, 1) + 0.5)
        picture = picture + strength * rng.standard_normal(picture.shape)
    grey = np.clip(picture, 0.0, 1.0) ** (1 / look.gamma)
    return np.asarray(np.rint(255 * grey).astype(np.uint8))


def _lit(model: Any, data: Any, seen: Traced, met: Bools, lamp: Lamp) -> Points:
    """Light of a lamp on what each pixel sees."""
    way = seen.place - lamp.place
    far = np.sqrt((way * way).sum(axis=1))
    way = way / np.maximum(far, 1e-9)[:, None]
    _, first, _ = _cast(model, data, lamp.place, way, -1)
    steep = -(seen.normal * way).sum(axis=1)
    light = np.where(met & (first > far - SKIN), np.maximum(steep, 0.0), 0.0) / (1 + far * far / 4)
    if lamp.aim is not None:
        axis = lamp.aim - lamp.place
        light *= np.maximum(way @ axis / np.sqrt(axis @ axis), 0.0) ** lamp.narrow
    return np.asarray(light[:, None] * lamp.colour)


def _albedo(
    data: Any, seen: Traced, geom: Int64[np.ndarray, " n"], materials: Sequence[Material]
) -> Points:
    """Colour of what each pixel sees."""
    colours = np.array([one.colour for one in materials])[geom]
    for number in np.unique(geom[geom >= 0]):
        material = materials[number]
        if material.pattern is not None and material.other is not None:
            mine = np.flatnonzero(geom == number)
            own = (seen.place[mine] - data.geom_xpos[number]) @ data.geom_xmat[number].reshape(3, 3)
            share = np.clip(material.pattern(own / material.size), 0.0, 1.0)[:, None]
            colours[mine] += share * (material.other - material.colour)
    return np.asarray(colours)
