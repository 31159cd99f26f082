"""The commands ``evertwin serve``, ``evertwin page`` and ``evertwin token``."""

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


def page(
    service: Annotated[str, typer.Option(help="Where the service is reached.")] = (
        "http://127.0.0.1:8700"
    ),
    token_file: Annotated[
        Path, typer.Option(help="File with a token of the service; it prints where it keeps one.")
    ] = Path("store/token"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="On loopback; 0: any free one.")] = (
        8701
    ),
    host: Annotated[
        list[str] | None, typer.Option(help="Name that a proxy calls the page by; repeat.")
    ] = None,
    machine: Annotated[
        list[str] | None,
        typer.Option(help="NAME=HOST:PORT, an embedded machine to be told faults; repeat."),
    ] = None,
    certificates: Annotated[
        Path | None, typer.Option(help="PEM file of what the service's certificate is signed by.")
    ] = None,
) -> None:
    """Show the twins of a service in a browser: a process of its own, beside the service.

    Example: evertwin page --token-file store/token
    """
    from evertwin.app.serving import show_page

    where = (token_file, certificates)
    show_page(service, where, port, tuple(host or ()), tuple(machine or ()))


def token(as_json: AsJson = False) -> None:
    """Make a random token for a user of the service, and the hash that the site file keeps.

    Example: evertwin token
    """
    from evertwin.app.serving import make_token

    make_token(as_json)


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.command()(serve)
    app.command()(page)
    app.command()(token)
