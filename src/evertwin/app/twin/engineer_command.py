"""What ``evertwin engineer`` does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evertwin.app.console import show
from evertwin.app.opening import recordings
from evertwin.engineering.engineer import engineer
from evertwin.errors import UsageError
from evertwin.report.engineering_report import engineering_text, write_engineering


def engineer_twin(
    breakdown: Path, out: tuple[Path, Path | None, bool], data: Sequence[Path] | None, as_json: bool
) -> None:
    """``evertwin engineer``; ``out``: twin file, report, and whether files may be overwritten.

    Raises:
        UsageError: the twin file is there already.
        DataError: a recording is not there.
    """
    twin, report, force = out
    if twin.exists() and not force:
        raise UsageError(f"{twin}: exists already: choose another name, or say --force")
    done = engineer(breakdown, twin, recordings(data))
    if report is not None:
        write_engineering(done, report)
    content = done.study.to_dict() | {"file": str(done.path)}
    text = f"{engineering_text(done.study)}\n\n{done.path}: written; next: evertwin run {done.path}"
    show(content, text, as_json)
