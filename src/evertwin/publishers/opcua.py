"""What a twin says, as an OPC UA server: variables that can be read and watched, never written.

Below ``Objects / NAME``: for each output an object with ``measured``, ``predicted``, ``residual``,
``sigma`` and ``mark``, stamped as the row is; ``condition``, ``stale`` and ``event`` beside them;
``life.COMPONENT`` with ``low``, ``median`` and ``high`` (80 %) in ``unit`` once lives are told.
The server has a thread and an event loop of its own: loading its address space takes a second. With
a security policy a session is opened for certificates of the trust folder alone.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import math
import threading
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from evertwin.errors import needs
from evertwin.publishers.contract import About, Ask, News
from evertwin.publishers.lasting import lasting
from evertwin.publishers.opcua_spec import OpcuaOutSettings
from evertwin.publishers.uncollected import uncollected
from evertwin.trust import why_not

with needs("live", "asyncua"):
    from asyncua import Server, ua
    from asyncua.crypto.permission_rules import User, UserRole
    from asyncua.server.internal_server import InternalServer
    from asyncua.server.user_managers import UserManager

LOG = logging.getLogger("evertwin.live")
SPACE = "urn:evertwin:twin"
"""Namespace of the variables."""
COLUMNS = ("measured", "predicted", "residual", "sigma")
WAITING = 100
"""Messages that wait at most; beyond, the newest rows win."""
CHUNKS, BYTES = 64, 1 << 20
"""Largest message of a client, in chunks and in bytes."""


class _Sessions(InternalServer):  # type: ignore[misc]
    """Sessions end with their connection: who has lost one opens another. The library would give a
    session to whoever names its number, and numbers can be guessed."""

    def lookup_external_session(self, auth_token: Any) -> None:
        """None is found."""


class _Trusted(UserManager):  # type: ignore[misc]
    """Who may open a session: the owner of a certificate that is trusted, on its own channel."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get_user(self, iserver: Any, username: Any = None, password: Any = None,
                 certificate: bytes | None = None) -> User | None:  # fmt: skip
        """A reader, or nobody."""
        if certificate is None or why_not(certificate, self._folder):
            return None
        return User(role=UserRole.User)


