"""The twin files of this repository, as they are and with a setting changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import FitResult, Model, Twin, TwinSpec
from evertwin.config import read
from evertwin.models.spec import ParameterSpec

TWINS = Path(__file__).parent.parent / "twins"


def shipped(name: str, **sections: Any) -> TwinSpec:
    """A shipped twin file; ``sections`` are keys of a section by its name, or whole values.

    >>> shipped("robot1d", arbiter={"vote": 9}).arbiter.vote
    9
    """
    spec = read(TWINS / f"{name}.toml")
    changed = {
        section: replace(getattr(spec, section), **keys) if isinstance(keys, dict) else keys
        for section, keys in sections.items()
    }
    return replace(spec, **changed)


def opened(name: str, **sections: Any) -> Twin:
    """The twin of it."""
    return Twin(shipped(name, **sections))


def with_values(name: str, result: FitResult, **sections: Any) -> Twin:
    """The twin of a file, with the values that a fit has found."""
    values = {item.name: ParameterSpec(value=item.value) for item in result.parameters}
    return opened(name, model={"parameters": values}, **sections)


def written(file: Path, columns: Mapping[str, np.ndarray]) -> Path:
    """Columns by name as a CSV file; a number that is none is an empty cell."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = (",".join("" if cell != cell else str(cell) for cell in row) for row in rows)
    file.write_text("\n".join([",".join(columns), *lines, ""]), encoding="utf-8")
    return file


def planned(model: Model, file: Path, u: np.ndarray, dt: np.ndarray) -> Path:
    """Inputs to come in SI, written as `Twin.forecast` reads them."""
    names = (f"{c.name} [{c.unit}]" if c.unit != "1" else c.name for c in model.inputs)
    return written(file, {"t": np.cumsum(dt) - dt, **dict(zip(names, u.T, strict=True))})
