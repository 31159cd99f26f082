"""A state as pieces that are named by their hash: what did not change is not written again.

Large arrays (the newest rows, a detector's buffer) are cut every `PIECE` bytes; between two
checkpoints most of their pieces stay as they were, whichever way a ring is filled. Everything
small goes into one piece. A piece proves itself: its name is the hash of its bytes.

>>> state = (np.zeros(100_000), 7)
>>> first = cut(state)
>>> second = cut((np.r_[np.zeros(99_999), 1.0], 8))
>>> len(first.pieces), len(second.pieces.keys() - first.pieces.keys())
(3, 2)
>>> joined(first.layout, first.pieces, state)[1]
7
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from evertwin.errors import StoreDamaged
from evertwin.fold.state import filled, leaves
from evertwin.store.sql.arrays import pack, unpack

S = TypeVar("S")
PIECE = 1 << 14
"""Bytes of a piece."""


class Pieces(NamedTuple):
    """A state, cut.

    >>> Pieces("{}", {}).layout
    '{}'
    """

    layout: str
    """JSON: the name of the small piece; for each large array its type, shape and pieces."""
    pieces: dict[str, bytes]
    """Name → bytes."""


def name_of(content: bytes) -> str:
    """The name of a piece."""
    return hashlib.blake2b(content, digest_size=20).hexdigest()


def cut(state: object) -> Pieces:
    """The pieces of a state.

    Raises:
        StoreError: a leaf is neither an array nor a plain number, text or None.
    """
    pieces: dict[str, bytes] = {}
    small: dict[str, np.ndarray] = {}
    large: dict[str, Any] = {}

    def keep(content: bytes) -> str:
        name = name_of(content)
        pieces[name] = content
        return name

    for path, array in leaves(state).items():
        if array.nbytes <= PIECE:
            small[path] = array
            continue
        raw = array.tobytes()
        names = [keep(raw[at : at + PIECE]) for at in range(0, len(raw), PIECE)]
        large[path] = (array.dtype.str, array.shape, names)
    told = {"small": keep(pack(small)), "large": large}
    return Pieces(json.dumps(told, separators=(",", ":")), pieces)


def names_in(layout: str) -> set[str]:
    """The pieces that a layout needs.

    Raises:
        StoreDamaged: it is no layout.
    """
    try:
        told = json.loads(layout)
        return {told["small"]} | {name for _, _, names in told["large"].values() for name in names}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise StoreDamaged(f"checkpoint: its layout cannot be read: {error}") from error


def joined(layout: str, pieces: Mapping[str, bytes], like: S) -> S:
    """The state in the shape of ``like``.

    Raises:
        StoreDamaged: a piece is missing or was changed.
        StoreError: a field is missing or has another type or rank: another version saved it.
    """
    for name in names_in(layout):
        if name not in pieces or name_of(pieces[name]) != name:
            raise StoreDamaged(f"checkpoint: piece {name[:12]} is missing or was changed")
    told = json.loads(layout)
    arrays = unpack(pieces[told["small"]])
    for path, (dtype, shape, names) in told["large"].items():
        raw = b"".join(pieces[name] for name in names)
        arrays[path] = np.frombuffer(raw, np.dtype(dtype)).reshape(shape).copy()
    return filled(like, arrays)


def proof(*values: object) -> str:
    """A hash over plain values, stored beside them."""
    return name_of("\n".join(map(str, values)).encode())
