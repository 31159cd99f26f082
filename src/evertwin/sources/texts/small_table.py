"""Small tables that people write or export: a path, a history. CSV with one line of headings.

They are read as recordings are: commas, semicolons or tabs between cells, decimal commas where no
comma stands between cells, comments, a byte-order mark. A heading may carry a unit (``q1 [deg]``);
numbers are then turned into SI; a column without a heading is called ``c1`` if it is the first.
Empty cells, ``nan`` and ``n/a`` are absent. Columns of dates (`evertwin.sources.clocks.dates`)
become seconds since 1970; columns of text stay text. ``13.01.2025`` is the 13th of January where
a day of the column is above 12; a column of which no date says which of its numbers is the day is
refused.

>>> table = parse(["t,q1 [deg],note", "0,90,", "1,,gearbox replaced"], "path.csv")
>>> table.column("q1").round(3).tolist(), table.text["note"]
([1.571, nan], ('', 'gearbox replaced'))
"""

from __future__ import annotations

import contextlib
import csv
import itertools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from evertwin.errors import DataError, UsageError, naming
from evertwin.signals.channels import position
from evertwin.signals.units import si_unit, to_si
from evertwin.sources.clocks.dates import beside, date_ns, is_date, order_of, zone_of
from evertwin.sources.sniff import sniff
from evertwin.sources.texts.dialect import COMMENTS, MISSING, detect
from evertwin.types import Vector

ABSENT = frozenset(word.decode() for word in MISSING)
"""What an empty cell may say, in lower case."""
_HEAD = re.compile(r"^\s*(.*?)\s*(?:\[(.*)\])?\s*$")
_COMMENTS = tuple(sign.decode() for sign in COMMENTS)
_COMMA = re.compile(r"[+-]?\d*,\d+")
_GROUPED = re.compile(r"[+-]?\d{1,3},\d{3}")
"""Decimals, or thousands."""
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+(?:,\d+)?|[+-]?\d{1,3}(?:,\d{3})+(?:\.\d+)?")
_OF_UNIT = re.compile(r"([+-]?\d+(?:[.,]\d+)?)\s*%")
_TITLES = 10
"""Lines among which headings are sought below a title."""
_TOP = 60
"""Lines that tell how a table is written."""
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
    zoned: frozenset[str] = frozenset()
    """Of these, columns whose dates name a zone."""
    lines: tuple[int, ...] = ()
    """Line of each row in the file."""
    written: Mapping[str, str] = field(default_factory=dict)
    """The same units as the headings write them."""

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
        if name in self.text:
            raise DataError(f"{self.name}:{self._misfit(name)}")
        with naming(self.name, UsageError, DataError):
            position(self.names, name, "column of numbers")
        return self.numbers[name]

    def _misfit(self, name: str) -> str:
        """The first cell by which a column is neither numbers nor dates."""
        cells = list(zip(self.lines, self.text[name], strict=True))
        kept = [(line, cell) for line, cell in cells if cell.lower() not in ABSENT]
        order = _order(list(self.text[name]), self.name)
        for line, cell in kept:
            if _numbers([cell]) is None and _dates([cell], order) is None:
                hint = f": write {cell.replace(',', '.')}" if _COMMA.fullmatch(cell) else ""
                hint += f" or {cell.replace(',', '')}" if _GROUPED.fullmatch(cell) else ""
                hint = hint or _written_anew(name, cell)
                return (
                    f"{line}: {name}: expected a number or a date as in 2027-03-01, got {cell!r}"
                    + (hint or "; leave the cell empty where there is none")
                )
        numbers = [(line, cell) for line, cell in kept if _numbers([cell]) is not None]
        if numbers:
            line, cell = numbers[0]
            return f"{line}: {name}: expected numbers or dates alone, got both ({cell!r})"
        bare = [(line, cell) for line, cell in kept if not _zoned([cell])]
        line, cell = bare[0]
        return (
            f"{line}: {name}: expected a zone with each date or with none, got {cell!r} among "
            "dates with a zone: write 2027-03-01T08:00:00+01:00"
        )


