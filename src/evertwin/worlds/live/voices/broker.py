"""An MQTT broker for a machine that has none: amqtt, which pip installs, in this process."""

from __future__ import annotations

import logging

from amqtt.broker import Broker
from amqtt.contexts import BrokerConfig, ListenerConfig

from evertwin.worlds.live.voices.cable import Address


class OwnBroker:
    """Anonymous, on one address.

    >>> OwnBroker(("127.0.0.1", 1883)).near
    ('127.0.0.1', 1883)
    """

    def __init__(self, near: Address) -> None:
        self.near = near
        self._broker: Broker | None = None

    async def open(self) -> None:
        """Listens."""
        for name in ("amqtt", "transitions"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        listener = ListenerConfig(bind=f"{self.near[0]}:{self.near[1]}")
        allow = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
        self._broker = Broker(BrokerConfig(listeners={"default": listener}, plugins=allow))
        await self._broker.start()

    async def close(self) -> None:
        """Listens no more."""
        if self._broker is not None:
            await self._broker.shutdown()
