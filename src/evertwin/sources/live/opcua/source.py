"""OPC UA: variables of a server, by subscription, with the source's own time stamps.

Namespaces are found by their URI with every connection; a lost line is left, and the subscription
made anew. A value that the server calls Bad is an error of measurement, as a sentinel is, and its
row says so; one that it calls Uncertain is used and counted. A queue that overflowed at the server
is a loss with its cause. Nothing here writes.

>>> Opcua.settings.__name__
'OpcuaSettings'
"""

from __future__ import annotations

import asyncio
import calendar
import logging
import math
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import suppress
from datetime import datetime
from typing import TYPE_CHECKING, Any

from evertwin.errors import UsageError, reason_of
from evertwin.sources.foreign import load
from evertwin.sources.live.contract import UNCERTAIN, Around
from evertwin.sources.live.decode import BAD, PROTOCOL, Columns, Raw
from evertwin.sources.live.line import DOWN, Line, LineDown
from evertwin.sources.live.opcua.groups import Groups, Passed
from evertwin.sources.live.opcua.spec import OpcuaSettings
from evertwin.sources.live.secrets import password
from evertwin.sources.spec import SourceSpec
from evertwin.trust import why_not

if TYPE_CHECKING:
    from asyncua import Client
    from asyncua.common.subscription import Subscription

QUEUE = 100
"""Values of a node that the server keeps between two reports."""
LARGEST = 1 << 22
"""Bytes of the largest message; the library's own default is no limit."""
UNREAD = "the server's queue overflowed: this process did not read for a while"
STALLED, STALLED_PERIODS = 1.0, 10.0
"""Seconds, and periods, without a look at what came: the server's queue may be full by then."""
CATCHES_UP = 3.0
"""Seconds in which what waited has come."""
OVERFLOW = 0x480
"""Bits of a status that say: values before this one are gone."""


