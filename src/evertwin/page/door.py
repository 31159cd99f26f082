"""What stands before every request to the page: name, origin, who may order, and what a browser may
load.

Who opens the page may look. Who came by the link that the command prints has a cookie and may also
order; the link follows from the token, so it holds as long as the token does.

>>> door = Door("secret", ("hall.example",))
>>> door.calls("hall.example:8701"), door.calls("evil.example"), door.knows(door.key)
(True, False, True)
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from starlette.responses import JSONResponse

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "evertwin"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""No inline script, no inline style, no evaluation of text, nothing from elsewhere."""
HEADERS = (
    (b"content-security-policy", POLICY.encode()), (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"), (b"cache-control", b"no-cache"),
    (b"cross-origin-opener-policy", b"same-origin"),
)  # fmt: skip
ASKS = ("/whatif", "/forecast")
"""Questions that are posted and change nothing."""


class Door:
    """Who may come in. See the module for an example."""

    def __init__(self, token: str, hosts: tuple[str, ...] = ()) -> None:
        self.key = hmac.new(token.encode(), b"evertwin page", hashlib.sha256).hexdigest()[:40]
        """What the link and the cookie hold."""
        self._hosts = {"localhost", *(host.lower() for host in hosts)}

    def calls(self, host: str) -> bool:
        """Is it a name of this page? Another one is a page that had its name rebound."""
        try:
            name = (urlsplit(f"//{host}").hostname or "").lower()
        except ValueError:
            return False
        try:
            return ipaddress.ip_address(name).is_loopback
        except ValueError:
            return name in self._hosts

    def knows(self, key: str) -> bool:
        """Is it the key?"""
        return hmac.compare_digest(key.encode(), self.key.encode())

    def may_order(self, headers: Mapping[str, str]) -> bool:
        """Has the browser the cookie?"""
        try:
            told = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        return COOKIE in told and self.knows(told[COOKIE].value)

    def guarded(self, app: ASGIApp) -> ASGIApp:
        """The application behind this door."""

        async def inside(scope: Scope, receive: Receive, send: Send) -> None:
            if scope["type"] not in ("http", "websocket"):
                return await app(scope, receive, send)
            headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
            refused = self._refused(scope, headers)
            if not refused:
                return await app(scope, receive, _with_headers(send))
            if scope["type"] == "websocket":
                await receive()
                return await send({"type": "websocket.close", "code": 4403, "reason": refused})
            status = 401 if refused.startswith("sign in") else 403
            await JSONResponse({"error": refused}, status)(scope, receive, _with_headers(send))

        return inside

    def _refused(self, scope: Scope, headers: Mapping[str, str]) -> str:
        """Why it goes no further; empty where it does."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self.calls(host):
            return "host: not a name of this page: start it with --host NAME"
        if origin is not None and origin.partition("://")[2] != host:
            return "origin: a page of others may not ask"
        if scope["type"] == "websocket" or scope["method"] in ("GET", "HEAD"):
            return "" if scope["type"] == "http" or origin is not None else "origin: expected one"
        if scope["path"].endswith(ASKS) or self.may_order(headers):
            return ""
        return "sign in to order: open the link that 'evertwin page' has printed"


def _with_headers(send: Send) -> Send:
    async def sends(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *HEADERS]}
        await send(message)

    return sends
