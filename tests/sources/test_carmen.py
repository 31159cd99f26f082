"""CARMEN logs: scans, odometry and what is wrong with their stamps and poses."""

from __future__ import annotations

import gzip
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.signals.planar import between, compose
from evertwin.sources import inspect, open_recording, render
from evertwin.sources.columns.scans import Scans

BEAMS, COUNT = 181, 40
Stamp = Callable[[int], float]


def ranges(i: int) -> np.ndarray:
    return np.round(2 + np.sin(np.arange(BEAMS) * 0.1 + i), 2)


def flaser(i: int, stamp: float, pose: float, values: np.ndarray | None = None) -> str:
    values = ranges(i) if values is None else values
    cells = " ".join(f"{v:.2f}" for v in values)
    beside = f"{pose} 0 0.1 {pose} 0 0.1"
    return f"FLASER {len(values)} {cells} {beside} {stamp:.6f} host {stamp:.6f}"


def odom(i: float, stamp: float) -> str:
    return f"ODOM {0.1 * i:.4f} {0.02 * i:.4f} {3.1 + 0.01 * i:.5f} 0.1 0 0 {stamp:.6f} host 0"


def log(path: Path, stamp: Stamp, wheels: Stamp) -> Path:
    lines = ["# a log", "PARAM robot_frontlaser_offset 0.0 host 0"]
    for i in range(COUNT):
        lines += [odom(i, wheels(i)), flaser(i, stamp(i), 0.2 * i), odom(i + 0.5, wheels(i + 0.5))]
    path.write_text("\n".join(lines) + "\n")
    return path


def only(path: Path) -> Scans:
    (scans,) = open_recording(path).scans
    return scans


def test_scans_and_the_odometry_at_each(tmp_path: Path) -> None:
    scans = only(log(tmp_path / "run.log", lambda i: 5 + i, lambda i: 4.9 + i))
    assert np.array_equal(scans.ranges[3], ranges(3)) and scans.rate == pytest.approx(1.0)
    assert scans.lidar.angles(BEAMS)[[0, -1]] == pytest.approx([-math.pi / 2, math.pi / 2])
    assert scans.odometry is not None and scans.stated is not None
    # stamped 0.1 s after its line: a tenth of a step further, across the half turn
    assert scans.odometry[10] == pytest.approx([1.01, 0.202, 3.1 + 0.101], abs=1e-9)
    assert scans.stated[10].tolist() == [2.0, 0.0, 0.1]
    assert any("not used" in line for line in scans.findings)


def test_poses_of_a_mapping_program_are_no_odometry(tmp_path: Path) -> None:
    """GMapping goes on from its own pose behind every scan: an ODOM line without a stamp."""
    step, lines, wheels = np.array([0.1, 0.0, 0.02]), [], [np.zeros(3)]
    shown, rng = np.zeros(3), np.random.default_rng(3)
    for i in range(1, 120):
        wheels.append(compose(wheels[-1], step))
        shown = compose(shown, step)
        lines.append(f"ODOM {shown[0]:.9f} {shown[1]:.9f} {shown[2]:.9f} 0 0 0 {i} host {i}")
        if i % 3 == 0:
            shown = shown + rng.normal(0, 0.05, 3)
            pose = f"{shown[0]:.9f} {shown[1]:.9f} {shown[2]:.9f}"
            cells = " ".join(f"{v:.2f}" for v in ranges(i))
            lines.append(f"FLASER {BEAMS} {cells} {pose} {pose} {i} host {i}")
            lines.append(f"ODOM {pose} 0 0 0 0 host 0 {i}")
    path = tmp_path / "run.log"
    path.write_text("\n".join(lines))
    scans = only(path)
    assert scans.odometry is not None
    truth = between(np.broadcast_to(wheels[1], (39, 3)), np.array(wheels[3::3]))
    told = between(np.broadcast_to(scans.odometry[0], (39, 3)), scans.odometry)
    assert told == pytest.approx(between(np.broadcast_to(truth[0], (39, 3)), truth), abs=1e-6)
    assert "39 of 158 lines are not set" in " ".join(inspect(path).findings)


