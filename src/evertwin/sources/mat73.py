"""MATLAB files of version 7.3, which are HDF5: numeric vectors and matrices, also in structures.

MATLAB keeps its arrays column by column, so HDF5 shows them transposed. Texts, cells and objects
are no numbers and are left out by name. Links to other files are never followed.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.sources.arrays import Array, bounded, table_of
from evertwin.sources.foreign import foreign
from evertwin.sources.optional import load
from evertwin.sources.table import Recording

DEEPEST = 8
"""Structures within structures."""
_NUMERIC = {
    "double", "single", "logical",
    "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64",
}  # fmt: skip


def open_mat73(path: Path) -> Recording:
    """The numeric variables of a MAT file of version 7.3 as one table.

    Raises:
        DataError: damaged, too large, or without numeric vectors.
        MissingExtra: h5py is not installed.
    """
    h5py = load("h5py")
    notes: list[str] = []
    arrays: dict[str, Array] = {}
    with foreign(path.name), h5py.File(path, "r") as file:
        found = dict(_datasets(h5py, file, "", notes, 0))
        size = sum(8.0 * math.prod(float(n) for n in d.shape) for d in found.values())
        bounded(path, size, path.stat().st_size)
        for name, dataset in found.items():
            value = np.asarray(dataset[()]).T
            arrays[name] = value.astype(np.bool_) if _class(dataset) == "logical" else value
    return table_of(path, arrays, "mat", notes)


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
        elif _class(item) not in _NUMERIC or item.dtype.kind not in "fiu" or item.ndim > 2:
            notes.append(f"{name}: {_class(item) or item.dtype} is no number")
        elif "MATLAB_empty" in item.attrs:
            notes.append(f"{name}: empty")
        else:
            yield name, item


def _class(item: Any) -> str:
    """What MATLAB calls a variable's type."""
    said = item.attrs.get("MATLAB_class", b"")
    return said.decode("ascii", "replace") if isinstance(said, bytes) else str(said)
