"""Scan to pose: `python -m proofs.scans` (needs EVERTWIN_DATA).

1. The Intel lab (ranges alone) and the ACES building (with its wheels' odometry, and from ranges
   alone) by `evertwin map … --against stated`: error of the steps over 1 m and 10 m, of the whole
   way, time a scan; beside kiss-icp (the best of three voxel sizes) and what the recordings bring:
   the chained scan matches of the Intel log, the raw odometry of ACES.
2. The same log twice, from every other beam: how far two halves that share no beam differ. That is
   the mapping's own scatter; what is beyond it in 1 is the reference's. And how far the odd beams,
   which the poses of the even ones never saw, are off the walls of the scans around: by those
   poses, and by the stated ones.
3. Floors drawn by seed, seen by other lidars, against the truth: steps, lost poses, poses that are
   off by 0.3 m of the step over 1 m and called good, and the share of the poses inside their 95 %.
4. The settings of following, halved and doubled.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.features.maps.mapping import followed, mapped
from evertwin.features.maps.segments import surface_of
from evertwin.features.maps.trajectory_error import TrajectoryError, trajectory_error
from evertwin.features.scans import habits, scan_fit, scan_matcher
from evertwin.features.scans.local_map import Known, placed
from evertwin.features.scans.registration import REACH, beside
from evertwin.signals.planar import between, chained
from evertwin.sources import open_recording
from evertwin.sources.columns.scans import Scans
from planted.rooms import Sensor, recorded
from proofs._verdict import ended, no_data

INTEL, ACES = "laser_intel/intel-lab.log", "laser_aces/aces-corrected.log.gz"
STEPS = {"1 m": 0.037, "10 m": 0.065}
"""Asked of the Intel lab [m]: its chained scan matches over 1 m, half of theirs over 10 m."""
WHOLE, PER_SCAN = 0.25, 5.0
"""Asked of it as a whole [m], and of the time for a scan [ms]."""
CHI2 = 7.815
"""95 % of three squares."""
LIDARS = {
    "180 × 1°, 20 m, 1 cm": Sensor(),
    "120 × 2°": Sensor(beams=120, step=np.radians(2.0)),
    "1080 × 0.25°, 30 m": Sensor(beams=1080, step=np.radians(0.25), longest=30.0),
    "6 m": Sensor(longest=6.0),
    "3 cm": Sensor(noise=0.03),
    "a scan each 0.5 m": Sensor(apart=0.5),
    "a scan each 5 cm": Sensor(apart=0.05),
    "a scan each 1 m": Sensor(apart=1.0),
    "a scan each 1 m, 8 m": Sensor(apart=1.0, longest=8.0),
}
SETTINGS = {
    "APART": scan_matcher, "TURNED": scan_matcher, "FAMILIAR": scan_matcher,
    "CLEARLY": scan_fit, "ALIKE": scan_fit, "PART": habits, "RECENT": habits,
}  # fmt: skip
AROUND, EACH = 10, 7
"""Scans to either side whose walls one is compared with, and of how many one is."""


def command(log: Path, out: Path, *more: str) -> dict[str, Any]:
    """What `evertwin map` says."""
    words = [sys.executable, "-m", "evertwin", "map", str(log), "-o", str(out), "--json", *more]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def kiss(scans: Scans) -> tuple[TrajectoryError, float]:
    """kiss-icp on the same ranges: the best of three voxel sizes, and its time a scan [s]."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    angles, found = scans.lidar.angles(scans.ranges.shape[1]), []
    for voxel in (0.05, 0.1, 0.25):
        config = KISSConfig()
        config.data.deskew, config.data.min_range = False, 0.05
        config.data.max_range = float(np.nanmax(scans.ranges))
        config.mapping.voxel_size = voxel
        odometry, poses = KissICP(config), []
        began = time.perf_counter()
        for ranges in scans.ranges:
            r = ranges[np.isfinite(ranges)]
            a = angles[np.isfinite(ranges)]
            flat = np.column_stack([r * np.cos(a), r * np.sin(a), np.zeros(len(r))])
            points = np.concatenate([flat, flat + np.array([0.0, 0.0, 0.5])])  # else it tilts
            odometry.register_frame(points, np.zeros(len(points)))
            m = odometry.last_pose
            poses.append([m[0, 3], m[1, 3], np.arctan2(m[1, 0], m[0, 0])])
        took = (time.perf_counter() - began) / len(scans.t)
        assert scans.stated is not None
        found.append((trajectory_error(np.array(poses), scans.stated), took))
    return min(found, key=lambda one: one[0].absolute)