@pytest.mark.parametrize("stamp", [0.0, 976053557.5])
def test_constant_stamps_are_named_and_scans_counted(tmp_path: Path, stamp: float) -> None:
    path = log(tmp_path / "run.log", lambda _: stamp, lambda _: stamp)
    scans = only(path)
    assert not scans.timed and np.all(np.diff(scans.t) == 10**9)
    assert "every stamp is the same" in " ".join(scans.findings)
    assert scans.odometry is not None and np.array_equal(scans.odometry[7, :2], [0.7, 0.14])
    assert inspect(path).scans[0].rate is None and "no rate" in render(inspect(path))


def test_scans_between_two_lines_of_odometry_share_the_step(tmp_path: Path) -> None:
    """Half of the scans seemed not to move: beams were said to be 2° apart."""
    lines = [f"ODOM {i} 0 0 0 0 0 5 h 5\n{flaser(i, 5, i)}\n{flaser(i, 5, i)}" for i in range(9)]
    (tmp_path / "a.log").write_text("\n".join(lines))
    odometry = only(tmp_path / "a.log").odometry
    assert odometry is not None and odometry[:5, 0].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]


def test_stamps_that_go_back_are_placed_between(tmp_path: Path) -> None:
    scans = only(log(tmp_path / "run.log", lambda i: i - 2.5 * (i % 10 == 7), lambda i: 1.0 * i))
    assert np.all(np.diff(scans.t) > 0)
    assert np.abs(scans.t - np.arange(COUNT) * 10**9).max() == 0
    assert "4 go back, by up to 1.5 s" in " ".join(scans.findings)


def test_what_did_not_return_is_no_range(tmp_path: Path) -> None:
    values = np.full(BEAMS, 3.0)
    values[:6] = [81.91, 81.83, 0.0, -1.0, math.nan, math.inf]
    values[100:] = 81.91
    path = tmp_path / "run.log"
    path.write_text("\n".join(flaser(i, i, 0.0, values) for i in range(5)))
    scans = only(path)
    assert np.flatnonzero(np.isfinite(scans.ranges[0])).tolist() == list(range(6, 100))
    assert scans.lidar.longest == 81.8


def test_the_largest_range_is_none_where_it_keeps_returning(tmp_path: Path) -> None:
    """Without a stated range: 50 stands for nothing here, 3.0 is a range like others."""
    values = [np.where(np.arange(BEAMS) < 4, 50.0, ranges(i)) for i in range(COUNT)]
    path = tmp_path / "run.log"
    path.write_text("\n".join(flaser(i, i, 0.0, v) for i, v in enumerate(values)))
    scans = only(path)
    assert scans.lidar.longest == 50.0 and np.nanmax(scans.ranges) == 3.0


@pytest.mark.parametrize("codes", [(8.19, 8.18), (81.5, 81.4), (50.0, 50.0)])
def test_codes_below_the_largest_range_are_none(tmp_path: Path, codes: tuple[float, float]) -> None:
    """Of several codes, or where a few ranges lie above: walls stood where nothing came back."""
    rng, lines = np.random.default_rng(0), []
    for i in range(20):
        values = np.round(rng.uniform(1.0, 0.8 * codes[1], 180), 2)
        values[rng.integers(180)], values[90:] = 1.001 * codes[1], codes[1]
        values[:2] = codes[0]
        lines.append(flaser(i, i * 0.1, 0.0, values))
    (tmp_path / "a.log").write_text("\n".join(lines))
    found = only(tmp_path / "a.log")
    assert np.nanmax(found.ranges) < codes[1] <= np.min(codes) and found.lidar.longest == codes[1]


