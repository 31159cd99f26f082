"""The commands of images: taken in simulation, and what a recording's show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Adds the commands."""

    @app.command()
    def camera(
        world: Annotated[
            Path | None,
            typer.Argument(help="MuJoCo world. Default: halls drawn anew.", metavar="[WORLD.xml]"),
        ] = None,
        out: Annotated[Path, typer.Option("-o", "--out", help="Bag to write.")] = Path(
            "camera.mcap"
        ),
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
        from evertwin.app.picturing import take_pictures

        own = None if world is None else (world, poses, height)
        take_pictures(out, own, (images, seed), plain)

    @app.command()
    def detect(
        recording: Annotated[
            Path, typer.Argument(help="Recording with images.", metavar="RECORDING")
        ],
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
        as_json: Annotated[
            bool, typer.Option("--json", help="One JSON document on stdout.")
        ] = False,
    ) -> None:
        """Tables, boxes, people in images; with --objects also labels for evertwin confusions.

        Example: evertwin detect run.mcap --objects run-objects.csv -o real
        """
        from evertwin.app.detecting import show_detections

        show_detections(recording, out, (objects, weights), images, least, as_json)