def matches(file: Path) -> np.ndarray:
    """The scan matches from line to line that the Intel log brings, chained."""
    edges = [line.split() for line in file.read_text().splitlines() if line.startswith("EDGE2")]
    steps = {int(e[1]): [float(v) for v in e[3:6]] for e in edges if int(e[2]) == int(e[1]) + 1}
    return chained(np.zeros(3), np.array([steps[k] for k in sorted(steps)]))


def row(name: str, figures: tuple[float, ...], more: str) -> None:
    """One row of figures."""
    near, middle, far, turn, whole = figures
    print(
        f"   {name:34} 1 m {100 * near:6.1f} cm (median {100 * middle:.1f})   10 m "
        f"{100 * far:6.1f} cm {turn:.4f} rad   whole {whole:6.3f} m  {more}",
        flush=True,
    )


def line(name: str, off: TrajectoryError, more: str = "") -> None:
    """An error as a row."""
    near, far = (off.relative[length] for length in (1.0, 10.0))
    row(name, (near.way, near.median, far.way, far.turn, off.absolute), more)


def said(name: str, found: dict[str, Any]) -> None:
    """The same from what the command says."""
    off = found["against"]
    near, far = off["relative"]["1 m"], off["relative"]["10 m"]
    more = f"{found['ms_per_scan']['mean']:.1f} ms a scan, {found['by']['lost']} lost, "
    figures = near["way"], near["median"], far["way"], far["turn"], off["absolute"]
    row(name, figures, f"{more}{found['loops']} loops")


def real(folder: Path, out: Path) -> dict[str, bool]:
    """Figures of the two logs; what was reached."""
    print("1. Recorded, against the poses that the logs state")
    intel = open_recording(folder / INTEL).scans[0]
    aces = open_recording(folder / ACES).scans[0]
    assert intel.stated is not None and aces.stated is not None and aces.odometry is not None
    lab = command(folder / INTEL, out / "intel", "--against", "stated")
    said("Intel lab, ranges alone", lab)
    line("   its chained scan matches", trajectory_error(matches(folder / INTEL), intel.stated))
    off, took = kiss(intel)
    line("   kiss-icp", off, f"{1e3 * took:.1f} ms a scan")
    wheels = command(folder / ACES, out / "aces", "--against", "stated")
    alone = command(folder / ACES, out / "alone", "--against", "stated", "--ranges-alone")
    said("ACES, with odometry", wheels)
    said("ACES, ranges alone", alone)
    raw = trajectory_error(aces.odometry, aces.stated)
    line("   its raw odometry", raw)
    off, took = kiss(aces)
    line("   kiss-icp", off, f"{1e3 * took:.1f} ms a scan")
    reached = {
        f"Intel lab over {name}: at most {100 * most:g} cm":
        lab["against"]["relative"][name]["way"] <= most for name, most in STEPS.items()
    }  # fmt: skip
    reached[f"Intel lab as a whole: at most {WHOLE} m"] = lab["against"]["absolute"] <= WHOLE
    for label, found in (("with odometry", wheels), ("ranges alone", alone)):
        for length, name in ((1.0, "1 m"), (10.0, "10 m")):
            most = 0.5 * raw.relative[length].way
            asked = f"ACES {label} over {name}: half of raw odometry, {100 * most:.1f} cm"
            reached[asked] = found["against"]["relative"][name]["way"] <= most
    reached[f"at most {PER_SCAN:g} ms a scan"] = all(
        one["ms_per_scan"]["mean"] <= PER_SCAN for one in (lab, wheels, alone)
    )
    return reached


def halves(folder: Path) -> None:
    """Two maps of the Intel lab that share no beam."""
    print("2. The Intel lab from its even and from its odd beams")
    scans = open_recording(folder / INTEL).scans[0]
    halved, found = [], []
    for k in (0, 1):
        lidar = replace(
            scans.lidar, start=scans.lidar.start + k * scans.lidar.step, step=2 * scans.lidar.step
        )
        halved.append(replace(scans, ranges=scans.ranges[:, k::2].copy(), lidar=lidar))
        found.append(mapped(halved[-1]).poses)
    line("one against the other", trajectory_error(found[0].pose, found[1].pose))
    print(f"   {[int(one.segment[-1]) + 1 for one in found]} maps of their own")
    assert scans.stated is not None
    for name, poses in (("of the even beams", found[0].pose), ("stated", scans.stated)):
        print(f"   odd beams by the poses {name}: {1e3 * off_walls(halved[1], poses):.1f} mm off "
              "the walls of the scans around (median)")  # fmt: skip


