"""Rows and events as they come, over one socket.

Events have a cursor, the position in the log: who comes back with it misses none and gets none
twice. Rows are for looking at: a slow reader gets the newest and is told how many messages it
missed.

    {"type": "events", "twin": "robot", "events": [...], "cursor": 812}
    {"type": "rows", "twin": "robot", "rows": {...}, "missed": 0}
    {"type": "alive", "twins": [{"name": "robot", "state": "running", ...}]}

>>> cursors("robot:812,arm:0")
{'robot': 812, 'arm': 0}
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect

from evertwin.errors import StoreError, UsageError
from evertwin.service.http.guard import PREFIX
from evertwin.service.http.strict_json import encoded
from evertwin.service.service import Service
from evertwin.service.twin.runner import Runner

ALIVE = 5.0
"""Seconds of silence; then something is sent, and the token is looked at again."""
SLOW = 30.0
"""Seconds that one message may take to get away."""
PAGE = 200
"""Events of one message."""


def cursors(text: str) -> dict[str, int]:
    """Twin → position, as in ``robot:812,arm:0``.

    Raises:
        UsageError: it says something else.
    """
    found = {}
    for part in filter(None, text.split(",")):
        name, _, number = part.rpartition(":")
        if not name or not number.isdigit() or len(number) > 18:
            raise UsageError(f"after: expected twin:number, got {part[:80]!r}")
        found[name] = int(number)
    return found


async def stream(socket: WebSocket, service: Service) -> None:
    """Serves one socket until either side ends it."""
    names = socket.query_params.getlist("twin") or list(service.runners)
    try:
        after = cursors(socket.query_params.get("after", ""))
    except UsageError as error:
        await socket.close(4400, str(error))
        return
    if unknown := [name for name in names if name not in service.runners]:
        await socket.close(4404, f"no twin {unknown[0][:80]!r}")
        return
    offered = [one for one in socket.scope["subprotocols"] if one.startswith(PREFIX)]
    await socket.accept(offered[0] if offered else None)
    reading = asyncio.create_task(_until_gone(socket))
    news = asyncio.Event()
    service.process.listeners.add(news)
    try:
        with contextlib.suppress(TimeoutError, WebSocketDisconnect):
            await _Reader(socket, service, after).serve(names, news, reading)
    finally:
        service.process.listeners.discard(news)
        reading.cancel()


async def _until_gone(socket: WebSocket) -> None:
    """What a reader says is not listened to."""
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            await socket.receive_text()


class _Reader:
    """How far one socket is."""

    def __init__(self, socket: WebSocket, service: Service, after: Mapping[str, int]) -> None:
        self._socket, self._service = socket, service
        self._after = dict(after)
        self._at: dict[str, tuple[Runner, int]] = {}

    async def serve(
        self, names: list[str], news: asyncio.Event, reading: asyncio.Task[None]
    ) -> None:
        """Sends what is new until the reader is gone or its token is no longer one."""
        await self._alive(names)
        while not reading.done():
            news.clear()
            for name in names:
                if name in self._service.runners:
                    await self._tell(self._service.runners[name])
            waiting = asyncio.create_task(news.wait())
            done, _ = await asyncio.wait(
                {waiting, reading}, timeout=ALIVE, return_when=asyncio.FIRST_COMPLETED
            )
            waiting.cancel()
            if not self._socket.scope["state"]["still"]():
                await self._socket.close(4401, "the token is no longer known")
                return
            if not done:
                await self._alive(names)

    async def _tell(self, runner: Runner) -> None:
        after = self._after.get(runner.name)
        if after is None:  # who names no cursor gets what comes from now on
            after = self._after[runner.name] = runner.events[-1][0] if runner.events else 0
        with contextlib.suppress(StoreError):  # no store yet, or none that can be read
            while runner.events and runner.events[-1][0] > self._after[runner.name]:
                await self._events(runner)
        known, serial = self._at.get(runner.name, (runner, runner.serial))
        serial = serial if known is runner else 0
        for number, rows in [one for one in runner.rows if one[0] > serial]:
            if number <= serial:
                continue
            oldest = runner.rows[0][0]
            if oldest > serial + 1 and number < runner.serial:
                number, rows = runner.rows[-1]  # too slow: the newest only
            await self._send({"type": "rows", "twin": runner.name, "rows": rows,
                              "missed": number - serial - 1})  # fmt: skip
            serial = number
        self._at[runner.name] = runner, serial

    async def _events(self, runner: Runner) -> None:
        found = await asyncio.to_thread(runner.events_after, self._after[runner.name], PAGE)
        if not found:
            self._after[runner.name] = runner.events[-1][0]
            return
        self._after[runner.name] = found[-1][0]
        events = [event for _, event in found]
        await self._send({"type": "events", "twin": runner.name, "events": events,
                          "cursor": found[-1][0]})  # fmt: skip

    async def _alive(self, names: list[str]) -> None:
        runners = (self._service.runners.get(name) for name in names)
        told = [one.status() for one in runners if one is not None]
        await self._send({"type": "alive", "twins": told})

    async def _send(self, message: Mapping[str, Any]) -> None:
        text = encoded(message).decode()
        await asyncio.wait_for(self._socket.send_text(text), SLOW)