def _written_anew(name: str, cell: str) -> str:
    """How a number that is written with thousands or with its unit is to be written."""
    if _THOUSANDS.fullmatch(cell):
        point = max(cell.rfind("."), cell.rfind(","))
        decimals = len({*cell} & {".", ","}) == 2
        whole = re.sub("[.,]", "", cell[:point] if decimals else cell)
        return f": write {whole}{'.' + cell[point + 1 :] if decimals else ''}, without thousands"
    if found := _OF_UNIT.fullmatch(cell):
        return f": write {found[1].replace(',', '.')}, and the unit in the heading: {name} [%]"
    return ""


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
        sniff(file)  # raises what else it is
        raise DataError(
            f"{file}: expected UTF-8 text, byte {error.start} is not: save it as CSV in UTF-8"
        ) from error
    except csv.Error as error:
        raise DataError(f"{file}: not CSV: {error}") from error


def parse(lines: Iterable[str], name: str) -> Table:
    """The table in lines of text; ``name`` stands in messages.

    Raises:
        DataError: a heading twice, a row of another length.
    """
    rows, comma = _rows(list(lines))
    if len(rows) < 2:
        got = f"only {','.join(rows[0][1])[:60]!r}" if rows else "an empty file"
        raise DataError(f"{name}: expected a line of headings and rows below it, got {got}")
    _check_top(rows, name)
    parts = [_HEAD.match(cell) for cell in rows[0][1]]
    heads = [
        ((m and m[1]) or f"c{k}", ((m and m[2]) or "").strip("-"))  # [-] is no unit
        for k, m in enumerate(parts, 1)
    ]
    names = [head for head, _ in heads]
    if len(set(names)) < len(names):
        wrong = next(n for k, n in enumerate(names) if n in names[:k])
        raise DataError(
            f"{name}:{rows[0][0]}: expected a heading of its own for each column, got {wrong!r} "
            "twice"
        )
    for number, row in rows[1:]:
        if len(row) != len(names):
            raise DataError(
                f"{name}:{number}: expected {len(names)} cells, got {len(row)}: one for each "
                "heading; quote a text that holds a comma"
            )
    _join(heads, rows)
    numbers: dict[str, Vector] = {}
    text: dict[str, tuple[str, ...]] = {}
    dates: set[str] = set()
    zoned: set[str] = set()
    for k, (head, unit) in enumerate(heads):
        cells = [row[k].strip() for _, row in rows[1:]]
        if comma:
            cells = [c.replace(",", ".") if _COMMA.fullmatch(c) else c for c in cells]
        values = _numbers(cells)
        if values is not None and np.isinf(values).any():
            line = rows[1 + int(np.argmax(np.isinf(values)))][0]
            raise DataError(
                f"{name}:{line}: {head}: expected a finite number, or an empty cell where there is "
                "none, got infinity"
            )
        if values is None:
            values = _dates(cells, _order(cells, f"{name}:{rows[1][0]}: {head}"))
            dates |= set() if values is None else {head}
            zoned |= {head} if values is not None and _zoned(cells) else set()
        if values is None:
            text[head] = tuple(cells)
        else:
            numbers[head] = _si(values, unit, f"{name}:{rows[0][0]}: {head}")
    written = {head: unit for head, unit in heads if unit and head in numbers}
    units = {head: si_unit(unit) for head, unit in written.items()}
    places = tuple(number for number, _ in rows[1:])
    return Table(name, numbers, text, units, frozenset(dates), frozenset(zoned), places, written)


