"""How each machine speaks: its servers or its publisher, each behind a cable.

arm     ModbusServer ── Cable ── who asks        robot   MqttPublisher ── Cable ── broker
        OpcUaServer  ── Cable ── who asks
"""

from __future__ import annotations

import socket
from typing import Protocol

from evertwin.errors import UsageError
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.control import LOOPBACK
from evertwin.worlds.live.voices.cable import Address, Cable


def address(text: str) -> Address:
    """``HOST:PORT``.

    >>> address("127.0.0.1:5020")
    ('127.0.0.1', 5020)

    Raises:
        UsageError: it has another form.
    """
    host, sign, port = text.rpartition(":")
    if not host or not sign or not port.isdigit() or int(port) > 65535:
        raise UsageError(f"expected HOST:PORT, such as 127.0.0.1:5020, got {text!r}")
    return host, int(port)


def inside() -> Address:
    """An address on loopback that is free."""
    with socket.socket() as found:
        found.bind((LOOPBACK, 0))
        return LOOPBACK, int(found.getsockname()[1])


class Voice(Protocol):
    """What speaks for a machine.

    >>> hasattr(Voice, "say")
    True
    """

    cables: dict[str, Cable]

    async def open(self) -> dict[str, str]:
        """Listens or connects; returns what is reached where."""
        ...

    async def say(self, sample: Sample) -> None:
        """Publishes a sample, stamped by the wall."""
        ...

    async def close(self) -> None:
        """Falls silent."""
        ...
