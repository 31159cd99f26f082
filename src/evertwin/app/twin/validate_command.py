"""What ``evertwin validate`` does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.app.opening import as_kept
from evertwin.errors import DataError
from evertwin.report.validation_report import write_validation
from evertwin.sources.merging import Excerpt
from evertwin.twin import Twin

Files = Sequence[Path] | None


def validate_twin(
    twin: Path, data: tuple[Files, Files], report: Path | None, as_json: bool, check: bool
) -> None:
    """``evertwin validate``; ``data``: test and train."""
    test, train = (None if files is None else [_named(path) for path in files] for files in data)
    with Twin(as_kept(twin), reading=True) as opened:
        found = opened.validate(test or (), train)
    if report is not None:
        write_validation(found, report)
    show(found.to_dict(), str(found), as_json)
    if check and not found.passed:
        raise typer.Exit(1)


def _named(path: Path) -> str:
    """A recording that is there.

    Raises:
        DataError: it is not.
    """
    if not Excerpt.parse(path).path.exists():
        raise DataError(f"{path}: there is no such file")
    return str(path)
