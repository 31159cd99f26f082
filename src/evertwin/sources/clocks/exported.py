"""Messages and fixes that were exported to a table: the columns that are made of several.

Where the seconds and the nanoseconds of a stamp are two columns (``header.stamp.secs``,
``header.stamp.nsecs``), the stamp is one more, as a bag has it; where a quaternion is four, so is
its ``yaw`` about the vertical axis; latitude and longitude are ``east`` and ``north`` [m] on a
plane that touches the earth near by. A stamp of zero is none, and what has not the length of a turn
is no quaternion.

>>> computed(["header.stamp.secs", "header.stamp.nsecs", "q.x", "q.y", "q.z", "q.w"])["q.yaw"].parts
('q.x', 'q.y', 'q.z', 'q.w')
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.sources.clocks.stamps import NO_STAMP
from evertwin.sources.columns.table import Column, Recording, Rows, Table
from evertwin.types import Float64, Stamps, Vector

_SECONDS = re.compile(r"^(?:(.+?)[._/])?(secs?|n(?:ano)?secs?)$")
_AXIS = re.compile(r"^(.+?)([._/]?)([xyzw])$")
_FIX = re.compile(r"^(|.*[^a-z])(lat(?:itude)?|lon(?:gitude)?|lng|long)(?:[^a-z]deg)?$", re.I)
_LIMIT = 2**63 * 1e-9
"""The latest stamp [s]."""
_RADIUS, _FLAT = 6_378_137.0, 1.0 / 298.257223563
"""Of the earth (WGS 84): at the equator [m], and how much less at the poles."""
_UNITS = {"stamp": "ns", "yaw": "rad", "east": "m", "north": "m"}


class Whole(NamedTuple):
    """A column that is made of others.

    >>> Whole("stamp", ("t.secs", "t.nsecs")).origin
    (0.0, 0.0)
    """

    kind: str
    """``stamp``, ``yaw``, ``east`` or ``north``."""
    parts: tuple[str, ...]
    origin: tuple[float, float] = (0.0, 0.0)
    """Latitude and longitude where the plane touches the earth [deg]."""


def computed(names: Sequence[str]) -> dict[str, Whole]:
    """What columns of these names are parts of, by its own name."""
    stamps, turns, fixes = (dict[str, dict[str, str]]() for _ in range(3))
    for name in names:
        if (found := _SECONDS.match(name)) is not None:
            stamps.setdefault(found[1] or "stamp", {})[found[2][0]] = name
        elif (found := _AXIS.match(name)) is not None:
            whole = f"{found[1]}{found[2] or '_'}yaw"
            turns.setdefault(whole, {})[found[3]] = name
        elif (found := _FIX.match(name)) is not None:
            fixes.setdefault(found[1], {})[found[2][:2].lower()] = name
    out = {name: Whole("stamp", (p["s"], p["n"])) for name, p in stamps.items() if len(p) == 2}
    out |= {
        name: Whole("yaw", tuple(p[axis] for axis in "xyzw"))
        for name, p in turns.items() if len(p) == 4
    }  # fmt: skip
    for before, parts in fixes.items():
        if {"la", "lo"} <= parts.keys():
            pair = (parts["la"], parts["lo"])
            out |= {f"{before}{to}": Whole(to, pair) for to in ("east", "north")}
    return out


def parts_of(names: Iterable[str]) -> set[str]:
    """Columns that are parts of another, which is there.

    >>> list(computed(["sec", "nanosec"]))
    ['stamp']
    >>> sorted(parts_of(["stamp", "stamp.sec", "stamp.nanosec", "v.sec", "v.nanosec"]))
    ['stamp.nanosec', 'stamp.sec']
    """
    there = set(names)
    return {
        part for name, whole in computed(sorted(there)).items() if name in there
        for part in whole.parts
    }  # fmt: skip


@dataclass(frozen=True)
class Exported:
    """A table with what its columns are parts of. Implements `Table`.

    >>> Exported.__name__
    'Exported'
    """

    inner: Table
    wholes: Mapping[str, Whole]
    """By their names."""

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
            Column(name, "time" if one.kind == "stamp" else "number", _UNITS[one.kind])
            for name, one in self.wholes.items()
        )
        return (*self.inner.columns, *more)

    @property
    def notes(self) -> Iterator[str]:
        """Where a plane touches the earth."""
        for name, one in self.wholes.items():
            if one.kind == "east":
                north, (a, b) = f"{name.removesuffix('east')}north", one.parts
                yield (
                    f"{a}, {b}: read as {name}, {north} [m] from {one.origin[0]:g}, "
                    f"{one.origin[1]:g} deg"
                )

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        clock = self.wholes.get(time or "")
        asked = [*numbers, *([time] if time is not None and clock is not None else [])]
        parts = (part for name in asked for part in self._parts(name))
        columns = list(dict.fromkeys(parts))
        for rows in self.inner.rows(columns, time if clock is None else None, strict):
            cells = dict(zip(columns, rows.values.T, strict=True))
            stamps = rows.time if clock is None else _stamps([cells[p] for p in clock.parts])
            values = [self._cells(name, cells) for name in numbers]
            stacked = np.stack(values, axis=1) if values else np.zeros((len(rows.line), 0))
            yield rows._replace(time=stamps, values=stacked)

    def _parts(self, name: str) -> tuple[str, ...]:
        return self.wholes[name].parts if name in self.wholes else (name,)

    def _cells(self, name: str, cells: Mapping[str, Vector]) -> Vector:
        if name not in self.wholes:
            return cells[name]
        one = self.wholes[name]
        parts = [cells[part] for part in one.parts]
        if one.kind == "stamp":  # as a number
            number: Vector = parts[0] * 1e9 + parts[1]
            return number
        if one.kind == "yaw":
            return _yaw(parts)
        east, north = _on_plane(parts[0], parts[1], one.origin)
        return east if one.kind == "east" else north


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


def _on_plane(lat: Vector, lon: Vector, origin: tuple[float, float]) -> tuple[Vector, Vector]:
    """East and north [m] of fixes [deg] on the plane that touches the ellipsoid; a fix of 0, 0 is
    none."""
    none = ~((np.abs(lat) <= 90.0) & (np.abs(lon) <= 360.0) & ((lat != 0.0) | (lon != 0.0)))
    places = _from_centre(np.where(none, np.nan, lat), lon)
    x, y, z = (
        a - b
        for a, b in zip(places, _from_centre(*(np.array([one]) for one in origin)), strict=True)
    )
    phi, lam = map(math.radians, origin)
    out = math.cos(lam) * x + math.sin(lam) * y
    return (
        math.cos(lam) * y - math.sin(lam) * x, math.cos(phi) * z - math.sin(phi) * out
    )  # fmt: skip


def _from_centre(lat: np.ndarray, lon: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the earth [m], on its surface."""
    phi, lam = np.radians(lat), np.radians(lon)
    square = _FLAT * (2.0 - _FLAT)
    radius = _RADIUS / np.sqrt(1.0 - square * np.sin(phi) ** 2)
    out = radius * np.cos(phi)
    return out * np.cos(lam), out * np.sin(lam), radius * (1.0 - square) * np.sin(phi)


