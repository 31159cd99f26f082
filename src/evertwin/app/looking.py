"""What ``evertwin doctor site.toml`` shows: the machines behind a site file, as they speak now."""

from __future__ import annotations

import asyncio
import tomllib
from collections.abc import Awaitable
from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.errors import reason_of
from evertwin.ros.spec import Place
from evertwin.service.plan import Site, read_site
from evertwin.sources.live.contract import Around
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.look import look
from evertwin.sources.live.look_ros import look_ros, wanted
from evertwin.sources.live.ros_spec import RosSettings


def is_site(path: Path) -> bool:
    """Does the file name twins, as a site file does?"""
    try:
        with path.open("rb") as file:
            return isinstance(tomllib.load(file).get("twin"), list)
    except (OSError, ValueError):
        return False


def look_at(path: Path, as_json: bool) -> None:
    """Each source of each twin; exit code 1 where one does not answer."""
    seen, whole = asyncio.run(_look(read_site(path)))
    text = "\n\n".join("\n  ".join((name, *lines)) for name, lines in seen.items())
    show({"schema": "evertwin.look/1", "sources": seen}, text, as_json)
    if not whole:
        raise typer.Exit(1)


async def _look(site: Site) -> tuple[dict[str, list[str]], bool]:
    out: dict[str, list[str]] = {}
    whole = True
    for name, seen in _looks(site).items():
        try:
            out[name] = await seen
        except (LineDown, OSError, TimeoutError) as error:
            out[name], whole = [f"down: {reason_of(error)}"], False
    return out, whole


def _looks(site: Site) -> dict[str, Awaitable[list[str]]]:
    """One look at each source; one at each ROS master, for all who hear it."""
    out: dict[str, Awaitable[list[str]]] = {}
    masters: dict[Place, dict[str, dict[str, str]]] = {}
    for plan in site.twins:
        every = () if plan.spec is None else plan.spec.source + plan.spec.array
        specs = {one.name: one for one in every}
        for settings in plan.sources:
            if isinstance(settings, RosSettings):
                known = masters.setdefault(settings.place, {})
                if settings.source in specs:
                    for topic, fields in wanted(settings, specs[settings.source]).items():
                        named = {key: f"{plan.name}: {to}" for key, to in fields.items()}
                        known.setdefault(topic, {}).update(named)
                continue
            name = f"{plan.name}: {settings.source} ({settings.protocol})"
            out[name] = look(settings, Around(plan.file.parent))
    for place, known in masters.items():
        out[f"{place.master} (ros)"] = look_ros(place, known)
    return out
