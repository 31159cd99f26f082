"""The commands of features that simulation and reality are compared by: labels, tables, images."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.cli_camera import register as register_camera

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]
Check = Annotated[bool, typer.Option("--check", help="Exit with 1 when there are findings.")]


def confusions(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Labels (CSV): of both sides with a column side, or simulated and real.",
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
    as_json: AsJson = False,
    check: Check = False,
) -> None:
    """What a detector takes for what, simulated and real; whether they differ, and in what.

    Columns: truth, label; side (simulated or real) in a single file; probability, group and
    settings of the simulation where there are some.
    Example: evertwin confusions simulated.csv real.csv
    """
    from evertwin.app.confusing import show_confusions

    show_confusions(files, (level, least), most, as_json, check)


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.command()(confusions)
    register_camera(app)

    @app.command()
    def tables(
        recording: Annotated[
            Path, typer.Argument(help="Recording with scans.", metavar="RECORDING")
        ],
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
        as_json: AsJson = False,
    ) -> None:
        """Tables from the scans of a recording: boxes with covariance, costs, MuJoCo bodies.

        Example: evertwin tables run.log --poses room/poses.csv -o room
        """
        from evertwin.app.furnishing import Asked, make_tables, pose_of
        from evertwin.app.mapping import Topics
        from evertwin.errors import UsageError
        from evertwin.features.cost_map import Inflation
        from evertwin.features.table_bodies import Plate

        if not (0 < radius <= inflation and height > 0.05 and overhang >= 0):
            raise UsageError("tables: expected 0 < radius ≤ inflation, height above 0.05 m, "
                             "overhang from 0 m")  # fmt: skip
        asked = Asked(
            Inflation(radius, inflation), Plate(height, overhang, solid), pose_of(origin), three
        )
        make_tables(recording, out, poses, asked, Topics(scan), as_json)
