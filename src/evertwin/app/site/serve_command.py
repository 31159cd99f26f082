"""What ``evertwin serve``, ``evertwin page`` and ``evertwin token`` do."""

from __future__ import annotations

import asyncio
from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.app.machine.live_processes import told
from evertwin.errors import UsageError, needs
from evertwin.service.http.access import hashed, new_token
from evertwin.service.logs import log_to_stderr


def run_service(site: Path, form: str) -> None:
    """``evertwin serve``.

    Raises:
        MissingExtra: the extra ``live`` is not installed.
    """
    with needs("live"):
        from evertwin.service.server import serve
    log_to_stderr(form)
    asyncio.run(serve(site, lambda line: typer.echo(line)))


def show_page(
    service: str, files: tuple[Path, Path | None], port: int, hosts: tuple[str, ...],
    machines: tuple[str, ...],
) -> None:  # fmt: skip
    """``evertwin page``; ``files``: of the token, and of certificates.

    Raises:
        MissingExtra: the extra ``web`` is not installed.
        UsageError: the token cannot be read, or a machine has another form.
    """
    with needs("web"):
        from evertwin.page.door import Door
        from evertwin.page.relay import Relay
        from evertwin.page.server import Machines, run_page, token_of
    token, certificates = token_of(files[0]), files[1]
    named = dict(one.partition("=")[::2] for one in machines)
    if bad := [name for name, where in named.items() if not where]:
        raise UsageError(f"--machine: expected NAME=HOST:PORT, got {bad[0]!r}")
    relay = Relay(service, token, True if certificates is None else str(certificates))
    run_page(relay, Door(token, hosts), Machines(named, told), port, lambda s: typer.echo(s))


def make_token(as_json: bool) -> None:
    """``evertwin token``."""
    made = new_token()
    content = {"schema": "evertwin.token/1", "token": made, "hash": hashed(made)}
    show(content, f'token: {made}\nhash = "{hashed(made)}"', as_json)
