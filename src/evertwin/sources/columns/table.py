"""A recording is one or more tables; a table is columns over rows, read in pieces of bounded size.

A file of columns (CSV, MAT, Parquet, NumPy) is one table. A bag is one table per topic, because
each topic has a clock of its own. Every reader implements the two members of `Table`; all that
follows (stamps, units, marks, statistics) is written once, on this interface.

>>> Column("q1", "number", "rad").unit
'rad'
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.columns.names import closest
from evertwin.sources.columns.scans import Scans
from evertwin.types import Float64, Int64

WIDEST = 4096
"""Columns of the widest table that is read."""


class Problem(NamedTuple):
    """One thing that was wrong with one row, found while reading.

    >>> Problem("truncated", 12, "3 fields, expected 7").line
    12
    """

    kind: str
    """truncated, overlong, text, no_stamp, repeated, backward, clock_jump, gap, cut_off, …"""
    line: int
    """Line of a text file, row or message number elsewhere; both count from 1."""
    detail: str
    """One phrase with the figures."""
    file: str = ""
    """Name of the file, where there may be several."""


@dataclass(frozen=True)
class Column:
    """A named column.

    >>> Column("t1", "number").kind
    'number'
    """

    name: str
    kind: str
    """number, boolean, time (calendar stamps) or text."""
    unit: str = ""
    """Unit stated by the file itself, empty where it states none."""
    also: tuple[str, ...] = ()
    """Further names that the file gives it."""

    def called(self, name: str) -> bool:
        """Whether this is one of its names."""
        return name == self.name or name in self.also


class Rows(NamedTuple):
    """n ≥ 0 rows of a table.

    >>> Rows.empty(2).values.shape
    (0, 2)
    """

    line: Int64[np.ndarray, " n"]
    """Line (text) or row number of each row, from 1: what a message names."""
    order: Int64[np.ndarray, " n"]
    """Position of the row in the recording, from 0, rows left out included."""
    time: np.ndarray
    """Raw stamps, (n,): bytes, integers, floats or datetime64[ns]."""
    values: Float64[np.ndarray, "n k"]
    """The requested columns; NaN where a cell is empty."""
    problems: tuple[Problem, ...] = ()
    """What was wrong with rows of this piece, those left out included."""

    @classmethod
    def empty(cls, columns: int, problems: tuple[Problem, ...] = ()) -> Rows:
        """No rows, only problems."""
        none = np.zeros(0, dtype=np.int64)
        return cls(none, none, none, np.zeros((0, columns)), problems)


class Table(Protocol):
    """Columns over rows. Implemented by every file format.

    ``rows(numbers, time, strict)`` yields the columns ``numbers`` as float64 and the raw column
    ``time`` (None: no such column, `Rows.time` is then the order), in file order, in pieces of
    bounded size. With ``strict`` a cell that is no number raises `DataError` with file, line and
    column; without, it becomes NaN and a `Problem`.

    >>> hasattr(Table, "rows")
    True
    """

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def name(self) -> str:
        """Topic of a bag, empty for a file that is one table."""
        ...

    @property
    def columns(self) -> tuple[Column, ...]:
        """All columns, in file order."""
        ...

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """The requested columns, piece by piece."""
        ...


@dataclass(frozen=True)
class Recording:
    """An opened file: its kind, its tables, and what cannot be read of it.

    >>> Recording(Path("run.csv"), "csv", ()).kind
    'csv'
    """

    path: Path
    kind: str
    """csv, mat, parquet, npy, npz, mcap, ros1, ros2 or carmen."""
    tables: tuple[Table, ...]
    notes: tuple[str, ...] = ()
    """What is in the file and was left out, with the reason."""
    scans: tuple[Scans, ...] = ()
    """Scans of its lidars."""

    def find(self, column: str) -> tuple[Table, Column]:
        """The table that holds ``column``, and the column.

        Raises:
            DataError: no table holds it (the nearest names are given), or several do.
        """
        every = [(t, c) for t in self.tables for c in t.columns]
        hits = [(t, c) for t, c in every if c.name == column]
        hits = hits or [(t, c) for t, c in every if c.called(column)]
        if len(hits) == 1:
            return hits[0]
        if hits:
            raise DataError(f"{self.path.name}: {len(hits)} columns are called {column!r}: rename")
        names = [c.name for t in self.tables for c in t.columns]
        raise DataError(
            f"{self.path.name}: no column {column!r}; {closest(column, names)}: "
            "correct the column's name in the twin file"
        )
