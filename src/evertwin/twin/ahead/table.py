"""Small tables that people write or export: a path, a history. CSV with one line of headings.

A heading may carry a unit (``q1 [deg]``); numbers are then turned into SI. Empty cells are absent.
Columns of dates (ISO 8601) become seconds since 1970; columns of text stay text.

>>> table = parse(["t,q1 [deg],note", "0,90,", "1,,gearbox replaced"], "path.csv")
>>> table.column("q1").round(3).tolist(), table.text["note"]
([1.571, nan], ('', 'gearbox replaced'))
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.signals.channels import position
from evertwin.signals.units import si_unit, to_si
from evertwin.types import Vector

__all__ = ["Table", "parse", "read_table"]

_HEAD = re.compile(r"^\s*(.*?)\s*(?:\[(.*)\])?\s*$")
LARGEST = 200_000_000
"""Bytes of the largest table."""


@dataclass(frozen=True)
class Table:
    """Columns by name. See the module for an example.

    >>> Table("a.csv", {}).names
    ()
    """

    name: str
    numbers: Mapping[str, Vector]
    text: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    """SI unit of each column whose heading gives one."""
    dates: frozenset[str] = frozenset()
    """Columns that were dates."""
    lines: tuple[int, ...] = ()
    """Line of each row in the file."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of numbers."""
        return tuple(self.numbers)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.numbers.values()), ()))

    def column(self, name: str) -> Vector:
        """A column of numbers.

        Raises:
            DataError: there is none of this name; the nearest one is given. A cell is no number;
                its line is given.
        """
        for line, cell in zip(self.lines, self.text.get(name, ()), strict=False):
            if cell and _numbers([cell]) is None and _dates([cell]) is None:
                raise DataError(
                    f"{self.name}:{line}: {name}: expected a number or a date, got {cell!r}"
                )
        if name in self.text:
            raise DataError(
                f"{self.name}:{self.lines[0]}: {name}: expected numbers or dates alone, got both"
            )
        try:
            position(self.names, name, "column of numbers")
        except UsageError as error:
            raise DataError(f"{self.name}: {error}") from error
        return self.numbers[name]


def read_table(path: str | Path) -> Table:
    """The table in a CSV file.

    Raises:
        DataError: it cannot be read, or is no table; with its line.
    """
    file = Path(path)
    try:
        if file.stat().st_size > LARGEST:
            raise DataError(f"{file}: over {LARGEST} bytes: expected a small table")
        with file.open(newline="", encoding="utf-8-sig") as lines:
            return parse(lines, str(path))
    except OSError as error:
        raise DataError(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{file}: expected UTF-8 text, byte {error.start} is not") from error
    except csv.Error as error:
        raise DataError(f"{file}: not CSV: {error}") from error


def parse(lines: Iterable[str], name: str) -> Table:
    """The table in lines of text; ``name`` stands in messages.

    Raises:
        DataError: no heading, a heading twice, a row of another length.
    """
    rows = [(number, row) for number, row in enumerate(csv.reader(lines), start=1) if any(row)]
    if len(rows) < 2:
        raise DataError(f"{name}: expected a line of headings and rows below it")
    if len(rows[0][1]) == 1 and ";" in rows[0][1][0]:
        raise DataError(f"{name}:{rows[0][0]}: expected commas between cells, got semicolons")
    parts = [_HEAD.match(cell) for cell in rows[0][1]]
    heads = [(m[1], m[2] or "") if m else ("", "") for m in parts]
    names = [head for head, _ in heads]
    if "" in names or len(set(names)) < len(names):
        raise DataError(f"{name}:{rows[0][0]}: expected a heading for each column, each once")
    for number, row in rows[1:]:
        if len(row) != len(names):
            raise DataError(f"{name}:{number}: expected {len(names)} cells, got {len(row)}")
    numbers: dict[str, Vector] = {}
    text: dict[str, tuple[str, ...]] = {}
    dates: set[str] = set()
    for k, (head, unit) in enumerate(heads):
        cells = [row[k].strip() for _, row in rows[1:]]
        values = _numbers(cells)
        if values is not None and np.isinf(values).any():
            line = rows[1 + int(np.argmax(np.isinf(values)))][0]
            raise DataError(f"{name}:{line}: {head}: expected a finite number, or an empty cell")
        if values is None:
            values = _dates(cells)
            dates |= set() if values is None else {head}
        if values is None:
            text[head] = tuple(cells)
        else:
            numbers[head] = _si(values, unit, f"{name}:{rows[0][0]}: {head}")
    units = {head: si_unit(unit) for head, unit in heads if unit and head in numbers}
    places = tuple(number for number, _ in rows[1:])
    return Table(name, numbers, text, units, frozenset(dates), places)


def _si(values: Vector, unit: str, where: str) -> Vector:
    try:
        return np.asarray(to_si(values, unit)) if unit else values
    except UsageError as error:
        raise DataError(f"{where}: {error}") from error


def _numbers(cells: list[str]) -> Vector | None:
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
    except ValueError:
        return None


def _dates(cells: list[str]) -> Vector | None:
    try:
        moments = [datetime.fromisoformat(cell) for cell in cells]
    except ValueError:
        return None
    aware = [m if m.tzinfo else m.replace(tzinfo=UTC) for m in moments]
    return np.array([m.timestamp() for m in aware], dtype=np.float64)
