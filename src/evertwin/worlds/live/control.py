"""The line to a running machine: one line of orders in, one line of answer out, on loopback alone.

``payload=2 for=20`` is answered ``ok 12.3 payload=2`` (seconds of the machine's clock), or
``error`` with what was wrong; ``?`` with what the machine knows and what is turned, which ends with
an empty line.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from evertwin.errors import UsageError
from evertwin.worlds.live.contract import Machine

LOOPBACK = "127.0.0.1"
LONGEST = 4096
"""Bytes of a line of orders."""


class Control:
    """Listens for orders. ``told`` is called after each, with the machine's answer.

    >>> Control.__doc__.split(".")[0]
    'Listens for orders'
    """

    def __init__(self, machine: Machine, told: Callable[[], None]) -> None:
        self._machine, self._told = machine, told
        self._server: asyncio.Server | None = None

    async def open(self, port: int) -> int:
        """Listens; returns the port, which it chooses for 0."""
        self._server = await asyncio.start_server(self._serve, LOOPBACK, port, limit=LONGEST)
        return int(self._server.sockets[0].getsockname()[1])

    async def close(self) -> None:
        """Listens no more."""
        if self._server is not None:
            self._server.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while line := await reader.readline():
                writer.write(self._answer(line.decode(errors="replace").strip()).encode() + b"\n")
                await writer.drain()
        except (ConnectionError, ValueError):  # it left, or its line has no end
            pass
        finally:
            writer.close()

    def _answer(self, line: str) -> str:
        machine = self._machine
        if line == "?":
            turned = " ".join(f"{name}={value:g}" for name, value in machine.knobs.turned().items())
            return (
                f"{machine.name} at {machine.clock:.1f} s: {turned or 'as new'}\n{machine.knobs}\n"
            )
        try:
            done = machine.knobs.tell(line, machine.clock)
        except UsageError as error:
            return f"error {' '.join(str(error).split())}"
        self._told()
        return f"ok {machine.clock:.1f} {done}"
