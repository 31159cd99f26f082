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
import hashlib
import os
import ssl
import time
from collections import defaultdict
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.settings.notes import expand
from evertwin.sources.foreign import load
from evertwin.sources.live.contract import Around
from evertwin.sources.live.decode import Columns
from evertwin.sources.live.line import Line, LineDown
from evertwin.sources.live.mqtt_parts import Count, NoMessage, place
from evertwin.sources.live.mqtt_spec import MqttSettings, Part
from evertwin.sources.live.secrets import password
from evertwin.sources.spec import ArraySpec, SourceSpec
from evertwin.trust import Tls

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

FORGOTTEN = "the broker forgot the session: is its persistence on, its state saved at each change?"
FULL = "the broker's queue: raise its max_queued_messages (mosquitto: 1000)"
BEFORE = "before the broker: the publisher's own queue"

SETTLES = 60.0
"""Seconds after a connection in which a gap is what was lost while the line was down."""


class Mqtt(Line):
    """The source. Implements `LiveSource`. See the module for an example."""

    settings = MqttSettings
    arrays = True

    def __init__(
        self, settings: MqttSettings, spec: SourceSpec | ArraySpec, around: Around
    ) -> None:
        super().__init__(settings, spec)
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
                message = await line.next()
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

    def decode(self, columns: Columns) -> list[Chunk]:
        """See `Line`: what its messages are is kept until it is stored."""
        chunks = super().decode(columns)
        clock = self.decoder.clock
        if chunks:
            for chunk in chunks:
                self._given.setdefault(int(chunk.t[0]), [])
            self._given[int(chunks[-1].t[0])] += self._waiting
        elif clock.judged in self._given:
            self._given[clock.judged] += self._waiting  # given, and not stored yet
        elif clock.holds:
            return chunks
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
            return None
        if self.broker.sequence is not None:
            publisher = found[self.broker.publisher] if self.broker.publisher else None
            missing = self.count.missing(found[self.broker.sequence], publisher)
            if missing > 0:
                fresh = time.monotonic() < self._since + SETTLES
                self.told.lose(self._cause if fresh else BEFORE, missing)
                self._cause = BEFORE
        return {column: found[path] for path, column in paths.items()}

    def client(self) -> Client:
        """One that is not connected yet."""
        paho = load("paho.mqtt.client", "live")
        broker = self.broker
        old = {"clean_session": False} if broker.version == 3 else {}
        client: Client = paho.Client(
            paho.CallbackAPIVersion.VERSION2, client_id=self._name(), manual_ack=True,
            protocol=paho.MQTTv311 if broker.version == 3 else paho.MQTTv5,
            reconnect_on_failure=False, **old,
        )  # fmt: skip
        client.connect_timeout = broker.timeout
        if broker.user is not None:
            client.username_pw_set(broker.user, self._password())
        if broker.tls:
            self._tls = Tls(*map(self._file, (broker.ca, broker.certificate, broker.key)))
            client.tls_set_context(self._tls.context)
        if broker.will:
            client.will_set(broker.will, b"down", qos=1, retain=True)
        return client

    def _name(self) -> str:
        told = repr(
            (self.broker, self.name, str(self.around.folder.resolve()), os.uname().nodename)
        )
        return self.broker.client or f"evertwin-{hashlib.sha256(told.encode()).hexdigest()[:16]}"

    def _file(self, text: str | None) -> str | None:
        return None if text is None else str(self.around.folder / expand(text))

    def _password(self) -> str | None:
        broker = self.broker
        text = self._file(broker.password_file)
        file = None if text is None else Path(text)
        return password(f"source {self.name!r}", broker.password_env, file)


