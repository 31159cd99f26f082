"""What a twin says, over MQTT; and answers to questions.

``TOPIC/NAME/online`` is ``1`` while the twin is there; the broker sets it to ``0`` when the line
ends without a goodbye. Rows go with QoS 0: the next ones come soon; events and answers with QoS 1,
health and lives are retained.
"""

from __future__ import annotations

import asyncio
import json
import logging
import sys
from collections import Counter
from collections.abc import Mapping
from typing import Any

from evertwin.errors import DataError, EvertwinError, naming, needs, reason_of
from evertwin.publishers.contract import About, Ask, Kind, News
from evertwin.publishers.mqtt_spec import MqttOutSettings
from evertwin.trust import Tls

with needs("live", "paho-mqtt"):
    import paho.mqtt.client as paho
    from paho.mqtt.enums import CallbackAPIVersion

LOG = logging.getLogger("evertwin.live")
QOS = {"rows": 0, "events": 1, "health": 1, "life": 1}
WAITING = 1000
"""Messages that wait for a broker at most."""
LARGEST = 65_536
"""Bytes of a question."""
KINDS: tuple[Kind, ...] = ("whatif", "forecast", "life")
OPEN = 4
"""Questions that wait at most."""


class MqttOut:
    """Implements `Publisher`; nothing that comes in but questions is listened to.

    >>> MqttOut.__name__
    'MqttOut'
    """

    def __init__(self, settings: MqttOutSettings, about: About, ask: Ask) -> None:
        self.settings = settings
        self._base = f"{settings.topic}/{about.name}"
        self._ask = ask
        self._counts: Counter[str] = Counter()
        self._state, self._reason = "connecting", ""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._tls: Tls | None = None
        self._open: set[asyncio.Task[None]] = set()
        client = paho.Client(
            CallbackAPIVersion.VERSION2, client_id=f"evertwin-{about.name}-out", clean_session=True
        )
        client.max_queued_messages_set(WAITING)
        client.will_set(f"{self._base}/online", "0", qos=1, retain=True)
        client.reconnect_delay_set(1, 30)
        if settings.user:
            client.username_pw_set(settings.user, settings.password or None)
        client.on_connect, client.on_disconnect = self._connected, self._disconnected
        client.on_connect_fail, client.on_message = self._failed, self._message
        self._client = client

    @property
    def health(self) -> Mapping[str, Any]:
        """See `Publisher`."""
        told = {"protocol": "mqtt", "state": self._state, "reason": self._reason}
        return told | dict(self._counts)

    def open(self) -> None:
        """See `Publisher`."""
        self._loop = asyncio.get_running_loop()
        authority = self.settings.authority
        if authority:
            with naming("publisher mqtt: authority, certificate", OSError, DataError):
                self._tls = Tls(authority, self.settings.certificate or None)
            self._client.tls_set_context(self._tls.context)
        self._client.connect_async(self.settings.host, self.settings.port, keepalive=20)
        self._client.loop_start()

    def publish(self, news: News) -> None:
        """See `Publisher`."""
        if self._state != "up" and news.kind == "rows":
            self._counts["dropped"] += 1
            return
        text = json.dumps(news.content, allow_nan=False, separators=(",", ":"))
        self._send(news.kind, text, QOS[news.kind], keep=news.kind in ("health", "life"))

    def _send(self, topic: str, text: str, qos: int, *, keep: bool = False) -> None:
        sent = self._client.publish(f"{self._base}/{topic}", text, qos=qos, retain=keep)
        refused = sent.rc not in (paho.MQTT_ERR_SUCCESS, paho.MQTT_ERR_NO_CONN)
        self._counts["dropped" if refused else "sent"] += 1

    async def close(self) -> None:
        """See `Publisher`."""
        for task in self._open:
            task.cancel()
        if self._state == "up":
            self._client.publish(f"{self._base}/online", "0", qos=1, retain=True)
        self._state = "closed"
        self._client.disconnect()
        await asyncio.to_thread(self._client.loop_stop)

    # ------------------------------------------------------------------ in paho's thread

    def _connected(self, client: paho.Client, _: Any, __: Any, code: Any, ___: Any) -> None:
        if code.is_failure:
            self._state, self._reason = "down", str(code)
            LOG.warning("%s: mqtt: %s", self._base, code)
            return
        self._state, self._reason = "up", ""
        if self._tls is not None:
            self._tls.why = ""
        LOG.info("%s: mqtt: up", self._base)
        client.publish(f"{self._base}/online", "1", qos=1, retain=True)
        if self.settings.questions:
            client.subscribe(f"{self._base}/ask", qos=1)

    def _failed(self, client: paho.Client, _: Any) -> None:
        """Called while the error is handled that says why."""
        error = sys.exc_info()[1]
        reason = "no line to the broker" if error is None else reason_of(error)
        if (self._state, self._reason) != ("down", reason):
            LOG.warning("%s: mqtt: down: %s", self._base, reason)
        self._state, self._reason = "down", reason

    def _disconnected(self, client: paho.Client, _: Any, __: Any, code: Any, ___: Any) -> None:
        reason = self._tls.why if self._tls is not None and self._tls.why else str(code)
        if self._state == "closed" or (self._state, self._reason) == ("down", reason):
            return
        self._state, self._reason = "down", reason
        LOG.warning("%s: mqtt: down: %s", self._base, reason)

    def _message(self, client: paho.Client, _: Any, message: paho.MQTTMessage) -> None:
        if self._loop is not None and not message.retain and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._asked, bytes(message.payload))

    # ------------------------------------------------------------------ in the event loop

    def _asked(self, payload: bytes) -> None:
        if len(payload) > LARGEST or len(self._open) >= OPEN:
            self._counts["refused"] += 1
            return
        task = asyncio.create_task(self._answer(payload))
        self._open.add(task)
        task.add_done_callback(self._open.discard)

    async def _answer(self, payload: bytes) -> None:
        """``{"id": …, "whatif": {…}}`` (or forecast, life) is answered with its id."""
        question: Any = None
        try:
            question = json.loads(payload)
            asked = [k for k in KINDS if isinstance(question, dict) and k in question]
            if len(asked) != 1 or not isinstance(question[asked[0]], dict):
                raise TypeError("one table, not " + (" and ".join(asked) or "none"))
            kind = asked[0]
            told: dict[str, Any] = {"answer": await self._ask(kind, question[kind])}
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            self._counts["refused"] += 1
            told = {"error": f"expected id, and a table whatif, forecast or life: {error}"}
        except EvertwinError as error:
            told = {"error": str(error)}
        number = question.get("id") if isinstance(question, dict) else None
        told["id"] = number if isinstance(number, str | int) else None
        self._counts["answered"] += 1
        self._send("answer", json.dumps(told, allow_nan=False), 1)
