"""Tables from scans: what is one, what is none, what was moved; costs, bodies, and the command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.features.maps.occupancy import read
from evertwin.features.tables.legs import View
from evertwin.features.tables.tables import Happened, Room, furnished
from evertwin.sources.columns.scans import Lidar
from planted.halls import legs, met
from planted.rooms import box, ranges

LIDAR = Lidar(-np.pi, float(np.radians(0.5)), 12.0)
TABLE = np.array([0.3, 1.4, 0.4, 1.2, 0.7, 0.025])
ROOM = box(0, 0, 7, 7)
WAY = np.column_stack([np.linspace(-1.5, 1.5, 24), np.zeros(24), np.zeros(24)])


def scan(pose: np.ndarray, walls: np.ndarray, tables: list[np.ndarray], seed: int) -> np.ndarray:
    angles = LIDAR.angles(720)
    rounds = np.concatenate([np.zeros((0, 3)), *(legs(one) for one in tables)])
    seen = np.minimum(ranges(walls, pose, angles), met(rounds, pose, angles))
    return np.asarray(seen + 0.01 * np.random.default_rng(seed).normal(size=720))


def drive(
    walls: np.ndarray, *stages: list[np.ndarray], apart: float = 0.3, three: bool = False
) -> tuple[Room, tuple[Happened, ...]]:
    """To and fro, once for each of the stages."""
    views = []
    for k, tables in enumerate(stages):
        for j, pose in enumerate(WAY[:: 1 if k % 2 == 0 else -1]):
            t = round(1e9 * apart * (k * len(WAY) + j))
            views.append(View(t, scan(pose, walls, tables, k * 100 + j), LIDAR, pose))
    return furnished(views, three)


def test_a_table_is_found_with_its_size() -> None:
    room, happened = drive(ROOM, [TABLE])
    (table,) = room.tables
    off = table.shape - TABLE[:5]
    assert np.hypot(*off[:2]) < 0.02 and abs(off[2]) < 0.03 and np.abs(off[3:]).max() < 0.05
    assert [one.what for one in happened] == ["found"] and len(table.rectangle.known) == 4
    sigma = np.sqrt(table.rectangle.covariance.diagonal())
    assert (np.abs(off[:3]) < 4 * sigma[:3]).all() and sigma[:2].max() < 0.03


def test_boxes_pillars_and_chairs_are_none() -> None:
    chair = np.array([-1.0, 1.2, 0.3, 0.42, 0.42, 0.015])
    walls = np.concatenate([ROOM, box(1.2, 1.5, 0.9, 0.6, 0.5), box(-1.2, -1.5, 0.2, 0.2)])
    assert drive(walls, [chair])[0].tables == ()


def test_touching_tables_are_two() -> None:
    across = 0.7 * np.array([-np.sin(0.4), np.cos(0.4)])
    other = TABLE + np.array([*across, 0, 0, 0, 0])
    shapes = sorted(table.shape[1] for table in drive(ROOM, [TABLE, other])[0].tables)
    assert np.allclose(shapes, sorted([TABLE[1], other[1]]), atol=0.05)


def test_three_legs_are_a_table_only_if_that_is_asked_for() -> None:
    x, y = legs(TABLE)[0, :2]  # a cupboard swallows one leg
    walls = np.concatenate([ROOM, box(x + 0.1, y + 0.12, 0.4, 0.4, 0.4)])
    assert drive(walls, [TABLE])[0].tables == ()
    (table,) = drive(walls, [TABLE], three=True)[0].tables
    assert len(table.rectangle.known) == 3
    assert np.hypot(*(table.shape[:2] - TABLE[:2])) < 0.05


def test_a_table_that_was_moved_is_named() -> None:
    elsewhere = TABLE + np.array([-0.6, -2.7, 1.0, 0, 0, 0])
    room, happened = drive(ROOM, [TABLE], [elsewhere], [elsewhere])
    assert [one.what for one in happened if one.what in ("found", "moved")] == ["found", "moved"]
    last = happened[-1]
    assert last.what == "moved" and last.number == 1 and last.now is not None
    assert np.hypot(*(last.now[:2] - elsewhere[:2])) < 0.04
    assert [table.number for table in room.tables] == [1] and room.gone == ()


def test_a_table_that_is_taken_away_is_gone_and_another_size_is_another_table() -> None:
    other = np.array([-0.3, -1.4, 0.2, 1.6, 0.9, 0.025])
    room, happened = drive(ROOM, [TABLE], [other], [other])
    assert sorted(one.what for one in happened) == ["appeared", "found", "gone"]
    assert [table.number for table in room.tables] == [2]


def recorded(folder: Path) -> tuple[Path, Path]:
    """A log and its poses, the first one not at the origin of the map."""
    lines, poses = [], ["t_ns,x,y,theta,fix,segment"]
    for k, pose in enumerate(WAY):
        cells = " ".join(f"{v:.3f}" for v in scan(pose, ROOM, [TABLE], k))
        head = f"ROBOTLASER1 0 {LIDAR.start} 6.28 {LIDAR.step} {LIDAR.longest} 0.01 0 720"
        stamp = 100 + 0.3 * k
        lines.append(f"{head} {cells} 0 {'0 ' * 11}{stamp:.1f} host {stamp:.1f}")
        x, y, turn = pose
        poses.append(f"{round(1e9 * stamp)},{x:.4f},{y:.4f},{turn:.4f},matched,0")
    (folder / "run.log").write_text("\n".join([*lines, ""]))
    (folder / "poses.csv").write_text("\n".join([*poses, ""]))
    return folder / "run.log", folder / "poses.csv"


def told(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int = 0) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == code
    return capsys.readouterr().out


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, poses = recorded(tmp_path)
    out = tmp_path / "room"
    call = ["tables", str(log), "--poses", str(poses), "-o", str(out)]
    found = json.loads(told([*call, "--json", "--overhang", "0.1"], capsys))
    assert len(found["tables"]) == 1 and found["events"][0]["what"] == "found"
    (row,) = csv.DictReader((out / "tables.csv").read_text().splitlines())
    assert abs(float(row["x"]) - TABLE[0]) < 0.03 and float(row["cov_x_x"]) > 0
    costs = read(out / "costs.yaml")
    assert costs.cells.shape[0] > 20 and "mode: raw" in (out / "costs.yaml").read_text()
    assert (out / "tables.png").stat().st_size > 1000
    assert "× " in told(call, capsys)


def test_the_prediction_changes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A cart that is pushed at the table stops at its leg in the twin's world."""
    mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    log, poses = recorded(tmp_path)
    told(["tables", str(log), "--poses", str(poses), "-o", str(tmp_path)], capsys)
    leg = min(legs(TABLE)[:, :2], key=lambda one: one[1])
    world = f"""<mujoco>{{}}<option timestep="0.005"/><worldbody>
      <body name="cart" pos="{leg[0]:.3f} -1 0.1"><joint name="y" type="slide" axis="0 1 0"/>
      <geom type="cylinder" size="0.2 0.1" mass="20"/></body></worldbody>
      <actuator><velocity joint="y" kv="200" forcerange="-40 40"/></actuator></mujoco>"""
    ends = []
    for name, include in (("bare", ""), ("world", '<include file="tables.xml"/>')):
        (tmp_path / f"{name}.xml").write_text(world.format(include))
        model = mujoco.MjModel.from_xml_path(str(tmp_path / f"{name}.xml"))
        data = mujoco.MjData(model)
        data.ctrl[0] = 0.3
        mujoco.mj_step(model, data, 2000)
        ends.append(float(data.qpos[0]) - 1)
    assert ends[0] > 1.8 and abs(ends[1] - (leg[1] - 0.225)) < 0.03


def test_bad_calls_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, poses = recorded(tmp_path)
    call = ["tables", str(log), "-o", str(tmp_path / "room"), "--poses", str(poses)]
    told([*call, "--origin", "here"], capsys, 2)
    told([*call, "--radius", "2"], capsys, 2)
    early = tmp_path / "early.csv"
    early.write_text("t_ns,x,y,theta\n1,0,0,0\n2,0,0,0\n")
    told([*call[:-1], str(early)], capsys, 4)
    early.write_text("t_ns,x,y\n1,0,0\n2,0,0\n")
    told([*call[:-1], str(early)], capsys, 4)
