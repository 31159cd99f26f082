"""The cable between a machine and who talks with it, which can be cut or go dead.

A relay on loopback. Cut: what is connected is thrown out and nobody gets in. Muted: connections
stand, and nothing comes through, as where a switch has lost its power; once it is back, what waited
comes late.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping

from evertwin.worlds.live.orders import Knob

PIECE = 65536
Address = tuple[str, int]


def cables(names: tuple[str, ...]) -> Mapping[str, Knob]:
    """The knobs of a machine's cables."""
    return {
        "cut": Knob("1: a cable is cut, nobody gets through", 0.0, 1.0, 0.0, names),
        "mute": Knob("1: connections stand, nothing comes through", 0.0, 1.0, 0.0, names),
    }


class Cable:
    """From the address ``near``, which others connect to, to the address ``far``.

    >>> Cable(("127.0.0.1", 0), ("127.0.0.1", 5020)).whole
    True
    """

    def __init__(self, near: Address, far: Address) -> None:
        self.near, self.far = near, far
        self.whole = True
        self._flowing = asyncio.Event()
        self._flowing.set()
        self._server: asyncio.Server | None = None
        self._ends: set[asyncio.StreamWriter] = set()

    async def open(self) -> Address:
        """Listens; returns where, the port chosen for 0.

        Raises:
            OSError: the address is taken or not there.
        """
        self._server = await asyncio.start_server(self._connected, *self.near)
        self.near = (self.near[0], int(self._server.sockets[0].getsockname()[1]))
        return self.near

    @property
    def muted(self) -> bool:
        """Does nothing come through?"""
        return not self._flowing.is_set()

    async def turn(self, *, cut: bool, mute: bool) -> None:
        """Cuts or mends it, mutes it or lets it speak."""
        if mute:
            self._flowing.clear()
        else:
            self._flowing.set()
        if self.whole == (not cut):
            return
        self.whole = not cut
        if cut:
            await self.close()
        else:
            await self.open()

    async def close(self) -> None:
        """Throws out who is connected; listens no more."""
        if self._server is not None:
            self._server.close()
        for end in tuple(self._ends):
            end.transport.abort()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            onward, back = await asyncio.open_connection(*self.far)
        except OSError:
            writer.close()
            return
        both = {writer, back}
        self._ends |= both
        ways = [self._carry(reader, back), self._carry(onward, writer)]
        _, open_ = await asyncio.wait(
            [asyncio.ensure_future(way) for way in ways], return_when=asyncio.FIRST_COMPLETED
        )
        for way in open_:
            way.cancel()
        for end in both:
            end.close()
        self._ends -= both

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while piece := await reader.read(PIECE):
                await self._flowing.wait()
                writer.write(piece)
                await writer.drain()
        except ConnectionError:
            pass  # one end has left: the other is let go as well
