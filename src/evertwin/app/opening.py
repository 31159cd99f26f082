"""A twin opened for a command, beside whatever process works with it."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from evertwin.config import TwinSpec, read
from evertwin.errors import DataError, StoreLocked, UsageError
from evertwin.sources.merging import Excerpt
from evertwin.store.spec import StoreSpec
from evertwin.twin import Twin


def as_kept(twin: Path) -> TwinSpec:
    """What a twin file says; where it names no store, and a site file beside it does, with that
    one: it is said on stderr that a service keeps it."""
    spec = read(twin)
    kept = of_service(twin, spec)
    if kept is None:
        return spec
    typer.echo(f"evertwin: {twin} names no [store]: read from the service's, {kept}", err=True)
    return replace(spec, store=StoreSpec(str(kept)))


def of_service(twin: Path, spec: TwinSpec) -> Path | None:
    """The store that a service keeps of a twin whose file names none, by the site files beside it;
    None where there is none."""
    if spec.store.path is not None:
        return None
    here = twin.resolve()
    for site in sorted({*here.parent.glob("*.toml"), *here.parent.parent.glob("*.toml")}):
        try:
            told: dict[str, Any] = tomllib.loads(site.read_text("utf-8"))
        except (OSError, ValueError):
            continue
        entries = told.get("twin")
        for entry in entries if isinstance(entries, list) else ():
            if not isinstance(entry, dict):
                continue
            if (site.parent / str(entry.get("file", ""))).resolve() == here:
                folder = site.parent / str(told.get("store", "store"))
                kept = folder / f"{entry.get('name') or spec.name}.db"
                if kept.is_file():
                    return kept
    return None


def store_path(twin: Path, spec: TwinSpec) -> Path:
    """Where its store stands.

    Raises:
        UsageError: it has none.
    """
    kept = of_service(twin, spec)
    if kept is not None:
        raise UsageError(
            f"{twin}: names no [store], and a service keeps it in {kept}: give that file to "
            "evertwin store, and order on the service's page or by its API"
        )
    if spec.store.path is None:
        raise UsageError(f"{twin}: keeps nothing: say [store] path = 'twin.db'")
    if spec.store.server is not None:
        raise UsageError(f"{twin}: keeps its store on a server: use the server's own tools")
    return Path(spec.folder) / spec.store.path


def to_work(twin: Path, *, telling: bool = False) -> Twin:
    """The twin to work with; read alone where another process works with its store.

    Args:
        twin: the twin file.
        telling: the other process is asked to heed what the command says.
    """
    try:
        return Twin.open(twin)
    except StoreLocked as error:
        if telling:
            held = str(error).partition(": wait")[0]
            typer.echo(f"evertwin: {held}: it is asked to heed this at its next beat", err=True)
        return Twin.open(twin, reading=True)


def recordings(data: Sequence[Path] | None) -> list[str] | None:
    """The recordings that were named, or parts of them; None where there are none.

    Raises:
        DataError: one is not there.
    """
    for path in data or ():
        file = Excerpt.parse(path).path
        if not file.exists():
            raise DataError(f"{file}: no such file")
    return [str(path) for path in data] if data else None
