"""The command ``evertwin label``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TwinFile = Annotated[Path, typer.Argument(help="Twin file (TOML).", metavar="TWIN.toml")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]


def register(app: typer.Typer) -> None:
    """Adds the command."""

    @app.command("label")
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
        tried first at the next tuning; faulty rows leave the window of fits.

        Example: evertwin label arm.toml 41 cause --cause friction --reason "new grease"
        """
        from evertwin.app.labelling import label_event

        label_event(twin, event, verdict, reason, (cause, rows), as_json)
