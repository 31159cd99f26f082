"""What ``evertwin doctor site.toml`` shows: the machines behind a site file, as they speak now."""

from __future__ import annotations

import asyncio
import logging
import math
import tomllib
from collections.abc import Awaitable, Coroutine
from pathlib import Path
from typing import Any

import typer

from evertwin.app.console import show
from evertwin.app.first.doctor_fleet import shared
from evertwin.errors import reason_of
from evertwin.ros.spec import Place
from evertwin.service.site.site_plan import Plan, Site, read_site
from evertwin.sources.live.contract import Around, LiveSettings
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.look import look
from evertwin.sources.live.ros.spec import RosSettings
from evertwin.sources.live.ros.topics import look_ros, wanted
from evertwin.sources.live.trying import misfits
from evertwin.sync.spec import SignalSpec


def is_site(path: Path) -> bool:
    """Does the file name twins, as a site file does?"""
    try:
        with path.open("rb") as file:
            return isinstance(tomllib.load(file).get("twin"), list)
    except (OSError, ValueError):
        return False


def look_at(path: Path, as_json: bool) -> None:
    """Each source of each twin, and the fleet; exit code 1 where one does not answer, does not fit
    its map, or cannot be where its twin may run."""
    site = read_site(path)
    # what goes wrong is told below; without a handler Python prints a library's warnings
    logging.getLogger("asyncua").addHandler(logging.NullHandler())
    seen, wrong = asyncio.run(_look(site))
    if site.spec.fleet.store:
        named, seen_there, wrong_there = shared(site)
        seen |= {named: seen_there}
        wrong |= {named: wrong_there} if wrong_there else {}
    told = {
        name: [*seen.get(name, ()), *(f"WRONG: {one}" for one in wrong.get(name, ()))]
        for name in dict.fromkeys((*seen, *wrong))
    }
    text = "\n\n".join("\n  ".join((name, *lines)) for name, lines in told.items())
    show({"schema": "evertwin.look/1", "sources": seen, "wrong": wrong}, text, as_json)
    if wrong:
        raise typer.Exit(1)


async def _look(site: Site) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """What each source says, and what is wrong with its map."""
    out: dict[str, list[str]] = {}
    wrong = {
        plan.name: plan.wrong.splitlines() if plan.file.exists() else [
            f"{plan.file.name} is not there yet: once the columns of its sources are named in "
            f"{site.file.name}, 'evertwin init {site.file.name}' reads the machine and proposes it"
        ] for plan in site.twins if plan.wrong
    }  # fmt: skip
    maps = _maps(site)
    for name, seen in _looks(site).items():
        try:
            out[name] = await seen
            found = await maps[name] if name in maps else []
        except (LineDown, OSError, TimeoutError) as error:
            found = [f"down: {reason_of(error)}"]
            out.setdefault(name, [])
            if name in maps:
                maps[name].close()
        wrong |= {name: found} if found else {}
    return out, wrong


def _maps(site: Site) -> dict[str, Coroutine[Any, Any, list[str]]]:
    """One trial of each source as the twin would read it."""
    out = {}
    for plan in site.twins:
        spec = plan.spec
        for settings in plan.sources if spec is not None else ():
            own = {one.name: one for one in spec.source + spec.array} if spec else {}
            if isinstance(settings, RosSettings) or settings.source not in own or spec is None:
                continue
            bounds = {name: _bounds(one) for name, one in spec.signals.items()}
            around = Around(plan.file.parent)
            out[_named(plan, settings)] = misfits(settings, own[settings.source], around, bounds)
    return out


def _bounds(signal: SignalSpec) -> tuple[float, float]:
    low, high = signal.low, signal.high
    return -math.inf if low is None else low, math.inf if high is None else high


def _named(plan: Plan, settings: LiveSettings) -> str:
    return f"{plan.name}: {settings.source} ({settings.protocol})"


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
            out[_named(plan, settings)] = look(settings, Around(plan.file.parent))
    for place, known in masters.items():
        out[f"{place.master} (ros)"] = look_ros(place, known)
    return out
