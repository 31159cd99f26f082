"""Named arrays as bytes and back: a line of JSON that says where each one is, then the arrays.

>>> unpack(pack({"t": np.arange(3), "x": np.zeros((0, 2))}))["t"].tolist()
[0, 1, 2]
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from evertwin.errors import StoreDamaged, naming

Arrays: TypeAlias = Mapping[str, np.ndarray]


def pack(arrays: Arrays) -> bytes:
    """One text of bytes; equal arrays give equal bytes."""
    told = tuple((name, array.dtype.str, array.shape) for name, array in arrays.items())
    return b"\n".join([_head(told), b"".join([array.tobytes() for array in arrays.values()])])


@lru_cache(maxsize=256)
def _head(told: tuple[tuple[str, str, tuple[int, ...]], ...]) -> bytes:
    """The first line; samples come in few shapes."""
    return json.dumps(told, separators=(",", ":")).encode()


def unpack(content: bytes) -> dict[str, np.ndarray]:
    """What `pack` was given.

    Raises:
        StoreDamaged: it is not what `pack` gives.
    """
    head, _, rest = content.partition(b"\n")
    found, at = {}, 0
    with naming("stored arrays cannot be read", (ValueError, TypeError), StoreDamaged):
        told: list[Any] = json.loads(head)
        for name, dtype, shape in told:
            kind = np.dtype(dtype)
            count = int(np.prod(shape, dtype=np.int64))
            array = np.frombuffer(rest, kind, count, at) if count else np.zeros(0, kind)
            found[name] = array.reshape(shape).copy()
            at += count * kind.itemsize
    return found
