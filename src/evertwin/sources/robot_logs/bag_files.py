"""Bags as plain sequences of messages, read front to back: MCAP, ROS 1 bags, ROS 2 databases.

No index is needed, so a bag that was cut off gives every message before the cut, and says so. The
bytes of a message are not decoded here.
"""

from __future__ import annotations

import bz2
import dataclasses
import io
import sqlite3
import struct
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from evertwin.errors import DataError
from evertwin.sources.foreign import Damaged, each, foreign, load

HELD = 1 << 26
"""Bytes of a file's messages that are kept in memory."""
LARGEST = 1 << 27
"""Bytes of the largest record that is believed."""

ZSTD = b"\x28\xb5\x2f\xfd"
"""What is packed by zstd begins with it."""


class Connection(NamedTuple):
    """What a topic carries.

    >>> Connection("/odom", "nav_msgs/msg/Odometry", "cdr", "").topic
    '/odom'
    """

    topic: str
    type: str
    encoding: str
    """cdr, ros1 or json."""
    definition: str
    """Text of the message definition where the bag carries it."""

    @property
    def image(self) -> bool:
        """Are these images, packed or not?"""
        return self.type.rpartition("/")[2] in ("Image", "CompressedImage")


class Message(NamedTuple):
    """One message: connection, time of its logging [ns], and its bytes.

    >>> Message(Connection("/v", "", "json", ""), 5, b"{}").time
    5
    """

    connection: Connection
    time: int
    data: bytes


class Cut(NamedTuple):
    """Stands last where a bag broke off.

    >>> Cut("unexpected end").reason
    'unexpected end'
    """

    reason: str


def messages(path: Path, kind: str, topic: str = "") -> Iterator[Message | Cut]:
    """The messages of a bag in file order, then a `Cut` if it broke off.

    A file of up to `HELD` bytes of messages is read once, however often and for however many topics
    it is asked; a larger one each time.

    Args:
        path: of the bag.
        kind: mcap, ros1 or db3.
        topic: only its messages; empty: all.

    Raises:
        DataError: not even its beginning can be read.
    """
    held = _held(path, kind, *map(_state, (path, path.with_name(f"{path.name}-wal"))))
    if held is not None:
        yield from held.topics.get(topic, held.end) if topic else held.all
        return
    for message in _read(path, kind):
        if not topic or isinstance(message, Cut) or message.connection.topic == topic:
            yield message


class _Held(NamedTuple):
    """The messages of a file: all, and those of each topic, with the `Cut` at the end."""

    all: tuple[Message | Cut, ...]
    topics: dict[str, list[Message | Cut]]
    end: tuple[Cut, ...]


def _state(file: Path) -> tuple[int, int]:
    """When a file was written last, and its size: with another one it is read anew."""
    if not file.is_file():
        return 0, 0
    found = file.stat()
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=2)
def _held(path: Path, kind: str, *_: tuple[int, int]) -> _Held | None:
    """None: it is too large to be kept."""
    whole, size = list[Message | Cut](), 0
    for message in _read(path, kind):
        whole.append(message)
        size += 0 if isinstance(message, Cut) else len(message.data)
        if size > HELD:
            return None
    end = tuple(one for one in whole if isinstance(one, Cut))
    topics: dict[str, list[Message | Cut]] = {}
    for one in whole:
        if not isinstance(one, Cut):
            topics.setdefault(one.connection.topic, []).append(one)
    return _Held(tuple(whole), {name: [*those, *end] for name, those in topics.items()}, end)


def _read(path: Path, kind: str) -> Iterator[Message | Cut]:
    try:
        yield from each(path.name, {"mcap": _mcap, "ros1": _ros1, "db3": _db3}[kind](path))
    except Damaged as error:
        yield Cut(error.reason)


def _mcap(path: Path) -> Iterator[Message]:
    reader = load("mcap.stream_reader")
    records = load("mcap.records")
    schemas: dict[int, Any] = {}
    connections: dict[int, Connection] = {}
    with path.open("rb") as file:
        for record in _mcap_records(reader, file):
            if isinstance(record, records.Schema):
                schemas[record.id] = record
            elif isinstance(record, records.Channel):
                connections[record.id] = _mcap_connection(record, schemas)
            elif isinstance(record, records.Message):
                yield Message(connections[record.channel_id], record.log_time, _plain(record.data))


def _mcap_records(reader: Any, file: io.BufferedReader) -> Iterator[Any]:
    """The records, those of a chunk unpacked to no more than it states."""
    stream = reader.StreamReader(
        file, emit_chunks=True, validate_crcs=True, record_size_limit=LARGEST
    )
    for record in stream.records:
        if hasattr(record, "uncompressed_size") and hasattr(record, "data"):
            data = _unpacked(record.compression, record.data, record.uncompressed_size)
            plain = dataclasses.replace(record, compression="", data=data)
            yield from reader.breakup_chunk(plain, validate_crc=True)
        else:
            yield record


