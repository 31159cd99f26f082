"""A whole drive: loops closed, the map saved, a scan found in it again; and by the command line."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.app.perception import map_command as app_mapping
from evertwin.errors import DataError
from evertwin.features.maps import pose_graph
from evertwin.features.maps.mapping import Mapped, followed, mapped
from evertwin.features.maps.occupancy import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Occupancy,
    counted,
    of_keyframes,
    read,
    save,
)
from evertwin.features.maps.open_ways import evened
from evertwin.features.maps.pose_graph import Edge, optimised
from evertwin.features.maps.relocalisation import View, located
from evertwin.features.maps.segments import surface_of
from evertwin.features.maps.trajectory_error import trajectory_error
from evertwin.features.scans.local_map import seen
from evertwin.features.scans.poses import Fix, Poses
from evertwin.signals.planar import between
from evertwin.sources.columns.scans import Scans
from planted.draws import first_of
from planted.rooms import Sensor, box, ranges, recorded

pytest.importorskip("gtsam", reason="the extra perception is not installed")
COARSE = Sensor(beams=120, step=np.radians(2.0), apart=0.25)


@pytest.fixture(scope="module")
def drive() -> tuple[Scans, np.ndarray, Mapped]:
    scans, truth = recorded(4, COARSE, laps=1.1, slip=0.05)
    return scans, truth, mapped(scans)


def test_loops_bring_the_map_together(drive: tuple[Scans, np.ndarray, Mapped]) -> None:
    scans, truth, found = drive
    alone = trajectory_error(followed(scans).poses.pose, truth).absolute
    closed = trajectory_error(found.poses.pose, truth).absolute
    assert found.loops > 0 and closed < 0.05 and closed < max(alone, 0.02)


def test_a_drive_that_is_lost_on_the_way_is_still_mapped() -> None:
    """Corridors far longer than the lidar sees: no pose there rather than a wrong one."""
    scans, truth = recorded(2, COARSE._replace(longest=3.0, apart=0.15), laps=0.5)
    found = mapped(scans).poses
    lost = np.isnan(found.pose[:, 0])
    assert 0 < lost.mean() < 0.5
    assert trajectory_error(found.pose, truth).absolute < 0.6


def test_what_one_scan_leaves_open_is_decided_by_those_that_follow() -> None:
    """A scan each metre in corridors, from the ranges alone."""
    scans, truth = recorded(2, Sensor(apart=1.0, longest=8.0))
    found = mapped(scans).poses
    assert np.isfinite(found.pose).all() and found.segment[-1] == 0
    assert trajectory_error(found.pose, truth).relative[10.0].way < 0.1


def test_what_was_told_behind_a_gap_stands_by_the_keyframe_behind_it() -> None:
    """Lost in a corridor; a scan between the gap and the next keyframe goes with that one."""
    scans, truth = recorded(1, Sensor(longest=6.0))
    found = mapped(scans).poses.pose
    off = between(found[:-7], found[7:]) - between(truth[:-7], truth[7:])
    assert np.isnan(found).any() and np.nanmax(np.hypot(off[:, 0], off[:, 1])) < 0.3


def test_a_leap_goes_back_along_the_open_direction_alone() -> None:
    """A corridor along x: not sure of x from scan 3 on, 0.4 m off when sure again; y is right."""
    way = np.column_stack([np.arange(10.0), 0.1 * np.arange(10.0) ** 2, np.zeros(10)])
    pose, wide = way.copy(), np.tile(np.eye(3) * 1e-4, (10, 1, 1))
    wide[3:8, 0, 0] = 0.1 * np.arange(1, 6)
    pose[3:8, 0] -= 0.08 * np.arange(1, 6)
    zeros, ones = np.zeros(10, np.int64), np.ones(10)
    poses = Poses(
        np.arange(10), pose, wide, np.full(10, Fix.MATCHED, np.uint8), ones, ones.astype(np.uint8),
        zeros, pose, wide, zeros.astype(np.uint8), ones,
    )  # fmt: skip
    found = evened(poses, wheels=way).pose
    assert np.allclose(found[:, 1], way[:, 1], atol=1e-9)
    assert np.abs(found[3:8, 0] - way[3:8, 0]).max() < 0.1


def test_a_loop_is_closed_and_a_wrong_one_weighs_little() -> None:
    """A square with a turn that errs by 0.02 rad each, one true loop and one that is nonsense."""
    step, square = np.array([1.0, 0.0, 0.0]), []
    poses = [np.zeros(3)]
    for k in range(40):
        turn = np.pi / 2 + 0.02 if k % 10 == 9 else 0.0
        edge = np.array([*step[:2], turn])
        square.append(Edge(k, k + 1, edge, np.diag([0.02, 0.02, 0.02]) ** 2))
        c, s = np.cos(poses[-1][2]), np.sin(poses[-1][2])
        poses.append(poses[-1] + [c, s, turn])
    firm = np.diag([0.01, 0.01, 0.01]) ** 2
    true = Edge(0, 40, np.zeros(3), firm, loop=True)
    false = Edge(5, 25, np.array([0.5, 0.0, 0.0]), firm, loop=True)
    good = optimised(np.array(poses), [*square, true])
    both = optimised(np.array(poses), [*square, true, false])
    assert np.hypot(*good.poses[40, :2]) < 0.05
    assert np.hypot(*(both.poses[20] - good.poses[20])[:2]) < 0.5
    assert good.covariances[20, 0, 0] > good.covariances[2, 0, 0] > 0


def there_and_back(seed: int) -> tuple[np.ndarray, list[Edge]]:
    """Firm steps, but one of a bare corridor each way; and the places that are passed again."""
    rng = np.random.default_rng(seed)
    out = 0.36 * np.arange(60)
    way = np.column_stack([np.r_[out, out[::-1]], np.zeros(120), np.repeat([0.0, np.pi], 60)])
    firm = np.diag(10 ** rng.uniform(-8.3, -7.3, 3))
    gap = np.diag([rng.uniform(2, 20), 1e-5, 2e-6])
    wide = [30, 31, 88, 89]
    steps = [
        Edge(k, k + 1, between(way[k], way[k + 1]), gap if k in wide else firm) for k in range(119)
    ]
    open_ = [
        Edge(k, 119 - k, between(way[k], way[119 - k]), np.diag([1.0, 1e-5, 3e-6]), loop=True)
        for k in range(10, 50, 2)
    ]
    return way, steps + open_


@pytest.mark.parametrize("seed", range(5))
def test_a_bare_corridor_is_an_open_direction_of_the_graph(seed: int) -> None:
    """It ended with "Indeterminate linear system"; nothing was written."""
    way, edges = there_and_back(seed)
    found = optimised(way, edges)
    spread = np.sqrt(found.covariances[:, 0, 0])
    assert not found.failed and np.allclose(found.poses[:, :2], way[:, :2], atol=1e-3)
    assert spread[30] < 0.02 and spread[40] > 1.0
    alone = pose_graph._along(way, edges)
    assert np.allclose(alone[:30], found.covariances[:30], rtol=0.05, atol=1e-6)
    assert alone[40, 0, 0] >= found.covariances[40, 0, 0]


def test_a_graph_that_cannot_be_solved_leaves_what_was_followed(
    drive: tuple[Scans, np.ndarray, Mapped], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("Indeterminate linear system")

    monkeypatch.setattr(pose_graph, "_fitted", fails)
    found = mapped(drive[0])
    assert "as they were followed" in " ".join(found.findings)
    assert trajectory_error(found.poses.pose, drive[1]).absolute < 0.3
    spread = np.trace(found.poses.covariance[:, :2, :2], axis1=1, axis2=2)
    assert spread[-1] > spread[len(spread) // 4] > 0


def test_the_map_is_that_of_map_server(
    drive: tuple[Scans, np.ndarray, Mapped], tmp_path: Path
) -> None:
    found = drive[2]
    chart = of_keyframes(found.keyframes, found.surfaces)
    save(chart, tmp_path / "map.yaml")
    image = (tmp_path / "map.pgm").read_bytes()
    rows, columns = chart.cells.shape
    assert image.startswith(b"P5\n%d %d\n255\n" % (columns, rows))
    assert image[-columns:] == chart.cells[0].tobytes()  # the last row is the lowest
    assert set(np.unique(chart.cells)) == {FREE, OCCUPIED, UNKNOWN}


def test_maps_of_others_are_read(tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P5 # a remark\n2 2\n255\n" + bytes([0, 254, 205, 128]))
    text = "image: 'm.pgm'\nresolution: 0.1\norigin: [-1.0, 2e0, 0]\nnegate: 1\n"
    file = tmp_path / "m.yaml"
    file.write_text(text + "occupied_thresh: 0.65\nfree_thresh: 0.196 # of 255\n")
    chart = read(file)
    assert chart.cells.tolist() == [[OCCUPIED, UNKNOWN], [FREE, OCCUPIED]]
    assert chart.origin == (-1.0, 2.0)


@pytest.mark.parametrize(
    ("yaml", "pgm"),
    [
        ("image: m.pgm\n", b"P5\n2 2\n255\n1234"),
        ("", b"P2\n2 2\n255\n1 2 3 4"),
        ("", b"P5\n2 2\n255\n12"),
        ("origin: [0, 0, 1.57]\n", b"P5\n2 2\n255\n1234"),
        ("image: none.pgm\n", b""),
    ],
)
def test_what_is_no_map_is_refused(tmp_path: Path, yaml: str, pgm: bytes) -> None:
    (tmp_path / "m.pgm").write_bytes(pgm)
    whole = (
        "image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.6\nfree_thresh: 0.2\n"
    )
    (tmp_path / "m.yaml").write_text(yaml if yaml == "image: m.pgm\n" else whole + yaml)
    with pytest.raises(DataError):
        read(tmp_path / "m.yaml")


def test_both_forms_count_alike(run_as: Callable[[str], None]) -> None:
    walls = np.random.default_rng(0).uniform(0.1, 4.9, (50, 2))

    def cells() -> tuple[np.ndarray, np.ndarray]:
        passed, met = np.zeros((50, 50), np.int64), np.zeros((50, 50), np.int64)
        counted(walls, 50, np.array([2.5, 2.5]), 0.1, passed, met)
        return passed, met

    run_as("plain")
    plainly = cells()
    run_as("machine code")
    assert all(np.array_equal(a, b) for a, b in zip(plainly, cells()))


@pytest.mark.slow
def test_a_scan_is_found_in_its_map_and_in_no_other(
    drive: tuple[Scans, np.ndarray, Mapped],
) -> None:
    scans, _, found = drive
    chart = of_keyframes(found.keyframes, found.surfaces)
    right = 0
    for k in (30, 60):
        place = located([View(surface_of(scans, k))], chart)
        if place.pose is None:
            assert place.reason
            continue
        off = between(found.poses.pose[k], place.pose)
        assert np.hypot(off[0], off[1]) < 0.1 and abs(off[2]) < 0.05
        right += 1
    assert right
    other, _ = recorded(11, COARSE, laps=0.1)
    assert located([View(surface_of(other, 5))], chart).pose is None
    assert located([View(np.zeros((2, 4)))], chart).pose is None


@pytest.mark.slow
@first_of(("cell", "half"), [(0.05, 0.075), (0.05, 0.04), (0.1, 0.05)])
def test_a_scan_is_found_in_a_map_whose_walls_are_drawn_thick(cell: float, half: float) -> None:
    """As other tools draw them: a beam that grazes a wall is in its cells long before its end."""
    right, wrong = 0, 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        walls = np.concatenate(
            [box(0, 0, *rng.uniform(7, 11, 2)), *(box(*rng.uniform(-3, 3, 2), 0.6, 0.9, k)
                                                 for k in range(3)),
             *(box(*rng.uniform(-3, 3, 2), 0.06, 0.06) for _ in range(12))]
        )  # fmt: skip
        side = np.arange(-6.5, 6.5, cell) + 0.5 * cell
        at = np.stack(np.meshgrid(side, side), axis=-1)[:, :, None]
        a, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
        part = np.clip(((at - a) * along).sum(-1) / (along**2).sum(-1), 0, 1)
        off = np.hypot(*np.moveaxis(at - a - part[..., None] * along, -1, 0)).min(axis=-1)
        cells = np.where(off < half, OCCUPIED, FREE).astype(np.uint8)
        chart = Occupancy(cells, cell, (-6.5, -6.5))
        for _ in range(3):
            pose = np.array([*rng.uniform(-2, 2, 2), rng.uniform(-3, 3)])
            angles = np.radians(np.arange(-180.0, 180.0))
            scan = ranges(walls, pose, angles) + 0.01 * rng.normal(size=360)
            place = located([View(seen(scan, angles, (0.0, 0.0, 0.0)))], chart).pose
            if place is not None:
                good = np.hypot(*between(pose, place)[:2]) < 0.15
                right, wrong = right + int(good), wrong + int(not good)
    assert right >= 9 and not wrong


def log_of(scans: Scans, truth: np.ndarray, file: Path) -> Path:
    lines = []
    for k, (r, p) in enumerate(zip(np.nan_to_num(scans.ranges, nan=81.9), truth)):
        cells = " ".join(f"{v:.3f}" for v in r)
        pose = f"{p[0]:.6f} {p[1]:.6f} {p[2]:.6f}"
        start, step = scans.lidar.start, scans.lidar.step
        head = f"ROBOTLASER1 0 {start} {-2 * start} {step} 80 0.01 0 {len(r)}"
        lines.append(f"{head} {cells} 0 {pose} {pose} 0 0 0 0 0 {k}.5 host {k}.5")
    file.write_text("\n".join(lines) + "\n")
    return file


def told(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--json"])
    assert ended.value.code == 0
    out = json.loads(capsys.readouterr().out)
    assert isinstance(out, dict)
    return out


def test_the_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scans, truth = recorded(4, COARSE, laps=0.2)
    log, out = log_of(scans, truth, tmp_path / "run.log"), tmp_path / "room"
    found = told(["map", str(log), "-o", str(out), "--against", "stated"], capsys)
    against = found["against"]
    assert isinstance(against, dict) and against["absolute"] < 0.05
    rows = list(csv.DictReader((out / "poses.csv").read_text().splitlines()))
    assert len(rows) == len(scans.t) and {row["fix"] for row in rows} == {"matched"}
    again = ["map", str(log), "-o", str(out), "--against", str(out / "poses.csv")]
    same = told(again, capsys)["against"]
    assert isinstance(same, dict) and same["absolute"] < 1e-6
    place = told(["locate", str(out / "map.yaml"), str(log), "--number", "30"], capsys)
    pose = place["pose"]
    assert pose is None or np.hypot(
        pose[0] - float(rows[30]["x"]), pose[1] - float(rows[30]["y"])
    ) < 0.1  # type: ignore[index]  # fmt: skip
    assert (out / "map.png").stat().st_size > 1000


def test_headings_of_poses_csv_are_of_one_turn(
    drive: tuple[Scans, np.ndarray, Mapped], tmp_path: Path
) -> None:
    """They ran on to -36 rad; and of a reference an empty pose took all those behind it."""
    scans, _, found = drive
    n, file = len(scans.t), tmp_path / "poses.csv"
    pose = found.poses.pose + np.array([0.0, 0.0, -36.0])
    pose[:, 2] -= np.linspace(0, 12, n)
    pose[n // 2] = np.nan
    app_mapping._write(found.poses._replace(pose=pose), file)
    theta = np.array(
        [float(row["theta"] or "nan") for row in csv.DictReader(file.read_text().splitlines())]
    )
    assert np.nanmax(np.abs(theta)) <= np.pi and np.isnan(theta[n // 2])
    again = app_mapping._reference(scans, str(file))
    off = np.abs(np.delete(again - pose, n // 2, axis=0))
    assert off[:, :2].max() < 1e-6 and np.abs(np.exp(1j * off[:, 2]) - 1).max() < 1e-6


def test_bad_calls_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "run.csv"
    table.write_text("t,x\n0,1\n1,2\n")
    scans, truth = recorded(4, COARSE, laps=0.05)
    log = log_of(scans, truth, tmp_path / "run.log")
    calls = {
        ("map", str(table), "-o", str(tmp_path / "a")): 4,
        ("map", str(tmp_path / "none.log"), "-o", str(tmp_path / "a")): 4,
        ("map", str(log), "-o", str(tmp_path / "a"), "--against", str(table)): 2,
        ("locate", str(tmp_path / "none.yaml"), str(log)): 4,
        ("locate", str(tmp_path / "none.yaml"), str(log), "--number", "9999"): 2,
        ("map", str(log), "-o", str(tmp_path / "a"), "--step", "1"): 2,  # it says its angles
    }
    for call, code in calls.items():
        with pytest.raises(SystemExit) as ended:
            main(list(call))
        assert ended.value.code == code, capsys.readouterr().err


def test_a_log_that_does_not_say_its_angles_is_read_by_those_that_are_given(
    tmp_path: Path,
) -> None:
    log = tmp_path / "run.log"
    line = "FLASER 5 1 2 3 2 1 0 0 0 0 0 0 {0}.5 host {0}.5"
    log.write_text("\n".join(line.format(k) for k in range(4)) + "\n")
    scans = app_mapping.only_lidar(log, app_mapping.Topics())
    assert scans.lidar.step == np.pi / 4 and "says nothing of its angles" in scans.findings[0]
    given = app_mapping.only_lidar(log, app_mapping.Topics(step=60.0))
    assert given.lidar.angles(5) == pytest.approx(np.radians([-120, -60, 0, 60, 120]))
    assert not any("angles" in line for line in given.findings)
