"""How a text table is written: delimiter, decimal sign, heading, comments, found from its top.

The delimiter is the one that cuts most lines into the same number of cells, most of them numbers.
A decimal comma is only believed where another sign delimits, or where each such cell is quoted and
is no thousands (``"1,049"``); ``1,5,2,5`` under two headings is refused, because it can be read in
two ways. Where decimals are marked by commas, a point parts thousands; a table that seems to have
both is read once ``decimal`` says so.

>>> d = detect([b"# drive", b"t [s];v", b"0;1,5", b"1;1,6"])
>>> d.delimiter, d.decimal_comma, d.headings.names, d.skip
(b';', True, ('t [s]', 'v'), 2)

A table may open with up to five lines of words. The first names the columns. Of the lines below it,
one of units is told by its cells, most of which are units; with two lines in all it is the second.
What is left names the columns a second time (``Time`` and ``t``), and either name will do. Lines
above that are no headings (a plant, a serial number, a date) are left out.

Texts are UTF-8, or else Windows-1252, which is what spreadsheets of the west write.

>>> lines = ["Time;Speed of motor 1", "ms;rad/s", "t;m1vel"]
>>> read_headings([line.split(";") for line in lines])
Headings(names=('Time', 'Speed of motor 1'), units=('ms', 'rad/s'), also=(('t',), ('m1vel',)))
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

from evertwin.errors import DataError, UsageError
from evertwin.sources.clocks.dates import is_date
from evertwin.sources.columns.names import unit_problem
from evertwin.sources.texts.switches import kinds_of_columns

MOST = 5
"""Heading lines of a table."""
TITLES = 40
"""Lines above them that name no columns."""
_WORD = re.compile(r"[^\W\d_]")


class Headings(NamedTuple):
    """Names of the columns, empty for a table without; units, empty where none are given.

    >>> Headings().names
    ()
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    also: tuple[tuple[str, ...], ...] = ()
    """Further names of each column."""

    def cut(self, fields: int) -> Headings:
        """Those of the first ``fields`` columns."""
        return Headings(self.names[:fields], self.units[:fields], self.also[:fields])


def encoding_of(lines: Sequence[bytes]) -> str:
    """How the words of the first lines are written: ``utf-8`` or ``cp1252``.

    Raises:
        DataError: neither.

    >>> encoding_of(["Gerät".encode()]), encoding_of(["Gerät".encode("cp1252")])
    ('utf-8', 'cp1252')
    """
    text = b"\n".join(lines)
    for name in ("utf-8", "cp1252"):
        try:
            text.decode(name)
        except UnicodeDecodeError:
            continue
        return name
    raise DataError("its first lines are neither UTF-8 nor Windows-1252 text: save it as UTF-8")


def shown(cell: bytes, encoding: str) -> str:
    """A heading as text; what cannot be shown becomes a blank.

    >>> shown(b' "Weg\\xa0[m]" ', "cp1252")
    'Weg [m]'
    """
    text = cell.decode(encoding).strip().strip('"')
    if text.isprintable():
        return text
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def read_headings(lines: Sequence[Sequence[str]]) -> Headings:
    """The headings of a table from its opening lines, cell by cell."""
    if not lines:
        return Headings()
    below = [tuple(line) for line in lines[1:]]
    at = _units(below)
    units = tuple(_UNIT.sub(r"\1", unit) for unit in below.pop(at)) if at is not None else ()
    names = _joined(lines[0], below)
    also = tuple(
        tuple(line[j] for line in below if j < len(line) and line[j]) for j in range(len(names))
    )
    return Headings(names, units, also if below else ())


