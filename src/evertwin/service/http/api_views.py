"""What somebody who looks asks for: the past by pixel, what a machine looks like, the log.

>>> MOST
10000
"""

from __future__ import annotations

import asyncio
import dataclasses
import ipaddress
import socket
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

from fastapi import FastAPI, HTTPException, Query
from pydantic import BaseModel, ConfigDict, Field

from evertwin.errors import UsageError, reason_of
from evertwin.service.http.strict_json import StrictJSON
from evertwin.service.service import Service
from evertwin.service.twin.questions import LONG, beside
from evertwin.service.twin.runner import Runner
from evertwin.service.views.history import WIDEST, Span, Stored, looked_back
from evertwin.service.views.new_machine import Machine, added, kinds
from evertwin.service.views.tuning_choice import engineered
from evertwin.service.views.version_comparison import Pair, compared
from evertwin.sources.live import registry as sources
from evertwin.sources.live.contract import Around
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.look import look

MOST = 10_000
"""Rows, samples or events of one answer."""
PATIENCE = 60.0
"""Seconds that an answer may take."""
Count = Annotated[int, Query(ge=1, le=MOST)]
Width = Annotated[int, Query(ge=1, le=WIDEST)]


class Look(BaseModel):
    """A machine that somebody wants to add.

    >>> Look(protocol="modbus", host="127.0.0.1", port=502).url
    ''
    """

    model_config = ConfigDict(extra="forbid")
    protocol: Literal["modbus", "mqtt", "opcua"]
    host: str = Field(default="127.0.0.1", max_length=255)
    port: int = Field(default=0, ge=0, le=65535)
    url: str = Field(default="", max_length=255)
    """OPC UA: where its server is."""
    device: int = Field(default=1, ge=0, le=255)
    """Modbus: the unit behind the address."""


def found_at(service: Service, name: str) -> Runner:
    """One twin; 404 where there is none of this name."""
    try:
        return service.runner(name)
    except UsageError as error:
        raise HTTPException(404, str(error)) from error


async def in_time(work: Any, patience: float = PATIENCE) -> StrictJSON:
    """What comes of it; 503 where it takes too long."""
    try:
        return StrictJSON(await asyncio.wait_for(work, patience))
    except TimeoutError as error:
        raise HTTPException(503, f"no answer within {patience:g} s: the twin is busy") from error


def looks(app: FastAPI, service: Service) -> None:
    """Adds the routes."""
    busy = asyncio.Semaphore(1)
    """One look at a machine after the other."""

    @app.get("/api/v1/twins/{name}/history")
    async def history(
        name: str, first: float, last: float, width: Width = 800,
        signal: Annotated[Sequence[str], Query(max_length=64)] = (),
    ) -> StrictJSON:  # fmt: skip
        """A span of time [s] in ``width`` pixels: least and largest value of each, by signal."""
        runner = found_at(service, name)
        return await in_time(_history(runner, Span.of(first, last, width), signal))

    @app.get("/api/v1/twins/{name}/scene")
    async def scene(name: str) -> StrictJSON:
        """What its machine looks like: the joints of an arm, or the pose of a base."""
        return await in_time(found_at(service, name).ask(lambda work: work.scene))

    @app.get("/api/v1/twins/{name}/engineering")
    async def engineering(name: str) -> StrictJSON:
        """What is tuned, how often and why: breakdown, criticality, sensitivity, schedule."""
        return await in_time(beside(found_at(service, name), engineered), LONG)

    @app.get("/api/v1/twins/{name}/compare")
    async def compare(
        name: str, a: Annotated[int, Query(ge=0)], b: Annotated[int, Query(ge=0)], signal: str
    ) -> StrictJSON:
        """Two versions over the newest rows: one output on one axis, every output run by run."""
        job = partial(compared, pair=Pair(a, b, signal))
        return await in_time(beside(found_at(service, name), job), LONG)

    @app.get("/api/v1/log")
    async def log(after: Annotated[int, Query(ge=0)] = 0) -> list[dict[str, object]]:
        """The newest lines of the service's log behind a number."""
        return service.log.after(after)

    @app.post("/api/v1/look")
    async def looked(at: Look) -> dict[str, list[str]]:
        """What a machine says that no twin file knows yet, decoded side by side."""
        async with busy:
            return {"lines": await _look(at)}

    @app.get("/api/v1/kinds")
    async def known() -> Mapping[str, Any]:
        """Models that a machine may be added with, and the names and units that each takes."""
        return await asyncio.to_thread(kinds)

    @app.post("/api/v1/draft")
    async def draft(asked: Machine) -> Mapping[str, Any]:
        """A machine is sampled for some seconds: its twin file, its entry in the site file, and how
        far the twin is off. Nothing is kept."""
        host = urlsplit(asked.url).hostname if asked.protocol == "opcua" else asked.host
        await _allowed(host)
        async with busy:
            return await added(asked)


async def _history(runner: Runner, span: Span, signals: Sequence[str]) -> Mapping[str, Any]:
    view, model = await runner.ask(
        lambda work: (work.between(span.first, span.last), work.twin.model)
    )
    known = model.outputs.names
    if unknown := [one for one in signals if one not in known]:
        raise HTTPException(404, f"no signal {unknown[0]!r}; there are {', '.join(known)}")
    sources = () if runner.plan.spec is None else runner.plan.spec.source
    stored = Stored(runner.reader, sources)
    return await asyncio.to_thread(looked_back, stored, view, model, span, signals or known)


def may_be_asked(host: str) -> bool:
    """May a machine have this address? Link-local ones are those of a cloud's own services.

    >>> may_be_asked("127.0.0.1"), may_be_asked("169.254.169.254"), may_be_asked("fe80::1")
    (True, False, False)
    """
    found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    named = [ipaddress.ip_address(str(one[4][0]).partition("%")[0]) for one in found]
    plain = [getattr(one, "ipv4_mapped", None) or one for one in named]
    return not any(one.is_link_local or one.is_multicast or one.is_unspecified for one in plain)


async def _allowed(host: str | None) -> None:
    try:
        allowed = bool(host) and await asyncio.to_thread(may_be_asked, str(host))
    except OSError as error:
        raise HTTPException(502, f"host: {reason_of(error)}") from error
    if not allowed:
        raise HTTPException(400, "host: expected one that a machine may have")


async def _look(at: Look) -> list[str]:
    form = sources.settings_of(at.protocol)
    given: dict[str, Any] = at.model_dump(exclude={"protocol"}, exclude_defaults=True)
    named = {field.name for field in dataclasses.fields(form)}
    chosen = {name: value for name, value in given.items() if name in named}
    host = urlsplit(at.url).hostname if at.url else at.host
    try:
        await _allowed(host)
        settings = form(source="look", protocol=at.protocol, **chosen)
        return await look(settings, Around())
    except (LineDown, OSError, TimeoutError) as error:
        raise HTTPException(502, f"{at.protocol}: {reason_of(error)}") from error
