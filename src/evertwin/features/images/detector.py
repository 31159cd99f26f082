"""Things in images: a small fully convolutional net finds them, and boxes around them.

The net (ONNX, 1.4 MB, `DATA`) was trained on domain-randomised pictures of drawn halls and
knows tables, boxes and people; how it was trained stands in ``proofs/detector_training``. It takes
a picture (1, 3, h, w) of 0 to 255 and gives, for each cell and class, the probability that the
middle of a thing lies there, and its left, upper, right and lower edge [pixels]: (1, rows, columns,
classes, 5). A net of one's own of this form names its classes in its metadata (``classes``, with
commas between).

What it says of a picture and of its mirror image is averaged, which leaves out chance errors. A
cell speaks if no neighbour is more probable (Zhou et al., Objects as Points, 2019); of boxes of a
class that overlap by half the most probable stays.

>>> cells = np.zeros((2, 2, 1, 5))
>>> cells[0, 0, 0] = 0.9, 1, 1, 9, 9
>>> decoded(cells, ("box",), 0.5)
[Detection(label='box', probability=0.9, corners=(1.0, 1.0, 9.0, 9.0))]
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy
from PIL import Image

from evertwin.errors import UsageError
from evertwin.sources.foreign import Damaged, foreign, load
from evertwin.sources.robot_logs.images import Pixels
from evertwin.types import Float64

DATA = Path(__file__).parent / "data" / "objects.onnx"
SAME = 0.5
"""Overlap (intersection over union) from which two boxes are of one thing."""
Corners = tuple[float, float, float, float]
"""Left, upper, right, lower edge [pixels]."""


class Detection(NamedTuple):
    """What is said to be seen. See the module for an example."""

    label: str
    probability: float
    corners: Corners


class Detector:
    """A net and its classes, on one core.

    >>> Detector().classes
    ('box', 'person', 'table')
    """

    def __init__(self, weights: Path = DATA) -> None:
        """Loads a net.

        Raises:
            MissingExtra: ONNX Runtime is not installed.
            UsageError: the file holds no such net.
        """
        runtime = load("onnxruntime", "perception")
        options = runtime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            with foreign(weights.name):
                self._net: Any = runtime.InferenceSession(
                    weights.read_bytes(), options, providers=["CPUExecutionProvider"]
                )
                named = self._net.get_modelmeta().custom_metadata_map.get("classes", "")
                (taken,), (given,) = self._net.get_inputs(), self._net.get_outputs()
                _, _, self._height, self._width = taken.shape
        except Damaged as error:
            raise UsageError(f"{weights}: expected a net in ONNX ({error.reason})") from None
        self.classes: tuple[str, ...] = tuple(named.split(","))
        if not named or list(given.shape[3:]) != [len(self.classes), 5]:
            raise UsageError(
                f"{weights}: expected a net that names its classes in its metadata and gives (1, "
                f"rows, columns, classes, 5), got {given.shape} and classes {named!r}"
            )
        self._taken = taken.name

    def detect(self, pixels: Pixels, least: float = 0.05) -> list[Detection]:
        """What an image shows, the most probable first; no less probable than ``least``.

        An image of another size is brought to the net's, its sides kept in proportion.
        """
        height, width = pixels.shape[:2]
        scale = min(self._width / width, self._height / height)
        size = max(1, round(scale * width)), max(1, round(scale * height))
        image = Image.fromarray(pixels)
        if size != image.size:
            image = image.resize(size, Image.Resampling.BILINEAR)  # averages where it shrinks
        shown = np.asarray(image, dtype=np.float32)
        taken = np.empty((self._height, self._width, 3), np.float32)
        taken[:] = shown.mean(axis=(0, 1))
        taken[: size[1], : size[0]] = shown
        cells = (self._cells(taken) + mirrored(self._cells(taken[:, ::-1]), self._width)) / 2
        return [
            one._replace(corners=_inside(one.corners, scale, width, height))
            for one in decoded(cells, self.classes, least)
        ]

    def _cells(self, taken: np.ndarray) -> Float64[np.ndarray, "rows columns classes 5"]:
        found = self._net.run(None, {self._taken: taken.transpose(2, 0, 1)[None]})
        return np.asarray(found[0][0], dtype=np.float64)


def _inside(corners: Corners, scale: float, width: int, height: int) -> Corners:
    """In pixels of the image, within it."""
    left, upper, right, lower = (one / scale for one in corners)
    return max(left, 0.0), max(upper, 0.0), min(right, float(width)), min(lower, float(height))


def mirrored(
    cells: Float64[np.ndarray, "rows columns classes 5"], width: int
) -> Float64[np.ndarray, "rows columns classes 5"]:
    """Cells of a picture of ``width`` as those of its mirror image.

    >>> mirrored(np.array([[[[0.9, 1.0, 2.0, 5.0, 6.0]]]]), 8).ravel().tolist()
    [0.9, 3.0, 2.0, 7.0, 6.0]
    """
    turned = cells[:, ::-1, :, [0, 3, 2, 1, 4]]
    turned[..., [1, 3]] = width - turned[..., [1, 3]]
    return turned


def decoded(
    cells: Float64[np.ndarray, "rows columns classes 5"], classes: tuple[str, ...], least: float
) -> list[Detection]:
    """What a net's cells say, the most probable first."""
    heat = cells[..., 0]
    peak = (heat >= least) & (heat >= scipy.ndimage.maximum_filter(heat, (3, 3, 1), mode="nearest"))
    where = np.argwhere(peak)
    order = np.argsort(-heat[peak], kind="stable")
    kept: list[Detection] = []
    for row, column, label in where[order]:
        probability, *edges = (float(one) for one in cells[row, column, label])
        corners = edges[0], edges[1], edges[2], edges[3]
        name = classes[label]
        if all(one.label != name or overlap(one.corners, corners) < SAME for one in kept):
            kept.append(Detection(name, probability, corners))
    return kept


def overlap(one: Corners, other: Corners) -> float:
    """Intersection over union.

    >>> overlap((0, 0, 2, 2), (1, 0, 3, 2))
    0.3333333333333333
    """
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    if width <= 0 or height <= 0:
        return 0.0
    first, second = ((c[2] - c[0]) * (c[3] - c[1]) for c in (one, other))
    return width * height / (first + second - width * height)
