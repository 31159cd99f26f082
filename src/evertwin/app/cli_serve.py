"""The commands ``evertwin serve`` and ``evertwin token``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]


def serve(
    site: Annotated[Path, typer.Argument(help="Site file (TOML).", metavar="SITE.toml")],
    log: Annotated[
        Literal["text", "json"], typer.Option(help="Form of the log on stderr.")
    ] = "text",
) -> None:
    """Run the twins of a site beside their machines, until SIGTERM or Ctrl-C; SIGHUP reloads.

    Example: evertwin serve site.toml --log json
    """
    from evertwin.app.serving import run_service

    run_service(site, log)


def token(as_json: AsJson = False) -> None:
    """Make a random token for a user of the service, and the hash that the site file keeps.

    Example: evertwin token
    """
    from evertwin.app.serving import make_token

    make_token(as_json)


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.command()(serve)
    app.command()(token)
