"""Bags (MCAP, ROS 1, ROS 2) as one table per topic.

Opening reads the bag once to learn its topics; each topic's first message names its columns, those
of transforms its first `FRAMES`: each places some of the frames. Two more columns hold time:
``stamp`` (the message's header, where it has one) and ``logged``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.clocks.stamps import NO_STAMP
from evertwin.sources.columns.names import listed
from evertwin.sources.columns.table import Column, Problem, Recording, Rows
from evertwin.sources.robot_logs.bag_files import Cut, Message, messages
from evertwin.sources.robot_logs.ros_messages import Content, Decoder
from evertwin.sources.sniff import sniff

PIECE = 4096
"""Messages read at once."""
KEPT = 1 << 20
"""Numbers of one topic that are kept once they are decoded."""
FRAMES = 1000
"""Messages of transforms that are looked into for frames."""
_KINDS = {"mcap": "mcap", "ros1": "ros1", "db3": "ros2"}


def open_bag(path: Path, kind: str) -> Recording:
    """The topics of a bag file, or of a folder as ``ros2 bag record`` writes it.

    Raises:
        DataError: no topic holds numbers, or the folder holds no bag.
        MissingExtra: the reader is not installed.
    """
    files = _inside(path) if kind == "directory" else ((path, kind),)
    decoder = Decoder()
    columns: dict[str, tuple[Column, ...]] = {}
    notes: dict[str, str] = {}
    looked: Counter[str] = Counter()
    for file, file_kind in files:
        for message in messages(file, file_kind):
            if isinstance(message, Cut):
                notes[f"{file.name}:"] = f"broke off: {message.reason}"
                continue
            topic = message.connection.topic
            looked[topic] += 1
            if looked[topic] <= (FRAMES if _framed(message) else 1):
                _learn(message, decoder, columns, notes)
    tables = tuple(TopicTable(files, path, topic, c) for topic, c in columns.items() if c)
    left_out = tuple(f"{topic} {reason}" for topic, reason in notes.items())
    if not tables:
        reason = listed(left_out) or "no messages: were the QoS settings of the recorder right?"
        raise DataError(f"{path.name}: no topic with numbers ({reason})")
    return Recording(path, _KINDS[files[0][1]], tables, left_out)


def _inside(path: Path) -> tuple[tuple[Path, str], ...]:
    packed = sorted(path.glob("*.zstd"))
    files = sorted([*path.glob("*.db3"), *path.glob("*.mcap")], key=_natural)
    if not files:
        what = f"{packed[0].name}: unpack it first (zstd -d)" if packed else "no *.db3 or *.mcap"
        raise DataError(f"{path}: expected a recording or a folder with a ROS 2 bag, got {what}")
    return tuple((file, sniff(file)) for file in files)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts run_2 before run_10."""
    return [(int(p), "") if p.isdigit() else (-1, p) for p in re.split(r"(\d+)", path.name)]


def _framed(message: Message) -> bool:
    """Does each message of this topic place some of several frames?"""
    return message.connection.type.rpartition("/")[2].lower() == "tfmessage"


def _learn(
    message: Message,
    decoder: Decoder,
    columns: dict[str, tuple[Column, ...]],
    notes: dict[str, str],
) -> None:
    topic = message.connection.topic
    known = columns.setdefault(topic, ())
    try:
        content = decoder.read(message)
    except DataError as error:
        notes[topic] = f"left out: {error}"
        return
    names = [f"{topic}.{name}" for name in content.cells]
    if not names and not message.connection.image:  # images have their times at least
        notes[topic] = f"left out: {message.connection.type or 'its type'} holds no short numbers"
        return
    clocks = ["stamp"] if content.stamp is not None else []
    times = tuple(Column(f"{topic}.{clock}", "time", "ns") for clock in [*clocks, "logged"])
    found = (*times, *(Column(name, "number") for name in names))
    columns[topic] = (*known, *(column for column in found if column not in known))


