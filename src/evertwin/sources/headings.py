"""What stands above the data of a text table: names, units, and further names.

A table may open with up to five lines of words. The first names the columns. Of the lines below it,
one of units is told by its cells, most of which are units; with two lines in all it is the second.
What is left names the columns a second time (``Time`` and ``t``), and either name will do.

Texts are UTF-8, or else Windows-1252, which is what spreadsheets of the west write.

>>> lines = ["Time;Speed of motor 1", "ms;rad/s", "t;m1vel"]
>>> read_headings([line.split(";") for line in lines])
Headings(names=('Time', 'Speed of motor 1'), units=('ms', 'rad/s'), also=(('t',), ('m1vel',)))
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from evertwin.errors import DataError, UsageError
from evertwin.signals.units import conversion

MOST = 5
"""Heading lines of a table."""
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
    names = tuple(lines[0])
    also = tuple(
        tuple(line[j] for line in below if j < len(line) and line[j]) for j in range(len(names))
    )
    return Headings(names, units, also if below else ())


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
    return sum(map(_is_unit, words)) / max(len(words), 1)


def _is_unit(text: str) -> bool:
    try:
        conversion(text)
    except UsageError:
        return False
    return True


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
