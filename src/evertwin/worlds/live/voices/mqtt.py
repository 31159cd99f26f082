"""The machine's samples as JSON to an MQTT broker, QoS 1: topic ``robot/pose`` and so on.

>>> message({"t": 0.5, "seq": 3, "x": float("nan"), "y": 1.0}, session="a1")
'{"session":"a1","t":0.5,"seq":3,"x":null,"y":1.0}'
"""

from __future__ import annotations

import json
import math
import secrets
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress

from paho.mqtt.client import Client, MQTTMessageInfo
from paho.mqtt.enums import CallbackAPIVersion

from evertwin.worlds.live.voices.cable import Address

WAITING = 10_000
"""Messages that wait for the broker at most; then the oldest are lost."""
AGAIN = 0.05
"""Seconds in which what was under way when the line broke is sent again, before all others."""
LAST = 1.0
"""Seconds that the last message may take."""


def message(columns: Mapping[str, float | Sequence[float]], session: str) -> str:
    """One sample; what no sensor gave is null. ``session``: drawn anew when the machine starts."""
    plain = {
        name: None if isinstance(value, float) and math.isnan(value) else value
        for name, value in columns.items()
    }
    return json.dumps({"session": session, **plain}, separators=(",", ":"))


class MqttPublisher:
    """Publishes for the machine ``name``.

    >>> MqttPublisher("robot").name
    'robot'
    """

    def __init__(self, name: str) -> None:
        self.name, self.session = name, secrets.token_hex(4)
        self._client = Client(
            CallbackAPIVersion.VERSION2, client_id=f"{name}-{self.session}", clean_session=True
        )
        self._client.max_queued_messages_set(WAITING)
        self._client.reconnect_delay_set(1, 5)
        self._client.on_connect = self._connected
        self._client.on_disconnect = self._cut
        self._since = math.inf
        self._waiting: deque[tuple[str, str]] = deque(maxlen=WAITING)
        self._newest: MQTTMessageInfo | None = None

    def open(self, broker: Address) -> None:
        """Connects, and connects again, in a thread of its own."""
        self._client.connect_async(*broker, keepalive=10)
        self._client.loop_start()

    def _connected(self, *_: object) -> None:
        self._since = time.monotonic()

    def _cut(self, *_: object) -> None:
        self._since = math.inf

    def say(self, topic: str, columns: Mapping[str, float | Sequence[float]]) -> None:
        """Sends one sample; it waits while there is no broker, and none overtakes another."""
        self._waiting.append((f"{self.name}/{topic}", message(columns, self.session)))
        if time.monotonic() > self._since + AGAIN:
            self._send()

    def _send(self) -> None:
        while self._waiting:
            topic, content = self._waiting.popleft()
            self._newest = self._client.publish(topic, content, qos=1)

    def close(self) -> None:
        """Sends what waits, and lets go."""
        if self._client.is_connected():
            self._send()
            if self._newest is not None:
                with suppress(RuntimeError, ValueError):  # not taken: nothing to wait for
                    self._newest.wait_for_publish(LAST)
        self._client.disconnect()
        self._client.loop_stop()
