"""``evertwin tables``: the tables of a room, its cost map, and bodies for a MuJoCo world."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin.app.console import Alive, show
from evertwin.app.perception.map_command import Topics, only_lidar
from evertwin.errors import DataError, UsageError
from evertwin.features.maps.cost_map import Inflation, freed, inflated
from evertwin.features.maps.mapping import mapped
from evertwin.features.maps.occupancy import of_keyframes, save
from evertwin.features.maps.segments import surface_of
from evertwin.features.scans.poses import Fix
from evertwin.features.tables.legs import View
from evertwin.features.tables.rectangles import corners
from evertwin.features.tables.tables import Happened, Room, Table, furnished
from evertwin.models.tables.bodies import Plate, bodies
from evertwin.report.table_picture import draw_tables
from evertwin.signals import unwrapped
from evertwin.signals.planar import compose
from evertwin.sources.columns.scans import Scans
from evertwin.sources.texts.small_table import read_table
from evertwin.types import Float64

KEYFRAME = 0.3
"""Way between the scans that draw the map [m]."""
NAMES = ("x", "y", "heading", "length", "width")
COLUMNS = (
    "number", *NAMES, *(f"cov_{a}_{b}" for k, a in enumerate(NAMES) for b in NAMES[k:]),
    "leg_radius", "legs_seen", "since_ns", "seen_ns",
)  # fmt: skip

WORDS = {
    "found": "found", "appeared": "appeared where nothing stood", "gone": "is gone",
    "withdrawn": "withdrawn: its legs are another's",
}  # fmt: skip


class Asked(NamedTuple):
    """What is said of machine and tables.

    >>> Asked(Inflation(0.2, 0.6), Plate(), np.zeros(3)).plate.height
    0.72
    """

    inflation: Inflation
    plate: Plate
    origin: Float64[np.ndarray, " 3"]
    """Pose of the map's origin in the world that the bodies go into."""
    three: bool = False
    """Are three legs a table whose fourth was never in sight?"""


def make_tables(
    file: Path, out: Path, poses: Path | None, asked: Asked, topics: Topics, as_json: bool
) -> None:
    """``evertwin tables``."""
    scans = only_lidar(file, topics)
    with Alive() as alive:
        alive.say(f"looking for tables in {len(scans.t)} scans")
        pose = _mapped(scans) if poses is None else _read_poses(scans, poses)
        told = np.flatnonzero(np.isfinite(pose).all(axis=1))
        if not len(told):
            raise DataError(f"{poses or file}: no scan has a pose")
        lidar = compose(pose, np.broadcast_to(np.array(scans.lidar.mount), pose.shape))
        room, happened = furnished(
            (View(int(scans.t[k]), scans.ranges[k], scans.lidar, lidar[k]) for k in told),
            asked.three,
        )
        keys = _keyframes(pose, told)
        chart = of_keyframes(pose[keys], tuple(surface_of(scans, int(k)) for k in keys),
                             scans.lidar.mount)  # fmt: skip
        gone = [corners(one.before) for one in happened if one.before is not None]
        chart = freed(chart, np.concatenate([*gone, np.zeros((0, 2))]))
        costs = inflated(chart, [table.shape for table in room.tables], asked.inflation)
        out.mkdir(parents=True, exist_ok=True)
        save(costs, out / "costs.yaml", "raw")
        _write(room.tables, out / "tables.csv")
        named = [(f"table{one.number}", one.shape, one.radius) for one in room.tables]
        world = bodies(named, asked.plate, asked.origin)
        (out / "tables.xml").write_text(world, encoding="utf-8")
        picture = draw_tables((chart, costs), room.tables, happened, pose[told])
        picture.savefig(out / "tables.png", dpi=150)
    content = _content(scans, told, room, happened)
    show(content, _text(content, out), as_json)


def _mapped(scans: Scans) -> Float64[np.ndarray, "n 3"]:
    """Poses from the scans themselves; NaN where there is none in the first map."""
    poses = mapped(scans).poses
    known = (poses.fix != Fix.LOST) & (poses.segment == 0)
    return np.where(known[:, None], poses.pose, np.nan)


