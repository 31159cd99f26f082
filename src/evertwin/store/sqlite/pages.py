"""The rows of a SQLite file that still stand in it, whatever else is damaged.

SQLite finds a row through the file's header, its schema and the pages above it; when one of them is
damaged, it finds none. Here every page of the file and of its write-ahead log is looked at alone: a
*leaf* of a table holds rows, and says where on the page each begins. Which table a row is of, and
whether it is sound, is for the caller to tell by its columns and its hash. Pages that were freed or
written over may still stand there, so older rows come along.

The format: https://www.sqlite.org/fileformat2.html, sections 1.6 (pages), 2.1 (records), 4 (log).
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import StoreDamaged
from evertwin.store.sql.database import PAGE

Raw: TypeAlias = "bytes | mmap.mmap"
Value: TypeAlias = "int | float | str | bytes | None"
LEAF = 0x0D
HEADER = 100
"""Bytes of the file's header, before what page 1 holds."""
LOG_HEADER, FRAME_HEADER = 32, 24
LOCAL = PAGE - 35
"""Most bytes of a row that stand on its leaf."""
LEAST = (PAGE - 12) * 32 // 255 - 23
LARGEST = 1 << 30
WHOLE = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
"""Bytes of whole numbers by their type."""


class Found(NamedTuple):
    """A row.

    >>> Found(1, ("a",)).number
    1
    """

    number: int
    """Its rowid."""
    values: tuple[Value, ...]


def rows_in(path: Path) -> Iterator[Found]:
    """Every row that stands whole on a page of the database or of its write-ahead log."""
    pages = _Pages(path)
    for number, page in pages.all():
        start = HEADER if number == 1 else 0
        if page[start] == LEAF:
            yield from _rows(page, start, pages)


def check_log(path: Path) -> None:
    """Is the write-ahead log whole up to its end?

    SQLite takes a log up to the first frame whose checksum fails for the end that a crash left.
    Where a sound commit follows, what was durable would be lost without a word. Frames that commit
    nothing may be left over from a transaction that was killed, behind a shorter one after it.

    Raises:
        StoreDamaged: there is such a commit.
    """
    raw = _raw(Path(f"{path}-wal"))
    frames = range(LOG_HEADER, len(raw) - PAGE - FRAME_HEADER + 1, PAGE + FRAME_HEADER)
    head, order = raw[:LOG_HEADER], (raw[3:4] == b"\x83" and ">u4") or "<u4"
    broken, salts = 0, head[16:24]
    if frames and _checksum(head[:24], b"\0" * 8, order) != head[24:32]:
        broken, salts = 1, raw[frames[0] + 8 : frames[0] + 16]
    before = head[24:32]
    for at in frames:
        frame = raw[at : at + FRAME_HEADER]
        content = frame[:8] + raw[at + FRAME_HEADER : at + FRAME_HEADER + PAGE]
        # frames with other salts are left over from an older log
        if frame[8:16] != salts or _checksum(content, before, order) != frame[16:24]:
            broken = broken or at
        elif broken and frame[4:8] != bytes(4):
            raise StoreDamaged(f"{path}-wal: byte {broken} and those behind it were changed")
        before = frame[16:24]


def _checksum(content: bytes, before: bytes, order: str) -> bytes:
    """SQLite's checksum, from the one before.

    Per pair of words ``a += x + b; b += y + a`` (mod 2³²): a linear recurrence, so a word counts by
    a Fibonacci number that only depends on how many follow.
    """
    words = np.frombuffer(content, np.dtype(order)).astype(np.uint32)
    first, second = struct.unpack(">II", before)
    n = len(words)
    f = _fibonacci(n + 2)
    a = int(np.sum(words * f[n - 1 :: -1])) + first * int(f[n - 1]) + second * int(f[n])
    b = int(np.sum(words * f[n:0:-1])) + first * int(f[n]) + second * int(f[n + 1])
    return struct.pack(">II", a & 0xFFFFFFFF, b & 0xFFFFFFFF)


@cache
def _fibonacci(count: int) -> np.ndarray:
    """The first numbers, mod 2³²."""
    found = [0, 1]
    while len(found) < count:
        found.append((found[-1] + found[-2]) & 0xFFFFFFFF)
    return np.array(found, dtype=np.uint32)


