"""Pictures of MuJoCo worlds, into a bag, and beside it what each shows (``NAME-objects.csv``).

Each is of another hall drawn by seed, or of a world of one's own from the poses of a file; in each
light, colours, patterns, exposure and noise are drawn anew, or ``--plain`` has one look for all.

    python -m evertwin.worlds.shots --images 200 --seed 1 --out halls.mcap
    python -m evertwin.worlds.shots --world room.xml --poses poses.csv --out room.mcap
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from evertwin.errors import DataError, EvertwinError, ModelError
from evertwin.sources.texts.small_table import read_table
from evertwin.worlds.camera import View, traced
from evertwin.worlds.eye import HEIGHT, LENS, Shot, carried, save_rows, shot
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.voices.ros_bag import save_bag
from evertwin.worlds.looks import drawn, plain
from evertwin.worlds.scenes import hall, view


def of_halls(images: int, seed: int, one_look: bool) -> Iterator[tuple[int, Shot]]:
    """A picture of each of so many halls, one a second; its stamp [ns]."""
    for k in range(images):
        rng = np.random.default_rng([seed, k])
        scene = hall(rng)
        world = _World(mujoco.MjModel.from_xml_string(scene.xml), scene.half, (0.0, 0.0))
        yield k * 10**9, world.shot(view(scene, rng), one_look, rng, f"hall{k}")


def of_poses(
    world: Path, poses: Path, most: int, how: tuple[int, bool, float]
) -> Iterator[tuple[int, Shot]]:
    """Pictures of a world from poses (``t_ns``, ``x``, ``y`` [m], ``theta`` [rad]), evenly chosen.

    Args:
        world: MJCF; a thing is what its body or geom is called, without its number: ``table3``.
        poses: CSV, as ``evertwin map`` writes them.
        most: pictures.
        how: seed, one look for all, height of the camera [m].

    Raises:
        ModelError: MuJoCo cannot read the world.
        DataError: a column is absent, or there is no pose.
    """
    try:
        model = mujoco.MjModel.from_xml_path(str(world))
    except ValueError as error:
        raise ModelError(f"{world}: {error}") from None
    table = read_table(poses)
    rows = np.column_stack([table.column(name) for name in ("t_ns", "x", "y", "theta")])
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        raise DataError(f"{poses}: expected poses, got none")
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, most).astype(np.int64))[: len(rows)]]
    # the room is where the poses are, and a little around
    low, high = rows[:, 1:3].min(axis=0), rows[:, 1:3].max(axis=0)
    middle = (low + high) / 2
    scene = _World(model, float((high - low).max()) / 2 + 1.5, (middle[0], middle[1]))
    seed, one_look, height = how
    for k, (t, x, y, heading) in enumerate(rows):
        rng = np.random.default_rng([seed, k])
        yield int(t), scene.shot(carried(x, y, heading, height), one_look, rng)


class _World:
    """A world that stands still."""

    def __init__(self, model: Any, half: float, middle: tuple[float, float]) -> None:
        self._model, self._room = model, (half, middle)
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)

    def shot(self, at: View, one_look: bool, rng: np.random.Generator, group: str = "") -> Shot:
        half, middle = self._room
        look = (
            plain(self._model, half, middle) if one_look else drawn(self._model, half, rng, middle)
        )
        return shot(self._model, self._data, traced(self._model, self._data, at, LENS), look, rng,
                    group)  # fmt: skip


def main(arguments: list[str] | None = None) -> None:
    """Writes a bag and a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plain", action="store_true", help="one look for all")
    parser.add_argument("--world", type=Path, help="MJCF, in place of drawn halls")
    parser.add_argument("--poses", type=Path, help="CSV, in that world")
    parser.add_argument("--height", type=float, default=HEIGHT, help="of the camera [m]")
    given = parser.parse_args(arguments)
    if given.world is None:
        shots = list(of_halls(given.images, given.seed, given.plain))
    else:
        how = given.seed, given.plain, given.height
        shots = list(of_poses(given.world, given.poses, given.images, how))
    samples = (
        Sample("camera", 1e-9 * t, k, {"image": one.png}) for k, (t, one) in enumerate(shots)
    )
    save_bag(given.out, samples, 0.0)
    save_rows(given.out.with_name(f"{given.out.stem}-objects.csv"), shots)


if __name__ == "__main__":
    try:
        main()
    except (EvertwinError, OSError) as error:
        sys.exit(f"{error}")