def _join(heads: list[tuple[str, str]], rows: list[tuple[int, list[str]]]) -> None:
    """Puts times of day that stand in a column of their own to their dates."""
    cells = zip(*(row for _, row in rows[1:]), strict=True)
    kept = ([c.strip().encode() for c in of if c.strip().lower() not in ABSENT] for of in cells)
    found = beside(list(kept))
    if found is None:
        return
    day, time = found
    for _, row in rows[1:]:
        row[day] = f"{row[day].strip()} {row[time].strip()}".strip()
    del heads[time]
    for _, row in rows:
        del row[time]


def _rows(lines: list[str]) -> tuple[list[tuple[int, list[str]]], bool]:
    """Rows with their lines, and whether decimals are marked by commas."""
    kept = ["" if line.lstrip().startswith(_COMMENTS) else line for line in lines]
    top = [line.rstrip("\r\n").encode() for line in kept if line.strip()][:_TOP]
    delimiter, comma = ",", False
    if len(top) > 1:
        with contextlib.suppress(DataError):  # the rows below say what is wrong, with their line
            found = detect(top)
            delimiter = (found.delimiter or b",").decode("latin-1")
            comma = found.decimal_comma
    reader = csv.reader(kept, delimiter=delimiter)
    return [(reader.line_num, row) for row in reader if any(row)], comma


def _check_top(rows: list[tuple[int, list[str]]], name: str) -> None:
    """Refuses a first line of numbers, or of a title.

    Raises:
        DataError: with the line of the headings, where there is one.
    """

    def said(row: list[str]) -> list[bool]:
        cells = [c.strip() for c in row if c.strip()]
        return [_numbers([c]) is None and not is_date(c.encode()) for c in cells]

    first = said(rows[0][1])
    if len(first) == len(rows[0][1]) and not any(first):
        raise DataError(
            f"{name}:{rows[0][0]}: expected headings in the first line, got "
            f"{','.join(rows[0][1])[:60]!r}: write a line of headings above it, as in run,wear"
        )
    for (line, row), (_, below) in itertools.pairwise(rows[1:_TITLES]):
        words, values = said(row), said(below)
        if len(words) > len(first) and all(words) and 2 * sum(values) <= len(values):
            raise DataError(
                f"{name}:{rows[0][0]}: expected headings in the first line, got "
                f"{rows[0][1][0][:60]!r}: they seem to stand in line {line}: delete the lines above"
            )


def _si(values: Vector, unit: str, where: str) -> Vector:
    with naming(where, UsageError, DataError):
        return np.asarray(to_si(values, unit)) if unit else values


def _numbers(cells: list[str]) -> Vector | None:
    try:
        return np.array([np.nan if c.lower() in ABSENT else _number(c) for c in cells])
    except ValueError:
        return None


def _number(cell: str) -> float:
    """A number; Python itself would take ``1_0`` and the digits of every script.

    Raises:
        ValueError: it is none.
    """
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    return float(cell)


def _order(cells: list[str], where: str) -> str:
    """What comes first in the dates of a column, one of `ORDERS`.

    Raises:
        DataError: all are dates, and none says which of its numbers is the day.
    """
    order, sure = order_of(cell.encode() for cell in cells)
    if not sure and _dates(cells, order) is not None:
        first = next(cell for cell in cells if cell.lower() not in ABSENT)
        raise DataError(
            f"{where}: expected a number or a date as in 2027-03-01, got {first!r}, and no "
            "row says which of its numbers is the day"
        )
    return order if order in ("dmy", "mdy") else "iso"


def _zoned(cells: list[str]) -> bool:
    """Do the dates name a zone?"""
    return any(zone_of(cell.encode()) for cell in cells)


def _dates(cells: list[str], order: str) -> Vector | None:
    """Seconds since 1970; None where a cell is no date, or only some have a zone."""
    known = [cell.encode() for cell in cells if cell.lower() not in ABSENT]
    if len({bool(zone_of(cell)) for cell in known}) > 1:
        return None
    try:
        return np.array([
            np.nan if cell.lower() in ABSENT else 1e-9 * date_ns(cell.encode(), order)
            for cell in cells
        ])  # fmt: skip
    except ValueError:
        return None
