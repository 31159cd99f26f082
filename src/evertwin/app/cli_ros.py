"""The command ``evertwin ros rviz``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ros_app = typer.Typer(
    help="What twins say at a ROS 1 master: rviz shows it.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@ros_app.callback()
def _several() -> None:
    """What twins say at a ROS 1 master: rviz shows it."""


@ros_app.command("rviz")
def rviz(
    site: Annotated[Path, typer.Argument(help="Site file (TOML).", metavar="SITE.toml")],
    out: Annotated[
        Path | None, typer.Option(help="File to write. Default: beside the site file, .rviz.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
) -> None:
    """Write RViz's configuration for what is said at the master now, and how to start it.

    Example: evertwin ros rviz site.toml
    """
    from evertwin.app.rviz import write_rviz

    write_rviz(site, out, as_json)


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.add_typer(ros_app, name="ros")
