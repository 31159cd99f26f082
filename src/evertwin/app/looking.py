"""What ``evertwin doctor site.toml`` shows: the machines behind a site file, as they speak now."""

from __future__ import annotations

import asyncio
import tomllib
from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.service.plan import Site, read_site
from evertwin.sources.live.contract import Around
from evertwin.sources.live.line import LineDown, reason_of
from evertwin.sources.live.look import look


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
    for plan in site.twins:
        for settings in plan.sources:
            name = f"{plan.name}: {settings.source} ({settings.protocol})"
            try:
                out[name] = await look(settings, Around(plan.file.parent))
            except (LineDown, OSError, TimeoutError) as error:
                out[name], whole = [f"down: {reason_of(error)}"], False
    return out, whole