def test_a_described_laser_says_its_angles(tmp_path: Path) -> None:
    path = tmp_path / "run.log.gz"
    line = "ROBOTLASER1 0 -1.0 2.0 0.5 30.0 0.1 0 4 1.0 2.0 30.0 4.0 2 7 8 "
    path.write_bytes(gzip.compress((line + "1 2 3 1 2 4 0 0 0 0 0 5.5 host 0\n").encode()))
    scans = only(path)
    assert (scans.lidar.start, scans.lidar.step, scans.lidar.longest) == (-1.0, 0.5, 30.0)
    assert np.isnan(scans.ranges[0, 2]) and scans.stated is not None and scans.t[0] == 5500000000


@pytest.mark.parametrize("seed", range(5))
def test_what_is_taken_for_angles_that_are_not_said_is_told(tmp_path: Path, seed: int) -> None:
    """360 beams that look all around were called half a turn, and rubbish was called matched."""
    rng, beams = np.random.default_rng(seed), 360
    turn = np.exp(1j * np.radians(np.arange(beams)))
    walls, path = np.exp(1j * rng.uniform(0, 2 * np.pi, COUNT)), tmp_path / "run.log"
    seen = [4 + 2 * (turn * wall).real + rng.normal(0, 0.02, beams) for wall in walls]
    path.write_text("\n".join(flaser(i, i, 0.0, r) for i, r in enumerate(seen)))
    scans = only(path)
    assert scans.lidar.step == pytest.approx(math.radians(1.0))
    assert scans.lidar.start == pytest.approx(-math.pi)
    assert "360 beams are taken to share 360°" in " ".join(inspect(path).scans[0].findings)
    path.write_text("\n".join(flaser(i, i, 0.0, r[:181]) for i, r in enumerate(seen)))
    assert only(path).lidar.start == pytest.approx(-math.pi / 2)
    assert "181 beams are taken to share 180°, 1° apart" in only(path).assumed


