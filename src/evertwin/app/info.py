"""``evertwin info``: what a recording holds."""

from __future__ import annotations

from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.errors import DataError
from evertwin.sources.info import inspect
from evertwin.sources.info_text import render


def show_info(file: Path, as_json: bool, check: bool, picture: Path | None = None) -> None:
    """``evertwin info``; ``picture``: a file for some of its images.

    Raises:
        DataError: no such file, or no image for the picture.
    """
    if not file.exists():
        raise DataError(f"{file}: no such file")
    sheet = None
    if picture is not None:
        from evertwin.report.image_picture import Sheet  # loads matplotlib

        sheet = Sheet()
    found = inspect(file, None if sheet is None else sheet.add)
    if picture is not None and sheet is not None:
        if not sheet.kept:
            raise DataError(f"{file}: no image that can be read: --picture has nothing to show")
        sheet.save(picture)
    show(found.to_dict(), render(found), as_json)
    if check and found.findings:
        raise typer.Exit(1)
