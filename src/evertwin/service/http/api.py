"""What is asked over HTTP. Every answer is strict JSON: what is not a number is null."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from fastapi import Body, FastAPI, HTTPException, Query, Request, Response, WebSocket
from pydantic import BaseModel, ConfigDict, Field

from evertwin.errors import DataError, EvertwinError, NotYet, StoreError, UsageError
from evertwin.fold import plain
from evertwin.ledger.label import Label, Verdict
from evertwin.service.http.api_views import Count, found_at, in_time, looks
from evertwin.service.http.metrics import exposition
from evertwin.service.http.stream import stream
from evertwin.service.http.strict_json import StrictJSON
from evertwin.service.service import Service
from evertwin.service.twin.runner import Runner

SOON = 2.0
"""Seconds that a twin has to say how it is now."""
CODES = ((NotYet, 503), (UsageError, 400), (DataError, 409), (StoreError, 503))


class Order(BaseModel):
    """What an operator orders.

    >>> Order(order="pin", version=2, reason="to see").order
    'pin'
    """

    model_config = ConfigDict(extra="forbid")
    order: Literal["promote", "rollback", "pin", "unpin"]
    version: int | None = Field(default=None, ge=0)
    reason: str = Field(min_length=1, max_length=500)
    person: str = Field(default="", max_length=100)
    """Who says so, where the token belongs to nobody in particular."""


class Said(BaseModel):
    """What a person says to an event.

    >>> Said(event=7, verdict="false alarm", reason="the door was open").event
    7
    """

    model_config = ConfigDict(extra="forbid")
    event: int = Field(ge=1, le=2**53)
    """Its number in the log."""
    verdict: Verdict
    reason: str = Field(min_length=1, max_length=500)
    person: str = Field(default="", max_length=100)
    cause: str = Field(default="", max_length=100)
    """With the verdict cause: which one."""
    rows: tuple[int, int] | None = None
    """With the verdict faulty: the first and the last one; None: those of the event."""


def create_app(service: Service) -> FastAPI:
    """The application, without what guards it."""
    app = FastAPI(
        title="evertwin", docs_url=None, redoc_url=None, openapi_url="/api/v1/openapi.json",
        default_response_class=StrictJSON,
    )  # fmt: skip
    _errors(app)
    _health(app, service)
    _twins(app, service)
    _operate(app, service)
    looks(app, service)

    @app.websocket("/api/v1/stream")
    async def streamed(socket: WebSocket) -> None:
        await stream(socket, service)

    return app


def _errors(app: FastAPI) -> None:
    @app.exception_handler(EvertwinError)
    async def told(_: Request, error: EvertwinError) -> StrictJSON:
        status = next((code for kind, code in CODES if isinstance(error, kind)), 500)
        return StrictJSON({"error": str(error)}, status)


def _health(app: FastAPI, service: Service) -> None:
    @app.get("/-/healthy")
    async def healthy() -> dict[str, bool]:
        """The process is there and its loop runs."""
        return {"healthy": True}

    @app.get("/-/ready")
    async def ready(response: Response) -> dict[str, bool]:
        """Every twin runs or is in quarantine; 503 before and while the service stops."""
        response.status_code = 200 if service.ready else 503
        return {"ready": service.ready}

    @app.get("/api/v1/fleet")
    async def fleet() -> dict[str, Any]:
        """Nodes, and who has which twin: age of the lease, lag; 404 where this machine is alone."""
        if service.tending is None:
            raise HTTPException(404, "no fleet: the site file has no [fleet] store")
        return await service.tending.status()

    @app.get("/metrics")
    async def metrics() -> Response:
        """Figures for Prometheus."""
        return Response(exposition(service), media_type="text/plain; version=0.0.4; charset=utf-8")

    @app.get("/api/v1/status")
    async def status() -> StrictJSON:
        """The service: its twins, the lag of its loop, the newest error of a reload."""
        return StrictJSON(service.status())


def _twins(app: FastAPI, service: Service) -> None:
    @app.get("/api/v1/twins")
    async def twins() -> StrictJSON:
        """Every twin: state, condition, age, counts of its sources."""
        return StrictJSON([runner.status() for runner in service.runners.values()])

    @app.get("/api/v1/twins/{name}")
    async def twin(name: str) -> StrictJSON:
        """One twin: also its versions, parameters with intervals, and the open trial."""
        runner = found_at(service, name)
        about: Mapping[str, Any] = {} if runner.work is None else runner.work.about
        if runner.work is not None and runner.state == "running":
            with contextlib.suppress(TimeoutError):  # it is told as it was last
                about = await asyncio.wait_for(runner.ask(lambda work: work.looked_at()), SOON)
        return StrictJSON({**about, **runner.status(), "versions": about.get("versions", [])})

    @app.get("/api/v1/twins/{name}/life")
    async def life(name: str) -> StrictJSON:
        """How long the twin's components last, as ``evertwin life`` tells it."""
        return await in_time(found_at(service, name).answer("life", {}))

    @app.get("/api/v1/twins/{name}/rows")
    async def rows(name: str, last: Count = 1000, points: Count = 1000) -> StrictJSON:
        """The newest rows, thinned to so many points."""
        return await in_time(found_at(service, name).ask(lambda work: work.rows(last, points)))

    @app.get("/api/v1/twins/{name}/events")
    async def events(
        name: str, after: Annotated[int, Query(ge=0)] = 0, limit: Count = 1000,
        last: Count | None = None,
    ) -> StrictJSON:  # fmt: skip
        """What was decided behind a position of the log, and the position to ask from next;
        ``last``: the newest so many, of those that are at hand."""
        runner = found_at(service, name)
        if last is not None:
            newest = list(runner.events)[-last:]
            cursor = newest[-1][0] if newest else 0
            return StrictJSON({"events": [event for _, event in newest], "cursor": cursor})
        found = await asyncio.to_thread(runner.events_after, after, limit)
        cursor = found[-1][0] if found else after
        return StrictJSON({"events": [event for _, event in found], "cursor": cursor})

    @app.get("/api/v1/twins/{name}/samples")
    async def samples(
        name: str, source: str, first: float = -math.inf, last: float = math.inf,
        limit: Count = 1000,
    ) -> StrictJSON:  # fmt: skip
        """Samples of a source that are kept, stamped in [first, last] [s], in order of arrival."""
        runner = found_at(service, name)
        return StrictJSON(await asyncio.to_thread(_samples, runner, source, (first, last), limit))


