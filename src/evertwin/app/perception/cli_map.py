"""The commands of a lidar: map, locate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.options import AsJson, Scans

app = typer.Typer()
Scan = Annotated[str, typer.Option(help="Topic of the scans. Default: the first one.")]

Step = Annotated[
    float, typer.Option(help="From beam to beam, of a log that does not say it (FLASER) [°].")
]


@app.command("map")
def map_scans(
    recording: Scans,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for poses, map and picture.")],
    against: Annotated[
        str | None,
        typer.Option(help="Reference: 'stated' (poses in a map), or CSV with t_ns,x,y,theta."),
    ] = None,
    ranges_alone: Annotated[
        bool, typer.Option("--ranges-alone", help="Without the recording's odometry.")
    ] = False,
    scan: Scan = "",
    odometry: Annotated[
        str, typer.Option(help="Topic of the odometry. Default: the first of wheels.")
    ] = "",
    step: Step = 0.0,
    as_json: AsJson = False,
) -> None:
    """Poses with covariance and an occupancy map from the scans of a recording.

    Example: evertwin map run.log -o room
    """
    from evertwin.app.perception.map_command import Topics, make_map

    make_map(recording, out, against, ranges_alone, Topics(scan, odometry, step), as_json)


@app.command()
def locate(
    chart: Annotated[Path, typer.Argument(help="Map (YAML beside its PGM).", metavar="MAP.yaml")],
    recording: Scans,
    number: Annotated[int, typer.Option(help="Number of the scan, from 0.")] = 0,
    scan: Scan = "",
    step: Step = 0.0,
    as_json: AsJson = False,
) -> None:
    """Where a scan was taken, from a map alone; or why that cannot be told.

    Example: evertwin locate room/map.yaml run.log --number 120
    """
    from evertwin.app.perception.map_command import Topics, find_place

    find_place(chart, recording, number, Topics(scan, step=step), as_json)