def seen(turn: float, step: float, beams: int, noisy: np.random.Generator) -> np.ndarray:
    """Of a room of 8 m × 6 m, from beside its middle."""
    angles = turn + step * (np.arange(beams) - beams // 2)
    at = noisy.uniform(-1, 1, 2)
    with np.errstate(divide="ignore"):
        sides = [(4 - at[0]) / np.cos(angles), (-4 - at[0]) / np.cos(angles),
                 (3 - at[1]) / np.sin(angles), (-3 - at[1]) / np.sin(angles)]  # fmt: skip
    return np.min([np.where(w > 0, w, np.inf) for w in sides], axis=0) + noisy.normal(
        0, 0.01, beams
    )


@pytest.mark.parametrize(("beams", "shared"), [(541, 270), (361, 180), (683, 240), (181, 180)])
@pytest.mark.parametrize("seed", range(3))
def test_walls_tell_what_beams_share(tmp_path: Path, beams: int, shared: int, seed: int) -> None:
    noisy, path = np.random.default_rng(seed), tmp_path / "run.log"
    step = math.radians(shared / (beams - 1))
    scans = [seen(0.1 * i, step, beams, noisy) for i in range(COUNT)]
    path.write_text("\n".join(flaser(i, i, 0.0, r) for i, r in enumerate(scans)))
    assert only(path).lidar.step == pytest.approx(step)


@pytest.mark.parametrize("covered", [2, 20, COUNT])
@pytest.mark.parametrize("seed", range(3))
def test_a_covered_lidar_does_not_look_all_around(tmp_path: Path, seed: int, covered: int) -> None:
    """Two scans of 0.1 m among fifty made half a turn a whole one, and five times less of a way."""
    rng, path = np.random.default_rng(seed), tmp_path / "run.log"
    scans = [seen(rng.uniform(0, 6), math.radians(1), 180, rng) for _ in range(COUNT)]
    near = [np.full(180, 0.1) + 0.01 * (seed > 0) * rng.random(180) for _ in range(covered)]
    mixed = [(scans + near)[k] for k in rng.permutation(COUNT + covered)]
    path.write_text("\n".join(flaser(i, i, 0.0, r) for i, r in enumerate(mixed)))
    assert "180 beams are taken to share 180°" in only(path).assumed


@pytest.mark.parametrize("by", ["the two poses", "a parameter"])
def test_odometry_is_told_of_the_lidar(tmp_path: Path, by: str) -> None:
    """Beside the robot's middle the lidar goes along with every turn."""
    path = log(tmp_path / "run.log", lambda i: 5 + i, lambda i: 5 + i)
    text, mount = path.read_text(), np.array([0.25, 0.0, 0.0])
    middle = only(path).odometry
    if by == "a parameter":
        text = text.replace("frontlaser_offset 0.0", "frontlaser_offset 0.25")
    else:
        for i in range(COUNT):
            pose = f" {0.2 * i} 0 0.1 "
            lidar = compose(np.array([0.2 * i, 0.0, 0.1]), mount)
            text = text.replace(pose + pose[1:], f" {lidar[0]} {lidar[1]} 0.1{pose}", 1)
    path.write_text(text)
    found = only(path).odometry
    assert middle is not None and found is not None
    told = np.isfinite(middle).all(axis=1)
    assert found[told] == pytest.approx(compose(middle, np.tile(mount, (COUNT, 1)))[told])


def test_the_second_pose_is_odometry_where_the_first_does_not_go_along(tmp_path: Path) -> None:
    path, lines = tmp_path / "run.log", []
    for i in range(COUNT):
        both = f"{0.2 * i} 0 0.1 {0.2 * i} 0 0.1"
        lines.append(
            flaser(i, i, 0.2 * i).replace(both, f"{0.2 * i} 0 0.1 {0.21 * i} {0.01 * i} 0")
        )
    path.write_text("\n".join(lines))
    scans = only(path)
    assert scans.odometry is not None and scans.odometry[10] == pytest.approx([2.1, 0.1, 0.0])
    assert "is taken for odometry" in " ".join(scans.findings)


def test_damaged_lines_are_left_out_and_named(tmp_path: Path) -> None:
    path = log(tmp_path / "run.log", lambda i: 5 + i, lambda i: 5 + i)
    lines = path.read_text().splitlines()
    lines[3] = lines[3][:200]
    lines[12] = lines[12].replace("FLASER 181", "FLASER nine")
    lines[15] = flaser(1, 9.5, 0.0, np.ones(90))
    path.write_text("\n".join(lines))
    assert len(only(path).t) == COUNT - 3
    text = " ".join(inspect(path).findings)
    assert "FLASER: 2 lines left out, the first in line 4" in text
    assert "1 of 38 scans have not 181 beams" in text


def test_a_log_without_scans_and_odometry_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text("PARAM a b host 0\nSYNC x host 0\n")
    with pytest.raises(DataError, match="scans or odometry"):
        open_recording(path)


@pytest.mark.data
def test_real_logs(data_dir: Path) -> None:
    intel = inspect(data_dir / "laser_intel" / "intel-lab.log").scans[0]
    assert (intel.count, intel.beams, intel.odometry) == (2672, 180, False)
    aces = inspect(data_dir / "laser_aces" / "aces-corrected.log.gz").scans[0]
    assert (aces.count, aces.beams, aces.odometry) == (440, 180, True)


def test_scans_out_of_order_are_taken_by_their_even_stamps(tmp_path: Path) -> None:
    order = np.arange(COUNT)
    order[[9, 10, 30, 31]] = order[[10, 9, 31, 30]]
    found = {}
    for name, rows in (("in", np.arange(COUNT)), ("out", order)):
        file = tmp_path / f"{name}.log"
        lines = [f"ODOM {0.1 * i} 0 0 0 0 0 {i / 10:.6f} host {i / 10:.6f}\n{flaser(i, i / 10, 0)}"
                 for i in rows]  # fmt: skip
        file.write_text("\n".join([*lines, ""]))
        found[name] = open_recording(file).scans[0]
    one, other = found["in"], found["out"]
    assert np.array_equal(one.t, other.t) and np.array_equal(one.ranges, other.ranges)
    assert one.odometry is not None and other.odometry is not None
    assert np.array_equal(one.odometry, other.odometry, equal_nan=True)
    assert "2 of 40 scans stand out of order" in " ".join(other.findings)
    assert "out of order" not in " ".join(one.findings)