def _read_poses(scans: Scans, file: Path) -> Float64[np.ndarray, "n 3"]:
    """Poses of a file, as ``evertwin map`` writes them, at the stamps of the scans.

    Raises:
        DataError: a column is absent, or no pose lies within the recording's time.
    """
    table = read_table(file)
    t, whole = table.column("t_ns"), [table.column(name) for name in ("x", "y", "theta")]
    whole[2] = unwrapped(whole[2])
    if np.any(np.diff(t) <= 0):
        raise DataError(f"{file}: t_ns: expected stamps that increase")
    pose = np.column_stack([np.interp(scans.t, t, one, np.nan, np.nan) for one in whole])
    if "segment" in table.numbers:
        segment = np.interp(scans.t, t, table.numbers["segment"])
        pose[segment > 0] = np.nan
    if not np.isfinite(pose).any():
        raise DataError(
            f"{file}: no pose lies within the recording's time, {scans.t[0]} to {scans.t[-1]} ns: "
            "are both of one drive?"
        )
    return np.asarray(pose)


def _keyframes(pose: Float64[np.ndarray, "n 3"], told: np.ndarray) -> list[int]:
    """Scans that draw the map."""
    keys = [int(told[0])]
    for k in told[1:]:
        if np.hypot(*(pose[k, :2] - pose[keys[-1], :2])) > KEYFRAME:
            keys.append(int(k))
    return keys


def _write(tables: Sequence[Table], file: Path) -> None:
    upper = np.triu_indices(5)
    lines = [",".join(COLUMNS)]
    for one in tables:
        numbers = [*one.shape, *one.rectangle.covariance[upper], one.radius]
        cells = [str(one.number), *(f"{v:.9g}" for v in numbers)]
        lines.append(",".join([*cells, str(len(one.rectangle.known)), str(one.since),
                               str(one.seen)]))  # fmt: skip
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _content(
    scans: Scans, told: np.ndarray, room: Room, happened: Sequence[Happened]
) -> dict[str, Any]:
    return {
        "schema": "evertwin.tables/1", "scans": len(scans.t), "with_pose": len(told),
        "began_ns": int(scans.t[0]),
        "tables": [
            {"number": one.number, **dict(zip(NAMES, one.shape.tolist())),
             "sigma": np.sqrt(one.rectangle.covariance.diagonal()).tolist(),
             "leg_radius": one.radius, "legs_seen": len(one.rectangle.known),
             "since_ns": one.since, "seen_ns": one.seen}
            for one in room.tables
        ],
        "events": [
            {"t_ns": one.t, "what": one.what, "number": one.number, "before": one.before,
             "now": one.now}
            for one in happened
        ],
    }  # fmt: skip


def _text(content: dict[str, Any], out: Path) -> str:
    tables, events = content["tables"], content["events"]
    lines = [f"{len(tables)} table{'' if len(tables) == 1 else 's'} in {content['with_pose']} of "
             f"{content['scans']} scans"]  # fmt: skip
    for one in tables:
        s = one["sigma"]
        seen = "" if one["legs_seen"] == 4 else "; one leg was never in sight"
        lines.append(
            f"  table {one['number']}: x {one['x']:.3f} ± {s[0]:.3f}, y {one['y']:.3f} ± "
            f"{s[1]:.3f} m, heading {one['heading']:.3f} ± {s[2]:.3f} rad, {one['length']:.3f} ± "
            f"{s[3]:.3f} × {one['width']:.3f} ± {s[4]:.3f} m around its legs{seen}"
        )
    for one in events:
        line = f"  {1e-9 * (one['t_ns'] - content['began_ns']):.1f} s: table {one['number']} "
        if one["what"] == "moved":
            way = np.asarray(one["now"])[:2] - np.asarray(one["before"])[:2]
            line += f"was moved by {np.hypot(*way):.2f} m"
        else:
            line += WORDS[one["what"]]
        lines.append(line)
    files = "tables.csv, tables.xml, tables.png, costs.yaml, costs.pgm"
    return "\n".join([*lines, f"written: {out}/{files}"])


def pose_of(text: str) -> Float64[np.ndarray, " 3"]:
    """Three numbers.

    Raises:
        UsageError: they are not.
    """
    try:
        x, y, heading = (float(one) for one in text.replace(",", " ").split())
    except ValueError:
        raise UsageError(
            f"--origin: expected x [m], y [m] and heading [rad], as in '1.5 0 1.57', got {text!r}"
        ) from None
    return np.array([x, y, heading])
