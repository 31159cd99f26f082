"""``evertwin life HISTORY.csv``: a series alone, without what a twin needs to be opened."""

from __future__ import annotations

from glob import glob
from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.errors import UsageError
from evertwin.prognosis.laws.indicator import Direction
from evertwin.prognosis.lone_series import Series, life_of_series


def show_series(
    file: Path, told: tuple[float | None, bool, str, list[str], bool], as_json: bool, check: bool
) -> None:
    """The life that one series tells.

    Raises:
        UsageError: no limit, or a fleet without members.
    """
    limit, below, column, wanted, today = told
    if limit is None:
        raise UsageError(
            f"{file}: a series alone needs --limit, where its life ends (and --below if that is "
            "below), as in --limit 1.4 --below; a twin file ends with .toml"
        )
    direction: Direction = "below" if below else "above"
    members = _members(file, wanted)
    found = life_of_series(Series(file, limit, direction, column, fleet=members, from_today=today))
    show(found.to_dict(), str(found), as_json)
    if check and found.alarms:
        raise typer.Exit(1)


def _members(file: Path, wanted: list[str]) -> tuple[Path, ...]:
    """The files of a fleet, without the one that is asked for."""
    members = []
    for pattern in wanted:
        there = [Path(name) for name in sorted(glob(pattern))]
        if not there:
            raise UsageError(f"--fleet {pattern}: expected histories (CSV), no file is called so")
        members += [one for one in there if one.resolve() != file.resolve()]
    return tuple(dict.fromkeys(members))
