"""A twin opened for a command, beside whatever process works with it."""

from __future__ import annotations

from pathlib import Path

import typer

from evertwin.config import TwinSpec
from evertwin.errors import StoreLocked, UsageError
from evertwin.twin import Twin


def store_path(twin: Path, spec: TwinSpec) -> Path:
    """Where its store stands.

    Raises:
        UsageError: it has none.
    """
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
            typer.echo(f"evertwin: {error}; it is asked to heed this at its next beat", err=True)
        return Twin.open(twin, reading=True)