class _Pages:
    """Pages by number, the newest first: those of the log before that of the database."""

    def __init__(self, path: Path) -> None:
        self._found: dict[int, list[tuple[Raw, int]]] = {}
        log, database = _raw(Path(f"{path}-wal")), _raw(path)
        for at in range(LOG_HEADER, len(log) - PAGE - FRAME_HEADER + 1, PAGE + FRAME_HEADER):
            (number,) = struct.unpack_from(">I", log, at)
            self._found.setdefault(number, []).insert(0, (log, at + FRAME_HEADER))
        for at in range(0, len(database), PAGE):
            self._found.setdefault(at // PAGE + 1, []).append((database, at))

    def all(self) -> Iterator[tuple[int, bytes]]:
        """Every version of every page."""
        for number, versions in self._found.items():
            for raw, at in versions:
                yield number, raw[at : at + PAGE].ljust(PAGE, b"\0")

    def one(self, number: int, *, newest: bool) -> bytes | None:
        """The newest or the oldest version of a page."""
        versions = self._found.get(number)
        if versions is None:
            return None
        raw, at = versions[0 if newest else -1]
        return raw[at : at + PAGE].ljust(PAGE, b"\0")


def _raw(path: Path) -> Raw:
    """A file's bytes, of which only what is looked at is read."""
    if not path.is_file() or not path.stat().st_size:
        return b""
    with path.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def _rows(page: bytes, start: int, pages: _Pages) -> Iterator[Found]:
    """The rows of a leaf; a cell that cannot be one is passed over."""
    (count,) = struct.unpack_from(">H", page, start + 3)
    for k in range(min(count, (PAGE - start - 8) // 2)):
        (at,) = struct.unpack_from(">H", page, start + 8 + 2 * k)
        seen = set[bytes]()
        for newest in (True, False):
            cell = _cell(page, at, pages, newest=newest)
            if cell is not None and cell[1] not in seen:
                seen.add(cell[1])
                values = _record(cell[1])
                if values is not None:
                    yield Found(cell[0], values)


def _cell(page: bytes, at: int, pages: _Pages, *, newest: bool) -> tuple[int, bytes] | None:
    """Rowid and content of a cell, the pages that it overflows to included."""
    size, at = _varint(page, at)
    number, at = _varint(page, at)
    if not 0 < size <= LARGEST:
        return None
    kept = LEAST + (size - LEAST) % (PAGE - 4)
    local = size if size <= LOCAL else kept if kept <= LOCAL else LEAST
    parts, left = [page[at : at + local]], size - local
    (following,) = struct.unpack_from(">I", page.ljust(at + local + 4, b"\0"), at + local)
    while left > 0:
        further = pages.one(following, newest=newest)
        if further is None:
            return None
        parts.append(further[4 : 4 + min(left, PAGE - 4)])
        left -= PAGE - 4
        (following,) = struct.unpack_from(">I", further)
    content = b"".join(parts)
    return (number, content) if len(content) == size else None


def _record(content: bytes) -> tuple[Value, ...] | None:
    """The values of a row; None if it is none."""
    head, at = _varint(content, 0)
    if not 0 < head <= len(content):
        return None
    kinds, place, values = [], head, list[Value]()
    while at < head:
        kind, at = _varint(content, at)
        kinds.append(kind)
    for kind in kinds:
        size = WHOLE.get(kind, 8 if kind == 7 else max(kind - 12, 0) // 2)
        part = content[place : place + size]
        if len(part) < size or kind in (10, 11):
            return None
        place += size
        try:
            values.append(_value(kind, part))
        except UnicodeDecodeError:
            return None
    return tuple(values)


def _value(kind: int, part: bytes) -> Value:
    if kind == 0:
        return None
    if kind in (8, 9):
        return kind - 8
    if kind == 7:
        return float(struct.unpack(">d", part)[0])
    if kind in WHOLE:
        return int.from_bytes(part, "big", signed=True)
    return part.decode() if kind % 2 else part


def _varint(raw: bytes, at: int) -> tuple[int, int]:
    """A number of 1 to 9 bytes, and where the next begins; −1 beyond the end."""
    value = 0
    for k in range(9):
        if at >= len(raw):
            return -1, at
        byte = raw[at]
        at += 1
        if k == 8:
            return value << 8 | byte, at
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            break
    return value, at