class Connection:
    """One connection of paho, driven by the event loop: no thread of its own.

    >>> hasattr(Connection, "next")
    True
    """

    def __init__(self, client: Client, tls: Tls | None = None) -> None:
        self.client = client
        self._tls = tls
        self._loop = asyncio.get_running_loop()
        self._inbox: asyncio.Queue[MQTTMessage | str] = asyncio.Queue()
        self._answer: asyncio.Future[tuple[bool, str]] = self._loop.create_future()
        self._granted: asyncio.Future[str] = self._loop.create_future()
        self.inflight = 65535
        """Messages that the broker sends at most before they are acknowledged."""
        self._socket: Any = None
        self._beat: asyncio.Task[None] | None = None
        client.on_connect = self._on_connect
        client.on_message = self._on_message
        client.on_disconnect = self._on_disconnect
        client.on_subscribe = self._on_subscribe
        client.on_socket_close = self._on_socket_close
        client.on_socket_register_write = self._on_register_write

    async def connect(self, broker: MqttSettings, topics: list[str]) -> bool:
        """Connects and subscribes; did the broker keep the session?

        Raises:
            LineDown, OSError, TimeoutError: it did not work.
        """
        more: dict[str, Any] = {}
        if broker.version == 5:
            properties = load("paho.mqtt.properties", "live")
            kinds = load("paho.mqtt.packettypes", "live")
            more["properties"] = properties.Properties(kinds.PacketTypes.CONNECT)
            more["properties"].SessionExpiryInterval = min(int(broker.session), 0xFFFFFFFE)
            more["clean_start"] = False
        async with asyncio.timeout(broker.timeout):
            await asyncio.to_thread(
                self.client.connect, broker.host, broker.port, broker.keepalive, **more
            )
            self._socket = self.client.socket()
            if self._socket is None:
                raise LineDown("the broker closed the line")
            self._loop.add_reader(self._socket, self._read)
            self._loop.add_writer(self._socket, self._write)
            self._beat = asyncio.create_task(self._beats())
            kept, reason = await self._answer
            if reason:
                raise LineDown(f"the broker refuses: {reason}")
            self.client.subscribe([(topic, 1) for topic in topics])
            refused = await self._granted
            if refused:
                raise LineDown(f"the broker refuses the subscription: {refused}")
        return kept

    async def next(self) -> MQTTMessage:
        """The next message.

        Raises:
            LineDown: there is no line any more.
        """
        message = await self._inbox.get()
        if isinstance(message, str):
            raise LineDown(message)
        return message

    def close(self) -> None:
        """Let go; the broker keeps the session."""
        if self._beat is not None:
            self._beat.cancel()
        for future in (self._answer, self._granted):
            future.cancel()
        self.client.disconnect()
        with suppress(OSError):
            self.client.loop_write()
        found = self.client.socket()
        if found is not None:
            self._on_socket_close(None, None, found)
            found.close()

    async def _beats(self) -> None:
        while True:
            await asyncio.sleep(1.0)
            self.client.loop_misc()

    def _read(self) -> None:
        line = self._socket
        self.client.loop_read()
        while isinstance(line, ssl.SSLSocket) and line is self._socket and line.pending():
            self.client.loop_read()

    def _write(self) -> None:
        line = self._socket
        self.client.loop_write()
        if line is not None and line is self._socket and not self.client.want_write():
            self._loop.remove_writer(line)

    def _on_register_write(self, _c: object, _u: object, line: Any) -> None:
        def register() -> None:
            if line is self._socket:
                self._loop.add_writer(line, self._write)

        self._loop.call_soon_threadsafe(register)

    def _on_socket_close(self, _c: object, _u: object, line: Any) -> None:
        if self._socket is not None and line.fileno() >= 0:
            self._loop.remove_reader(line)
            self._loop.remove_writer(line)
        self._socket = None

    def _on_connect(self, _c: object, _u: object, flags: Any, code: Any, told: Any) -> None:
        self.inflight = getattr(told, "ReceiveMaximum", self.inflight)
        if not self._answer.done():
            reason = str(code) if code.is_failure else ""
            self._answer.set_result((bool(flags.session_present), reason))

    def _on_subscribe(self, _c: object, _u: object, _mid: int, codes: Any, _p: object) -> None:
        refused = [str(code) for code in codes if code.is_failure]
        if not self._granted.done():
            self._granted.set_result("; ".join(refused))

    def _on_message(self, _c: object, _u: object, message: MQTTMessage) -> None:
        self._inbox.put_nowait(message)

    def _on_disconnect(self, _c: object, _u: object, _f: object, code: Any, _p: object) -> None:
        why = self._tls.why if self._tls is not None and self._tls.why else code
        reason = f"the broker closed the line ({why})"
        self._inbox.put_nowait(reason)
        if not self._answer.done():
            self._answer.set_result((False, reason))
        if not self._granted.done():
            self._granted.set_result(reason)
