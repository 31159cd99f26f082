"""The machine's values as OPC UA variables: ``Objects/arm/q1`` and so on, read only.

Each is a Double with the machine's stamp as its source time stamp; ``seq`` and ``t`` stand beside
them, and where a sensor gives nothing the value is Bad.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta

from asyncua import Server, ua

from evertwin.worlds.live.voices.cable import Address

NAMESPACE = "urn:evertwin:machine"
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class OpcUaServer:
    """Shows the newest sample; ``public``: the address that clients use.

    >>> OpcUaServer("arm", ("q1",), ("127.0.0.1", 4840)).url
    'opc.tcp://127.0.0.1:4840/arm'
    """

    def __init__(self, name: str, values: tuple[str, ...], public: Address) -> None:
        self.name, self._names = name, ("seq", "t", *values)
        self.url = f"opc.tcp://{public[0]}:{public[1]}/{name}"
        self._nodes: dict[str, ua.NodeId] = {}
        self._server = Server()

    async def open(self, near: Address) -> None:
        """Listens on an address of its own, told to clients as the public one."""
        logging.getLogger("asyncua").setLevel(logging.ERROR)
        server = self._server
        await server.init()
        server.set_endpoint(self.url)
        server.socket_address = near
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        space = await server.register_namespace(NAMESPACE)
        place = ua.NodeId(self.name, space)
        owner = await server.nodes.objects.add_object(place, ua.QualifiedName(self.name, space))
        for name in self._names:
            node = ua.NodeId(f"{self.name}.{name}", space)
            await owner.add_variable(node, ua.QualifiedName(name, space), 0.0)
            self._nodes[name] = node
        await server.start()

    async def say(self, columns: Mapping[str, float | Sequence[float]]) -> None:
        """A newer sample."""
        t = columns["t"]
        assert isinstance(t, float)
        stamp = EPOCH + timedelta(microseconds=round(t * 1e6))
        for name, node in self._nodes.items():
            value = columns[name]
            assert not isinstance(value, Sequence)
            bad = math.isnan(value)
            shown = ua.DataValue(
                None if bad else ua.Variant(float(value), ua.VariantType.Double),
                ua.StatusCode(ua.StatusCodes.BadSensorFailure if bad else ua.StatusCodes.Good),
                SourceTimestamp=stamp,
            )
            await self._server.write_attribute_value(node, shown)

    async def close(self) -> None:
        """Listens no more."""
        await self._server.stop()
