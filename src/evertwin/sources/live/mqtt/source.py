"""MQTT: messages of a broker that keeps them until they are stored here.

QoS 1 and a session that outlives the line; a message is acknowledged when its chunk is committed,
not when it came. So what was not stored comes again after a crash, and is known by its stamp. A gap
in the publisher's count is a loss, with its cause as far as it can be known from here: a broker
that forgot the session (it has no persistence, was killed before it saved, or the session was over)
or whose queue was full.

>>> Mqtt.settings.__name__
'MqttSettings'
"""

from __future__ import annotations

import asyncio
import dataclasses
import hashlib
import logging
import os
import time
from collections import defaultdict
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import TYPE_CHECKING

from evertwin.errors import UsageError, reason_of
from evertwin.fold import Chunk
from evertwin.sources.foreign import load
from evertwin.sources.live.contract import Around
from evertwin.sources.live.decode import LATE, Columns, Raw
from evertwin.sources.live.line import Line, LineDown
from evertwin.sources.live.mqtt.connection import LISTEN, Connection, Heard, heard
from evertwin.sources.live.mqtt.parts import Count, NoMessage, place
from evertwin.sources.live.mqtt.spec import MqttSettings, Part
from evertwin.sources.live.secrets import password
from evertwin.sources.live.stamping import AGAIN
from evertwin.sources.spec import ArraySpec, SourceSpec
from evertwin.trust import Tls

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

FORGOTTEN = "the broker forgot the session: is its persistence on, its state saved at each change?"
FULL = "the broker's queue: raise its max_queued_messages (mosquitto: 1000)"
BEFORE = (
    "not on this topic: lost before the broker (the publisher's own queue), or published elsewhere"
)
LOG = logging.getLogger("evertwin.live")
SILENT = 10.0
"""Seconds without any message after which it is looked what the broker has in its place."""
SETTLES = 60.0
"""Seconds after a connection in which a gap is what was lost while the line was down."""


