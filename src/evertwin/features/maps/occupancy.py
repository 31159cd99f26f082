"""An occupancy map: which cells hold a wall, which are free, which nobody has seen.

Each beam passes through free cells and ends in an occupied one. A cell is what most of the beams
that met it say. Saved as ROS's ``map_server`` has it: an image (PGM, 0 occupied, 254 free, 205
unknown, first row at the top) beside a YAML file with the resolution and the pose of the lower left
corner.

>>> from pathlib import Path
>>> import tempfile
>>> wall = np.array([[1.0, y, -1.0, 0.0] for y in np.arange(-0.5, 0.5, 0.05)])
>>> drawn = of_keyframes(np.zeros((1, 3)), [wall])
>>> file = Path(tempfile.mkdtemp()) / "map.yaml"
>>> save(drawn, file)
>>> again = read(file)
>>> bool(np.array_equal(again.cells, drawn.cells)), again.resolution
(True, 0.05)
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.errors import DataError
from evertwin.features.scans.local_map import Surface, placed
from evertwin.signals.planar import compose
from evertwin.types import Float64, UInt8

RESOLUTION = 0.05
"""Side of a cell [m]."""
FREE, OCCUPIED, UNKNOWN = 254, 0, 205
"""Values in the image."""
MARGIN = 1.0
"""Around what was seen [m]."""
LARGEST = 100_000_000
"""Cells of the largest map."""
WALL = 2
"""Beams that a cell's occupied ones count as, against those that pass."""


class Occupancy(NamedTuple):
    """A map, its cells as in the image but rows upwards: cells[row, column] is at y, x.

    >>> Occupancy(np.full((2, 3), UNKNOWN, np.uint8), 0.05, (0.0, 0.0)).cells.shape
    (2, 3)
    """

    cells: UInt8[np.ndarray, "rows columns"]
    resolution: float
    """[m]"""
    origin: tuple[float, float]
    """x, y of the lower left corner [m]."""

    def walls(self) -> Float64[np.ndarray, "k 2"]:
        """Middles of the occupied cells [m]."""
        row, column = np.nonzero(self.cells == OCCUPIED)
        at = np.column_stack([column, row]) + 0.5
        return np.asarray(at * self.resolution + np.array(self.origin))


@njit(cache=True)
def counted(walls: Any, n: int, start: Any, side: float, passed: Any, met: Any) -> None:
    """Counts, for cells of side ``side`` (rows: y), the beams from ``start`` that pass and end.

    Args:
        walls: where beams ended (k, ≥ 2), the first ``n``, relative to the lower left corner [m].
        start: where they began, (2,), likewise.
        side: of a cell [m].
        passed: beams that went through each cell, to be added to.
        met: beams that ended in it, to be added to.
    """
    ax, ay = start[0] / side, start[1] / side
    for k in range(n):
        bx, by = walls[k, 0] / side, walls[k, 1] / side
        length = max(abs(bx - ax), abs(by - ay))
        steps = int(length)
        for j in range(steps):
            x, y = ax + (bx - ax) * j / length, ay + (by - ay) * j / length
            passed[math.floor(y), math.floor(x)] += 1
        met[math.floor(by), math.floor(bx)] += 1


