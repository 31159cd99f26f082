"""MATLAB files of version 5: numeric vectors and matrices, also inside plain structures.

Objects, function handles and cells are not numbers and are left out by name. What a file holds is
read from the heads of its variables before any of them is unpacked. Version 7.3 is HDF5:
`evertwin.sources.mat73`.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.errors import DataError
from evertwin.sources.arrays import Array, bounded, table_of
from evertwin.sources.foreign import foreign
from evertwin.sources.table import WIDEST, Recording

_CLASSES = dict(enumerate(
    ("cell", "struct", "object", "char", "sparse", "double", "single", "int8", "uint8", "int16",
     "uint16", "int32", "uint32", "int64", "uint64", "function", "opaque"), start=1,
))  # fmt: skip
_NUMERIC = {*tuple(_CLASSES.values())[5:15], "struct"}
_MATRIX, _PACKED = 14, 15
_HEAD = 1 << 12
"""Bytes of a variable that hold its class, shape and name."""


class _Variable(NamedTuple):
    """One variable of a file, as its head tells it."""

    name: str
    kind: str
    size: float
    """Bytes as float64; of a structure all that it unpacks to."""


def open_mat(path: Path) -> Recording:
    """The numeric variables of a MAT file as one table.

    Raises:
        DataError: damaged, too large, or without numeric vectors.
    """
    with foreign(path.name):
        variables = tuple(_variables(path))
    if len(variables) > WIDEST:
        raise DataError(f"{path.name}: {len(variables)} variables, the limit is {WIDEST}")
    notes = [f"{v.name}: {v.kind} is no number" for v in variables if v.kind not in _NUMERIC]
    wanted = [v.name for v in variables if v.kind in _NUMERIC]
    bounded(path, sum(v.size for v in variables if v.kind in _NUMERIC), path.stat().st_size)
    arrays: dict[str, Array] = {}
    with foreign(path.name):
        content = scipy.io.loadmat(str(path), variable_names=wanted)
        for name in wanted:
            _collect(name, content.get(name), arrays, notes)
    return table_of(path, arrays, "mat", notes)


def _variables(path: Path) -> Iterator[_Variable]:
    """The variables in file order."""
    with path.open("rb") as file:
        order = {b"IM": "<", b"MI": ">"}[file.read(128)[126:]]
        while tag := file.read(8):
            kind, size = struct.unpack(f"{order}II", tag)
            start = file.tell()
            if kind == _PACKED:
                head = zlib.decompressobj().decompress(file.read(min(size, _HEAD)), _HEAD)
                kind, inner = struct.unpack(f"{order}II", head[:8])
                head = head[8:]
            else:
                head, inner = file.read(min(size, _HEAD)), size
            if kind == _MATRIX:
                yield _variable(head, order, inner)
            file.seek(start + size)


def _variable(head: bytes, order: str, inner: int) -> _Variable:
    """From the first elements of a matrix: flags, shape, name."""
    elements = io.BytesIO(head)
    (flags,) = struct.unpack(f"{order}I", _element(elements, order)[:4])
    kind = _CLASSES.get(flags & 0xFF, "unknown")
    if kind == "opaque":  # an object of a class: it has no shape
        return _Variable(_element(elements, order).decode("utf-8", "replace"), kind, 0.0)
    shape = np.frombuffer(_element(elements, order), f"{order}i4").astype(np.float64)
    name = _element(elements, order).decode("utf-8", "replace")
    size = float(inner) if kind == "struct" else 8.0 * math.prod(np.abs(shape).tolist())
    return _Variable(name, kind, max(size, float(inner)))


def _element(elements: io.BytesIO, order: str) -> bytes:
    """The next element of data; one of up to four bytes stands in its own tag."""
    (word,) = struct.unpack(f"{order}I", elements.read(4))
    if word >> 16:
        return elements.read(4)[: word >> 16]
    (size,) = struct.unpack(f"{order}I", elements.read(4))
    data = elements.read(size)
    elements.seek(-size % 8, io.SEEK_CUR)
    return data


def _collect(name: str, value: Any, arrays: dict[str, Array], notes: list[str]) -> None:
    """Numeric arrays of a variable, those of a structure as ``structure.field``."""
    if not isinstance(value, np.ndarray):
        notes.append(f"{name}: {type(value).__name__} is no number")
    elif value.dtype.names is not None and value.size == 1:
        record = value.reshape(-1)[0]
        for field in value.dtype.names:
            _collect(f"{name}.{field}", record[field], arrays, notes)
    elif value.dtype.kind in "fiub" and value.ndim <= 2:
        arrays[name] = value
    else:
        notes.append(f"{name}: {value.dtype} of shape {value.shape} is no column")
