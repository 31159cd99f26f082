"""``evertwin info``: what a recording holds."""

from __future__ import annotations

from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.errors import DataError
from evertwin.sources.info import inspect
from evertwin.sources.info_text import render


def show_info(file: Path, as_json: bool, check: bool) -> None:
    """``evertwin info``."""
    if not file.exists():
        raise DataError(f"{file}: no such file")
    found = inspect(file)
    show(found.to_dict(), render(found), as_json)
    if check and found.findings:
        raise typer.Exit(1)
