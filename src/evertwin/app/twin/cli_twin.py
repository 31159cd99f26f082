"""The commands of one twin besides its run: label, validate, engineer, export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.options import PART, AsJson, Force, Report, TwinFile

app = typer.Typer()
SHORT = " FILE@START:STOP is a part."


@app.command()
def label(
    twin: TwinFile,
    event: Annotated[int, typer.Argument(help="Its number in the log.", metavar="EVENT")],
    verdict: Annotated[
        str,
        typer.Argument(
            help="acknowledged, shelved, true, false alarm, cause or faulty.", metavar="VERDICT"
        ),
    ],
    reason: Annotated[str, typer.Option(help="Because of what; kept in the log.")],
    cause: Annotated[str, typer.Option(help="With cause: which of [tuning.causes].")] = "",
    rows: Annotated[
        str, typer.Option(help="With faulty: FIRST:LAST; else those of the event.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Say to an event what you know: it acts at the next beat of a run, or on the next run.

    A false alarm counts in the rate of its detector and is no evidence again; a named cause is
    tried first at the next tuning; faulty rows leave the window of fits. True, of what was learned
    or of an alarm of a life, says that it is the machine and no sensor.

    Example: evertwin label arm.toml 41 cause --cause friction --reason "new grease"
    """
    from evertwin.app.twin.label_command import label_event

    label_event(twin, event, verdict, reason, (cause, rows), as_json)


@app.command()
def validate(
    twin: TwinFile,
    test: Annotated[
        list[Path] | None, typer.Option("--test", help="Held-out recording; list several." + SHORT)
    ] = None,
    train: Annotated[
        list[Path] | None,
        typer.Option("--train", help="Tune on these first; nothing goes live." + SHORT),
    ] = None,
    report: Report = None,
    as_json: AsJson = False,
    check: Annotated[bool, typer.Option("--check", help="Exit with 1 when one fails.")] = False,
) -> None:
    """Verify a model by other engines and by laws; validate it on recordings held out.

    Example: evertwin validate arm.toml --train monday.csv --test tuesday.csv
    """
    from evertwin.app.twin.validate_command import validate_twin

    validate_twin(twin, (test, train), report, as_json, check)


@app.command()
def engineer(
    breakdown: Annotated[
        Path, typer.Argument(help="Breakdown file (TOML).", metavar="BREAKDOWN.toml")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Twin file to write.")],
    data: Annotated[
        list[Path] | None,
        typer.Option("--data", help="Recordings that the choice rests on; list several." + PART),
    ] = None,
    report: Report = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """From a list of components to a twin file: what to model, what to tune, how often, and why.

    Example: evertwin engineer arm-parts.toml --data monday.csv -o arm.toml --report arm.html
    """
    from evertwin.app.twin.engineer_command import engineer_twin

    engineer_twin(breakdown, (out, report, force), data, as_json)


@app.command()
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
    from evertwin.app.twin.export_command import export_twin

    export_twin(twin, (form, out, version), data, as_json)