class Opcua(Line):
    """The source. Implements `LiveSource`. See the module for an example."""

    settings = OpcuaSettings

    def __init__(self, settings: OpcuaSettings, spec: SourceSpec, around: Around) -> None:
        super().__init__(settings, spec, around)
        self.server = settings
        self.around = around
        self._pace = Passed()
        self._caught_up = -math.inf
        """Until when reports may be gone, because nobody read them for a while."""
        if self.decoder.time is not None and self.decoder.time not in settings.nodes:
            self.decoder.by_protocol = True

    def open(self) -> None:
        """See `LiveSource`."""
        super().open()
        load("asyncua", "live")
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # a line here says it once
        lacking = [name for name in self.decoder.names if name not in self.server.nodes]
        if lacking:
            raise UsageError(
                f"source {self.name!r}: [twin.source.nodes] lack {', '.join(lacking)}: give each "
                "column of the twin file its node"
            )
        self._password()

    async def session(self) -> AsyncIterator[Columns]:
        """One connection."""
        asyncua = load("asyncua", "live")
        errors = (asyncua.ua.UaError, ConnectionError, asyncio.TimeoutError)
        client: Client = asyncua.Client(self.server.url, timeout=self.server.timeout)
        client.max_messagesize = LARGEST
        client.max_chunkcount = LARGEST >> 16
        try:
            try:
                await self.connect(client)
                changes = await self._subscribe(client)
                async for columns in self._samples(client, changes):
                    yield columns
            except errors as error:
                raise LineDown(reason_of(error)) from None
            finally:
                with suppress(*errors, asyncio.CancelledError):
                    async with asyncio.timeout(self.server.timeout):
                        await client.disconnect()
        finally:
            client.disconnect_socket()

    async def connect(self, client: Client) -> None:
        """Connects, as user and securely where that is said."""
        server = self.server
        if server.user is not None:
            client.set_user(server.user)
            client.set_password(self._password() or "")
        async with asyncio.timeout(3 * server.timeout):
            if server.security != "none":
                await self._secure(client)
            await client.connect()

    async def _secure(self, client: Client) -> None:
        """Signed and encrypted, with a server whose certificate lies in the trust folder."""
        policies = load("asyncua.crypto.security_policies", "live")
        policy = getattr(policies, f"SecurityPolicy{self.server.security}")
        endpoints = await client.connect_and_get_server_endpoints()
        shown = {e.ServerCertificate for e in endpoints if e.SecurityPolicyUri == policy.URI}
        if not shown:
            raise LineDown(f"the server has no endpoint with {self.server.security}")
        trust = self.around.file(self.server.trust)
        assert trust is not None
        why = {one: why_not(one, trust) for one in sorted(shown)}
        found = [one for one, reason in why.items() if not reason]
        if not found:
            raise LineDown(f"the server: {next(iter(why.values()))}")
        own = (str(self.around.file(one)) for one in (self.server.certificate, self.server.key))
        await client.set_security(policy, *own, server_certificate=found[0])

    async def _subscribe(self, client: Client) -> tuple[Subscription, dict[Any, str]]:
        """The subscription, and which node is which column."""
        ua = load("asyncua.ua", "live")
        spaces: dict[str, int] = {}
        nodes: dict[Any, str] = {}
        for column in self._columns():
            node = self.server.node(self.server.nodes[column])
            uri, _, rest = node.removeprefix("nsu=").rpartition(";")
            if uri and uri not in spaces:
                try:
                    spaces[uri] = await client.get_namespace_index(uri)
                except ValueError:
                    raise LineDown(f"the server has no namespace {uri!r}") from None
            nodes[ua.NodeId.from_string(f"ns={spaces[uri]};{rest}" if uri else rest)] = column
        period = self.server.period * 1e3
        changes = await client.create_subscription(period, queue_maxsize=QUEUE * len(nodes) + 1000)
        requests = [_item(ua, node, k, period) for k, node in enumerate(nodes, start=1)]
        given = await changes.create_monitored_items(requests)
        for status, (node, column) in zip(given, nodes.items(), strict=True):
            if isinstance(status, ua.StatusCode):
                raise LineDown(f"{column}: the server refuses {node.to_string()}: {status.name}")
        return changes, nodes

    def _columns(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(self.decoder.names))

    async def _samples(
        self, client: Client, changes: tuple[Subscription, dict[Any, str]]
    ) -> AsyncIterator[Columns]:
        subscription, nodes = changes
        groups = Groups(self._columns(), round(self.server.together * 1e9))
        settle = 2.0 * self.server.period + 0.05
        before = checked = time.monotonic()
        while True:
            event = await subscription.next_event(self.server.period)
            now = time.monotonic()
            if now - before > max(STALLED, STALLED_PERIODS * self.server.period):
                groups.doubt(await self._unchanged(client, nodes, groups))
                self._caught_up = now + CATCHES_UP
            elif groups.firm != set(groups.names) and now > self._caught_up:
                groups.believe()
            before = now
            if event is not None:
                checked = now
                data = getattr(event, "data", None)
                if data is None:
                    raise LineDown(f"the server ends it: {event.notification.Status.name}")
                column = nodes[event.node.nodeid]
                value, stamp = self._value(column, data.monitored_item.Value)
                groups.put(column, value, stamp, now)
            elif now > checked + self.server.timeout:
                checked = now
                async with asyncio.timeout(self.server.timeout):
                    await client.check_connection()
                    await client.nodes.server_state.read_value()
            for stamp, columns in groups.take(now, settle):
                self._gap(self._pace.since(stamp, now), doubted=now <= self._caught_up)
                yield {**columns, PROTOCOL: stamp}

    async def _unchanged(
        self, client: Client, nodes: Mapping[Any, str], groups: Groups
    ) -> list[str]:
        """Columns that have the source stamp still that was reported last."""
        ua = load("asyncua.ua", "live")
        asked = [client.get_node(node) for node in nodes]
        async with asyncio.timeout(self.server.timeout):
            said = await client.uaclient.read_attributes(
                [one.nodeid for one in asked], ua.AttributeIds.Value
            )
        return [
            column for column, one in zip(nodes.values(), said, strict=True)
            if groups.stamps.get(column) == nanoseconds(one.SourceTimestamp or one.ServerTimestamp)
        ]  # fmt: skip

    def _gap(self, missing: int, *, doubted: bool) -> None:
        """Counts samples that a server made and that never came."""
        if self._left is not None:
            if self._pace.known:  # a clock that was set meanwhile says nothing of samples
                self._left = None
                self.told.lose(DOWN, min(missing, self._pace.room))
            else:
                self.lost_since(self.server.period)
        elif doubted and missing:
            self.told.lose(UNREAD, missing)

    def _value(self, column: str, said: Any) -> tuple[Raw, int]:
        status = said.StatusCode_.value if hasattr(said, "StatusCode_") else said.StatusCode.value
        if status & OVERFLOW == OVERFLOW:
            self.told.lose("the server's queue overflowed")
        quality = status >> 30
        if quality == 1:
            self.told.note(f"{column}{UNCERTAIN}")
        value = None if said.Value is None else said.Value.Value
        if quality >= 2:
            self.told.note(f"{column}: bad")
            value = BAD
        if isinstance(value, list | tuple | bytes) or not isinstance(value, Raw | None):
            value = None
        return value, nanoseconds(said.SourceTimestamp or said.ServerTimestamp)

    def _password(self) -> str | None:
        file = self.around.file(self.server.password_file)
        return password(f"source {self.name!r}", self.server.password_env, file)


def nanoseconds(stamp: datetime | None) -> int:
    """A time stamp of OPC UA, which is UTC; now, where there is none.

    >>> nanoseconds(datetime(1970, 1, 2, microsecond=5))
    86400000005000
    """
    if stamp is None:
        return time.time_ns()
    return calendar.timegm(stamp.utctimetuple()) * 10**9 + stamp.microsecond * 1000


def _item(ua: Any, node: Any, handle: int, period: float) -> Any:
    """Reports of one node: each new time stamp, also of a value that stays."""
    mode = ua.DataChangeFilter(Trigger=ua.DataChangeTrigger.StatusValueTimestamp)
    wanted = ua.MonitoringParameters(
        ClientHandle=handle, SamplingInterval=period, Filter=mode, QueueSize=QUEUE,
        DiscardOldest=True,
    )  # fmt: skip
    return ua.MonitoredItemCreateRequest(
        ItemToMonitor=ua.ReadValueId(NodeId=node, AttributeId=ua.AttributeIds.Value),
        MonitoringMode=ua.MonitoringMode.Reporting, RequestedParameters=wanted,
    )  # fmt: skip
