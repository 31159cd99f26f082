"""What ``evertwin serve`` and ``evertwin token`` do."""

from __future__ import annotations

import asyncio
from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.errors import MissingExtra
from evertwin.service.access import hashed, new_token
from evertwin.service.logs import log_to_stderr


def run_service(site: Path, form: str) -> None:
    """``evertwin serve``.

    Raises:
        MissingExtra: the extra ``live`` is not installed.
    """
    try:
        from evertwin.service.server import serve
    except ModuleNotFoundError as error:
        raise MissingExtra.of(str(error.name), "live") from error
    log_to_stderr(form)
    asyncio.run(serve(site, lambda line: typer.echo(line)))


def make_token(as_json: bool) -> None:
    """``evertwin token``."""
    made = new_token()
    content = {"schema": "evertwin.token/1", "token": made, "hash": hashed(made)}
    show(content, f'token: {made}\nhash = "{hashed(made)}"', as_json)
