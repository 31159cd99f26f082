"""ROS 1: one topic of a master, heard by a node in a process of its own.

A message becomes columns by the code that reads bags, so one twin file serves both. It is stamped
by its header; one without a header (Twist) by its receipt, on ROS's own clock, which is simulated
where the master's ``/use_sim_time`` says so. A gap in the header's count is a loss. Messages
without a header have no count: what is lost of them cannot be known.

>>> Ros.settings.__name__
'RosSettings'
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import AsyncIterator
from typing import Any

from evertwin.errors import DataError, UsageError
from evertwin.ros.node import Raw, Subscription, node_at
from evertwin.ros.transforms import TYPES
from evertwin.sources.foreign import load
from evertwin.sources.live.contract import Around
from evertwin.sources.live.decode import Columns
from evertwin.sources.live.decode import Raw as Cell
from evertwin.sources.live.line import DOWN, Line
from evertwin.sources.live.mqtt.parts import Count
from evertwin.sources.live.ros.spec import RosSettings
from evertwin.sources.robot_logs.bag_files import Connection, Message
from evertwin.sources.robot_logs.ros_messages import Decoder, array_of, flat, stamp_of
from evertwin.sources.spec import ArraySpec, SourceSpec

THERE = "between the publisher and here: its queue (queue_size) or the line"
HERE = "waited too long here"
NAMES = 64
"""Publishers whose counts are kept apart."""


class Ros(Line):
    """The source. Implements `LiveSource`. See the module for an example."""

    settings = RosSettings
    arrays = True

    def __init__(self, settings: RosSettings, spec: SourceSpec | ArraySpec, around: Around) -> None:
        super().__init__(settings, spec, around)
        self.ros = settings
        self._array = spec.column if isinstance(spec, ArraySpec) else None
        self._prefix = ""
        self._decoder = Decoder()
        self._counts: dict[str, Count] = defaultdict(Count)
        """By publisher."""
        self._fresh: set[str] = set()
        """Publishers that were heard on this line."""
        self._dropped = 0

    def open(self) -> None:
        """See `LiveSource`."""
        super().open()
        load("rosbags.typesys")
        prefixes = {name.partition(".")[0] for name in self.decoder.names}
        if len(prefixes) != 1 or not min(prefixes).startswith("/"):
            raise UsageError(
                f"source {self.name!r}: expected columns of one topic, as a bag names them "
                f"(/odom.pose.pose.position.x, time /odom.stamp), got {', '.join(prefixes)}: make "
                "each topic a source of its own"
            )
        self._prefix = min(prefixes)

    async def session(self) -> AsyncIterator[Columns]:
        """As long as the node lives."""
        topic = self.ros.topic or self._prefix
        async with node_at(self.ros.place) as node:
            self._fresh.clear()
            heard, self._dropped = node.subscribe(topic), 0
            self.told.reason = silent = f"nobody said anything on {topic} yet"
            try:
                while True:
                    async with asyncio.timeout(self.ros.silence):
                        raw = await heard.next()
                    if self.told.reason is silent:
                        self.told.reason = ""
                    columns = self._columns(raw, heard)
                    if columns is not None:
                        yield columns
            finally:
                node.leave(heard)

    def _columns(self, raw: Raw, heard: Subscription) -> Columns | None:
        connection = Connection(raw.topic, raw.type, "ros1", raw.definition)
        try:
            content = self._decoder.content(Message(connection, raw.at, raw.data))
        except DataError as error:
            self.told.reject(str(error))
            return None
        self._lost(raw.publisher, content, heard)
        found: dict[str, Cell] = {}
        if self._array is None:
            found = {f"{self._prefix}.{name}": value for name, value in flat(content)}
        else:
            found[self._array] = array_of(content, self._array.partition(".")[2])
        if raw.type in TYPES and not found.keys() & set(self.decoder.names):
            return None  # it places other frames
        if raw.at:
            found[f"{self._prefix}.logged"] = raw.at
        stamp = stamp_of(content)
        if stamp is None and f"{self._prefix}.stamp" == self.decoder.time:
            self.told.note("stamped by its receipt: its header has no stamp")
            stamp = raw.at or None
        if stamp is not None:
            found[f"{self._prefix}.stamp"] = stamp
        return found

    def _lost(self, publisher: str, content: Any, heard: Subscription) -> None:
        dropped, self._dropped = heard.dropped - self._dropped, heard.dropped
        if dropped:
            self.told.lose(HERE, dropped)
        if len(self._counts) > NAMES:
            self._counts.clear()
        number = getattr(getattr(content, "header", None), "seq", None)
        missing = self._counts[publisher].missing(number, None) - dropped
        if missing > 0:
            self.told.lose(THERE if publisher in self._fresh else DOWN, missing)
        self._fresh.add(publisher)
