"""``evertwin life HISTORY.csv``: a series alone, without what a twin needs to be opened."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

import typer

from evertwin.app.console import Progress, show
from evertwin.errors import UsageError
from evertwin.prognosis.laws.series.indicator import Direction
from evertwin.prognosis.likes.like_machines import files_of
from evertwin.prognosis.outlook.lone_series import Series, life_of_series

Likes: TypeAlias = "tuple[list[str] | None, list[str] | None]"


def show_series(
    file: Path, told: tuple[str | None, bool, str, bool], likes: Likes, report: Path | None,
    as_json: bool, check: bool,
) -> None:  # fmt: skip
    """The life that one series tells.

    Args:
        file: the series.
        told: its limit, whether that is below, the column of values, and whether from today.
        likes: patterns of like machines, and of those that failed.
        report: written beside, with pictures.
        as_json: one document in place of text.
        check: exit with 1 while an alarm is due.

    Raises:
        UsageError: no limit, or a fleet without members.
    """
    limit, below, column, today = told
    if limit is None:
        raise UsageError(
            f"{file}: a series alone needs --limit, where its life ends (and --below if that is "
            "below), as in --limit 1.4 --below; a twin file ends with .toml"
        )
    direction: Direction = "below" if below else "above"
    fleet, failed = (files_of(names or (), Path(), (file,)) for names in likes)
    if likes[0] and not fleet:
        raise UsageError(
            f"--fleet: expected histories of other machines, got {file} alone; its own earlier "
            "lives count without, from four that ended"
        )
    asked = Series(file, limit, direction, column, "", fleet, failed, today)
    with Progress("the series are read"):
        found = life_of_series(asked, drawn=report is not None)
    if report is not None:
        from evertwin.report.prognosis_report import write_prognosis  # pictures take 0.4 s

        write_prognosis(found, None, report)
    show(found.to_dict(), str(found), as_json)
    if check and found.alarms:
        raise typer.Exit(1)
