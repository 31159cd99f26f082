"""The command ``evertwin engineer``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.cli_export import PART


def engineer(
    breakdown: Annotated[
        Path, typer.Argument(help="Breakdown file (TOML).", metavar="BREAKDOWN.toml")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Twin file to write.")],
    data: Annotated[
        list[Path] | None,
        typer.Option("--data", help="Recordings that the choice rests on; list several." + PART),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Write a self-contained HTML report.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
) -> None:
    """From a list of components to a twin file: what to model, what to tune, how often, and why.

    Example: evertwin engineer arm-parts.toml --data monday.csv -o arm.toml --report arm.html
    """
    from evertwin.app.engineering import engineer_twin

    engineer_twin(breakdown, (out, report, force), data, as_json)


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command()(engineer)
