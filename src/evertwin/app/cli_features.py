"""The commands of features that simulation and reality are compared by: confusions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]
Check = Annotated[bool, typer.Option("--check", help="Exit with 1 when there are findings.")]


def confusions(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Labels (CSV): of both sides with a column side, or simulated and real.",
            metavar="LABELS.csv [REAL.csv]",
        ),
    ],
    level: Annotated[
        float, typer.Option(help="Probability of calling them different though they are alike.")
    ] = 0.01,
    least: Annotated[
        float | None, typer.Option(help="Labels less probable than this count as none.")
    ] = None,
    most: Annotated[int, typer.Option(help="Confusions of each side that are listed.")] = 10,
    as_json: AsJson = False,
    check: Check = False,
) -> None:
    """What a detector takes for what, simulated and real; whether they differ, and in what.

    Columns: truth, label; side (simulated or real) in a single file; probability, group and
    settings of the simulation where there are some.
    Example: evertwin confusions simulated.csv real.csv
    """
    from evertwin.app.confusing import show_confusions

    show_confusions(files, (level, least), most, as_json, check)


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.command()(confusions)
