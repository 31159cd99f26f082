"""MATLAB files of version 5: numeric vectors and matrices, also inside plain structures.

Objects, function handles and cells are not numbers and are left out by name. Version 7.3 is HDF5:
`evertwin.sources.mat73`.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from scipy.io.matlab import MatReadError

from evertwin.errors import DataError
from evertwin.sources.arrays import LARGEST, Array, table_of
from evertwin.sources.table import Recording

__all__ = ["open_mat"]

_NUMERIC = {
    "double", "single", "logical", "struct",
    "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64",
}  # fmt: skip
_DAMAGE = (
    MatReadError, ValueError, TypeError, KeyError, IndexError, OSError, EOFError, OverflowError,
    NotImplementedError, struct.error, zlib.error, MemoryError,
)  # fmt: skip


def open_mat(path: Path) -> Recording:
    """The numeric variables of a MAT file as one table.

    Raises:
        DataError: damaged, too large, or without numeric vectors.
    """
    notes: list[str] = []
    wanted: list[str] = []
    try:
        listed = scipy.io.whosmat(str(path))
    except _DAMAGE as error:
        raise _damaged(path, error) from None
    size = 0
    for name, shape, kind in listed:
        if kind not in _NUMERIC:
            notes.append(f"{name}: {kind} is no number")
            continue
        wanted.append(name)
        size += 8 * int(np.prod([float(n) for n in shape]))
    if size > LARGEST:
        raise DataError(
            f"{path.name}: unpacks to {size} bytes, the limit is {LARGEST}: save it as Parquet, "
            "which is read in pieces"
        )
    try:
        content = scipy.io.loadmat(str(path), variable_names=wanted)
    except _DAMAGE as error:
        raise _damaged(path, error) from None
    arrays: dict[str, Array] = {}
    for name in wanted:
        _collect(name, content.get(name), arrays, notes)
    return table_of(path, arrays, "mat", notes)


def _damaged(path: Path, error: Exception) -> DataError:
    return DataError(
        f"{path.name}: damaged or cut off ({type(error).__name__}: {error}): copy or save it again"
    )


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