def of_keyframes(
    poses: Float64[np.ndarray, "k 3"],
    surfaces: Sequence[Surface],
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Occupancy:
    """The map that keyframes draw, whose lidar stands at ``mount`` on the machine.

    Raises:
        DataError: it would be larger than `LARGEST` cells.
    """
    walls = [placed(one, pose)[:, :2] for one, pose in zip(surfaces, poses, strict=True)]
    lidars = compose(poses, np.broadcast_to(np.array(mount), poses.shape))[:, :2]
    seen = np.concatenate([*walls, lidars, poses[:, :2]])
    low = np.floor((seen.min(axis=0) - MARGIN) / RESOLUTION) * RESOLUTION
    columns, rows = np.ceil((seen.max(axis=0) + MARGIN - low) / RESOLUTION).astype(np.int64)
    if columns * rows > LARGEST:
        raise DataError(
            f"the map would have {columns} × {rows} cells of {RESOLUTION} m: expected at most "
            f"{LARGEST}: are the poses of one place?"
        )
    passed, met = np.zeros((rows, columns), np.int32), np.zeros((rows, columns), np.int32)
    for lidar, ends in zip(lidars, walls, strict=True):
        counted(ends - low, len(ends), lidar - low, RESOLUTION, passed, met)
    cells = np.full((rows, columns), UNKNOWN, np.uint8)
    cells[passed > 0] = FREE
    cells[(met > 0) & (WALL * met >= passed)] = OCCUPIED
    return Occupancy(cells, RESOLUTION, (float(low[0]), float(low[1])))


def save(drawn: Occupancy, file: Path, mode: str = "trinary") -> None:
    """Writes ``file`` (YAML), and the image (PGM) beside it; ``mode``: how its cells are read."""
    image = file.with_suffix(".pgm")
    rows, columns = drawn.cells.shape
    image.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + drawn.cells[::-1].tobytes())
    x, y = drawn.origin
    file.write_text(
        f"image: {image.name}\nmode: {mode}\nresolution: {drawn.resolution}\n"
        f"origin: [{x!r}, {y!r}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )


class Keys(NamedTuple):
    """What the YAML file of a map says.

    >>> Keys("trinary", 0.05, (0.0, 0.0), 0.65, 0.196, True).side
    0.05
    """

    mode: str
    side: float
    """Of a cell [m]."""
    origin: tuple[float, float]
    """x, y of the lower left corner [m]."""
    occupied: float
    free: float
    dark: bool
    """Are dark cells the occupied ones?"""


def read(file: Path) -> Occupancy:
    """The map of a YAML file and the PGM image that it names, whoever wrote them.

    Raises:
        DataError: no such file, a key that is absent, or an image that is none.
    """
    keys, grey = grey_of(file)
    share = 1 - grey / 255.0 if keys.dark else grey / 255.0
    cells = np.full(grey.shape, UNKNOWN, np.uint8)
    cells[share > keys.occupied], cells[share < keys.free] = OCCUPIED, FREE
    return Occupancy(cells, keys.side, keys.origin)


def grey_of(file: Path) -> tuple[Keys, np.ndarray]:
    """What a YAML file says, and the rows of its image, upwards, 0 to 255.

    Raises:
        DataError: as `read`.
    """
    try:
        text = file.read_text(encoding="utf-8")
        keys = dict(re.findall(r"^(\w+):[ \t]*([^\n#]*?)[ \t]*(?:#.*)?$", text, re.MULTILINE))
        image = (file.parent / keys["image"].strip("'\"")).read_bytes()
        side = float(keys["resolution"])
        x, y, turn = (float(v) for v in re.findall(r"[-+.\deE]+", keys["origin"]))
        occupied, free = float(keys["occupied_thresh"]), float(keys["free_thresh"])
        dark = int(keys.get("negate", "0")) == 0
    except (OSError, KeyError, ValueError, UnicodeDecodeError) as error:
        raise DataError(
            f"{file}: expected a map as map_server has it, with image, resolution, origin, "
            f"occupied_thresh and free_thresh ({type(error).__name__}: {error})"
        ) from None
    if turn or side <= 0:
        raise DataError(f"{file}: expected a resolution above 0 and an origin that is not turned")
    found = Keys(keys.get("mode", "trinary"), side, (x, y), occupied, free, dark)
    return found, _grey(image, file)


def _grey(image: bytes, file: Path) -> np.ndarray:
    """The rows of a PGM image, upwards, 0 to 255."""
    head = re.match(
        rb"P5(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)\s", image
    )
    if head is None:
        raise DataError(f"{file}: expected a binary PGM image (P5): save the map with map_saver")
    columns, rows, top = (int(v) for v in head.groups())
    body = image[head.end() :]
    if not (0 < columns * rows <= LARGEST and 0 < top < 256 and len(body) >= columns * rows):
        raise DataError(
            f"{file}: {len(body)} bytes of image, expected {columns} × {rows}: cut off?"
        )
    grey = np.frombuffer(body, np.uint8, columns * rows).reshape(rows, columns)[::-1]
    return np.asarray(grey * (255.0 / top))
