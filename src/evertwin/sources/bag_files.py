"""Bags as plain sequences of messages, read front to back: MCAP, ROS 1 bags, ROS 2 databases.

No index is needed, so a bag that was cut off gives every message before the cut, and says so. The
bytes of a message are not decoded here.
"""

from __future__ import annotations

import bz2
import io
import sqlite3
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from evertwin.errors import DataError, MissingExtra
from evertwin.sources.optional import load

__all__ = ["Connection", "Cut", "Message", "messages"]

LARGEST = 1 << 28
"""Bytes of the largest record that is believed."""


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


def messages(path: Path, kind: str) -> Iterator[Message | Cut]:
    """The messages of a bag in file order, then a `Cut` if it broke off.

    Raises:
        DataError: not even its beginning can be read.
    """
    return {"mcap": _mcap, "ros1": _ros1, "db3": _db3}[kind](path)


def _mcap(path: Path) -> Iterator[Message | Cut]:
    reader = load("mcap.stream_reader")
    records = load("mcap.records")
    exceptions = load("mcap.exceptions")
    schemas: dict[int, Any] = {}
    connections: dict[int, Connection] = {}
    with path.open("rb") as file:
        stream = reader.StreamReader(file, validate_crcs=True, record_size_limit=LARGEST)
        try:
            for record in stream.records:
                if isinstance(record, records.Schema):
                    schemas[record.id] = record
                elif isinstance(record, records.Channel):
                    connections[record.id] = _mcap_connection(record, schemas)
                elif isinstance(record, records.Message):
                    yield Message(connections[record.channel_id], record.log_time, record.data)
        except _damage(exceptions.McapError) as error:
            yield Cut(f"{type(error).__name__}: {error}")


def _mcap_connection(channel: Any, schemas: dict[int, Any]) -> Connection:
    schema = schemas.get(channel.schema_id)
    name = schema.name if schema else ""
    text = schema.data.decode("utf-8", "replace") if schema and schema.encoding != "json" else ""
    return Connection(channel.topic, name, channel.message_encoding, text)


def _damage(*more: type[Exception]) -> tuple[type[Exception], ...]:
    """What a decoder raises on damaged bytes."""
    codecs: tuple[type[Exception], ...] = (RuntimeError,)
    for module, name in (("zstandard", "ZstdError"), ("lz4.block", "LZ4BlockError")):
        try:
            codecs += (getattr(load(module), name),)
        except MissingExtra:
            continue
    return (EOFError, OSError, ValueError, KeyError, IndexError, struct.error, zlib.error,
            OverflowError, MemoryError, *codecs, *more)  # fmt: skip


def _ros1(path: Path) -> Iterator[Message | Cut]:
    connections: dict[int, Connection] = {}
    with path.open("rb") as file:
        file.readline()
        try:
            yield from _ros1_records(file, connections, depth=0)
        except _damage() as error:
            yield Cut(f"{type(error).__name__}: {error}")


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
    size = _size(header[b"size"])
    unpack: dict[bytes, Callable[[bytes], bytes]] = {
        b"none": bytes,
        b"bz2": lambda packed: bz2.BZ2Decompressor().decompress(packed, size),
        b"lz4": lambda packed: bytes(load("lz4.frame").decompress(packed)),
    }
    return io.BytesIO(unpack[header[b"compression"]](data))


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


def _db3(path: Path) -> Iterator[Message | Cut]:
    """A ROS 2 database, opened read-only; a write-ahead log beside it is read with it."""
    log = path.with_name(f"{path.name}-wal")
    still = "" if log.is_file() and log.stat().st_size else "&immutable=1"
    link = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro{still}", uri=True)
    try:
        connections = {
            row[0]: Connection(row[1], row[2], row[3], "") for row in _topics(link, path)
        }
        query = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
        for topic, stamp, data in link.execute(query):
            yield Message(connections[topic], int(stamp), bytes(data))
    except (sqlite3.Error, KeyError, TypeError, ValueError) as error:
        yield Cut(f"{type(error).__name__}: {error}")
    finally:
        link.close()


def _topics(link: sqlite3.Connection, path: Path) -> list[tuple[int, str, str, str]]:
    try:
        return link.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
    except sqlite3.Error as error:
        raise DataError(
            f"{path.name}: no ROS 2 database ({error}): expected a table 'topics'"
        ) from None