def _samples(runner: Runner, source: str, span: tuple[float, float], limit: int) -> dict[str, Any]:
    spec = runner.plan.spec
    known = [one.name for one in spec.source + spec.array] if spec is not None else []
    if source not in known:
        raise HTTPException(404, f"no source {source!r}; there are {', '.join(known)}")
    if any(math.isnan(edge) for edge in span):
        raise HTTPException(422, "first, last: expected numbers")
    low, high = (int(1e9 * min(max(edge, -4e9), 4e9)) for edge in span)
    told: list[Any] = []
    left = limit
    for chunk in runner.reader.samples(source, low, high):
        told.append({"task": chunk.task, "t": chunk.t[:left].tolist(), "v": plain(chunk.v[:left])})
        left -= len(chunk.t)
        if left <= 0:
            break
    channels = [tuple(one.channels) for one in spec.source if one.name == source] if spec else []
    return {"source": source, "channels": channels[0] if channels else None, "chunks": told,
            "whole": left > 0}  # fmt: skip


def _person(told: Order | Said, request: Request) -> str:
    """Who says it: the user, or, where the token belongs to nobody in particular, as named."""
    user = str(request.scope["state"]["user"])
    return told.person or user if user == "token" else user


def _operate(app: FastAPI, service: Service) -> None:
    @app.post("/api/v1/twins/{name}/orders")
    async def order(name: str, told: Order, request: Request) -> StrictJSON:
        """Promote a version, roll back, pin or unpin; heeded at the next beat, kept in the log."""
        person = _person(told, request)
        number = None if told.order == "unpin" else told.version
        if number is None and told.order in ("promote", "pin"):
            raise HTTPException(422, f"{told.order}: needs version")
        what = "pin" if told.order == "unpin" else told.order
        order = found_at(service, name).done(
            lambda work: work.ordered(what, number, told.reason, person)
        )
        return await in_time(order)

    @app.post("/api/v1/twins/{name}/labels")
    async def label(name: str, told: Said, request: Request) -> StrictJSON:
        """What a person says to an event, kept in the log; what acts is heeded at the next beat."""
        said = Label(**{**told.model_dump(), "person": _person(told, request)})
        return await in_time(found_at(service, name).done(lambda work: work.labelled(said)))

    @app.post("/api/v1/twins/{name}/whatif")
    async def whatif(name: str, scenario: Annotated[dict[str, Any], Body()]) -> StrictJSON:
        """A scenario, as a scenario file says it but without files, beside the newest rows."""
        return await in_time(found_at(service, name).answer("whatif", scenario))

    @app.post("/api/v1/twins/{name}/forecast")
    async def forecast(name: str, question: Annotated[dict[str, Any], Body()]) -> StrictJSON:
        """What comes within ``horizon`` seconds."""
        return await in_time(found_at(service, name).answer("forecast", question))

    @app.post("/api/v1/reload")
    async def reload() -> Any:
        """Takes the site file and the twin files anew; on an error nothing changes (400)."""
        return await service.reload()
