"""The commands of features that simulation and reality are compared by: labels, images, tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.options import AsJson, Check, Scans, TwinFile

app = typer.Typer()


@app.command()
def confusions(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Labels (CSV): of both sides with a column side, or simulated and real; with "
            "--drift known ones and new ones (-: as they come on stdin).",
            metavar="LABELS.csv [REAL.csv]",
        ),
    ],
    level: Annotated[
        float, typer.Option(help="Probability of calling them different though they are alike.")
    ] = 0.01,
    least: Annotated[
        float | None, typer.Option(help="Labels less probable than this count as none.")
    ] = None,
    most: Annotated[int, typer.Option(help="Confusions of each side that are listed.")] = 10,
    drift: Annotated[
        float, typer.Option(help="Has the second file drifted? Labels for one false event.")
    ] = 0.0,
    as_json: AsJson = False,
    check: Check = False,
) -> None:
    """What a detector takes for what, simulated and real; whether they differ, and in what.

    Columns: truth, label; side (simulated or real) in a single file; probability, group and
    settings of the simulation where there are some. With --drift labels are taken in their order,
    and an event names each confusion that is no longer as known.
    Example: evertwin confusions simulated.csv real.csv
    Example: evertwin confusions known.csv new.csv --drift 200000
    """
    if drift:
        from evertwin.app.perception.confusions_drift import show_drift

        show_drift(files, (drift, least), as_json, check)
        return
    from evertwin.app.perception.confusions_command import show_confusions

    show_confusions(files, (level, least), most, as_json, check)


@app.command()
def randomise(
    twin: TwinFile,
    data: Annotated[
        list[Path] | None, typer.Option(help="Recording; list several. Default: the twin file's.")
    ] = None,
    as_json: AsJson = False,
    check: Check = False,
) -> None:
    """How widely numbers, lag and noise of the simulation are drawn until it holds the machine.

    Told are the share of what was measured inside the simulated 95 %, at each width, and its cost.
    Example: evertwin randomise twin.toml --data run.csv
    """
    from evertwin.app.twin.randomise_command import show_widening

    show_widening(twin, data, as_json, check)


@app.command()
def camera(
    world: Annotated[
        Path | None,
        typer.Argument(help="MuJoCo world. Default: halls drawn anew.", metavar="[WORLD.xml]"),
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Bag to write.")] = Path("camera.mcap"),
    poses: Annotated[
        Path | None, typer.Option(help="Poses in that world (CSV), as of evertwin map.")
    ] = None,
    images: Annotated[int, typer.Option(min=1, max=100_000, help="At most so many.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Of all that is drawn.")] = 1,
    plain: Annotated[
        bool, typer.Option("--plain", help="One light and look, nothing of it drawn.")
    ] = False,
    height: Annotated[float, typer.Option(help="Of the camera in that world [m].")] = 0.5,
) -> None:
    """Simulated images in randomised light and texture, and what they show: NAME-objects.csv.

    Example: evertwin camera --images 300 -o halls.mcap
    """
    from evertwin.app.perception.camera_command import take_pictures

    own = None if world is None else (world, poses, height)
    take_pictures(out, own, (images, seed), plain)


@app.command()
def detect(
    recording: Annotated[Path, typer.Argument(help="Recording with images.", metavar="RECORDING")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for labels, a picture.")],
    objects: Annotated[
        Path | None, typer.Option(help="What the images show (CSV), to judge them by.")
    ] = None,
    images: Annotated[str, typer.Option(help="Their topic. Default: the first.")] = "",
    least: Annotated[
        float, typer.Option(min=0.02, max=1.0, help="Labels less probable are left out.")
    ] = 0.3,
    weights: Annotated[
        Path | None, typer.Option(help="A net of your own (ONNX). Default: the one shipped.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tables, boxes, people in images; with --objects also labels for evertwin confusions.

    Example: evertwin detect run.mcap --objects run-objects.csv -o real
    """
    from evertwin.app.perception.detect_command import show_detections

    show_detections(recording, out, (objects, weights), images, least, as_json)


@app.command()
def tables(
    recording: Scans,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for boxes, costs, picture.")],
    poses: Annotated[
        Path | None, typer.Option(help="Poses (CSV) of evertwin map. Default: map anew.")
    ] = None,
    radius: Annotated[float, typer.Option(help="Of the machine, for the costs [m].")] = 0.25,
    inflation: Annotated[float, typer.Option(help="How far costs reach [m].")] = 0.75,
    height: Annotated[float, typer.Option(help="Of the plates [m].")] = 0.72,
    overhang: Annotated[float, typer.Option(help="Of the plates over the legs [m].")] = 0.0,
    solid: Annotated[
        bool, typer.Option("--solid", help="Boxes down to the floor, no legs.")
    ] = False,
    three: Annotated[
        bool, typer.Option("--three", help="Also where one leg was never in sight.")
    ] = False,
    origin: Annotated[
        str, typer.Option(help="Pose of the map's origin in the world: 'X Y HEADING'.")
    ] = "0 0 0",
    scan: Annotated[str, typer.Option(help="Topic of the scans. Default: the first.")] = "",
    step: Annotated[float, typer.Option(help="From beam to beam, as for map [°].")] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Tables from the scans of a recording: boxes with covariance, costs, MuJoCo bodies.

    Example: evertwin tables run.log --poses room/poses.csv -o room
    """
    from evertwin.app.perception.map_command import Topics
    from evertwin.app.perception.tables_command import Asked, make_tables, pose_of
    from evertwin.errors import UsageError
    from evertwin.features.maps.cost_map import Inflation
    from evertwin.models.tables.bodies import Plate

    if not (0 < radius <= inflation and height > 0.05 and overhang >= 0):
        raise UsageError("tables: expected 0 < radius ≤ inflation, height above 0.05 m, "
                         "overhang from 0 m")  # fmt: skip
    asked = Asked(
        Inflation(radius, inflation), Plate(height, overhang, solid), pose_of(origin), three
    )
    make_tables(recording, out, poses, asked, Topics(scan, step=step), as_json)