def exported(recording: Recording) -> Recording:
    """The recording, its tables with the wholes that their first rows bear out."""
    tables = tuple(map(_with_wholes, recording.tables))
    notes = (note for table in tables if isinstance(table, Exported) for note in table.notes)
    return replace(recording, tables=tables, notes=(*recording.notes, *notes))


def _with_wholes(table: Table) -> Table:
    there = {column.name for column in table.columns}
    numbers = [column.name for column in table.columns if column.kind == "number"]
    found = {name: one for name, one in computed(numbers).items() if name not in there}
    if not found:
        return table
    columns = list(dict.fromkeys(part for one in found.values() for part in one.parts))
    rows = next(iter(table.rows(columns, None, strict=False)), None)
    if rows is None or not len(rows.line):
        return table
    cells = dict(zip(columns, rows.values.T, strict=True))
    looked = {name: _borne_out(one, cells) for name, one in found.items()}
    sound = {name: one for name, one in looked.items() if one is not None}
    return Exported(table, sound) if sound else table


def _borne_out(one: Whole, cells: Mapping[str, Vector]) -> Whole | None:
    """Are these seconds with nanoseconds below one, the parts of a turn, or places that lie far
    nearer to each other than to the equator, or to the meridian of 0?"""
    parts = np.array([cells[part] for part in one.parts])
    parts = parts[:, np.isfinite(parts).all(axis=0)]
    if one.kind in ("east", "north"):
        parts = parts[:, (parts != 0.0).any(axis=0)]
    if not parts.shape[1]:
        return None
    if one.kind == "stamp":
        below = (parts[1] >= 0.0) & (parts[1] < 1e9)
        return one if below.all() and parts[0].any() else None
    if one.kind == "yaw":
        size = np.sqrt((parts**2).sum(axis=0))
        return one if float(np.median(np.abs(size - 1.0))) < 0.01 else None
    middle, reach = np.median(parts, axis=1), np.abs(parts).max(axis=1)
    near = np.quantile(np.abs(parts - middle[:, None]), 0.9, axis=1) < 0.01 * np.abs(middle)
    if reach[0] > 90.0 or reach[1] > 360.0 or not near.any():
        return None
    lat, lon = (round(float(value), 2) for value in middle)  # of one site the same for all files
    return one._replace(origin=(lat, lon))
