"""A server on asyncua, in a process of its own: PORT CERTIFICATE KEY; told by its input.

A line ``n x quality`` writes both variables with one stamp. ``restart N`` starts a server anew,
with N namespaces registered before the machine's, so that its index moves.
"""

from __future__ import annotations

import asyncio
import sys
from datetime import UTC, datetime, timedelta
from typing import Any

from asyncua import Server, ua

START = datetime(2020, 1, 1, tzinfo=UTC)
CODES = {"good": 0, "uncertain": ua.StatusCodes.UncertainSensorNotAccurate,
         "bad": ua.StatusCodes.BadSensorFailure}  # fmt: skip


async def begin(port: str, certificate: str, key: str, spaces: int) -> tuple[Server, list[Any]]:
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/arm")
    await server.load_certificate(certificate)
    await server.load_private_key(key)
    kinds = ua.SecurityPolicyType
    server.set_security_policy([kinds.NoSecurity, kinds.Basic256Sha256_SignAndEncrypt])
    for k in range(spaces):
        await server.register_namespace(f"urn:other:{k}")
    space = await server.register_namespace("urn:arm")
    objects = server.nodes.objects
    nodes = [await objects.add_variable(ua.NodeId(name, space), name, 0.0) for name in "nx"]
    await server.start()
    return server, nodes


async def main(*where: str) -> None:
    server, nodes = await begin(*where, 0)
    loop = asyncio.get_running_loop()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        word, *rest = line.split()
        if word == "restart":
            await server.stop()
            server, nodes = await begin(*where, int(rest[0]))
            continue
        stamp = START + timedelta(milliseconds=10 * int(word))
        for node, number, code in zip(nodes, (word, rest[0]), ("good", rest[1]), strict=True):
            value = ua.Variant(float(number), ua.VariantType.Double)
            said = ua.DataValue(value, ua.StatusCode(CODES[code]), SourceTimestamp=stamp)
            await server.write_attribute_value(node.nodeid, said)


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