def _joined(first: Sequence[str], below: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """The first line; names that repeat are told apart by the lines below, where these do.

    >>> _joined(["t", "torque", "torque"], [["", "J1", "J2"]])
    ('t', 'torque J1', 'torque J2')
    """
    names = tuple(first)
    for line in below:
        again = {name for name in names if name and names.count(name) > 1}
        cells = (*line, *[""] * len(names))
        told = tuple(
            f"{name} {cell}" if name in again and cell else name
            for name, cell in zip(names, cells, strict=False)
        )
        names = told if len(set(told)) > len(set(names)) else names
    return names


_UNIT = re.compile(r"^[\[(](.*)[\])]$")


def _units(below: Sequence[tuple[str, ...]]) -> int | None:
    """Which of the lines below the first is one of units."""
    if len(below) < 2:
        return 0 if below else None
    shares = [_share(line) for line in below]
    best = max(range(len(below)), key=shares.__getitem__)
    return best if shares[best] >= 0.5 else None


def _share(cells: Sequence[str]) -> float:
    """Share of the words that are units."""
    words = [_UNIT.sub(r"\1", cell) for cell in cells if cell]
    return sum(not unit_problem(word) for word in words) / max(len(words), 1)


def named_in_comment(
    comments: Sequence[str], delimiter: str | None, fields: int
) -> tuple[str, ...]:
    """Names from the last comment line, where it has as many parts as the data.

    >>> named_in_comment(["# run 7", "# t  v"], None, 2)
    ('t', 'v')
    """
    for line in reversed(comments):
        text = line.lstrip("#%/ \t")
        parts = re.split(r"\s{2,}|\t", text) if delimiter in (None, "\t") else None
        if parts is None or len(parts) != fields:
            parts = text.split(delimiter)
        if text:
            named = len(parts) == fields and all(_WORD.search(part) for part in parts)
            return tuple(part.strip() for part in parts) if named else ()
    return ()


def reconciled(
    headings: Headings, fields: int, body: Sequence[Sequence[bytes]]
) -> tuple[Headings, int]:
    """Headings and rows of different length: a closing delimiter is forgiven, nothing else.

    Raises:
        DataError: they do not belong together.
    """
    names = headings.names
    full = [row for row in body if len(row) == fields]
    if fields == len(names) + 1 and all(not row[-1] for row in full):
        return headings._replace(names=(*names, "")), fields
    if len(names) == fields + 1 and not names[-1]:
        return headings.cut(fields), fields
    if any(len(row) == len(names) for row in body):
        return headings, len(names)
    hint = "a decimal comma with commas between the columns? " if fields > len(names) else ""
    raise DataError(
        f"{len(names)} headings but {fields} cells in a row: {hint}"
        "give every column one heading, and write decimal points or ';' between columns"
    )


COMMENTS = (b"#", b"%", b"//")
"""What a comment line begins with."""
MISSING = frozenset({b"", b"nan", b"na", b"n/a", b"null", b"none", b"-", b"--", b"nil", b"#n/a"})
"""Words of an empty cell, in lower case."""
TRUTH = {b"true": 1.0, b"false": 0.0}
"""Words of a switch, in lower case."""

_WORDS: dict[str, bytes | None] = {"auto": None, "blank": None, "tab": b"\t"}
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$|[+-]?inf(inity)?$", re.IGNORECASE)
_COMMA_NUMBER = re.compile(rb"[+-]?\d*,\d+([eE][+-]?\d+)?$")
_THOUSANDS = re.compile(rb"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d+)?")
_GROUPED = re.compile(rb"[+-]?\d{1,3},\d{3}")
"""One comma before three digits: decimals, or thousands."""


@dataclass(frozen=True)
class Dialect:
    """How a text table is written.

    >>> Dialect(b",", False, Headings(("t", "x")), 1, 2, "ab").fields
    2
    """

    delimiter: bytes | None
    """One byte; None for runs of blanks."""
    decimal_comma: bool
    headings: Headings
    skip: int
    """Lines before the first row of data, blank ones included."""
    fields: int
    """Cells of a complete row."""
    kinds: str
    """One letter a column, from the first rows: n number, b boolean, d date, t text, ? empty."""
    even: float = 1.0
    """Share of the first rows that have so many cells."""
    encoding: str = "utf-8"
    """Of the headings."""


def cells_of(line: bytes, delimiter: bytes | None) -> list[bytes]:
    """The cells of one line; a quoted cell may hold the delimiter, a quote inside one is a sign.

    >>> cells_of(b'1,"a, b",4"9"', b",")
    [b'1', b'a, b', b'4"9"']
    """
    if delimiter is None:
        return line.split()
    if b'"' not in line:
        return line.split(delimiter)
    hits = _cell(delimiter).finditer(line)
    return [h[2] if h[1] is None else h[1].replace(b'""', b'"') for h in hits]


@cache
def _cell(delimiter: bytes) -> re.Pattern[bytes]:
    """A cell with the delimiter before it: quoted as a whole, or plain up to the next."""
    sign = re.escape(delimiter)
    return re.compile(rb'(?:^|%b) *+(?:"((?:[^"]|"")*+)" *(?=%b|$)|([^%b]*))' % (sign, sign, sign))


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
    return "d" if is_date(cell) else "t"


def pointed(cell: bytes) -> bytes:
    """A cell of a table with decimal commas, as other tables write it.

    >>> pointed(b"1.234,5"), pointed(b"-0,5"), pointed(b"13.01.2025 12:00")
    (b'1234.5', b'-0.5', b'13.01.2025 12:00')
    """
    if _THOUSANDS.fullmatch(cell):
        cell = cell.replace(b".", b"")
    return cell.replace(b",", b".")


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
            comma = comma and (delimiter != b"," or delimiter == found[0])
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
    titles = _titles(kinds)
    data, table, kinds = data[titles:], table[titles:], kinds[titles:]
    headed = _heading_lines(kinds)
    if stated.header is not None:
        headed = max(headed, 1) if stated.header else 0
    if headed == len(table):
        raise DataError("headings but no row of data: the recording may have been cut off")
    body = Counter(len(row) for row in table[headed:])
    fields = body.most_common(1)[0][0]
    encoding = encoding_of(lines[: data[headed][0]])
    headings = read_headings([[shown(c, encoding) for c in row] for row in table[:headed]])
    if not headed:
        above = [shown(line, encoding) for line in lines[: data[0][0]]]
        sign = delimiter.decode("latin-1") if delimiter else None
        headings = Headings(named_in_comment(above, sign, fields))
    if headings.names and len(headings.names) != fields:
        headings, fields = reconciled(headings, fields, table[headed:])
    columns = kinds_of_columns(kinds[headed:], table[headed:], fields)
    even = body[fields] / body.total()
    return Dialect(delimiter, comma, headings, data[headed][0], fields, columns, even, encoding)


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
        comma = _has_decimal_comma(flat, quoted=delimiter == b",")
        numeric = sum(kind_of_cell(c, delimiter != b"," or comma) in "nbd?" for c in flat) / max(
            len(flat), 1
        )
        score = (round(hits / len(rows), 1), round(numeric, 1), width)
        if score > best and hits * 2 > len(rows):
            best, choice = score, (delimiter, comma)
    return choice


def _has_decimal_comma(cells: Sequence[bytes], quoted: bool) -> bool:
    """``quoted``: the comma delimits too, so a cell that holds one was quoted."""
    with_comma = [c.strip() for c in cells if _COMMA_NUMBER.match(c.strip())]
    with_point = sum(b"." in c and _NUMBER.match(c.strip()) is not None for c in cells)
    thousands = quoted and all(_GROUPED.fullmatch(c) for c in with_comma)
    return bool(with_comma) and with_point == 0 and not thousands


def _titles(kinds: Sequence[str]) -> int:
    """How many lines stand above the headings: they fill no more than half of the columns or tell a
    number, and a line of words that fills more comes next (``Plant 3;;;``, ``Serial number;4711``).
    """
    fields = Counter(len(kind) for kind in kinds).most_common(1)[0][0]
    for count, kind in enumerate(kinds[: TITLES + 1]):
        if 2 * (len(kind) - kind.count("?")) > fields and set(kind) <= set("t?"):
            return count
        if "n" in kind and len(kind) >= fields:
            return 0
    return 0


def _heading_lines(kinds: Sequence[str]) -> int:
    """How many lines of words the table opens with; a table of words alone has one."""
    for count, kind in enumerate(kinds[: MOST + 1]):
        if "t" not in kind or set(kind) & set("nbd"):
            return count
    return 1
