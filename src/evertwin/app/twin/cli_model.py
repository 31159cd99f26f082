"""The commands ``evertwin model …``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.options import AsJson, Number, Reason, TwinFile, group

model_app = group("model", "The versions of a twin's model: list, show, promote, rollback, pin.")


@model_app.command("list")
def versions(twin: TwinFile, as_json: AsJson = False) -> None:
    """All versions, and which is live."""
    from evertwin.app.twin.twin_commands import list_versions

    list_versions(twin, as_json)


@model_app.command("show")
def show(
    twin: TwinFile,
    number: Number,
    as_json: AsJson = False,
) -> None:
    """Form, parameters and history of one version."""
    from evertwin.app.twin.twin_commands import show_version

    show_version(twin, number, as_json)


@model_app.command("promote")
def promote(
    twin: TwinFile,
    number: Number,
    reason: Reason = "by hand",
    as_json: AsJson = False,
) -> None:
    """Make a version live, whatever the gate says."""
    from evertwin.app.twin.twin_commands import by_hand

    by_hand(twin, "promote", number, reason, as_json)


@model_app.command("rollback")
def rollback(
    twin: TwinFile,
    reason: Reason = "by hand",
    as_json: AsJson = False,
) -> None:
    """Make the champion before the present one live again."""
    from evertwin.app.twin.twin_commands import by_hand

    by_hand(twin, "rollback", None, reason, as_json)


@model_app.command("pin")
def pin(
    twin: TwinFile,
    number: Annotated[
        int | None, typer.Argument(help="Number of a version; none: unpin.", metavar="[VERSION]")
    ] = None,
    reason: Reason = "by hand",
    as_json: AsJson = False,
) -> None:
    """Keep a version live until it is unpinned."""
    from evertwin.app.twin.twin_commands import by_hand

    by_hand(twin, "pin", number, reason, as_json)


@model_app.command("load")
def load(
    twin: TwinFile,
    file: Annotated[Path, typer.Argument(help="JSON or MAT file.", metavar="FILE")],
    reason: Reason = "",
    as_json: AsJson = False,
) -> None:
    """Make a version of the parameter values in a JSON or MAT file; nothing goes live."""
    from evertwin.app.twin.export_command import load_parameters

    load_parameters(twin, file, reason, as_json)
