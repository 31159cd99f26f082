"""The page's own process: static files, the way to the service, orders to embedded machines.

>>> Machines({}, lambda where, line: "").names
()
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles

from evertwin.errors import EvertwinError, UsageError
from evertwin.page.door import COOKIE, Door
from evertwin.page.relay import Relay

YEAR = 365 * 86_400


@dataclass(frozen=True)
class Machines:
    """Embedded machines that can be told something. See the module for an example."""

    where: Mapping[str, str]
    """Name → HOST:PORT of its orders."""
    tell: Callable[[str, str], str]
    """The answer of a machine to a line."""

    @property
    def names(self) -> tuple[str, ...]:
        """In order."""
        return tuple(self.where)

    async def told(self, request: Request) -> Response:
        """One order from the page, or what the machine knows."""
        name = request.path_params["name"]
        if name not in self.where:
            return JSONResponse({"error": f"no machine {name!r}"}, 404)
        line = "?"
        if request.method == "POST":
            said = await request.json()
            line = str(said.get("orders", "")) if isinstance(said, dict) else ""
        try:
            answer = await asyncio.to_thread(self.tell, self.where[name], line.replace("\n", " "))
        except EvertwinError as error:
            return JSONResponse({"error": str(error)}, 400)
        return JSONResponse({"answer": answer})


def create_page(relay: Relay, door: Door, machines: Machines) -> Starlette:
    """The application, without what guards it."""

    async def about(request: Request) -> Response:
        may = door.may_order(request.headers)
        return JSONResponse({"machines": machines.names, "may_order": may})

    async def enter(request: Request) -> Response:
        if not door.knows(request.query_params.get("key", "")):
            return JSONResponse({"error": "this link holds no longer: start the page anew"}, 403)
        answer = RedirectResponse("/", 303)
        secure = request.url.scheme == "https"
        answer.set_cookie(
            COOKIE, door.key, max_age=YEAR, httponly=True, samesite="strict", secure=secure
        )
        return answer

    async def first(request: Request) -> Response:
        path = files("evertwin.page").joinpath("static", "index.html")
        return Response(path.read_bytes(), media_type="text/html")

    static = StaticFiles(directory=str(files("evertwin.page").joinpath("static")))
    return Starlette(routes=[
        Route("/", first), Route("/enter", enter), Route("/page", about),
        Route("/machines/{name}", machines.told, methods=["GET", "POST"]),
        WebSocketRoute("/api/v1/stream", relay.pass_on),
        Route("/api/v1/{path:path}", relay.ask, methods=["GET", "POST"]),
        Mount("/static", static),
    ])  # fmt: skip


def run_page(
    relay: Relay, door: Door, machines: Machines, port: int, say: Callable[[str], None]
) -> None:
    """Serves until SIGTERM or Ctrl-C.

    Raises:
        UsageError: the port cannot be taken.
    """
    line = socket.socket()
    line.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        line.bind(("127.0.0.1", port))
    except OSError as error:
        line.close()
        raise UsageError(f"port {port}: {error.strerror}: choose another with --port") from error
    at = f"http://127.0.0.1:{line.getsockname()[1]}"
    say(at)
    say(f"to order, open: {at}/enter?key={door.key}")
    config = uvicorn.Config(
        door.guarded(create_page(relay, door, machines)), ws="websockets-sansio", lifespan="off",
        log_config=None, access_log=False, server_header=False, ws_max_size=4096,
        timeout_graceful_shutdown=1,
    )  # fmt: skip
    uvicorn.Server(config).run(sockets=[line])


def token_of(file: Path) -> str:
    """The token in a file.

    Raises:
        UsageError: it is not there or cannot be read.
    """
    try:
        return file.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(
            f"--token-file {file}: {error}: 'evertwin serve' prints where it keeps its token"
        ) from error
