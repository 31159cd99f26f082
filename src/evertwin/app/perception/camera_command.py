"""``evertwin camera``: images of MuJoCo worlds, without a display."""

from __future__ import annotations

from pathlib import Path

import typer

from evertwin.app.console import Alive
from evertwin.app.machine.recording_processes import shots
from evertwin.errors import UsageError


def take_pictures(
    out: Path, own: tuple[Path, Path | None, float] | None, drawn: tuple[int, int], plain: bool
) -> None:
    """``evertwin camera``.

    Args:
        out: bag.
        own: world, poses, height of the camera; None: halls drawn anew.
        drawn: number of images, seed.
        plain: one look for all.

    Raises:
        UsageError: a world without poses, or another kind of bag.
    """
    if out.suffix != ".mcap":
        raise UsageError(f"--out: expected a file that ends in .mcap, got {out}")
    options = ["--images", str(drawn[0]), "--seed", str(drawn[1]), *(["--plain"] if plain else [])]
    if own is not None:
        world, poses, height = own
        if poses is None:
            raise UsageError("camera: expected --poses too, where in the world it is")
        options += ["--world", str(world), "--poses", str(poses), "--height", str(height)]
    with Alive() as alive, shots(out, *options) as process:
        alive.say(f"taking up to {drawn[0]} images")
        process.recordings()
    typer.echo(f"{out}, {out.stem}-objects.csv")
