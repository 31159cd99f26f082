"""Tables that a program holds in memory, as recordings: stamps, units, gaps, empty cells and what
is left out are judged as those of a file are.

What has columns by name is one: a DataFrame (pandas, polars), an Arrow table, an xarray data set, a
record array, a mapping of columns, and a list of rows that are mappings of numbers. A masked value,
None, NA and NaT are empty cells; a text is read as that of a file.

>>> held = in_memory({"t": [0, 1], "v": np.ma.masked_array([1.5, 9.0], mask=[False, True])})
>>> next(held.recording.tables[0].rows(["v"], "t")).values[:, 0].tolist()
[1.5, nan]
"""

from __future__ import annotations

import datetime
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.clocks.dates import ORDERS
from evertwin.sources.clocks.exported import exported
from evertwin.sources.clocks.stamps import texts
from evertwin.sources.clocks.time_unit import guess, is_usual
from evertwin.sources.columns.names import split_unit
from evertwin.sources.columns.table import Column, Recording, Rows
from evertwin.sources.numeric.arrays import PIECE, kind_of
from evertwin.types import Vector

INDEX = "index"
"""What an index without a name is called."""
EMPTY = {"", "nan", "na", "n/a", "<na>", "nat", "null", "none"}
"""Texts of a cell without a value."""
_CELLS = "fiubmMS"
"""Kinds of arrays that can be cells."""
_DATED = (datetime.date, datetime.time)
_TOLD = (str, bytes, *_DATED)


@runtime_checkable
class Frame(Protocol):
    """A table of another package: a DataFrame of pandas or polars, an Arrow table.

    >>> hasattr(Frame, "__getitem__")
    True
    """

    @property
    def shape(self) -> Any:
        """Rows and columns."""
        ...

    def __getitem__(self, name: Any, /) -> Any:
        """One column."""
        ...


class InMemory(NamedTuple):
    """A recording, and the column that is its time where none is called for.

    >>> in_memory({"v": [1.0]}).clock is None
    True
    """

    recording: Recording
    clock: str | None
    """An index of dates, or of seconds; None: its rows have numbers at most."""
    mapping: bool
    """Is it a mapping of columns?"""


def in_memory(data: Any, number: int = 0) -> InMemory | None:
    """A table as a recording; None: it has no columns by name.

    Args:
        data: the table.
        number: which one it is where there are several, from 1.

    Raises:
        DataError: two columns of one name.
    """
    if isinstance(data, list | tuple) and data and all(map(_is_row, data)):
        names = dict.fromkeys(name for row in data for name in row)
        columns: dict[str, Any] | None = {n: [row.get(n) for row in data] for n in names}
    else:
        columns = _columns(data)
    if columns is None:
        return None
    index: Any = getattr(data, "index", None)
    clock = None
    if hasattr(index, "to_numpy") and not isinstance(data, Mapping):
        name = INDEX if index.name is None else str(index.name)
        if name not in columns and getattr(index, "nlevels", 1) == 1:
            clock = name if _is_time(index) else None
            columns |= {name: index} if clock or index.name is not None else {}
    if columns and all(np.ndim(column) == 0 for column in columns.values()):  # one sample
        columns = {name: np.atleast_1d(np.asarray(one)) for name, one in columns.items()}
    path = Path(type(data).__name__ + f" {number}" * bool(number))
    table = MemoryTable(path, columns)
    return InMemory(exported(Recording(path, "memory", (table,))), clock, isinstance(data, Mapping))


def _is_row(item: object) -> bool:
    return isinstance(item, Mapping) and all(np.ndim(value) == 0 for value in item.values())


def _columns(data: Any) -> dict[str, Any] | None:
    if isinstance(data, Mapping):
        along = getattr(data, "coords", {})  # of an xarray data set
        flat = {str(name): along[name] for name in along if np.ndim(along[name]) == 1}
        return flat | {str(name): column for name, column in data.items()}
    names = getattr(getattr(data, "dtype", None), "names", None)
    names = names or getattr(data, "column_names", getattr(data, "columns", None))
    if names is None or isinstance(names, str) or not isinstance(data, Frame):
        return None
    for name, count in Counter(map(str, names)).items():
        if count > 1:
            raise DataError(f"{count} columns are called {name!r}: rename them")
    return {str(name): data[name] for name in names}


def _is_time(index: Any) -> bool:
    """Does an index tell times, not numbers of rows?"""
    raw = as_cells(index[:1000])
    if raw.dtype.kind in "mM" or (raw.dtype.kind == "S" and guess("", raw).unit in ORDERS):
        return True
    if raw.dtype.kind not in "iuf":
        return False
    if index.name is not None:
        return is_usual(str(index.name))
    return raw.dtype.kind == "f" or guess("", raw).evident


