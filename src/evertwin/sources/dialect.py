"""How a text table is written: delimiter, decimal sign, heading, comments, found from its top.

The delimiter is the one that cuts most lines into the same number of cells, most of them numbers.
A decimal comma is only believed where another sign delimits; ``1,5,2,5`` under two headings is
refused, because it can be read in two ways.

>>> d = detect([b"# drive", b"t [s];v", b"0;1,5", b"1;1,6"])
>>> d.delimiter, d.decimal_comma, d.headings, d.skip
(b';', True, ('t [s]', 'v'), 2)
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from evertwin.errors import DataError, UsageError

__all__ = ["COMMENTS", "FOUND", "MISSING", "TRUTH", "Dialect", "Stated", "cells_of", "detect"]

COMMENTS = (b"#", b"%", b"//")
"""What a comment line begins with."""
MISSING = frozenset({b"", b"nan", b"na", b"n/a", b"null", b"none", b"-", b"--", b"nil", b"#n/a"})
"""Words of an empty cell, in lower case."""
TRUTH = {b"true": 1.0, b"false": 0.0}
"""Words of a switch, in lower case."""

_WORDS: dict[str, bytes | None] = {"auto": None, "blank": None, "tab": b"\t"}
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$|[+-]?inf(inity)?$", re.IGNORECASE)
_COMMA_NUMBER = re.compile(rb"[+-]?\d*,\d+([eE][+-]?\d+)?$")
_DATE = re.compile(rb"\d{4}[-./]\d\d?[-./]\d\d?[T ._]\d")
_WORD = re.compile(r"[^\W\d_]")


@dataclass(frozen=True)
class Dialect:
    """How a text table is written.

    >>> Dialect(b",", False, ("t", "x"), ("", ""), 1, 2, "ab").fields
    2
    """

    delimiter: bytes | None
    """One byte; None for runs of blanks."""
    decimal_comma: bool
    headings: tuple[str, ...]
    """Column headings, empty for a table without."""
    units: tuple[str, ...]
    """Units of a second heading line, empty strings where there is none."""
    skip: int
    """Lines before the first row of data, blank ones included."""
    fields: int
    """Cells of a complete row."""
    kinds: str
    """One letter a column, from the first rows: n number, b boolean, d date, t text, ? empty."""
    even: float = 1.0
    """Share of the first rows that have so many cells."""


def cells_of(line: bytes, delimiter: bytes | None) -> list[bytes]:
    """The cells of one line; a quoted cell may hold the delimiter.

    >>> cells_of(b'1,"a, b",', b",")
    [b'1', b'a, b', b'']
    """
    if delimiter is None:
        return line.split()
    if b'"' not in line:
        return line.split(delimiter)
    out, cell, inside = [], bytearray(), False
    for byte in line:
        if byte == 34:
            inside = not inside
        elif byte == delimiter[0] and not inside:
            out.append(bytes(cell))
            cell.clear()
        else:
            cell.append(byte)
    return [*out, bytes(cell)]


def kind_of_cell(cell: bytes, decimal_comma: bool) -> str:
    """One letter: n number, b boolean, d date, ? empty, t text.

    >>> [kind_of_cell(c, False) for c in (b"1e3", b"True", b"2021-03-04 12:00", b"", b"on")]
    ['n', 'b', 'd', '?', 't']
    """
    cell = cell.strip()
    low = cell.lower()
    if low in MISSING:
        return "?"
    if low in TRUTH:
        return "b"
    if _NUMBER.match(cell) or (decimal_comma and _COMMA_NUMBER.match(cell)):
        return "n"
    return "d" if _DATE.match(cell) else "t"


@dataclass(frozen=True)
class Stated:
    """What the user says of a text table; what is left open is found from its first lines.

    >>> detect([b"1,5,2,5", b"1,6,2,6"], Stated(delimiter=",")).fields
    4
    >>> detect([b"1,5;2,5"], Stated(decimal=",")).decimal_comma
    True
    """

    header: bool | None = None
    """Does it open with headings?"""
    delimiter: str = "auto"
    """One sign, ``tab``, ``blank`` for runs of blanks, or ``auto``."""
    decimal: Literal["auto", ".", ","] = "auto"

    def __post_init__(self) -> None:
        if self.delimiter not in _WORDS and len(self.delimiter.encode()) != 1:
            raise UsageError(
                f"delimiter: expected one sign, 'tab', 'blank' or 'auto', got {self.delimiter!r}"
            )
        if self.delimiter == self.decimal != "auto":
            raise UsageError(f"{self.decimal!r} cannot both delimit cells and mark decimals")

    def signs(self, found: tuple[bytes | None, bool]) -> tuple[bytes | None, bool]:
        """Delimiter and whether the decimal sign is a comma, given what was ``found``."""
        delimiter, comma = found
        if self.delimiter != "auto":
            delimiter = _WORDS.get(self.delimiter, self.delimiter.encode())
            comma = comma and delimiter != b","
        return delimiter, comma if self.decimal == "auto" else self.decimal == ","


FOUND = Stated()
"""Nothing is stated, all is found."""


def detect(lines: Sequence[bytes], stated: Stated = FOUND) -> Dialect:
    """The dialect of a table that begins with ``lines``; what is ``stated`` is believed.

    Raises:
        DataError: no row of data, or a table that can be read in two ways.
    """
    data = [(i, ln) for i, ln in enumerate(lines) if ln.strip() and not ln.startswith(COMMENTS)]
    if not data:
        raise DataError("no row of data, only blank and comment lines: check the file")
    delimiter, comma = stated.signs(_delimiter([ln for _, ln in data]))
    table = [[c.strip() for c in cells_of(ln, delimiter)] for _, ln in data]
    kinds = ["".join(kind_of_cell(c, comma) for c in row) for row in table]
    headed = _heading_lines(kinds)
    if stated.header is not None:
        headed = max(headed, 1) if stated.header else 0
    if headed == len(table):
        raise DataError("headings but no row of data: the recording may have been cut off")
    body = Counter(len(row) for row in table[headed:])
    fields = body.most_common(1)[0][0]
    headings = tuple(_text(c) for c in table[0]) if headed else ()
    if not headed:
        headings = _from_comment(lines[: data[0][0]], delimiter, fields)
    if headings and len(headings) != fields:
        headings, fields = _reconciled(headings, fields, table[headed:])
    units = tuple(_text(c) for c in table[1]) if headed == 2 else ()
    columns = _kinds_of_columns(kinds[headed:], fields)
    even = body[fields] / body.total()
    return Dialect(delimiter, comma, headings, units, data[headed][0], fields, columns, even)


def _text(cell: bytes) -> str:
    return cell.decode("utf-8", "replace").strip().strip('"')


def _delimiter(lines: Sequence[bytes]) -> tuple[bytes | None, bool]:
    best: tuple[float, float, int] = (-1.0, -1.0, 0)
    choice: tuple[bytes | None, bool] = (None, False)
    sample = lines[1:51] if len(lines) > 2 else lines
    for delimiter in (b";", b"\t", b"|", b",", None):
        rows = [cells_of(ln, delimiter) for ln in sample]
        width, hits = Counter(len(row) for row in rows).most_common(1)[0]
        if width < 2:
            continue
        flat = [c for row in rows if len(row) == width for c in row]
        comma = delimiter != b"," and _has_decimal_comma(flat)
        numeric = sum(kind_of_cell(c, comma) in "nbd?" for c in flat) / max(len(flat), 1)
        score = (round(hits / len(rows), 1), round(numeric, 1), width)
        if score > best and hits * 2 > len(rows):
            best, choice = score, (delimiter, comma)
    return choice


def _has_decimal_comma(cells: Sequence[bytes]) -> bool:
    with_comma = sum(_COMMA_NUMBER.match(c.strip()) is not None for c in cells)
    with_point = sum(b"." in c and _NUMBER.match(c.strip()) is not None for c in cells)
    return with_comma > 0 and with_point == 0


def _heading_lines(kinds: Sequence[str]) -> int:
    """0 without headings, 1 with, 2 with a line of units below."""

    def wordy(kind: str) -> bool:
        return "t" in kind and not set(kind) & set("nbd")

    if not wordy(kinds[0]):
        return 0
    if len(kinds) > 2 and wordy(kinds[1]) and not wordy(kinds[2]):
        return 2
    return 1


def _from_comment(
    comments: Sequence[bytes], delimiter: bytes | None, fields: int
) -> tuple[str, ...]:
    """Headings from the last comment line, where it has as many parts as the data."""
    for line in reversed(comments):
        text = _text(line.lstrip(b"#%/ \t"))
        parts = re.split(r"\s{2,}|\t", text) if delimiter in (None, b"\t") else None
        if parts is None or len(parts) != fields:
            parts = text.split(delimiter.decode() if delimiter else None)
        if text:
            named = len(parts) == fields and all(_WORD.search(part) for part in parts)
            return tuple(part.strip() for part in parts) if named else ()
    return ()


def _reconciled(
    headings: tuple[str, ...], fields: int, body: Sequence[Sequence[bytes]]
) -> tuple[tuple[str, ...], int]:
    """Headings and rows of different length: a closing delimiter is forgiven, nothing else."""
    full = [row for row in body if len(row) == fields]
    if fields == len(headings) + 1 and all(not row[-1] for row in full):
        return (*headings, ""), fields
    if len(headings) == fields + 1 and not headings[-1]:
        return headings[:-1], fields
    if any(len(row) == len(headings) for row in body):
        return headings, len(headings)
    hint = "a decimal comma with commas between the columns? " if fields > len(headings) else ""
    raise DataError(
        f"{len(headings)} headings but {fields} cells in a row: {hint}"
        "give every column one heading, and write decimal points or ';' between columns"
    )


def _kinds_of_columns(kinds: Sequence[str], fields: int) -> str:
    full = [kind for kind in kinds if len(kind) == fields]
    out = []
    for j in range(fields):
        seen = Counter(kind[j] for kind in full if kind[j] != "?")
        out.append(seen.most_common(1)[0][0] if seen else "?")
    return "".join(out)
