"""One connection to a broker, driven by the event loop, and what is heard there."""

from __future__ import annotations

import asyncio
import ssl
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from difflib import SequenceMatcher
from typing import TYPE_CHECKING, Any, NamedTuple

from evertwin.sources.foreign import load
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.mqtt.spec import MqttSettings
from evertwin.trust import Tls

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

LISTEN = 3.0
"""Seconds in which topics are heard."""
FEW = 8
"""Topics that are named in a sentence."""
OLDER = "a broker that speaks MQTT 3.1.1 alone is asked by version = 3"
"""What to do where MQTT 5 is not understood."""


class Heard(NamedTuple):
    """What a broker sends to whoever asks for all.

    >>> Heard(Counter({"a": 30, "cell/cart": 1}), {}, 20).like(["cell/kart"])
    'cell/cart, a'
    """

    topics: Counter[str]
    """Messages of each."""
    newest: dict[str, bytes]
    """The newest message of each."""
    inflight: int | None
    """Messages that the broker sends at most before they are acknowledged; None: not told (3.1)."""

    def like(self, wanted: Iterable[str]) -> str:
        """The topics in words, first those that are spelt most like one that was expected."""
        asked = list(wanted)
        alike = {one: max(SequenceMatcher(None, one, name).ratio() for name in asked)
                 for one in self.topics}  # fmt: skip
        names, more = sorted(alike, key=lambda one: -alike[one]), len(self.topics) - FEW
        return ", ".join(names[:FEW]) + (f" and {more} more" if more > 0 else "")


async def heard(client: Client, broker: MqttSettings, tls: Tls | None, seconds: float) -> Heard:
    """Listens to all topics for some seconds; ``client`` has a name of its own.

    Raises:
        LineDown, OSError, TimeoutError: the broker is not there, or refuses.
    """
    line, topics, newest = Connection(client, tls), Counter[str](), dict[str, bytes]()
    try:
        await line.connect(broker, ["#"])
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while True:
                    message = await line.next()
                    line.client.ack(message.mid, message.qos)
                    topics[message.topic] += 1
                    newest[message.topic] = bytes(message.payload)
    finally:
        line.close()
    return Heard(topics, newest, line.inflight if broker.version == 5 else None)


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
        try:
            async with asyncio.timeout(broker.timeout):
                kept = await self._connected(broker, topics, more)
        except TimeoutError:
            if broker.version == 5 and self._socket is not None and self._answer.cancelled():
                raise LineDown(f"no answer to MQTT 5 in time: {OLDER}") from None
            raise
        return kept

    async def _connected(
        self, broker: MqttSettings, topics: list[str], more: dict[str, Any]
    ) -> bool:  # fmt: skip
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
            older = broker.version == 5 and ("closed" in reason or "protocol version" in reason)
            raise LineDown(f"the broker refuses: {reason}{f'; {OLDER}' if older else ''}")
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
