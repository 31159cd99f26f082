"""What ``evertwin randomise`` does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer

from evertwin.ahead.widening import widened
from evertwin.app.console import show
from evertwin.app.opening import as_kept
from evertwin.twin import Twin


def show_widening(twin: Path, data: Sequence[Path] | None, as_json: bool, check: bool) -> None:
    """``evertwin randomise``; with ``check`` exit code 1 where no width holds the machine."""
    with Twin(as_kept(twin), reading=True) as opened:
        found = widened(opened.prospect().basis, data)
    show(found.to_dict(), str(found), as_json)
    if check and not found.found:
        raise typer.Exit(1)
