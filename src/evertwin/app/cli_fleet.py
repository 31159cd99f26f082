"""The commands ``evertwin fleet …``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Site = Annotated[Path, typer.Argument(help="Site file with [fleet] (TOML).", metavar="SITE.toml")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]

fleet_app = typer.Typer(
    help="Several machines that share the twins of a site.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@fleet_app.command()
def status(site: Site, as_json: AsJson = False) -> None:
    """Nodes, and who has which twin: age of the lease, lag.

    Example: evertwin fleet status site.toml
    """
    from evertwin.app.fleet import show_fleet

    show_fleet(site, as_json)


@fleet_app.command()
def move(
    site: Site,
    twin: Annotated[str, typer.Argument(help="Name of the twin.")],
    node: Annotated[str, typer.Argument(help="Where to; 'any': wherever it falls.")],
    anew: Annotated[
        bool, typer.Option("--anew", help="Also if NODE cannot load its state: from all samples.")
    ] = False,
) -> None:
    """Ask for a twin to move: once the other node can go on with it, its node stops it with a
    checkpoint.

    Example: evertwin fleet move site.toml arm south
    """
    from evertwin.app.fleet import move_twin

    move_twin(site, twin, "" if node == "any" else node, anew)


@fleet_app.command()
def drain(
    site: Site,
    node: Annotated[str, typer.Argument(help="Name of the node.")],
    back: Annotated[bool, typer.Option("--back", help="It may take twins again.")] = False,
) -> None:
    """Let a node give its twins to others and take none, before it is upgraded or switched off.

    A twin that no other node can go on with stays until it ends; the status says why.

    Example: evertwin fleet drain site.toml north
    """
    from evertwin.app.fleet import drain_node

    drain_node(site, node, not back)


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.add_typer(fleet_app, name="fleet")