def _unpacked(how: str, data: bytes, size: int) -> bytes:
    """A packed chunk of ``size`` bytes; never more of it."""
    if size > LARGEST:
        raise ValueError(f"a chunk of {size} bytes")
    if how in ("", "none"):
        return data
    if how == "bz2":
        out = bz2.BZ2Decompressor().decompress(data, size)
    elif how == "lz4":
        out = load("lz4.frame").LZ4FrameDecompressor().decompress(data, max_length=size)
    elif how == "zstd":
        out = _zstd(data, size)
    else:
        raise ValueError(f"a chunk packed by {how!r}")
    if len(out) < size:
        raise EOFError(f"{len(out)} bytes left of a chunk of {size}")
    return bytes(out)


def _zstd(data: bytes, size: int) -> bytes:
    unpacker = load("zstandard").ZstdDecompressor(max_window_size=LARGEST)
    return bytes(unpacker.stream_reader(data).read(size))


def _plain(data: bytes) -> bytes:
    """A message that ``ros2 bag record --compression-mode message`` packed; CDR begins with 0."""
    return _zstd(data, LARGEST) if data.startswith(ZSTD) else data


def _mcap_connection(channel: Any, schemas: dict[int, Any]) -> Connection:
    schema = schemas.get(channel.schema_id)
    name = schema.name if schema else ""
    text = schema.data.decode("utf-8", "replace") if schema and schema.encoding != "json" else ""
    return Connection(channel.topic, name, channel.message_encoding, text)


def _ros1(path: Path) -> Iterator[Message]:
    connections: dict[int, Connection] = {}
    with path.open("rb") as file:
        file.readline()
        yield from _ros1_records(file, connections, depth=0)


def _ros1_records(
    file: io.BufferedIOBase, connections: dict[int, Connection], depth: int
) -> Iterator[Message]:
    """Records of the bag format 2.0: header length, header, data length, data."""
    while True:
        head = file.read(4)
        if not head:
            return
        header = _ros1_fields(_exactly(file, _size(head)))
        code = header[b"op"]
        size = _size(file.read(4))
        open_chunk = code == b"\x05" and header.get(b"compression") == b"none"
        data = file.read(size) if open_chunk else _exactly(file, size)
        if code == b"\x02":
            seconds, nanos = struct.unpack("<II", header[b"time"])
            connection = connections[_size(header[b"conn"])]
            yield Message(connection, seconds * 10**9 + nanos, data)
        elif code == b"\x07":
            connections[_size(header[b"conn"])] = _ros1_connection(header, data)
        elif code == b"\x05" and depth == 0:
            yield from _ros1_records(_ros1_chunk(header, data), connections, 1)
            if len(data) < size:
                raise EOFError(f"{len(data)} bytes left of a chunk of {size}")


def _ros1_chunk(header: dict[bytes, bytes], data: bytes) -> io.BufferedIOBase:
    how = header[b"compression"].decode("ascii", "replace")
    return io.BytesIO(_unpacked(how, data, _size(header[b"size"])))


def _ros1_connection(header: dict[bytes, bytes], data: bytes) -> Connection:
    inner = _ros1_fields(data)
    name = inner[b"type"].decode("utf-8", "replace")
    definition = inner.get(b"message_definition", b"").decode("utf-8", "replace")
    return Connection(header[b"topic"].decode("utf-8", "replace"), name, "ros1", definition)


def _ros1_fields(data: bytes) -> dict[bytes, bytes]:
    out, at = {}, 0
    while at < len(data):
        size = _size(data[at : at + 4])
        name, _, value = data[at + 4 : at + 4 + size].partition(b"=")
        out[name] = value
        at += 4 + size
    return out


def _size(four: bytes) -> int:
    number = int(struct.unpack("<I", four)[0])
    if number > LARGEST:
        raise ValueError(f"a record of {number} bytes")
    return number


def _exactly(file: io.BufferedIOBase, size: int) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise EOFError(f"{len(data)} bytes left of a record of {size}")
    return data


def _db3(path: Path) -> Iterator[Message]:
    """A ROS 2 database, opened read-only; a write-ahead log beside it is read with it."""
    log = path.with_name(f"{path.name}-wal")
    still = "" if log.is_file() and log.stat().st_size else "&immutable=1"
    link = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro{still}", uri=True)
    try:
        topics = _topics(link, path)
        query = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
        for topic, stamp, data in link.execute(query):
            if not (isinstance(stamp, int) and isinstance(data, bytes)):
                raise TypeError(f"a message of {type(data).__name__} at {type(stamp).__name__}")
            yield Message(topics[topic], stamp, _plain(data))
    finally:
        link.close()


def _topics(link: sqlite3.Connection, path: Path) -> dict[int, Connection]:
    """The topics; a view in place of a table would run whatever it likes.

    Raises:
        DataError: it is no bag.
    """
    try:
        with foreign(path.name):
            link.execute("PRAGMA trusted_schema = OFF")
            tables = link.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
            if not {("topics",), ("messages",)} <= set(tables):
                raise DataError(
                    f"{path.name}: no ROS 2 database: expected tables 'topics' and 'messages'"
                )
            rows = link.execute("SELECT id, name, type, serialization_format FROM topics")
            return {i: Connection(str(n), str(t), str(e), "") for i, n, t, e in rows}
    except Damaged as error:
        raise DataError(
            f"{path.name}: no ROS 2 database ({error.reason}): expected a table 'topics'"
        ) from None
