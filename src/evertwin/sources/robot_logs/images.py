"""The images of a bag: `Image` (rgb8, bgr8, mono8 and their kin) and `CompressedImage` (JPEG, PNG).

They are read one at a time, so that a bag of any length fits. What cannot be read (cut off, an
encoding that is no colour) is a `LostImage` with the reason: it is counted, not passed over.

>>> image = pixels_of({"height": 1, "width": 2, "encoding": "bgr8", "step": 6,
...                    "data": [1, 2, 3, 4, 5, 6]})
>>> image.tolist()
[[[3, 2, 1], [6, 5, 4]]]
>>> pixels_of({"height": 2, "width": 2, "encoding": "mono8", "step": 2, "data": [1, 2, 3]})
Traceback (most recent call last):
evertwin.errors.DataError: 3 bytes of an image of 2 × 2 (mono8), expected 4: cut off
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from evertwin.errors import DataError, UsageError
from evertwin.sources.columns.names import closest
from evertwin.sources.columns.table import Recording
from evertwin.sources.foreign import Damaged, foreign
from evertwin.sources.robot_logs.bag_files import Cut, Message, messages
from evertwin.sources.robot_logs.bag_tracks import part
from evertwin.sources.robot_logs.bags import TopicTable
from evertwin.sources.robot_logs.ros_messages import Decoder, stamp_of
from evertwin.types import UInt8

CHANNELS = {
    "rgb8": (0, 1, 2), "bgr8": (2, 1, 0), "rgba8": (0, 1, 2, 3), "bgra8": (2, 1, 0, 3),
    "mono8": (0,), "8UC1": (0,), "8UC3": (2, 1, 0),
}  # fmt: skip
"""Where red, green, blue stand in each pixel."""
FORMATS = ("JPEG", "PNG")
MOST = 1 << 26
"""Pixels of the largest image."""
Pixels = UInt8[np.ndarray, "h w 3"]


class BagImage(NamedTuple):
    """One image.

    >>> BagImage("/camera", 5, np.zeros((2, 3, 3), np.uint8)).pixels.shape
    (2, 3, 3)
    """

    topic: str
    t: int
    """Of its header, else of its logging [ns]."""
    pixels: Pixels
    encoding: str = ""
    """``rgb8`` of an `Image`, ``jpeg`` of a `CompressedImage`, as they state it."""


class LostImage(NamedTuple):
    """One that cannot be read.

    >>> LostImage("/camera", 5, "cut off").reason
    'cut off'
    """

    topic: str
    t: int
    reason: str


@dataclass
class Images:
    """The images of one topic, counted.

    >>> images = Images("/camera")
    >>> images.add(BagImage("/camera", 5, np.zeros((2, 3, 3), np.uint8), "rgb8"))
    >>> images.add(LostImage("/camera", 6, "cut off"))
    >>> len(images.t), images.findings, images.kinds
    (2, ('1 of 2 images cannot be read: left out (the first: cut off)',), {(3, 2, 'rgb8')})
    """

    name: str
    t: list[int] = field(default_factory=list)
    """Stamps [ns] of all, in the order of the bag."""
    kinds: set[tuple[int, int, str]] = field(default_factory=set)
    """Width, height, encoding."""
    lost: list[str] = field(default_factory=list)
    """Why each that cannot be read cannot."""

    def add(self, one: BagImage | LostImage) -> None:
        """Counts one more."""
        self.t.append(one.t)
        if isinstance(one, LostImage):
            self.lost.append(one.reason)
        else:
            height, width, _ = one.pixels.shape
            self.kinds.add((width, height, one.encoding))

    @property
    def rate(self) -> float | None:
        """Images per second, from the median step of the stamps; None for one, or for one time."""
        steps = np.diff(np.unique(self.t))
        return 1e9 / float(np.median(steps)) if len(steps) else None

    @property
    def findings(self) -> tuple[str, ...]:
        """What is odd about them, as sentences."""
        said, n = [], len(self.t)
        if self.lost:
            said.append(f"{len(self.lost)} of {n} images cannot be read: left out (the first: "
                        f"{self.lost[0]})")  # fmt: skip
        if n > len(set(self.t)):
            said.append(f"{n - len(set(self.t))} of {n} images repeat the stamp of another one")
        if len(self.kinds) > 1:
            kinds = ", ".join(f"{w} × {h} {kind}" for w, h, kind in sorted(self.kinds))
            said.append(f"images of several kinds: {kinds}")
        return tuple(said)


def images_of(recording: Recording, topic: str = "") -> Iterator[BagImage | LostImage]:
    """The images of a recording, in the order of the bag.

    Args:
        recording: of any kind; only bags have images.
        topic: of these alone; empty: all.

    Raises:
        UsageError: no such topic (at the end of the bag).
    """
    table = recording.tables[0]
    if not isinstance(table, TopicTable):
        return
    decoder, known = Decoder(), set[str]()
    for file, kind in table.files:
        for message in messages(file, kind):
            if isinstance(message, Cut) or not message.connection.image:
                continue
            known.add(message.connection.topic)
            if topic in ("", message.connection.topic):
                yield _image(message, decoder)
    if topic and topic not in known:
        raise UsageError(f"no images on {topic!r}: {closest(topic, sorted(known))}")


def _image(message: Message, decoder: Decoder) -> BagImage | LostImage:
    topic = message.connection.topic
    try:
        content = decoder.content(message)
    except DataError as error:
        return LostImage(topic, message.time, str(error))
    t = stamp_of(content) or message.time
    try:
        kind = str(part(content, "encoding") or part(content, "format") or "")
        return BagImage(topic, t, pixels_of(content), kind)
    except Damaged as error:
        return LostImage(topic, t, error.reason)
    except DataError as error:
        return LostImage(topic, t, str(error))


def pixels_of(content: Any) -> Pixels:
    """The pixels of a decoded message.

    Raises:
        DataError: fewer bytes than it states, or an encoding that is no colour.
    """
    data = _bytes(part(content, "data"))
    if part(content, "encoding") is None:
        return _unpacked(data)
    encoding = str(part(content, "encoding"))
    if encoding not in CHANNELS:
        raise DataError(f"encoding {encoding!r}: expected one of {', '.join(CHANNELS)}")
    order = CHANNELS[encoding]
    with foreign("image"):
        width, height, step = (int(part(content, k) or 0) for k in ("width", "height", "step"))
    if not (width > 0 and height > 0 and width * height <= MOST):
        raise DataError(f"an image of {width} × {height}")
    step = max(step, len(order) * width) if height > 1 else len(order) * width
    if len(data) < step * (height - 1) + len(order) * width:
        raise DataError(f"{len(data)} bytes of an image of {width} × {height} ({encoding}), "
                        f"expected {step * height}: cut off")  # fmt: skip
    rows = np.zeros(step * height, np.uint8)
    rows[: len(data)] = np.frombuffer(data, np.uint8)[: len(rows)]
    cells = rows.reshape(height, step)[:, : len(order) * width].reshape(height, width, len(order))
    return np.ascontiguousarray(cells[:, :, (order * 3)[:3] if len(order) == 1 else order[:3]])


def _bytes(data: Any) -> bytes:
    """Of a message; in JSON they are base64, or numbers.

    Raises:
        DataError: none of it.
    """
    with foreign("image"):
        if isinstance(data, str):
            return base64.b64decode(data, validate=True)
        if isinstance(data, np.ndarray):
            return data.astype(np.uint8).tobytes()
        return bytes(data if data is not None else ())


def _unpacked(data: bytes) -> Pixels:
    """A JPEG or PNG file."""
    with foreign("image"), Image.open(io.BytesIO(data), formats=FORMATS) as image:
        if image.width * image.height > MOST:
            raise DataError(f"an image of {image.width} × {image.height}")
        return np.asarray(image.convert("RGB"))
