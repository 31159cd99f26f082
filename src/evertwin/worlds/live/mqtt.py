"""The machine's samples as JSON to an MQTT broker, QoS 1: topic ``robot/pose`` and so on.

>>> message({"t": 0.5, "seq": 3, "x": float("nan"), "y": 1.0}, session="a1")
'{"session":"a1","t":0.5,"seq":3,"x":null,"y":1.0}'
"""

from __future__ import annotations

import json
import math
import secrets
from collections.abc import Mapping, Sequence

from paho.mqtt.client import Client, MQTTMessageInfo
from paho.mqtt.enums import CallbackAPIVersion

from evertwin.worlds.live.cable import Address

WAITING = 10_000
"""Messages that wait for the broker at most; then the oldest are not sent again."""


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

    def open(self, broker: Address) -> None:
        """Connects, and connects again, in a thread of its own."""
        self._client.connect_async(*broker, keepalive=10)
        self._client.loop_start()

    def say(self, topic: str, columns: Mapping[str, float | Sequence[float]]) -> MQTTMessageInfo:
        """Sends one sample; it waits while there is no broker."""
        return self._client.publish(f"{self.name}/{topic}", message(columns, self.session), qos=1)

    def close(self) -> None:
        """Lets go."""
        self._client.disconnect()
        self._client.loop_stop()
