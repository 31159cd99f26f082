"""The commands of a site: serve, page, token, and ``evertwin fleet …``, ``evertwin ros …``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from evertwin.app.options import AsJson, SiteFile, group

app = typer.Typer()
fleet_app = group("fleet", "Several machines that share the twins of a site.")
ros_app = group("ros", "What twins say at a ROS 1 master: rviz shows it.")
Fleet = Annotated[Path, typer.Argument(help="Site file with [fleet] (TOML).", metavar="SITE.toml")]


@app.command()
def serve(
    site: SiteFile,
    log: Annotated[
        Literal["text", "json"], typer.Option(help="Form of the log on stderr.")
    ] = "text",
) -> None:
    """Run the twins of a site beside their machines, until SIGTERM or Ctrl-C; SIGHUP reloads.

    Example: evertwin serve site.toml --log json
    """
    from evertwin.app.site.serve_command import run_service

    run_service(site, log)


@app.command()
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
    from evertwin.app.site.serve_command import show_page

    where = (token_file, certificates)
    show_page(service, where, port, tuple(host or ()), tuple(machine or ()))


@app.command()
def token(as_json: AsJson = False) -> None:
    """Make a random token for a user of the service, and the hash that the site file keeps.

    Example: evertwin token
    """
    from evertwin.app.site.serve_command import make_token

    make_token(as_json)


@fleet_app.command()
def status(site: Fleet, as_json: AsJson = False) -> None:
    """Nodes, and who has which twin: age of the lease, lag.

    Example: evertwin fleet status site.toml
    """
    from evertwin.app.site.fleet_command import show_fleet

    show_fleet(site, as_json)


@fleet_app.command()
def move(
    site: Fleet,
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
    from evertwin.app.site.fleet_command import move_twin

    move_twin(site, twin, "" if node == "any" else node, anew)


@fleet_app.command()
def drain(
    site: Fleet,
    node: Annotated[str, typer.Argument(help="Name of the node.")],
    back: Annotated[bool, typer.Option("--back", help="It may take twins again.")] = False,
) -> None:
    """Let a node give its twins to others and take none, before it is upgraded or switched off.

    A twin that no other node can go on with stays until it ends; the status says why.

    Example: evertwin fleet drain site.toml north
    """
    from evertwin.app.site.fleet_command import drain_node

    drain_node(site, node, not back)


@ros_app.callback()
def _several() -> None:
    """What twins say at a ROS 1 master: rviz shows it."""


@ros_app.command("rviz")
def rviz(
    site: SiteFile,
    out: Annotated[
        Path | None, typer.Option(help="File to write. Default: beside the site file, .rviz.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write RViz's configuration for what is said at the master now, and how to start it.

    Example: evertwin ros rviz site.toml
    """
    from evertwin.app.site.rviz_command import write_rviz

    write_rviz(site, out, as_json)
