"""The command ``evertwin validate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

PART = " FILE@START:STOP is a part."


def validate(
    twin: Annotated[Path, typer.Argument(help="Twin file (TOML).", metavar="TWIN.toml")],
    test: Annotated[
        list[Path] | None, typer.Option("--test", help="Held-out recording; list several." + PART)
    ] = None,
    train: Annotated[
        list[Path] | None,
        typer.Option("--train", help="Tune on these first; nothing goes live." + PART),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Write a self-contained HTML report.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Exit with 1 when one fails.")] = False,
) -> None:
    """Verify a model by other engines and by laws; validate it on recordings held out.

    Example: evertwin validate arm.toml --train monday.csv --test tuesday.csv
    """
    from evertwin.app.validation import validate_twin

    validate_twin(twin, (test, train), report, as_json, check)


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command()(validate)
