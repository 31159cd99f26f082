"""Columns of a world's recording into a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from evertwin.signals import Channel, Layout
from evertwin.signals.series import Series
from evertwin.sources import write
from evertwin.types import Vector


def save(path: Path, columns: Mapping[str, Vector], units: Mapping[str, str]) -> None:
    """Writes ``columns``, of which ``t`` holds seconds, each in its unit."""
    names = [name for name in columns if name != "t"]
    layout = Layout(tuple(Channel(name, units[name]) for name in names))
    t = np.rint(np.asarray(columns["t"]) * 1e9).astype(np.int64)
    values = np.stack([columns[name] for name in names], axis=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, {"world": Series(layout, t, np.ascontiguousarray(values))})
