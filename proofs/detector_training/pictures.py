"""Pictures of drawn halls and what they show, for training: by seed, the same in every process."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from evertwin.worlds.camera import Lens, shaded, traced
from evertwin.worlds.looks import CLASSES, class_of, drawn, names, plain
from evertwin.worlds.scenes import hall, marked, view

STRIDE = 4
"""Pixels from cell to cell of what the net gives."""
LENS = Lens()
FIELD = (1.1, 1.7)
"""Of the lens, drawn [rad]."""
LEARNED = (5, 25)
"""Smaller things (pixels wide or high, pixels) are neither learned nor unlearned."""
SHAPE = LENS.height // STRIDE, LENS.width // STRIDE
FIRST = 10**6
"""Seeds of training lie above; those of `proofs.detector` below."""


class Picture(NamedTuple):
    """A picture, and for each class what the net shall say of it."""

    pixels: np.ndarray
    """(h, w, 3) uint8."""
    heat: np.ndarray
    """Nearness to the middle of a thing, (classes, rows, columns); NaN: not asked."""
    box: np.ndarray
    """Distances to its left, upper, right, lower edge [pixels], (classes, 4, rows, columns); NaN:
    not asked."""


def pictures(seed: int, randomised: bool, views: int = 2) -> list[Picture]:
    """Views into one hall, each in a look drawn anew, or all in the plain one."""
    rng = np.random.default_rng([7, FIRST + seed])
    scene = hall(rng)
    model = mujoco.MjModel.from_xml_string(scene.xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = []
    for _ in range(views):
        lens = LENS._replace(field=rng.uniform(*FIELD))
        seen = traced(model, data, view(scene, rng), lens)
        look = drawn(model, scene.half, rng) if randomised else plain(model, scene.half)
        pixels = shaded(model, data, seen, look, rng)
        every = marked(seen.geom, seen.range, names(model))
        found.append(Picture(pixels, *targets(every)))
    return found


def targets(things: list) -> tuple[np.ndarray, np.ndarray]:
    """Heat and boxes of what a picture shows, float16."""
    heat = np.zeros((len(CLASSES), *SHAPE), np.float32)
    box = np.full((len(CLASSES), 4, *SHAPE), np.nan, np.float32)
    x = STRIDE * (np.arange(SHAPE[1]) + 0.5)[None, :]
    y = STRIDE * (np.arange(SHAPE[0]) + 0.5)[:, None]
    for thing in sorted(things, key=lambda one: -one.pixels):
        label = CLASSES.index(class_of(thing.name))
        left, upper, right, lower = thing.corners
        width, height = right - left, lower - upper
        if min(width, height) < LEARNED[0] or thing.pixels < LEARNED[1]:
            inside = (x > left - 2) & (x < right + 2) & (y > upper - 2) & (y < lower + 2)
            heat[label][inside & (heat[label] == 0)] = np.nan
            continue
        # the middle is the nearest cell's
        cx = STRIDE * (np.floor((left + right) / 2 / STRIDE) + 0.5)
        cy = STRIDE * (np.floor((upper + lower) / 2 / STRIDE) + 0.5)
        spread = np.maximum([width / 6, height / 6], STRIDE / 3)
        bump = np.exp(-(((x - cx) / spread[0]) ** 2 + ((y - cy) / spread[1]) ** 2) / 2)
        heat[label] = np.fmax(heat[label], bump)
        near = bump > 0.3
        edges = (x - left + 0 * y, y - upper + 0 * x, right - x + 0 * y, lower - y + 0 * x)
        for k, edge in enumerate(edges):
            box[label, k][near] = np.maximum(edge[near], 0.5)
    return heat.astype(np.float16), box.astype(np.float16)
