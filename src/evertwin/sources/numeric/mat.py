"""MATLAB files of version 5 and 7.3: numeric vectors and matrices, also inside plain structures.

Objects, function handles and cells are not numbers and are left out by name. What a file holds is
read from the heads of its variables before any of them is unpacked. Version 7.3 is HDF5: MATLAB
keeps its arrays column by column, so HDF5 shows them transposed. Links to other files are never
followed.
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
from evertwin.sources.columns.table import WIDEST, Recording
from evertwin.sources.foreign import foreign, load
from evertwin.sources.numeric.arrays import Array, bounded, table_of

DEEPEST = 8
"""Structures inside one another that are followed."""
_CLASSES = dict(enumerate(
    ("cell", "struct", "object", "char", "sparse", "double", "single", "int8", "uint8", "int16",
     "uint16", "int32", "uint32", "int64", "uint64", "function", "opaque"), start=1,
))  # fmt: skip
_NUMBERS = tuple(_CLASSES.values())[5:15]
_NUMERIC = {*_NUMBERS, "struct"}
_MATRIX, _PACKED = 14, 15
_WORD = 64
"""Signs of the longest text that can be a unit."""
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
    found = _Found({}, {}, notes)
    with foreign(path.name):
        content = scipy.io.loadmat(str(path), variable_names=wanted)
        for name in wanted:
            _collect(name, content.get(name), found)
    return table_of(path, found.arrays, "mat", notes, found.texts)


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


class _Found(NamedTuple):
    arrays: dict[str, Array]
    texts: dict[str, str]
    notes: list[str]


def _collect(name: str, value: Any, found: _Found) -> None:
    """Numbers and texts of a variable, those of a structure as ``structure.field``, of several
    as ``structure.1.field``."""
    if not isinstance(value, np.ndarray):
        found.notes.append(f"{name}: {type(value).__name__} is no number")
    elif value.dtype.names is not None and 0 < value.size <= WIDEST:
        for i, record in enumerate(value.reshape(-1)):
            stem = name if value.size == 1 else f"{name}.{i + 1}"
            for field in value.dtype.names:
                _collect(f"{stem}.{field}", record[field], found)
    elif value.dtype.kind == "U" and value.size == 1:
        found.texts[name] = str(value.reshape(-1)[0])
    elif value.dtype.kind in "fiub" and value.ndim <= 2:
        found.arrays[name] = value
    else:
        found.notes.append(f"{name}: {value.dtype} of shape {value.shape} is no column")


def open_mat73(path: Path) -> Recording:
    """The numeric variables of a MAT file of version 7.3 as one table.

    Raises:
        DataError: damaged, too large, or without numeric vectors.
        MissingExtra: h5py is not installed.
    """
    h5py = load("h5py")
    notes: list[str] = []
    arrays, texts = dict[str, Array](), dict[str, str]()
    with foreign(path.name), h5py.File(path, "r") as file:
        found = dict(_datasets(h5py, file, "", notes, 0))
        size = sum(8.0 * math.prod(float(n) for n in d.shape) for d in found.values())
        bounded(path, size, path.stat().st_size)
        for name, dataset in found.items():
            value = np.asarray(dataset[()]).T
            if _class(dataset) == "char":
                texts[name] = "".join(map(chr, value.reshape(-1)))
                continue
            arrays[name] = value.astype(np.bool_) if _class(dataset) == "logical" else value
    return table_of(path, arrays, "mat", notes, texts)


def _datasets(h5py: Any, group: Any, stem: str, notes: list[str], depth: int) -> Any:
    """(name, dataset) of the numbers in a group, those of a structure as ``structure.field``."""
    for key in group:
        name = f"{stem}{key}"
        if key.startswith("#"):  # MATLAB's own: what cells refer to
            continue
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            notes.append(f"{name}: a link, which is not followed")
            continue
        item = group[key]
        if isinstance(item, h5py.Group):
            if depth < DEEPEST:
                yield from _datasets(h5py, item, f"{name}.", notes, depth + 1)
            else:
                notes.append(f"{name}: a structure within {DEEPEST} others")
        elif (
            _class(item) not in (*_NUMBERS, "logical", *(["char"] if item.size <= _WORD else []))
            or item.dtype.kind not in "fiu"
            or item.ndim > 2
        ):
            notes.append(f"{name}: {_class(item) or item.dtype} is no number")
        elif "MATLAB_empty" in item.attrs:
            notes.append(f"{name}: empty")
        else:
            yield name, item


def _class(item: Any) -> str:
    """What MATLAB calls a variable's type."""
    said = item.attrs.get("MATLAB_class", b"")
    return said.decode("ascii", "replace") if isinstance(said, bytes) else str(said)