def off_walls(scans: Scans, poses: np.ndarray) -> float:
    """How far points are off the walls that the scans around see [m]: median of scans' medians."""
    walls = [surface_of(scans, k) for k in range(len(scans.t))]
    medians = []
    for k in range(AROUND, len(walls) - AROUND, EACH):
        near = [j for j in range(k - AROUND, k + AROUND + 1) if np.isfinite(poses[j, 0]) and j != k]
        if not near or not np.isfinite(poses[k, 0]):
            continue
        view = Known.of(np.concatenate([placed(walls[j], poses[j]) for j in near]))
        told = [
            beside(*view, tuple(at), REACH) for at in placed(walls[k], poses[k]) if at[2:].any()
        ]
        medians.append(np.median([abs(off) for weight, off, *_ in told if weight > 0] or [np.nan]))
    return float(np.nanmedian(medians))


def drawn(seeds: int) -> dict[str, bool]:
    """Floors by seed, lidar by lidar."""
    print(f"3. Drawn floors, {seeds} seeds each, against the truth")
    wrong, inside, poses = 0, 0, 0
    for name, lidar in LIDARS.items():
        rows = []
        for seed in range(seeds):
            scans, truth = recorded(seed, lidar)
            found = mapped(scans).poses
            off = trajectory_error(found.pose, truth)
            told = np.isfinite(found.pose[:, 0]) & (found.segment == 0)
            gap = between(np.broadcast_to(truth[0], truth.shape), truth) - found.pose
            gap[:, 2] = (gap[:, 2] + np.pi) % (2 * np.pi) - np.pi
            nees = np.einsum("ni,nij,nj->n", gap[told], np.linalg.inv(found.covariance[told]),
                             gap[told])  # fmt: skip
            n = max(round(1.0 / lidar.apart), 1)
            step = between(found.pose[:-n], found.pose[n:]) - between(truth[:-n], truth[n:])
            bad = int((np.hypot(step[:, 0], step[:, 1])[told[:-n] & told[n:]] > 0.3).sum())
            wrong, inside, poses = wrong + bad, inside + int((nees < CHI2).sum()), poses + len(nees)
            rows.append((off.relative[1.0].way, off.relative[10.0].way, off.absolute,
                         1 - told.mean(), bad, (nees < CHI2).mean()))  # fmt: skip
        near, far, whole, lost, bad, share = np.mean(rows, axis=0)
        print(f"   {name:24} 1 m {100 * near:5.2f} cm, 10 m {100 * far:5.1f} cm, whole "
              f"{whole:.3f} m, {100 * lost:.0f} % without a pose, {bad:.1f} wrong a drive, "
              f"{100 * share:.0f} % inside their 95 %")  # fmt: skip
    print(f"   {wrong} of {poses} poses wrong and called good, {100 * inside / poses:.1f} % inside")
    return {
        "no pose wrong and called good": wrong == 0,
        "92 to 98 % of the poses inside their 95 %": 0.92 <= inside / poses <= 0.98,
    }


def settings(folder: Path) -> None:
    """Halved and doubled, on ACES with odometry and on a drawn floor."""
    print("4. Settings of following, halved and doubled")
    aces = open_recording(folder / ACES).scans[0]
    assert aces.stated is not None
    scans, truth = recorded(1)
    for name, module in SETTINGS.items():
        usual = getattr(module, name)
        for factor in (0.5, 2.0):
            setattr(module, name, usual * factor)
            line(
                f"{name} × {factor:g}, ACES", trajectory_error(mapped(aces).poses.pose, aces.stated)
            )
            line(f"{name} × {factor:g}, floor", trajectory_error(followed(scans).poses.pose, truth))
        setattr(module, name, usual)


def main() -> int:
    """Exit code 0 if everything asked was reached."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    folder = Path(os.environ["EVERTWIN_DATA"])
    with tempfile.TemporaryDirectory() as out:
        reached = real(folder, Path(out))
    halves(folder)
    reached |= drawn(seeds=3)
    settings(folder)
    return ended(reached)


if __name__ == "__main__":
    sys.exit(main())
