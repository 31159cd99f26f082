"""``evertwin map`` and ``evertwin locate``: scans to poses and a map, and a scan into a map."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin.app.console import Alive, show
from evertwin.errors import DataError, UsageError
from evertwin.features.maps.mapping import Fused, Mapped, mapped
from evertwin.features.maps.occupancy import of_keyframes, read, save
from evertwin.features.maps.relocalisation import View, located
from evertwin.features.maps.segments import surface_of
from evertwin.features.maps.trajectory_error import TrajectoryError, trajectory_error
from evertwin.features.scans.poses import Fix, Poses
from evertwin.features.scans.slips import Slip, slips
from evertwin.report.map_picture import draw_map
from evertwin.signals import unwrapped
from evertwin.signals.planar import wrapped
from evertwin.sources.columns.scans import Lidar, Scans
from evertwin.sources.recording import open_recording
from evertwin.sources.robot_logs.bag_scans import scans_of

COLUMNS = (
    "t_ns", "x", "y", "theta", "var_x", "cov_xy", "cov_xtheta", "var_y", "cov_ytheta", "var_theta",
    "fix", "share", "segment",
)  # fmt: skip
STATED = "stated"
"""What names the poses that a log states beside its scans."""


class Topics(NamedTuple):
    """What is asked for by name; empty: the first.

    >>> Topics("/scan").odometry
    ''
    """

    scan: str = ""
    odometry: str = ""
    step: float = 0.0
    """From beam to beam, of a lidar that does not say it [°]; 0: as it is taken."""


def make_map(
    file: Path, out: Path, against: str | None, ranges_alone: bool, topics: Topics, as_json: bool
) -> None:
    """``evertwin map``."""
    scans = only_lidar(file, topics)
    if ranges_alone:
        scans = replace(scans, odometry=None, wheels=None, gyro=None)
    with Alive() as alive:
        alive.say(f"following {len(scans.t)} scans")
        found = mapped(scans)
        out.mkdir(parents=True, exist_ok=True)
        chart = of_keyframes(found.keyframes, found.surfaces, found.lidar.mount)
        save(chart, out / "map.yaml")
        draw_map(chart, found.poses).savefig(out / "map.png", dpi=150)
        _write(found.poses, out / "poses.csv")
        if found.fused is not None:
            _write_fused(found.fused, out / "fused.csv")
    off = None
    if against is not None:
        off = trajectory_error(found.poses.pose, _reference(scans, against), found.poses.segment)
    content = _content(scans, found, off)
    show(content, _text(content, out), as_json)


def only_lidar(file: Path, topics: Topics) -> Scans:
    """The scans of a recording's lidar, the first one unless it is named.

    Raises:
        DataError: it has none.
        UsageError: no such topic.
    """
    if not file.exists():
        raise DataError(f"{file}: no such file")
    recording = open_recording(file)
    found = scans_of(recording, topics.scan, topics.odometry)
    if not found:
        raise DataError(
            f"{file}: expected scans (LaserScan of a bag, FLASER or ROBOTLASER of a CARMEN log), "
            "found none"
        )
    others = [one.name for one in found[1:]]
    also = (f"of {found[0].name}; there is {', '.join(others)} besides",) if others else ()
    cut = [note for note in recording.notes if "broke off" in note]
    one, assumed = found[0], [found[0].assumed] * bool(found[0].assumed)
    if topics.step:
        if not assumed or topics.step < 0:
            raise UsageError(
                f"--step {topics.step:g}: expected above 0°, and scans that do not say their "
                f"angles (FLASER), not {one.name}"
            )
        step, assumed = math.radians(topics.step), []
        one = replace(one, lidar=Lidar.ahead(one.ranges.shape[1], step, one.lidar.longest))
    return replace(one, findings=(*also, *cut, *assumed, *one.findings))


def _write(poses: Poses, file: Path) -> None:
    upper = np.triu_indices(3)
    rows = zip(poses.t, poses.pose, poses.covariance, poses.fix, poses.share, poses.segment)
    lines = [",".join(COLUMNS)]
    for t, pose, covariance, fix, share, segment in rows:
        numbers = [*_shown(pose), *covariance[upper]]
        cells = ["" if math.isnan(v) else f"{v:.9g}" for v in numbers]
        word = Fix(int(fix)).name.lower()
        lines.append(",".join([str(int(t)), *cells, word, f"{share:.3f}", str(int(segment))]))
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _shown(pose: np.ndarray) -> np.ndarray:
    """With a heading from -π to π: one that was followed counts its turns."""
    return np.concatenate([pose[:2], wrapped(pose[2:])])


def _write_fused(fused: Fused, file: Path) -> None:
    upper = np.triu_indices(3)
    lines = [",".join([*COLUMNS[:10], "segment"])]
    for t, pose, covariance, segment in zip(*fused[:4], strict=True):
        numbers = (f"{v:.9g}" for v in [*_shown(pose), *covariance[upper]])
        lines.append(",".join([str(int(t)), *numbers, str(int(segment))]))
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _reference(scans: Scans, against: str) -> np.ndarray:
    """Poses to compare with, at the stamps of the scans."""
    if against == STATED:
        if scans.stated is None:
            raise UsageError(f"--against {STATED}: the recording states no poses in a map")
        return scans.stated
    table = np.genfromtxt(against, delimiter=",", names=True)
    names = table.dtype.names or ()
    if not {"t_ns", "x", "y", "theta"} <= set(names):
        raise UsageError(f"--against {against}: expected columns t_ns, x, y, theta; got {names}")
    at, heading = table["t_ns"], unwrapped(table["theta"])
    whole = np.column_stack([table["x"], table["y"], heading])
    return np.column_stack([np.interp(scans.t, at, c, np.nan, np.nan) for c in whole.T])


def _content(scans: Scans, found: Mapped, off: TrajectoryError | None) -> dict[str, Any]:
    poses = found.poses
    last = np.flatnonzero(poses.fix != Fix.LOST)[-1]
    way = np.diff(poses.pose[poses.segment == 0, :2], axis=0)
    content: dict[str, Any] = {
        "schema": "evertwin.map/1",
        "scans": len(poses.t),
        "by": {fix.name.lower(): int((poses.fix == fix).sum()) for fix in Fix},
        "odometry": scans.odometry is not None,
        "gyro": scans.gyro is not None,
        "slips": [one._asdict() for one in _slips(scans, poses)],
        "segments": int(poses.segment.max()) + 1,
        "way": float(np.nansum(np.hypot(way[:, 0], way[:, 1]))),
        "keyframes": len(found.keyframes),
        "loops": found.loops,
        "sigma_at_end": np.sqrt(np.diag(poses.covariance[last])).tolist(),
        "ms_per_scan": {"median": 1e3 * float(np.median(found.took)),
                        "p95": 1e3 * float(np.quantile(found.took, 0.95)),
                        "mean": 1e3 * float(found.took[1:].mean())},
        "fused": 0 if found.fused is None else len(found.fused.t),
        "late": 0 if found.fused is None else found.fused.late,
        "findings": list(found.findings),
    }  # fmt: skip
    if off is not None:
        relative = {f"{length:g} m": one._asdict() for length, one in off.relative.items()}
        content["against"] = {"relative": relative, "absolute": off.absolute, "poses": off.poses}
    return content


def _text(content: dict[str, Any], out: Path) -> str:
    by, took, sigma = content["by"], content["ms_per_scan"], content["sigma_at_end"]
    by_odometry = f", {by['predicted']} by odometry alone" if by["predicted"] else ""
    segments = f"{content['segments']} segment{'s' if content['segments'] > 1 else ''}"
    wheels = f"{'with' if content['odometry'] else 'without'} odometry"
    wheels += " and gyro" if content["gyro"] else ""
    lines = [
        f"{content['scans']} scans over {content['way']:.1f} m: {by['matched']} placed"
        f"{by_odometry}, "
        f"{by['lost']} without a pose; {wheels}",
        f"{content['keyframes']} keyframes, {content['loops']} places recognised, {segments}",
        f"at the end ± {sigma[0]:.3f} m, {sigma[1]:.3f} m, {sigma[2]:.4f} rad (1 σ)",
        f"{took['median']:.2g} ms a scan (median), {took['p95']:.2g} ms (95 %)",
    ]
    if content["segments"] > 1:
        lines.append("lost for long: what comes after is a map of its own, by segment in poses.csv")
    if "against" in content:
        for length, off in content["against"]["relative"].items():
            lines.append(
                f"against the reference over {length}: {100 * off['way']:.1f} cm, "
                f"{off['turn']:.4f} rad (rms of {off['stretches']}), median "
                f"{100 * off['median']:.1f} cm"
            )
        lines.append(
            f"against the reference as a whole: {content['against']['absolute']:.3f} m "
            f"(rms of {content['against']['poses']} poses)"
        )
    lines += [
        f"the wheels slipped from {one['start'] * 1e-9:.1f} to {one['end'] * 1e-9:.1f} s: they say "
        f"{one['wheels']:.2f} m, the scans {one['scans']:.2f} m"
        for one in content["slips"]
    ]
    lines += [f"  - {line}" for line in content["findings"]]
    fused = ", fused.csv" if content["fused"] else ""
    return "\n".join([*lines, f"written: {out}/map.yaml, map.pgm, map.png, poses.csv" + fused])


def _slips(scans: Scans, poses: Poses) -> list[Slip]:
    if scans.odometry is None:
        return []
    return slips(scans.t, poses.pose, scans.odometry, (poses.slip, poses.scale))


def find_place(chart: Path, file: Path, number: int, topics: Topics, as_json: bool) -> None:
    """``evertwin locate``."""
    scans = only_lidar(file, topics)
    if not 0 <= number < len(scans.t):
        raise UsageError(f"--number {number}: expected 0 to {len(scans.t) - 1}")
    found = located([View(surface_of(scans, number))], read(chart))
    content: dict[str, Any] = {"schema": "evertwin.locate/1", "share": found.share}
    if found.pose is None or found.covariance is None:
        show(
            {**content, "pose": None, "reason": found.reason}, f"not told: {found.reason}", as_json
        )
        return
    sigma = np.sqrt(np.diag(found.covariance))
    pose = _shown(found.pose).tolist()
    show(
        {**content, "pose": pose, "covariance": found.covariance},
        f"x {pose[0]:.3f} ± {sigma[0]:.3f} m, y {pose[1]:.3f} ± {sigma[1]:.3f} m, heading "
        f"{pose[2]:.4f} ± {sigma[2]:.4f} rad; {100 * found.share:.0f} % of the scan fits",
        as_json,
    )