class Mqtt(Line):
    """The source. Implements `LiveSource`. See the module for an example."""

    settings = MqttSettings
    arrays = True

    def __init__(
        self, settings: MqttSettings, spec: SourceSpec | ArraySpec, around: Around
    ) -> None:
        super().__init__(settings, spec, around)
        self.broker = settings
        self.around = around
        self.count = Count()
        self.topics: dict[str, dict[str, str]] = defaultdict(dict)
        """Topic → place in its message → column."""
        for column in self.decoder.names:
            part = settings.columns.get(column, Part(column))
            self.topics[part.topic or settings.topic or ""][part.path] = column
        self._tls: Tls | None = None
        self._line: Connection | None = None
        self._given: dict[int, list[int]] = {}
        """Stamp of a sample that is not stored yet → its messages on this connection."""
        self._waiting: list[int] = []
        """Messages whose samples are held."""
        self._connected = 0
        self._cause = BEFORE
        """Of the next gap in the count."""
        self._number: tuple[Raw, Raw] = (None, None)
        """Of the newest message, and who counts."""
        self._since = 0.0

    def open(self) -> None:
        """See `LiveSource`."""
        super().open()
        load("paho.mqtt.client", "live")
        topics = list(self.topics)
        if any(not topic or set(topic) & set("+#") for topic in topics):
            raise UsageError(
                f"source {self.name!r}: name the topic of each column, one by one, or that of all "
                "(topic = …): wildcards would let any publisher be the machine"
            )
        if len(topics) > 1 and self.decoder.time is not None:
            raise UsageError(
                f"source {self.name!r}: columns of {len(topics)} topics have no stamp in common: "
                "make each topic a source of its own, or state stamp = 'arrival'"
            )
        self._password()

    def committed(self, chunk: Chunk) -> None:
        """See `LiveSource`: the broker may forget its messages."""
        for stamp in chunk.t.tolist():
            self._acknowledge(self._given.pop(stamp, []))

    async def session(self) -> AsyncIterator[Columns]:
        """One connection."""
        line = Connection(self.client(), self._tls)
        try:
            kept = await line.connect(self.broker, list(self.topics))
            self._cause = BEFORE if not self._connected else FULL if kept else FORGOTTEN
            if self._connected and not kept:
                self.told.note(FORGOTTEN)
            self._connected += 1
            self._since = time.monotonic()
            self._line = line
            if self.broker.will:
                line.client.publish(self.broker.will, b"up", qos=1, retain=True)
            while True:
                message = await self._message(line)
                if message.qos:
                    self._waiting.append(message.mid)
                else:
                    self.told.note("published with QoS 0: what is lost is not sent again")
                columns = self._columns(message)
                if columns is None:
                    self._acknowledge(self._waiting)
                    self._waiting = []
                else:
                    yield columns
        finally:
            self._line = None
            self._waiting = []
            for messages in self._given.values():
                messages.clear()  # they come again under other numbers
            line.close()

    async def _message(self, line: Connection) -> MQTTMessage:
        """The next message; where none ever comes it is said, and what does."""
        if self.told.state != "up":
            waiting = asyncio.ensure_future(line.next())
            try:
                while not (await asyncio.wait({waiting}, timeout=SILENT))[0]:
                    await self._say_silent()
            finally:
                waiting.cancel()
            return waiting.result()
        while self._waiting:
            with suppress(TimeoutError):
                async with asyncio.timeout(AGAIN * 1e-9):
                    return await line.next()
            # it may send no more before these are acknowledged, which wait for what comes
            self._acknowledge(self._waiting)
            self._waiting = []
        return await line.next()

    async def _say_silent(self) -> None:
        nothing = f"nothing came on {', '.join(self.topics)}"
        if self.told.reason.startswith(nothing):
            return
        self.told.reason = nothing
        try:
            found = await self.heard(LISTEN)
            others = found.like(self.topics) or "nothing on any topic"
        except (LineDown, OSError, TimeoutError) as error:
            others = f"not known: {reason_of(error)}"
        self.told.reason = f"{nothing} in {SILENT:.0f} s; what the broker sends: {others}"
        LOG.warning("%s: %s", self.name, self.told.reason)

    async def heard(self, seconds: float) -> Heard:
        """What the broker sends on all topics, under another name; no session is touched.

        Raises:
            LineDown, OSError, TimeoutError: it is not there, or refuses.
        """
        own = dataclasses.replace(
            self.broker, client=f"evertwin-look-{os.getpid()}-{time.monotonic_ns()}", session=1.0,
            will=None,
        )  # fmt: skip
        beside = Mqtt(own, SourceSpec("look", {}), self.around)
        return await heard(beside.client(clean=True), own, beside._tls, seconds)

    def decode(self, columns: Columns) -> list[Chunk]:
        """See `Line`: what its messages are is kept until it is stored."""
        refused = self.told.refused
        chunks = super().decode(columns)
        if self.broker.sequence is not None:
            self._counted(refused=self.told.refused > refused)
        clock = self.decoder.clock
        for chunk in chunks:
            self._given.setdefault(int(chunk.t[0]), [])
        if clock.holds:  # what is held may be among those that wait
            return chunks
        if chunks:
            self._given[int(chunks[-1].t[0])] += self._waiting
        elif clock.judged in self._given:
            self._given[clock.judged] += self._waiting  # given, and not stored yet
        else:
            self._acknowledge(self._waiting)
        self._waiting = []
        return chunks

    def _acknowledge(self, messages: list[int]) -> None:
        if self._line is not None:
            for mid in messages:
                self._line.client.ack(mid, 1)

    def _columns(self, message: MQTTMessage) -> Columns | None:
        if message.retain:
            self.told.reject("a retained message: an old value")
            return None
        paths = self.topics[message.topic]
        extra = [p for p in (self.broker.sequence, self.broker.publisher) if p is not None]
        try:
            found = place(bytes(message.payload), [*paths, *extra])
        except NoMessage as error:
            self.told.reject(str(error))
            self.count.missing(None, None)
            return None
        columns: dict[str, Raw] = {column: found[path] for path, column in paths.items()}
        if self.broker.sequence is not None:
            publisher = found[self.broker.publisher] if self.broker.publisher else None
            self._number = found[self.broker.sequence], publisher
            columns[LATE] = self.count.late(*self._number)
        return columns

    def _counted(self, *, refused: bool) -> None:
        fresh = time.monotonic() < self._since + SETTLES
        cause = self._cause if fresh else BEFORE
        missing = self.count.missing(*self._number, cause, refused=refused)
        if missing > 0:
            self.told.lose(self.count.cause, missing)
            self._cause = BEFORE
        elif missing < 0:
            self.told.found(self.count.cause, -missing)

    def client(self, *, clean: bool = False) -> Client:
        """One that is not connected yet; ``clean``: a broker of MQTT 3.1.1 keeps no session."""
        paho = load("paho.mqtt.client", "live")
        broker = self.broker
        old = {"clean_session": clean} if broker.version == 3 else {}
        client: Client = paho.Client(
            paho.CallbackAPIVersion.VERSION2, client_id=self._name(), manual_ack=True,
            protocol=paho.MQTTv311 if broker.version == 3 else paho.MQTTv5,
            reconnect_on_failure=False, **old,
        )  # fmt: skip
        client.connect_timeout = broker.timeout
        if broker.user is not None:
            client.username_pw_set(broker.user, self._password())
        if broker.tls:
            self._tls = Tls(*map(self.around.file, (broker.ca, broker.certificate, broker.key)))
            client.tls_set_context(self._tls.context)
        if broker.will:
            client.will_set(broker.will, b"down", qos=1, retain=True)
        return client

    def _name(self) -> str:
        told = repr(
            (self.broker, self.name, str(self.around.folder.resolve()), os.uname().nodename)
        )
        return self.broker.client or f"evertwin-{hashlib.sha256(told.encode()).hexdigest()[:16]}"

    def _password(self) -> str | None:
        file = self.around.file(self.broker.password_file)
        return password(f"source {self.name!r}", self.broker.password_env, file)
