"""The commands ``evertwin export`` and ``evertwin model load``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

PART = " FILE@START:STOP is the part from START to STOP, in seconds from its first stamp."
TwinFile = Annotated[Path, typer.Argument(help="Twin file (TOML).", metavar="TWIN.toml")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]


def export(
    twin: TwinFile,
    form: Annotated[str, typer.Option("--format", help="fmu, json, mat, urdf, …")],
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write.")],
    version: Annotated[
        int | None, typer.Option(help="Number of a version; without it the live one.")
    ] = None,
    data: Annotated[
        list[Path] | None,
        typer.Option(
            "--data", help="Recordings to add, with the predictions; list several." + PART
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a version's form and parameters, with intervals, for other tools.

    Example: evertwin export arm.toml --format mat --data monday.csv -o arm.mat
    """
    from evertwin.app.exporting import export_twin

    export_twin(twin, (form, out, version), data, as_json)


def load(
    twin: TwinFile,
    file: Annotated[Path, typer.Argument(help="JSON or MAT file.", metavar="FILE")],
    reason: Annotated[str, typer.Option(help="Why; kept in the log.")] = "",
    as_json: AsJson = False,
) -> None:
    """Make a version of the parameter values in a JSON or MAT file; nothing goes live."""
    from evertwin.app.exporting import load_parameters

    load_parameters(twin, file, reason, as_json)


def register(app: typer.Typer, model_app: typer.Typer) -> None:
    """Adds the commands."""
    app.command()(export)
    model_app.command("load")(load)
