"""The commands of a lidar: map, locate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]
Recording = Annotated[Path, typer.Argument(help="Recording with scans.", metavar="RECORDING")]


def map_scans(
    recording: Recording,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for poses, map and picture.")],
    against: Annotated[
        str | None,
        typer.Option(help="Reference: 'stated' (poses of the log), or CSV with t_ns,x,y,theta."),
    ] = None,
    ranges_alone: Annotated[
        bool, typer.Option("--ranges-alone", help="Without the recording's odometry.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Poses with covariance and an occupancy map from the scans of a recording.

    Example: evertwin map run.log -o room
    """
    from evertwin.app.mapping import make_map

    make_map(recording, out, against, ranges_alone, as_json)


def locate(
    chart: Annotated[Path, typer.Argument(help="Map (YAML beside its PGM).", metavar="MAP.yaml")],
    recording: Recording,
    scan: Annotated[int, typer.Option(help="Number of the scan, from 0.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Where a scan was taken, from a map alone; or why that cannot be told.

    Example: evertwin locate room/map.yaml run.log --scan 120
    """
    from evertwin.app.mapping import find_place

    find_place(chart, recording, scan, as_json)


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.command("map")(map_scans)
    app.command()(locate)
