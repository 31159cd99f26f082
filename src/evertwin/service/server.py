"""The process of ``evertwin serve``: one event loop, the HTTP server, signals."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from evertwin.errors import ConfigError, UsageError
from evertwin.service.http.api import create_app
from evertwin.service.http.guard import TOKEN, Guard
from evertwin.service.service import Service

LOG = logging.getLogger("evertwin.service")
SWITCH = 0.001
"""Seconds that a thread with work may keep the others from running; Python's own is 5 ms."""


class _Patient(H11Protocol):
    """Closes connections that have not said what they want in time, and those of an address that
    has half of all: what one does others do not feel."""

    late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        if self._crowded():
            transport.close()
            return
        self.late = self.loop.call_later(self.config.timeout_graceful_shutdown or 10, self._cut)

    def _crowded(self) -> bool:
        most, mine = max((self.config.limit_concurrency or 0) / 2.0, 1.0), self.client
        hosts = (getattr(one, "client", None) for one in self.connections)
        return mine is not None and sum(h is not None and h[0] == mine[0] for h in hosts) > most

    def _cut(self) -> None:
        if self.cycle is None and not self.transport.is_closing():
            self.transport.close()

    def handle_websocket_upgrade(self, event: Any) -> None:
        if self.late is not None:
            self.late.cancel()
        super().handle_websocket_upgrade(event)


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Signals belong to the service."""
        yield


async def serve(path: Path, say: Callable[[str], None]) -> None:
    """Runs the service of a site file until SIGTERM or SIGINT; SIGHUP reloads.

    Args:
        path: the site file.
        say: is told where the service is reached.

    Raises:
        ConfigError: the site file does not say what it must.
        UsageError: the address cannot be taken.
    """
    sys.setswitchinterval(SWITCH)
    service = Service(path)
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    guard = Guard(create_app(service), service)
    line = _bound(service)
    server = _Server(_config(service, guard))
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, ended.set)
    reloads: set[asyncio.Task[None]] = set()

    def reload() -> None:
        task = loop.create_task(_reloaded(service))
        reloads.add(task)
        task.add_done_callback(reloads.discard)

    loop.add_signal_handler(signal.SIGHUP, reload)
    serving = asyncio.create_task(server.serve([line]))
    http = service.site.spec.http
    scheme, (host, port) = "https" if http.certificate else "http", line.getsockname()[:2]
    shown = f"[{host}]" if ":" in host else host
    address = f"{scheme}://{shown}:{port}"
    if service.tending is not None:
        service.tending.address = address
    say(address)
    if not http.user:
        say(f"token: {service.site.store / TOKEN}")
    starting = asyncio.create_task(service.start())
    ending = asyncio.create_task(ended.wait())
    await asyncio.wait({ending, serving}, return_when=asyncio.FIRST_COMPLETED)
    starting.cancel()
    await service.stop()
    server.should_exit = True
    await serving


async def _reloaded(service: Service) -> None:
    with contextlib.suppress(ConfigError):  # told in the log, and in the status
        await service.reload()


def _bound(service: Service) -> socket.socket:
    http = service.site.spec.http
    family = socket.AF_INET6 if ":" in http.address else socket.AF_INET
    line = socket.socket(family, socket.SOCK_STREAM)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        line.bind((http.address, http.port))
        line.listen(http.connections)
    except OSError as error:
        line.close()
        raise UsageError(f"{http.address}:{http.port}: {error.strerror}: choose another") from error
    return line


def _config(service: Service, app: Any) -> uvicorn.Config:
    http, folder = service.site.spec.http, service.site.folder
    secured: dict[str, Any] = {}
    if http.certificate:
        files = {"ssl_certfile": folder / http.certificate, "ssl_keyfile": folder / http.key}
        for key, file in files.items():
            if not file.is_file():
                raise ConfigError(f"[http] {key.removeprefix('ssl_')}: {file}: no such file")
            secured[key] = str(file)
    return uvicorn.Config(
        app, http=_Patient, ws="websockets-sansio", lifespan="off", log_config=None,
        access_log=False, server_header=False, limit_concurrency=http.connections, ws_max_size=4096,
        h11_max_incomplete_event_size=16_384, timeout_keep_alive=int(max(http.timeout, 1.0)),
        timeout_graceful_shutdown=int(max(http.timeout, 1.0)), **secured,
    )  # fmt: skip
