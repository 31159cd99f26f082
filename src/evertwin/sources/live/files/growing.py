"""A text table that grows, read as it is written: its tail, through rotation and truncation.

Only lines with their line end are read; the rest of one may still come. Where the file was replaced
(rotation by name), the old one is read to its end first; where it was cut (rotation by copy), it is
read from its beginning, and rows that came before are known by their stamps.

>>> import asyncio, tempfile
>>> from evertwin.sources.live.contract import check_live
>>> from evertwin.sources.spec import ChannelSpec, TimeSpec
>>> file = Path(tempfile.mkdtemp()) / "run.csv"
>>> _ = file.write_text("t,v\\n0,5\\n1,6\\n2,")
>>> spec = SourceSpec("log", {"v": ChannelSpec("v", "m/s")}, time=TimeSpec("t"))
>>> source = Growing(GrowingSettings("log", "file", path=str(file)), spec, Around())
>>> [chunk.v[0, 0].item() for chunk in check_live(source, limit=2)]
[5.0, 6.0]
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from evertwin.backoff import Backoff
from evertwin.errors import DataError, UsageError
from evertwin.settings.kinds import Duration
from evertwin.settings.notes import Late, expand
from evertwin.sources.live.contract import Around, LiveSettings
from evertwin.sources.live.decode import Columns, Raw
from evertwin.sources.live.line import Line, LineDown
from evertwin.sources.spec import SourceSpec
from evertwin.sources.texts.dialect import COMMENTS, Dialect, Stated, cells_of, detect, pointed
from evertwin.sources.texts.no_number import number_of
from evertwin.sources.texts.text import LONGEST, columns_of

BLOCK = 1 << 18
"""Bytes read at once."""
_MARK = 64
"""Bytes before the place read up to, by which a file is known again."""
_TOP = 20
"""Lines after which a table that cannot be told is given up."""


@dataclass(frozen=True)
class GrowingSettings(LiveSettings):
    """``protocol = "file"``: a text table that grows.

    >>> GrowingSettings("log", "file", path="run.csv").look
    0.2
    """

    path: Annotated[str, Late()] = ""
    """The file; relative to the twin file."""
    look: Duration = 0.2
    """Time between two looks at its end."""

    lies_here: ClassVar[bool] = True


class Growing(Line):
    """The source. See the module for an example."""

    def __init__(self, settings: GrowingSettings, spec: SourceSpec, around: Around) -> None:
        super().__init__(settings, spec, around, arrives=False)
        self.path = around.folder / expand(settings.path)
        self.look = settings.look
        self.backoff = Backoff(self.look, max(self.look, 1.0))
        self.stated = Stated(spec.header, spec.delimiter, spec.decimal)

    def open(self) -> None:
        """See `LiveSource`."""
        if self.path.name == "" or self.decoder.time is None:
            raise UsageError(
                f"source {self.name!r}: a file that grows needs its path, and a column of time: "
                "rows that were read before are known by their stamps"
            )
        self.decoder.check(ordered=True)

    async def session(self) -> AsyncIterator[Columns]:
        """One stretch in which the file is there."""
        tail = _Tail(self.path)
        table = _Rows(self)
        try:
            while True:
                for line in tail.lines():
                    for columns in table.take(line):
                        yield columns
                if tail.more:
                    continue
                what = tail.turn()
                if what:
                    table = _Rows(self)
                    self.told.note(what)
                    if tail.rest:
                        self.told.reject("a line without its end")
                    tail.rest = b""
                else:
                    await asyncio.sleep(self.look)
        finally:
            tail.close()


class _Tail:
    """The bytes of a file as they come."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rest = b""
        """Of a line whose end did not come yet."""
        self.more = False
        """Did the last read end before the file?"""
        self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self._at = 0
        self._mark = b""

    def close(self) -> None:
        os.close(self._file)

    def lines(self) -> list[bytes]:
        """The complete lines that came."""
        data = os.pread(self._file, BLOCK, self._at)
        self.more = len(data) == BLOCK
        if self._at == 0:
            self.rest = b""
        self._at += len(data)
        self._mark = (self._mark + data)[-_MARK:]
        *lines, self.rest = (self.rest + data).split(b"\n")
        if len(self.rest) > LONGEST:
            raise LineDown(f"{self.path.name}: a line of more than {LONGEST} bytes")
        return [line.rstrip(b"\r") for line in lines]

    def turn(self) -> str:
        """What became of the file, once its end is read; empty while it is the same."""
        here = os.fstat(self._file)
        try:
            named = os.stat(self.path)
        except FileNotFoundError:
            raise LineDown(f"{self.path.name}: no such file") from None
        if (named.st_dev, named.st_ino) != (here.st_dev, here.st_ino):
            if here.st_size > self._at:
                return ""  # it was written to once more: the end of the old file comes first
            fresh = os.open(self.path, os.O_RDONLY | os.O_CLOEXEC)
            os.close(self._file)
            self._file, self._at, self._mark = fresh, 0, b""
            return "the file was replaced"
        same = os.pread(self._file, _MARK, max(self._at - len(self._mark), 0))[: len(self._mark)]
        if here.st_size < self._at or same != self._mark:
            self._at, self._mark = 0, b""
            return "the file was cut"
        return ""


class _Rows:
    """Lines → columns, once the first lines say how the table is written."""

    def __init__(self, source: Growing) -> None:
        self.source = source
        self._top: list[bytes] = []
        self._dialect: Dialect | None = None
        self._places: list[tuple[str, int]] = []

    def take(self, line: bytes) -> list[Columns]:
        """What one more line brings."""
        if not self._top:
            line = line.removeprefix(b"\xef\xbb\xbf")
        if self._dialect is not None:
            return self._row(line)
        self._top.append(line)
        try:
            d = self._dialect = detect(self._top, self.source.stated)
        except DataError:
            if len(self._top) > _TOP:
                raise
            return []
        names = [column.name for column in columns_of(d)]
        for wanted in self.source.decoder.names:
            place = int(wanted) if wanted.isdigit() and wanted not in names else None
            if place is None and wanted not in names:
                raise LineDown(
                    f"{self.source.path.name}: no column {wanted!r}; there are {', '.join(names)}"
                )
            self._places.append((wanted, names.index(wanted) if place is None else place))
        return [columns for row in self._top[d.skip :] for columns in self._row(row)]

    def _row(self, line: bytes) -> list[Columns]:
        d = self._dialect
        assert d is not None
        if not line.strip() or line.startswith(COMMENTS):
            return []
        cells = [cell.strip() for cell in cells_of(line, d.delimiter)]
        if len(cells) != d.fields or b"\0" in line:
            self.source.told.reject("a line with another number of cells")
            return []
        if d.decimal_comma:
            cells = [pointed(cell) for cell in cells]
        row: dict[str, Raw] = {}
        for name, place in self._places:
            timely = name == self.source.decoder.time
            number = None if timely else number_of(cells[place], d.kinds[place] == "b")
            row[name] = cells[place] if number is None else number
        return [row]
