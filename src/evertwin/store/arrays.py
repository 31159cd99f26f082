"""Named arrays as bytes and back: a line of JSON that says where each one is, then the arrays.

>>> unpack(pack({"t": np.arange(3), "x": np.zeros((0, 2))}))["t"].tolist()
[0, 1, 2]
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from evertwin.errors import StoreDamaged

Arrays: TypeAlias = Mapping[str, np.ndarray]


def pack(arrays: Arrays) -> bytes:
    """One text of bytes; equal arrays give equal bytes."""
    told, parts = [], []
    for name, array in arrays.items():
        told.append((name, array.dtype.str, array.shape))
        parts.append(array.tobytes())
    return b"\n".join([json.dumps(told, separators=(",", ":")).encode(), b"".join(parts)])


def unpack(content: bytes) -> dict[str, np.ndarray]:
    """What `pack` was given.

    Raises:
        StoreDamaged: it is not what `pack` gives.
    """
    head, _, rest = content.partition(b"\n")
    found, at = {}, 0
    try:
        told: list[Any] = json.loads(head)
        for name, dtype, shape in told:
            kind = np.dtype(dtype)
            count = int(np.prod(shape, dtype=np.int64))
            array = np.frombuffer(rest, kind, count, at) if count else np.zeros(0, kind)
            found[name] = array.reshape(shape).copy()
            at += count * kind.itemsize
    except (ValueError, TypeError) as error:
        raise StoreDamaged(f"stored arrays cannot be read: {error}") from error
    return found
