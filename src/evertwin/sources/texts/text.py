"""Text tables (CSV and its relatives), read in blocks of a few megabytes.

A row with too few or too many cells is left out and counted with its line; so is a row before a
line of one cell, because a line broken in its last number looks complete. So are the headings
again, where the rows below go on; where the time begins anew, the file is refused. The last line
without a line end may have been cut inside a number, ``3.1`` instead of ``3.14``, so it is kept
only where its last cell has as many decimals as the cells above it. A word among numbers (`worded`)
is no value, counted with its line. What may be a number written another way, and a column that
holds more words than numbers, are an error with file, line and column. Gzip is unpacked while
reading.
"""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np

from evertwin.errors import DataError, naming
from evertwin.sources.clocks.dates import beside
from evertwin.sources.clocks.stamps import texts
from evertwin.sources.columns.names import bracketed, distinct, split_unit
from evertwin.sources.columns.slashed import slashed
from evertwin.sources.columns.table import Column, Problem, Rows
from evertwin.sources.sniff import opened
from evertwin.sources.texts.dialect import (
    COMMENTS,
    FOUND,
    Dialect,
    Stated,
    cells_of,
    detect,
    pointed,
)
from evertwin.sources.texts.no_number import number_of, worded
from evertwin.types import Float64

BLOCK = 1 << 22
"""Bytes read at once."""
LONGEST = 1 << 20
"""Bytes of the longest line that is believed."""
_TOP = 60
_POINTED = re.compile(rb"\d\.\d{3}(?!\d)")
"""What may be thousands where decimals are marked by commas."""
_KINDS = {"n": "number", "b": "boolean", "d": "time", "t": "text", "?": "number"}
_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class TextTable:
    """A text table on disk.

    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("t,v [m/s]\\n0,1.5\\n1,\\n2,3,4\\n")
    >>> table = TextTable(file)
    >>> table.columns[1]
    Column(name='v', kind='number', unit='m/s', also=())
    >>> rows = next(table.rows(["v"], "t"))
    >>> rows.line.tolist(), rows.values[:, 0].tolist(), rows.problems[0].kind
    ([2, 3], [1.5, nan], 'overlong')
    """

    path: Path
    name: str = ""
    stated: Stated = FOUND
    """What the user says of how it is written."""

    @cached_property
    def dialect(self) -> Dialect:
        """How the table is written, from its first lines."""
        top: list[bytes] = []
        for _, lines, _ in self._blocks(1 << 16):
            top.extend(lines)
            if sum(bool(ln.strip()) and not ln.startswith(COMMENTS) for ln in top) >= _TOP:
                break
        with naming(self.path.name, DataError, DataError):
            return detect(top[:4000], self.stated)

    @cached_property
    def times(self) -> dict[int, int]:
        """Column of dates → the one of times of day that belongs to it."""
        if "d" not in self.dialect.kinds:
            return {}
        first, lines, _ = next(self._blocks(1 << 16), (1, [], ""))
        rows = (ln.rstrip(b"\r") for ln in lines[max(self.dialect.skip - first + 1, 0) :][:_TOP])
        cells = [_split(ln, self.dialect) for ln in rows if not ln.startswith(COMMENTS)]
        whole = [row for row in cells if len(row) == self.dialect.fields]
        columns = [[c for one in of if (c := one.strip())] for of in zip(*whole, strict=True)]
        found = beside(columns)
        return {} if found is None else {found[0]: found[1]}

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Columns with the units that the headings state."""
        return columns_of(self.dialect)

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        names = [column.name for column in self.columns]
        if strict and self.dialect.even < 0.5:
            raise DataError(
                f"{self.path.name}: most of its first lines have not {self.dialect.fields} cells: "
                "no table; state the delimiter, or take the table out of the log"
            )
        use = [names.index(name) for name in numbers]
        clock = None if time is None else names.index(time)
        order, known, words = 0, np.zeros(len(use)), np.zeros(len(use))
        for first, lines, cut in self._blocks(BLOCK):
            start = max(self.dialect.skip - first + 1, 0)
            piece = _Piece(self, lines[start:], first + start, order, strict)
            rows = piece.read(use, clock, cut)
            order = piece.order
            known += np.isfinite(rows.values).sum(axis=0)
            words += [len(piece.words.get(j, ())) for j in use]
            for j in np.array(use, dtype=np.int64)[words > known].tolist() if strict else ():
                raise self.refused(j, *piece.words[j][0], "correct the line, or map another column")
            if len(rows.line) or rows.problems:
                yield rows

    def refused(self, j: int, line: int, cell: bytes, advice: str) -> DataError:
        """The error that a cell of column ``j`` is no number."""
        text = cell[:40].decode("utf-8", "replace")
        return DataError(
            f"{self.path.name}:{line}: column {self.columns[j].name!r}: expected a number, got "
            f"{text!r}: {advice}"
        )

    def _blocks(self, size: int) -> Iterator[tuple[int, list[bytes], str]]:
        """Complete lines: number of the first, the lines, and how the last one ended.

        The third is empty inside the file, ``open`` when the file ends without a line end, and a
        reason when the compressed stream broke off.
        """
        line, held, rest, reason = 1, list[bytes](), b"", ""
        with opened(self.path) as file:
            while not reason:
                try:
                    data = file.read(size)
                except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                    data, reason = b"", f"the gzip stream is damaged: {error}"
                if not data:
                    break
                if line == 1 and not held and not rest:
                    data = data.removeprefix(_BOM)
                *lines, rest = (rest + data).replace(b"\r\n", b"\n").split(b"\n")
                if len(rest) > LONGEST:
                    raise DataError(
                        f"{self.path.name}:{line + len(held) + len(lines)}: a line of more than "
                        f"{LONGEST} bytes: end lines with a line feed"
                    )
                if len(held) > 1 and lines:  # its last line stays: the next may be the other half
                    yield line, held[:-1], ""
                    line, held = line + len(held) - 1, held[-1:]
                held += lines
        if rest.strip():
            yield line, [*held, rest], reason or "open"
        elif held or reason:
            yield line, held, reason


def columns_of(d: Dialect) -> tuple[Column, ...]:
    """The columns of a table that is written so.

    >>> [c.unit for c in columns_of(detect([b"t [s],v [m/s]", b"0,1.5"]))]
    ['s', 'm/s']
    """
    split = [split_unit(name) for name in d.headings.names or ("",) * d.fields]
    stated = d.headings.units or tuple(unit for _, unit in split)
    units = (*stated, *("",) * (d.fields - len(stated)))
    also = (*d.headings.also, *((),) * (d.fields - len(d.headings.also)))
    headings = d.headings.names
    named = [name for name, _ in split]
    for k, name in enumerate(headings):  # two units of one name stay apart
        if "/" in name and slashed(name) is not None:
            told = dict.fromkeys((*also[k], name, bracketed(name)[0]))
            also = (*also[:k], tuple(told), *also[k + 1 :])
            split[k] = (name if named.count(split[k][0]) > 1 else split[k][0], split[k][1])
    names = distinct([name for name, _ in split])
    kinds = [_KINDS[letter] for letter in d.kinds]
    found = tuple(map(Column, names, kinds, units, also))
    closed = bool(d.headings.names) and not split[-1][0] and d.kinds[-1] == "?"
    return found[:-1] if closed else found  # each line ends with a delimiter


@dataclass
class _Piece:
    """The lines of one block on their way to numbers."""

    table: TextTable
    lines: list[bytes]
    first: int
    order: int
    strict: bool
    words: dict[int, list[tuple[int, bytes]]] = field(default_factory=dict)
    """Cells of each column that are no numbers, with their lines."""

    def read(self, use: list[int], clock: int | None, cut: str) -> Rows:
        problems: list[Problem] = []
        kept: list[bytes] = []
        where: list[tuple[int, int]] = []
        again: list[tuple[int, int]] = []
        d = self.table.dialect
        heads = _heads(d)
        quoted = any(b'"' in ln for ln in self.lines)
        for i, raw in enumerate(self.lines):
            ln = raw.rstrip(b"\r")
            if not ln.strip() or ln.startswith(COMMENTS):
                continue
            if quoted and b'"' in ln:
                ln = _unquoted(ln, d)
            count = len(ln.split()) if d.delimiter is None else ln.count(d.delimiter) + 1
            last = bool(cut) and i == len(self.lines) - 1
            if count != d.fields or b"\0" in ln:
                if count == 1 and where and where[-1][0] == self.first + i - 1:
                    kept.pop()
                    detail = "the next line holds one cell: perhaps its other half"
                    problems.append(Problem("truncated", where.pop()[0], detail))
                problems.append(self._misfit(self.first + i, count, b"\0" in ln))
            elif last and (cut != "open" or not self._complete(raw, kept)):
                detail = "no line end: a cell may be cut short" if cut == "open" else cut
                problems.append(Problem("cut_off", self.first + i, detail))
            elif any(head in ln for head in heads) and _bare(ln, d) in heads.values():
                again.append((len(kept), self.first + i))
                problems.append(Problem("heading", self.first + i, "the headings again"))
            else:
                kept.append(ln)
                where.append((self.first + i, self.order))
            self.order += 1
        if cut and cut != "open" and not any(p.kind == "cut_off" for p in problems):
            problems.append(Problem("cut_off", self.first + len(self.lines), cut))
        for at, line in again if self.strict else ():
            self._goes_on(kept, at, line, 0 if clock is None else clock)
        if not kept:
            return Rows.empty(len(use), tuple(problems))
        lines, order = np.array(where, dtype=np.int64).T
        values = self._values(kept, use, lines, problems)
        stamps = order if clock is None else texts(self._stamps(kept, clock))
        return Rows(lines, order, stamps, values, tuple(problems))

    def _goes_on(self, kept: list[bytes], at: int, line: int, j: int) -> None:
        """Refuses headings below which the time begins anew."""
        cells = self._column(kept[max(at - 3, 0) : at + 1], j)
        told = [number for cell in cells if (number := number_of(cell)) is not None]
        if len(told) < 4 or at < 3:
            return
        if np.all(np.diff(told[:3]) > 0.0) and told[3] < told[2]:
            raise DataError(
                f"{self.table.path.name}:{line}: the headings again: a file begins anew here, give "
                "each a file of its own"
            )

    def _misfit(self, line: int, count: int, binary: bool) -> Problem:
        if binary:
            return Problem("damaged", line, "a zero byte in the line")
        fields = self.table.dialect.fields
        kind = "truncated" if count < fields else "overlong"
        return Problem(kind, line, f"{count} cells, expected {fields}")

    def _complete(self, raw: bytes, above: list[bytes]) -> bool:
        """Whether the last cell of an unfinished line can be shown to be whole."""
        d = self.table.dialect
        if raw.rstrip().endswith(b'"'):
            return True
        last = _split(raw, d)[-1].strip().replace(b",", b".")
        others = [_split(ln, d)[-1].strip().replace(b",", b".") for ln in above[-1000:]]
        if not last or not others:
            return False
        if b"." in last and b"e" not in last.lower():
            return len(last.partition(b".")[2]) >= max(len(o.partition(b".")[2]) for o in others)
        return len(last) >= max(map(len, others)) or (d.kinds[-1] in "bt" and last in others)

    def _stamps(self, kept: list[bytes], j: int) -> list[bytes]:
        """Cells of time; of a date with the time of day that stands in a column of its own."""
        cells, time = self._column(kept, j), self.table.times.get(j)
        if time is None:
            return cells
        return [b"%b %b" % pair for pair in zip(cells, self._column(kept, time), strict=True)]

    def _column(self, kept: list[bytes], j: int) -> list[bytes]:
        delimiter = self.table.dialect.delimiter
        cells = [ln.split(delimiter, j + 1)[j].strip() for ln in kept]
        return [pointed(c) for c in cells] if self.table.dialect.decimal_comma else cells

    def _values(
        self, kept: list[bytes], use: list[int], line: Any, problems: list[Problem]
    ) -> Float64[np.ndarray, "n k"]:
        """The fast way for plain numbers; any surprise goes cell by cell."""
        if not use:
            return np.zeros((len(kept), 0))
        d = self.table.dialect
        swap = d.decimal_comma and d.delimiter != b","
        if swap and any(map(_POINTED.search, kept)):
            return np.stack([self._slow(kept, j, line, problems) for j in use], axis=1)
        plain = [ln.replace(b",", b".") for ln in kept] if swap else kept
        try:
            return np.loadtxt(
                cast(Any, plain),
                delimiter=None if d.delimiter is None else d.delimiter.decode("latin-1"),
                usecols=use,
                comments=None,
                ndmin=2,
                encoding="latin-1",
            )
        except ValueError:
            columns = [self._slow(kept, j, line, problems) for j in use]
            return np.stack(columns, axis=1)

    def _slow(
        self, kept: list[bytes], j: int, line: Any, problems: list[Problem]
    ) -> Float64[np.ndarray, " n"]:
        out = np.full(len(kept), np.nan)
        for i, cell in enumerate(self._column(kept, j)):
            number = number_of(cell, self.table.dialect.kinds[j] == "b")
            if number is not None:
                out[i] = number
                continue
            if self.strict and not worded(cell):
                raise self.table.refused(j, int(line[i]), cell, self._advice(cell, kept[i], j))
            text = cell[:40].decode("utf-8", "replace")
            problems.append(
                Problem("text", int(line[i]), f"{self.table.columns[j].name}: {text!r}")
            )
            self.words.setdefault(j, []).append((int(line[i]), cell))
        return out

    def _advice(self, cell: bytes, row: bytes, j: int) -> str:
        """What to do about a cell that is no number."""
        columns, d = self.table.columns, self.table.dialect
        quoted = cell.replace(b" ", b",")  # what a quote held is a blank by now
        if number_of(pointed(quoted)) is None:
            return "correct the line, or map another column"
        if b"," not in quoted:
            return "points that part thousands? Say [[source]] decimal = ','"
        points = (
            (c.name, one.decode("utf-8", "replace"))
            for c, one in zip(columns, _split(row, d), strict=True)
            if b"." in one and number_of(one) is not None
        )
        for name, one in points:
            return (
                f"a decimal comma, and {one!r} in column {name!r} has a point: if it parts "
                "thousands, say [[source]] decimal = ','; else write all numbers in one way"
            )
        return "a decimal comma or thousands? Say [[source]] decimal, or write plain numbers"


def _split(line: bytes, dialect: Dialect) -> list[bytes]:
    return cells_of(line, dialect.delimiter)


def _bare(line: bytes, d: Dialect) -> tuple[bytes, ...]:
    return tuple(cell.strip().strip(b'"') for cell in _split(line, d))


def _heads(d: Dialect) -> dict[bytes, tuple[bytes, ...]]:
    """The lines of names and of units, by the first word of each."""
    lines = (tuple(name.encode(d.encoding) for name in one) for one in d.headings[:2])
    return {next(filter(None, line)): line for line in lines if any(line)}


def _unquoted(line: bytes, d: Dialect) -> bytes:
    """A quoted line with its quotes resolved and delimiters inside them replaced: by blanks, or in
    numbers with a decimal comma by points."""
    if d.delimiter is None or line.count(b'"') % 2:
        return line
    cells = cells_of(line, d.delimiter)
    if d.delimiter == b"," and d.decimal_comma:
        cells = [pointed(c) if number_of(pointed(c)) is not None else c for c in cells]
    return d.delimiter.join(c.replace(d.delimiter, b" ") for c in cells)
