"""Text tables whose head says how they are laid out, so that nothing about them is guessed.

A logger may stamp each signal by a column of its own. Signals with the same stamps are one table;
where a slower one has ended, its rows are none.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.columns.names import distinct, unit_problem
from evertwin.sources.columns.table import Column, Rows
from evertwin.sources.sniff import opened
from evertwin.sources.texts.dialect import (
    Dialect,
    Headings,
    cells_of,
    encoding_of,
    kind_of_cell,
    shown,
)
from evertwin.sources.texts.text import TextTable

HEAD = 1 << 20
"""Bytes among which a head ends."""
_FIRST = 50
"""Rows that tell which signals share their stamps."""


class Head(NamedTuple):
    """What a head says of the columns below it.

    >>> Head(b";", False, (b"t", b"v"), ("s", "m/s"), 3, ((0, (1,)),)).skip
    3
    """

    delimiter: bytes
    decimal_comma: bool
    names: tuple[bytes, ...]
    units: tuple[str, ...]
    skip: int
    """Lines above the first row of data."""
    clocks: tuple[tuple[int | None, tuple[int, ...]], ...]
    """Position of each column of time, and those of what it stamps; None: there is no column."""
    start: float = 0.0
    step: float = 0.0
    """Of the rows where there is no column [s]."""


def top_of(path: Path) -> list[bytes]:
    """The first lines of a text."""
    with opened(path) as file:
        lines = file.read(HEAD).removeprefix(b"\xef\xbb\xbf").split(b"\n")
    return [line.rstrip(b"\r") for line in lines[: None if len(lines) < 2 else -1]]


@dataclass(frozen=True)
class _Text(TextTable):
    """A text table of which it is known how it is written."""

    known: Dialect | None = None

    @cached_property
    def dialect(self) -> Dialect:
        """As the head says."""
        assert self.known is not None
        return self.known


@dataclass(frozen=True)
class Part:
    """Signals of a text with the same stamps. Implements `Table`.

    >>> Part.__name__
    'Part'
    """

    inner: TextTable
    use: tuple[int, ...]
    """Positions of its columns, the one of time first where there is one."""
    name: str
    every: tuple[float, float] | None
    """Start and step of its stamps [s] where no column holds them."""

    @property
    def path(self) -> Path:
        """See `Table`."""
        return self.inner.path

    @property
    def columns(self) -> tuple[Column, ...]:
        """See `Table`."""
        found = tuple(self.inner.columns[j] for j in self.use)
        return found if self.every is None else (Column(TIME, "number", "s"), *found)

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        made = self.every is not None
        asked = [name for name in numbers if not (made and name == TIME)]
        clock = None if made and time == TIME else time
        first = self.columns[0].name
        for rows in self.inner.rows(asked, clock, strict):
            if made:
                yield self._stamped(rows, numbers, time == TIME)
            elif time == first and rows.time.dtype.kind == "S":
                there = rows.time != b""  # it ended before others did
                line, order, stamps, values = (part[there] for part in rows[:4])
                yield Rows(line, order, stamps, values, rows.problems)
            else:
                yield rows

    def _stamped(self, rows: Rows, numbers: Sequence[str], is_time: bool) -> Rows:
        start, step = self.every or (0.0, 0.0)
        stamps = start + step * rows.order
        if TIME in numbers:
            values = np.insert(rows.values, list(numbers).index(TIME), stamps, axis=1)
            rows = rows._replace(values=values)
        return rows._replace(time=stamps) if is_time else rows


TIME = "X_Value"
"""Name of stamps that no column holds, as LabVIEW calls them."""


def parts_of_text(path: Path, head: Head, lines: Sequence[bytes]) -> tuple[Part, ...]:
    """The tables of a text with such a head.

    Raises:
        DataError: the rows have not as many cells as the head says.
    """
    rows = [cells_of(line, head.delimiter) for line in lines[head.skip :] if line.strip()][:_FIRST]
    fields = _fields(path, head, rows)
    whole = [row for row in rows if len(row) == fields]
    encoding = encoding_of(lines[: head.skip])
    names = tuple(shown(cell, encoding) for cell in head.names)[:fields]
    kinds = (
        Counter(kind_of_cell(row[j], head.decimal_comma) for row in whole) for j in range(fields)
    )
    letters = "".join(
        (Counter(k) - Counter({"?": k["?"]}) or k).most_common(1)[0][0] for k in kinds
    )
    dialect = Dialect(
        head.delimiter, head.decimal_comma, Headings(names, head.units[:fields]), head.skip, fields,
        letters, 1.0, encoding,
    )  # fmt: skip
    text = _Text(path, known=dialect)
    groups: dict[tuple[bytes, ...], list[int]] = {}
    for clock, stamped in head.clocks:
        key = () if clock is None else tuple(row[clock] for row in whole)
        groups.setdefault(key, [] if clock is None else [clock]).extend(
            j for j in stamped if j < fields
        )
    every = (head.start, head.step) if head.clocks[0][0] is None else None
    titles = distinct([names[use[-1] if len(use) == 1 else use[1]] for use in groups.values()])
    one = len(groups) == 1
    return tuple(
        Part(text, tuple(use), "" if one else title, every)
        for use, title in zip(groups.values(), titles, strict=True)
    )


def _fields(path: Path, head: Head, rows: Sequence[Sequence[bytes]]) -> int:
    """Cells of a row; the last ones that are named may be missing, a comment or nothing."""
    if not rows:
        raise DataError(f"{path.name}: headings but no row of data: was the recording cut off?")
    fields = Counter(map(len, rows)).most_common(1)[0][0]
    least = max(max(stamped, default=0) for _, stamped in head.clocks) + 1
    if not least <= fields <= len(head.names) + 1:
        raise DataError(
            f"{path.name}: its head names {least} columns, its rows have {fields} cells: a decimal "
            "comma with commas between the columns? Export it with tabs or ';' between them"
        )
    return min(fields, len(head.names)) if all(not row[-1] for row in rows) else fields


def spelled(unit: str) -> str:
    """A unit as a logger writes it in words.

    >>> spelled("deg C"), spelled("Volts"), spelled("V (Voltage)"), spelled("(None)"), spelled("%")
    ('degC', 'volts', 'V', '', '%')
    """
    plain = unit.partition(" (")[0].strip()
    if plain.startswith("(") or plain in ("", "-"):
        return ""
    tries = (plain.replace(" ", ""), plain, plain.lower())
    return next((one for one in tries if not unit_problem(one)), plain)
