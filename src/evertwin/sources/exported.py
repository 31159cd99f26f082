"""Messages that were exported to a table: the columns that a bag would have of them.

Where the seconds and the nanoseconds of a stamp are two columns (``header.stamp.secs``,
``header.stamp.nsecs``), the stamp is one more; where a quaternion is four, so is its ``yaw`` about
the vertical axis. A stamp of zero is none, and what has not the length of a turn is no quaternion.

>>> computed(["header.stamp.secs", "header.stamp.nsecs", "q.x", "q.y", "q.z", "q.w"])["q.yaw"]
('q.x', 'q.y', 'q.z', 'q.w')
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evertwin.sources.stamps import NO_STAMP
from evertwin.sources.table import Column, Rows, Table
from evertwin.types import Float64, Stamps, Vector

_SECONDS = re.compile(r"^(.+?)([._/])(secs?|n(?:ano)?secs?)$")
_AXIS = re.compile(r"^(.+?)([._/]?)([xyzw])$")
_LIMIT = 2**63 * 1e-9
"""The latest stamp [s]."""


def computed(names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """What columns of these names are parts of: the name of the whole → the names of its parts."""
    stamps, turns = dict[str, dict[str, str]](), dict[str, dict[str, str]]()
    for name in names:
        if (found := _SECONDS.match(name)) is not None:
            stamps.setdefault(found[1], {})[found[3][0]] = name
        elif (found := _AXIS.match(name)) is not None:
            whole = f"{found[1]}{found[2] or '_'}yaw"
            turns.setdefault(whole, {})[found[3]] = name
    out: dict[str, tuple[str, ...]]
    out = {name: (parts["s"], parts["n"]) for name, parts in stamps.items() if len(parts) == 2}
    out |= {name: tuple(p[a] for a in "xyzw") for name, p in turns.items() if len(p) == 4}
    return out


def parts_of(names: Iterable[str]) -> set[str]:
    """Columns that are parts of another, which is there.

    >>> sorted(parts_of(["stamp", "stamp.sec", "stamp.nanosec", "v.sec", "v.nanosec"]))
    ['stamp.nanosec', 'stamp.sec']
    """
    there = set(names)
    return {part for whole, parts in computed(sorted(there)).items() if whole in there
            for part in parts}  # fmt: skip


@dataclass(frozen=True)
class Exported:
    """A table with what its columns are parts of. Implements `Table`.

    >>> Exported.__name__
    'Exported'
    """

    inner: Table
    parts: Mapping[str, tuple[str, ...]]
    """Name of a whole → its parts: two of a stamp, four of a quaternion."""

    @property
    def path(self) -> Path:
        """See `Table`."""
        return self.inner.path

    @property
    def name(self) -> str:
        """See `Table`."""
        return self.inner.name

    @property
    def columns(self) -> tuple[Column, ...]:
        """Those of the file, which keep their positions, then the wholes."""
        more = (
            Column(name, "time", "ns") if len(parts) == 2 else Column(name, "number", "rad")
            for name, parts in self.parts.items()
        )
        return (*self.inner.columns, *more)

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        wanted = [part for name in numbers for part in self.parts.get(name, (name,))]
        clock = self.parts.get(time or "", ())
        columns = list(dict.fromkeys([*wanted, *clock]))
        for rows in self.inner.rows(columns, None if clock else time, strict):
            cells = dict(zip(columns, rows.values.T, strict=True))
            stamps = _stamps([cells[part] for part in clock]) if clock else rows.time
            values = [self._whole(name, cells) for name in numbers]
            stacked = np.stack(values, axis=1) if values else np.zeros((len(rows.line), 0))
            yield rows._replace(time=stamps, values=stacked)

    def _whole(self, name: str, cells: Mapping[str, Vector]) -> Vector:
        parts = [cells[part] for part in self.parts.get(name, ())]
        return _yaw(parts) if len(parts) == 4 else cells[name]


def _stamps(parts: Sequence[Float64[np.ndarray, " n"]]) -> Stamps:
    """Nanoseconds; none where a part is empty, or both are zero."""
    seconds, nanos = parts
    known = (np.abs(seconds) < _LIMIT) & (np.abs(nanos) < 1e10) & ((seconds != 0) | (nanos != 0))
    out = np.full(len(seconds), NO_STAMP, dtype=np.int64)
    out[known] = seconds[known].astype(np.int64) * 10**9 + nanos[known].astype(np.int64)
    return out


def _yaw(parts: Sequence[Vector]) -> Vector:
    x, y, z, w = parts
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.where(x * x + y * y + z * z + w * w > 0.5, yaw, np.nan)


def exported(table: Table) -> Table:
    """The table, with the wholes that its first rows bear out."""
    numbers = [column.name for column in table.columns if column.kind == "number"]
    found = {
        name: parts for name, parts in computed(numbers).items()
        if name not in {column.name for column in table.columns}
    }  # fmt: skip
    if not found:
        return table
    columns = list(dict.fromkeys(part for parts in found.values() for part in parts))
    rows = next(iter(table.rows(columns, None, strict=False)), None)
    if rows is None or not len(rows.line):
        return table
    cells = dict(zip(columns, rows.values.T, strict=True))
    sound = {
        name: parts
        for name, parts in found.items() if _borne_out([cells[part] for part in parts])
    }  # fmt: skip
    return Exported(table, sound) if sound else table


def _borne_out(parts: Sequence[Vector]) -> bool:
    """Are these seconds with nanoseconds below one, or the parts of a turn?"""
    known = np.isfinite(parts).all(axis=0)
    if len(parts) == 2:
        below = (parts[1][known] >= 0) & (parts[1][known] < 1e9)
        return bool(known.any() and below.all() and parts[0][known].any())
    size = np.sqrt(sum(part[known] ** 2 for part in parts))
    return bool(known.any() and np.median(np.abs(size - 1.0)) < 0.01)
