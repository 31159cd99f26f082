"""Questions and the socket, passed on to the service with its token.

A browser that reads slowly slows its own socket alone: the service then gives it the newest and
says how much it missed.

>>> Relay("https://hall.example:8700/", "secret").stream
'wss://hall.example:8700/api/v1/stream'
"""

from __future__ import annotations

import asyncio
import contextlib

import httpx
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake

PATIENCE = 125.0
"""Seconds that an answer may take."""
GONE = "the service does not answer"
LARGEST = 32 * 2**20
"""Bytes of a message."""


class Relay:
    """The way to one service. See the module for an example."""

    def __init__(self, service: str, token: str, verify: str | bool = True) -> None:
        """``verify``: file with the certificates that are trusted, beside those of the system."""
        self._service = service.rstrip("/")
        self._headers = {"Authorization": f"Bearer {token}"}
        self._client = httpx.AsyncClient(verify=verify, timeout=PATIENCE, trust_env=False)

    @property
    def stream(self) -> str:
        """Address of the socket."""
        return f"ws{self._service.removeprefix('http')}/api/v1/stream"

    async def ask(self, request: Request) -> Response:
        """One question; 503 where the service is not there."""
        headers = {**self._headers, "Content-Type": "application/json"}
        try:
            answer = await self._client.request(
                request.method, f"{self._service}{request.url.path}", headers=headers,
                params=httpx.QueryParams(request.url.query), content=await request.body(),
            )  # fmt: skip
        except httpx.TransportError:
            return JSONResponse({"error": GONE}, 503)
        kind = answer.headers.get("content-type", "application/json")
        return Response(answer.content, answer.status_code, media_type=kind)

    async def pass_on(self, socket: WebSocket) -> None:
        """One socket, until either side ends it."""
        await socket.accept()
        query = socket.url.query
        where = f"{self.stream}?{query}" if query else self.stream
        try:
            async with connect(
                where, additional_headers=self._headers, max_size=LARGEST, max_queue=4, proxy=None
            ) as line:
                await self._pump(line, socket)
        except (OSError, InvalidHandshake, ConnectionClosed, TimeoutError):
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await socket.close(1013, GONE)

    async def _pump(self, line: ClientConnection, socket: WebSocket) -> None:
        gone = asyncio.create_task(_until_gone(socket))
        sends = asyncio.create_task(_send(line, socket))
        done, left = await asyncio.wait({gone, sends}, return_when=asyncio.FIRST_COMPLETED)
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)
        for task in done:
            with contextlib.suppress(WebSocketDisconnect):
                task.result()


async def _send(line: ClientConnection, socket: WebSocket) -> None:
    async for message in line:
        await socket.send_text(message if isinstance(message, str) else message.decode())
    raise TimeoutError(GONE)


async def _until_gone(socket: WebSocket) -> None:
    """What a browser says is not listened to."""
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            await socket.receive_text()
