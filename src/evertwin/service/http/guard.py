"""What stands before every request: name, origin, pace, token, role, size and time.

Reading needs the role ``read``, everything else ``operate``; only ``/-/healthy`` and ``/-/ready``,
which say nothing else, need none. There are no cookies: a web page of others has nothing that a
browser would send along.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starlette.responses import JSONResponse

from evertwin.service.http.access import PATIENCE, Keys, Pace, may_be_called, may_come_from
from evertwin.service.service import Service

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

OPEN = ("/-/healthy", "/-/ready")
HEADERS = (
    (b"cache-control", b"no-store"), (b"x-content-type-options", b"nosniff"),
    (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'"),
    (b"referrer-policy", b"no-referrer"),
)  # fmt: skip
PREFIX = "bearer."
TOKEN = "token"
"""File of the token, in the store's folder."""


class Refused(Exception):
    """A request that goes no further.

    >>> Refused(401, "token").status
    401
    """

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


class Guard:
    """The outermost part of the application.

    >>> Guard.__name__
    'Guard'
    """

    def __init__(self, app: ASGIApp, service: Service) -> None:
        self._app = app
        self._service = service
        self._of: object = None
        self.site_changed()

    def site_changed(self) -> None:
        """Takes users and paces from the site as it is now."""
        site = self._service.site
        if self._of is not site:
            self._of = site
            site.store.mkdir(parents=True, exist_ok=True)
            self._keys = Keys.of_site(site.spec.http, site.store / TOKEN)
            self._pace = Pace(site.spec.http.rate)
            self._wrong = Pace(PATIENCE / 60.0, 60.0)

    @property
    def token_file(self) -> Path:
        """Where the token lies."""
        return self._service.site.store / TOKEN

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Lets it through, or says why not."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        self.site_changed()
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        try:
            user = self._checked(scope, headers)
        except Refused as error:
            await _refuse(scope, receive, send, error)
            return
        scope["state"] = {**scope.get("state", {}), "user": user, "still": self._still(headers)}
        if scope["type"] == "websocket":
            await self._app(scope, receive, send)
            return
        http = self._service.site.spec.http
        try:
            body = await asyncio.wait_for(_whole(receive, headers, http.body), http.timeout)
        except TimeoutError:
            await _refuse(scope, receive, send, Refused(408, "the request did not come whole"))
            return
        except Refused as error:
            await _refuse(scope, receive, send, error)
            return
        await self._app(scope, _again(body, receive), _with_headers(send))

    def _checked(self, scope: Scope, headers: Mapping[str, str]) -> str:
        """The user's name.

        Raises:
            Refused: with the reason.
        """
        http, path = self._service.site.spec.http, str(scope["path"])
        client = scope.get("client")
        who = client[0] if client else ""
        host, origin = headers.get("host", ""), headers.get("origin")
        if not may_be_called(http, host):
            raise Refused(421, "host: not a name of this service: add it to [http] hosts")
        if origin is not None and not may_come_from(http, origin, host):
            raise Refused(403, "origin: not listed in [http] origins")
        if not self._pace.takes(who):
            raise Refused(429, "too many requests")
        if path in OPEN and scope["type"] == "http":
            return ""
        token = _token(headers)
        found = self._keys.of(token)
        if found is None:
            if token and not self._wrong.takes(who):
                raise Refused(429, "too many wrong tokens")
            raise Refused(401, "expected Authorization: Bearer TOKEN")
        reads = scope["type"] == "websocket" or scope["method"] in ("GET", "HEAD")
        asks = path.endswith(("/whatif", "/forecast"))
        if found[1] == "read" and not reads and not asks:
            raise Refused(403, f"{found[0]} may only read")
        return found[0]

    def _still(self, headers: Mapping[str, str]) -> Any:
        """Whether the token of an open socket is still one."""
        token = _token(headers)

        def still() -> bool:
            self.site_changed()
            return self._keys.of(token) is not None

        return still


def _token(headers: Mapping[str, str]) -> str:
    """As a header, or (browsers cannot send one with a socket) as a protocol of the socket."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return token.strip()
    offered = headers.get("sec-websocket-protocol", "").split(",")
    found = (one.strip() for one in offered if one.strip().startswith(PREFIX))
    return next(found, PREFIX).removeprefix(PREFIX)


async def _whole(receive: Receive, headers: Mapping[str, str], most: int) -> bytes:
    """The body, of at most so many bytes."""
    told = headers.get("content-length", "0")
    if headers.get("content-encoding", "identity") != "identity":
        raise Refused(415, "content-encoding: send it as it is")
    if not told.isdigit() or int(told) > most:
        raise Refused(413, f"body: at most {most} bytes")
    body, more = b"", True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise Refused(400, "disconnected")
        body += message.get("body", b"")
        more = message.get("more_body", False)
        if len(body) > most:
            raise Refused(413, f"body: at most {most} bytes")
    return body


def _again(body: bytes, receive: Receive) -> Receive:
    """The body once more, then what comes after it."""
    given = False

    async def again() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again


def _with_headers(send: Send) -> Send:
    async def sends(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *HEADERS]}
        await send(message)

    return sends


async def _refuse(scope: Scope, receive: Receive, send: Send, error: Refused) -> None:
    if scope["type"] == "websocket":
        await receive()
        code = 4403 if error.status in (403, 421) else 4401 if error.status == 401 else 4429
        await send({"type": "websocket.close", "code": code, "reason": error.reason})
        return
    head = {"connection": "close"} | ({"www-authenticate": "Bearer"} if error.status == 401 else {})
    told = JSONResponse({"error": error.reason}, error.status, head)
    await told(scope, receive, _with_headers(send))