@dataclass(frozen=True)
class TopicTable:
    """One topic of a bag.

    >>> from evertwin.sources.robot_logs.bag_files import Connection
    >>> TopicTable((), Path("run.mcap"), "/v", (Column("/v.data", "number"),)).name
    '/v'
    """

    files: tuple[tuple[Path, str], ...]
    path: Path
    name: str
    columns: tuple[Column, ...]
    _kept: list[_Said | Cut] = field(default_factory=list, compare=False, repr=False)

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        order, batch = 0, _Batch(self, numbers, time)
        for one in self._read():
            if isinstance(one, Cut):
                batch.problems.append(Problem("cut_off", order, one.reason))
                continue
            batch.add(one, order)
            order += 1
            if len(batch.order) + len(batch.problems) >= PIECE:
                yield batch.rows()
                batch = _Batch(self, numbers, time)
        if batch.order or batch.problems:
            yield batch.rows()

    def _read(self) -> Iterator[_Said | Cut]:
        """The messages decoded; up to `KEPT` numbers of them once."""
        if self._kept:
            yield from self._kept
            return
        decoder, kept = Decoder(), list[_Said | Cut]()
        for file, kind in self.files:
            for message in messages(file, kind, self.name):
                one = message if isinstance(message, Cut) else _said(message, decoder)
                if len(kept) * len(self.columns) < KEPT:
                    kept.append(one)
                yield one
        if len(kept) * len(self.columns) < KEPT:
            self._kept[:] = kept


class _Said(NamedTuple):
    """A message's time of logging [ns] and content, or why it cannot be read."""

    logged: int
    framed: bool
    content: Content | DataError


def _said(message: Message, decoder: Decoder) -> _Said:
    try:
        content: Content | DataError = decoder.read(message)
    except DataError as error:
        content = error
    return _Said(message.time, _framed(message), content)


class _Batch:
    """Messages on their way to rows."""

    def __init__(self, table: TopicTable, numbers: Sequence[str], time: str | None) -> None:
        self.prefix = len(table.name) + 1
        self.wanted = [name[self.prefix :] for name in numbers]
        self.time = None if time is None else time[self.prefix :]
        self.order: list[int] = []
        self.stamps: list[float] = []
        self.values: list[list[float]] = []
        self.problems: list[Problem] = []

    def add(self, said: _Said, order: int) -> None:
        content = said.content
        if isinstance(content, DataError):
            self.problems.append(Problem("damaged", order + 1, str(content)))
            return
        absent = [name for name in self.wanted if name not in content.cells]
        if absent and said.framed and len(absent) == len(self.wanted):
            return  # it places others
        if absent and not said.framed:
            self.problems.append(
                Problem("truncated", order + 1, f"no {absent[0]!r} in the message")
            )
            return
        self.order.append(order)
        self.stamps.append(self._stamp(said.logged, content))
        self.values.append([content.cells.get(name, np.nan) for name in self.wanted])

    def _stamp(self, logged: int, content: Content) -> float:
        """The logging time or the message's own stamp [ns], or any of its numbers."""
        if self.time in ("logged", None):
            stamp: int | None = logged
        elif self.time == "stamp":
            stamp = content.stamp
        else:
            return content.cells.get(self.time or "", float("nan"))
        return NO_STAMP if stamp is None or abs(stamp) >= 2**63 else stamp

    def rows(self) -> Rows:
        if not self.order:
            return Rows.empty(len(self.wanted), tuple(self.problems))
        order = np.array(self.order, dtype=np.int64)
        own = self.time in ("logged", "stamp")
        stamps = np.array(self.stamps, dtype=np.int64 if own else np.float64)
        values = np.array(self.values, dtype=np.float64).reshape(len(order), len(self.wanted))
        time = order if self.time is None else stamps
        return Rows(order + 1, order, time, values, tuple(self.problems))
