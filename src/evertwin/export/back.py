"""Parameter values back in, from a JSON or MAT file: as exported, or written by another tool.

JSON: ``{"parameters": {"Fc1": 12.0, "Fv1": {"value": 10.0}}}``. MAT: a structure ``parameters``
with a field per parameter, a number or a structure with ``value`` (and ``name``, where the field's
name is not the parameter's).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from evertwin.errors import DataError
from evertwin.export.formats import identifier

_DAMAGE = (ValueError, TypeError, NotImplementedError, LookupError)


def values_in(path: Path, names: Sequence[str]) -> dict[str, float]:
    """The values that a file has for parameters ``names``.

    Raises:
        DataError: no such file, no parameters in it, one of them unknown or not a finite number.
    """
    try:
        with path.open("rb") as file:
            matlab = file.read(6) == b"MATLAB"
        found = _from_mat(path, names) if matlab else _from_json(path)
    except OSError as error:
        raise DataError(f"{path}: {error.strerror or error}: check the path") from error
    if not found:
        raise DataError(f"{path.name}: expected parameters, got none")
    for name, value in found.items():
        if name not in names:
            raise DataError(f"{path.name}: no parameter {name!r}; there are {', '.join(names)}")
        if not math.isfinite(value):
            raise DataError(f"{path.name}: {name}: expected a finite number, got {value}")
    return found


def _number(where: str, value: Any) -> float:
    if isinstance(value, Mapping):
        value = value.get("value")
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise DataError(f"{where}: expected a number, got {type(value).__name__}")
    return float(value)


def _from_json(path: Path) -> dict[str, float]:
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise DataError(
            f"{path.name}: expected JSON, or a MAT file of version 5 (save with -v7): {error}"
        ) from error
    items = content.get("parameters") if isinstance(content, dict) else None
    if not isinstance(items, dict):
        raise DataError(f"{path.name}: expected an object with 'parameters'")
    return {name: _number(f"{path.name}: {name}", value) for name, value in items.items()}


def _from_mat(path: Path, names: Sequence[str]) -> dict[str, float]:
    try:
        content = scipy.io.loadmat(
            str(path), variable_names=["parameters"], simplify_cells=True
        ).get("parameters")
    except (scipy.io.matlab.MatReadError, *_DAMAGE) as error:
        raise DataError(
            f"{path.name}: expected a MAT file of version 5 (save with -v7): {error}"
        ) from error
    if not isinstance(content, Mapping):
        raise DataError(f"{path.name}: expected a structure 'parameters' with a field each")
    known = {identifier(name): name for name in names}
    out: dict[str, float] = {}
    for field, value in content.items():
        own = value.get("name") if isinstance(value, Mapping) else None
        name: str = own if isinstance(own, str) and own else known.get(field, str(field))
        out[name] = _number(f"{path.name}: {field}", value)
    return out