@dataclass(frozen=True)
class MemoryTable:
    """Columns that are held in memory. Implements `Table`.

    >>> MemoryTable(Path("frame"), {"v [cm/s]": [1, 2]}).columns[0].unit
    'cm/s'
    """

    path: Path
    held: Mapping[str, Any]
    name: str = ""
    _seen: dict[str, np.ndarray] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """By their whole headings; without its unit a heading is another name of its column."""
        return tuple(
            Column(name, kind_of(self._cells(name)), unit, (short,) * (short != name))
            for name, (short, unit) in ((name, split_unit(name)) for name in self.held)
        )

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        asked = [*numbers] if time is None else [time, *numbers]
        length = len(self._cells(asked[0])) if asked else 0
        for name in asked:
            shape = self._cells(name).shape
            if shape != (length,):
                raise DataError(
                    f"{self.path.name}: column {name!r}: expected {length} values as "
                    f"{asked[0]!r} has, got shape {shape}"
                )
        if time is not None and self._cells(time).dtype.kind not in _CELLS:
            raise DataError(f"{self._where(time)}: expected stamps, got {self._cells(time).dtype}")
        values = [numbers_in(self._cells(name), self._where(name)) for name in numbers]
        for start in range(0, length, PIECE):
            order = np.arange(start, min(start + PIECE, length), dtype=np.int64)
            part = slice(start, start + PIECE)
            stacked = [column[part] for column in values]
            yield Rows(
                order + 1, order, order if time is None else self._cells(time)[part],
                np.stack(stacked, axis=1) if stacked else np.zeros((len(order), 0)),
            )  # fmt: skip

    def _cells(self, name: str) -> np.ndarray:
        if name not in self._seen:
            self._seen[name] = as_cells(self.held[name])
        return self._seen[name]

    def _where(self, name: str) -> str:
        return f"{self.path.name}: column {name!r}"


def as_cells(column: Any) -> np.ndarray:
    """A column as numbers, datetime64, timedelta64, or text in bytes; empty where it is masked.
    What is none of these stays as it is.

    >>> as_cells([1, None]).tolist(), as_cells(["1.5", None]).tolist()
    ([1.0, nan], [b'1.5', b''])
    """
    zone = getattr(getattr(column, "dtype", None), "tz", None)
    raw = np.asarray(column, dtype="datetime64[ns]") if zone is not None else np.asarray(column)
    if raw.dtype.kind == "O":
        raw = _of_objects(raw)
    if raw.dtype.kind in "UT":
        raw = texts([str(cell).strip().encode() for cell in raw.ravel()]).reshape(raw.shape)
    mask = np.ma.getmaskarray(column) if isinstance(column, np.ma.MaskedArray) else None
    if mask is not None and mask.any() and raw.dtype.kind in _CELLS:
        none: Any = {"M": "NaT", "m": "NaT", "S": b""}.get(raw.dtype.kind, np.nan)
        raw = raw.astype(np.float64) if raw.dtype.kind in "iub" else raw.copy()
        raw[mask] = none
    return raw


def _of_objects(raw: np.ndarray) -> np.ndarray:
    """Python objects: numbers, dates, durations, or text; None and its like are empty."""
    cells = raw.ravel().tolist()
    known = [cell for cell in cells if not _is_none(cell)]
    if known and all(isinstance(cell, datetime.timedelta) for cell in known):
        none = np.timedelta64("NaT", "ns")
        spans = [none if _is_none(cell) else np.timedelta64(cell) for cell in cells]
        return np.array(spans, "timedelta64[ns]").reshape(raw.shape)
    if any(isinstance(cell, _TOLD) for cell in known):
        told = [b"" if _is_none(cell) else _text(cell) for cell in cells]
        return texts(told).reshape(raw.shape)
    whole = len(known) == len(cells) and all(isinstance(cell, int | np.integer) for cell in cells)
    try:
        numbers = [np.nan if _is_none(cell) else cell for cell in cells]
        return np.array(numbers, np.int64 if whole else np.float64).reshape(raw.shape)
    except (TypeError, ValueError, OverflowError):
        return raw  # of what is no number `numbers_in` says so, if it is asked for


def _is_none(cell: object) -> bool:
    nan = isinstance(cell, float) and math.isnan(cell)
    return nan or cell is None or type(cell).__name__ in ("NAType", "NaTType", "MaskedConstant")


def _text(cell: object) -> bytes:
    if isinstance(cell, bytes):
        return cell
    told = cell.isoformat() if isinstance(cell, _DATED) else str(cell)
    return told.strip().encode()


def numbers_in(raw: np.ndarray, where: str) -> Vector:
    """Cells as float64; NaN where they are empty.

    Raises:
        DataError: one is no number, with its row.
    """
    if raw.dtype.kind in "fiub":
        return np.asarray(raw, dtype=np.float64)
    if raw.dtype.kind == "O":
        kinds = sorted({type(cell).__name__ for cell in raw.ravel()[:1000]} - {"NoneType"})
        raise DataError(f"{where}: expected numbers, got {', '.join(kinds[:3])}")
    if raw.dtype.kind != "S":
        raise DataError(f"{where}: expected numbers, got {raw.dtype}")
    out = np.full(len(raw), np.nan)
    for k, cell in enumerate(raw.tolist()):
        text = cell.decode("utf-8", "replace")
        if text.lower() in EMPTY:
            continue
        try:
            out[k] = float(text)
        except ValueError:
            raise DataError(
                f"{where}: row {k + 1}: expected a number, got {text[:40]!r}: correct it, or leave "
                "the cell empty"
            ) from None
    return out