class OpcuaOut:
    """Implements `Publisher`.

    >>> OpcuaOut.__name__
    'OpcuaOut'
    """

    def __init__(self, settings: OpcuaOutSettings, about: About, ask: Ask) -> None:
        self.settings = settings
        self._twin, self._outputs = about.name, [name for name, _ in about.outputs]
        self._counts: Counter[str] = Counter()
        self._state, self._reason = "connecting", ""
        self._news: asyncio.Queue[News] | None = None
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._nodes: dict[tuple[str, str], Any] = {}
        self._folder: Any = None
        self._space = 0
        self._thread = threading.Thread(target=self._run, name=f"opcua {about.name}", daemon=True)

    @property
    def health(self) -> Mapping[str, Any]:
        """See `Publisher`."""
        told = {"protocol": "opcua", "state": self._state, "reason": self._reason}
        return told | dict(self._counts)

    def open(self) -> None:
        """See `Publisher`."""
        self._thread.start()

    def publish(self, news: News) -> None:
        """See `Publisher`."""
        if self._state == "up":
            self._loop.call_soon_threadsafe(self._put, news)
        else:
            self._counts["dropped"] += 1

    async def close(self) -> None:
        """See `Publisher`."""
        if self._thread.is_alive():
            with suppress(RuntimeError):  # it has ended meanwhile
                self._loop.call_soon_threadsafe(self._ended.set)
            await asyncio.to_thread(self._thread.join, 10.0)
            gc.unfreeze()  # its address space is garbage now

    # ------------------------------------------------------------------ in its own thread

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        except (OSError, ValueError) as error:  # the port, or a file that is no certificate
            self._state, self._reason = "down", str(error)
            LOG.warning("%s: opcua: down: %s", self._twin, error)
        finally:
            self._loop.close()

    def _put(self, news: News) -> None:
        assert self._news is not None
        if self._news.qsize() >= WAITING:
            self._news.get_nowait()
            self._counts["dropped"] += 1
        self._news.put_nowait(news)

    async def _serve(self) -> None:
        secure = self.settings.security != "none"
        owners = _Trusted(Path(self.settings.trust)) if secure else None
        server = Server(_Sessions(user_manager=owners))
        server.iserver.allow_remote_admin = False
        if secure:
            await server.load_certificate(self.settings.certificate)
            await server.load_private_key(self.settings.key)
        with uncollected():
            await server.init()
        server.set_endpoint(f"opc.tcp://{self.settings.host}:{self.settings.port}/evertwin")
        server.set_server_name(f"evertwin {self._twin}")
        server.set_identity_tokens([ua.AnonymousIdentityToken])  # the certificate says who it is
        policy = f"{self.settings.security}_SignAndEncrypt" if secure else "NoSecurity"
        server.set_security_policy([ua.SecurityPolicyType[policy]])
        server.limits.max_chunk_count, server.limits.max_message_size = CHUNKS, BYTES
        await self._variables(server)
        self._news = asyncio.Queue()
        async with server:
            self._state = "up"
            LOG.info("%s: opcua: up", self._twin)
            while not self._ended.is_set():
                taking = asyncio.create_task(self._news.get())
                ending = asyncio.create_task(self._ended.wait())
                done, left = await asyncio.wait(
                    {taking, ending}, return_when=asyncio.FIRST_COMPLETED
                )
                for task in left:
                    task.cancel()
                if taking in done:
                    await self._told(taking.result())
        self._state = "closed"

    async def _variables(self, server: Server) -> None:
        self._space = await server.register_namespace(SPACE)
        own = ua.NodeId(self._twin, self._space)
        self._folder = await server.nodes.objects.add_object(own, self._twin)
        for output in self._outputs:
            await self._part(output, dict.fromkeys(COLUMNS, math.nan) | {"mark": 0})
        await self._part("", {"condition": "check", "stale": True, "event": ""})

    async def _part(self, name: str, firsts: Mapping[str, Any]) -> None:
        """An object with its variables; without a name those of the twin itself."""
        space, folder, path = self._space, self._folder, self._twin
        if name:
            path = f"{path}.{name}"
            folder = await folder.add_object(ua.NodeId(path, space), f"{space}:{name}")
        for column, first in firsts.items():
            self._nodes[name, column] = await folder.add_variable(
                ua.NodeId(f"{path}.{column}", space), f"{space}:{column}", first
            )

    async def _told(self, news: News) -> None:
        content = news.content
        if news.kind == "rows":
            when = datetime.fromtimestamp(content["t"][-1] * 1e-9, UTC)
            for output, columns in content["outputs"].items():
                for column in COLUMNS:
                    value = columns[column][-1]
                    await self._write(output, column, math.nan if value is None else value, when)
                await self._write(output, "mark", int(columns["mark"][-1]), when)
        elif news.kind == "health":
            await self._write("", "condition", str(content["condition"]))
            await self._write("", "stale", bool(content["stale"]))
        elif news.kind == "events":
            newest = content["events"][-1]
            await self._write("", "event", f"{newest['kind']}: {newest['reason']}")
        elif news.kind == "life":
            for component, one in content["components"].items():
                told = lasting(one["life"]) | {"unit": one["life"].get("unit", "")}
                name = f"life.{component}"
                if (name, "unit") not in self._nodes:
                    await self._part(name, told)
                for column, value in told.items():
                    await self._write(name, column, value)
        self._counts["sent"] += 1

    async def _write(
        self, output: str, column: str, value: object, when: datetime | None = None
    ) -> None:
        missing = isinstance(value, float) and math.isnan(value)
        status = ua.StatusCodes.BadNoData if missing else ua.StatusCodes.Good
        told = ua.DataValue(
            ua.Variant(value), ua.StatusCode(status),
            SourceTimestamp=when or datetime.now(UTC), ServerTimestamp=datetime.now(UTC),
        )  # fmt: skip
        await self._nodes[output, column].write_value(told)
