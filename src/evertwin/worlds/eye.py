"""A camera at work in a world: pictures as PNG, and beside them what each of them shows.

What is written of the things (`COLUMNS`) is what a person would who marks pictures: a box around
each; where it is too small to be told it has no label. ``light`` is the mean grey of the picture.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from evertwin.worlds.camera import Lens, Look, Traced, View, shaded
from evertwin.worlds.looks import class_of, names
from evertwin.worlds.scenes import marked

HEIGHT, PITCH = 0.5, -0.12
"""Of a camera on a mobile base: above the floor [m], downwards [rad]."""
LENS = Lens()
COLUMNS = (
    "t_ns", "label", "left", "upper", "right", "lower", "group", "distance", "light", "pixels",
)  # fmt: skip


class Shot(NamedTuple):
    """A picture and its rows.

    >>> Shot(b"", ()).rows
    ()
    """

    png: bytes
    rows: tuple[tuple[float | str, ...], ...]
    """As `COLUMNS`, from the label on."""


def shot(
    model: Any, data: Any, seen: Traced, look: Look, rng: np.random.Generator, group: str = ""
) -> Shot:
    """A picture of what was traced; ``group``: of its rows, else each thing's own name."""
    pixels = shaded(model, data, seen, look, rng)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    light = round(float(pixels.mean()), 1)
    rows = tuple(
        (class_of(one.name) if one.clear else "", *one.corners, group or one.name,
         round(one.distance, 2), light, one.pixels)
        for one in marked(seen.geom, seen.range, names(model))
    )  # fmt: skip
    return Shot(file.getvalue(), rows)


def carried(x: float, y: float, heading: float, height: float = HEIGHT) -> View:
    """The view of a camera on a base at a pose [m, rad], looking ahead."""
    return View(np.array([x, y, height]), heading, PITCH)


def save_rows(file: Path, shots: Sequence[tuple[int, Shot]]) -> None:
    """Writes what pictures show, each with its stamp [ns]."""
    with file.open("w", encoding="utf-8", newline="") as table:
        rows = ((t, *row) for t, one in shots for row in one.rows)
        csv.writer(table, lineterminator="\n").writerows([COLUMNS, *rows])
