"""The robot speaks MQTT, to a broker that is there or to one that it brings."""

from __future__ import annotations

from collections.abc import Sequence

from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.control import LOOPBACK
from evertwin.worlds.live.voices.broker import OwnBroker
from evertwin.worlds.live.voices.cable import Address, Cable
from evertwin.worlds.live.voices.mqtt import MqttPublisher


class RobotVoice:
    """What the robot says to the ``broker``, of all ``topics`` or these; ``own``: it is started
    here.

    >>> RobotVoice(("127.0.0.1", 1883), None, own=True).cables
    {}
    """

    def __init__(self, broker: Address, topics: Sequence[str] | None, *, own: bool) -> None:
        self._address, self._topics = broker, topics
        self._own = OwnBroker(broker) if own else None
        self.cables: dict[str, Cable] = {}
        self._publisher = MqttPublisher("robot")

    async def open(self) -> dict[str, str]:
        if self._own is not None:
            await self._own.open()
        cable = self.cables["mqtt"] = Cable((LOOPBACK, 0), self._address)
        self._publisher.open(await cable.open())
        return {"mqtt": f"{self._address[0]}:{self._address[1]}"}

    async def say(self, sample: Sample) -> None:
        if self._topics is None or sample.topic in self._topics:
            self._publisher.say(sample.topic, sample.columns)

    async def close(self) -> None:
        self._publisher.close()
        for cable in self.cables.values():
            await cable.close()
        if self._own is not None:
            await self._own.close()
