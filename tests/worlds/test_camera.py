"""The camera: where things are in its pictures, light and shadow, and that a seed tells all."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from evertwin.errors import DataError, ModelError
from evertwin.sources.texts.small_table import read_table
from evertwin.worlds.camera import Lamp, Lens, Look, Material, View, shaded, traced
from evertwin.worlds.eye import COLUMNS
from evertwin.worlds.live.machines.robot import LiveRobot
from evertwin.worlds.looks import drawn, names, plain
from evertwin.worlds.scenes import hall, marked, view
from evertwin.worlds.shots import main, of_poses

BOX = """<mujoco><worldbody><geom type="plane" size="9 9 .1"/>
<geom name="box1" type="box" pos="3 0.5 .5" size=".25 .25 .5"/>
<body name="person2" pos="4 -1 0"><geom type="cylinder" pos="0 0 .9" size=".2 .9"/></body>
</worldbody></mujoco>"""
RNG = np.random.default_rng(1)


def world(xml: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_a_thing_is_where_the_pinhole_says() -> None:
    model, data = world(BOX)
    lens = Lens(400, 300, 1.4)
    seen = traced(model, data, View(np.array([0.0, 0.0, 0.5]), 0.0), lens)
    box, person = marked(seen.geom, seen.range, names(model))
    assert (box.name, person.name) == ("box1", "person2")
    focal = 200 / np.tan(0.7)
    # the edges of the near face, 2.75 m ahead; the far left edge is not seen past the near one
    left, right = 200 - focal * 0.75 / 2.75, 200 - focal * 0.25 / 3.25
    upper, lower = 150 - focal * 0.5 / 2.75, 150 + focal * 0.5 / 2.75
    assert box.corners == pytest.approx((left, upper, right, lower), abs=1.5)
    assert box.distance == pytest.approx(2.8, abs=0.1) and person.clear


def test_heading_pitch_and_roll_turn_the_picture() -> None:
    model, data = world(BOX)
    eye = np.array([0.0, 0.0, 0.5])

    def middle(at: View) -> tuple[float, float]:
        seen = traced(model, data, at, Lens())
        left, upper, right, lower = marked(seen.geom, seen.range, names(model))[0].corners
        return (left + right) / 2, (upper + lower) / 2

    x, y = middle(View(eye, 0.0))
    assert middle(View(eye, 0.3))[0] > x + 10 and middle(View(eye, 0.0, 0.2))[1] > y + 8
    assert middle(View(eye, 0.0, 0.0, 0.5))[1] > y + 3


def test_a_lamp_lights_what_it_reaches_and_nothing_behind() -> None:
    model, data = world(BOX)
    seen = traced(model, data, View(np.array([0.0, 0.0, 3.0]), 0.0, -0.6), Lens())
    white = [Material(np.ones(3))] * model.ngeom
    lamp = Lamp(np.array([1.0, 0.5, 2.0]), np.ones(3))
    dark = shaded(model, data, seen, Look(white, (), 0.05), RNG)
    light = shaded(model, data, seen, Look(white, (lamp,), 0.05), RNG)
    floor, place = seen.geom.ravel() == 0, seen.place
    behind = floor & (abs(place[:, 1] - 0.5) < 0.15) & (place[:, 0] > 4.9) & (place[:, 0] < 5.4)
    before = floor & (abs(place[:, 1] - 0.5) < 0.15) & (place[:, 0] < 2.6)
    assert behind.sum() > 3 and before.sum() > 10

    def grey(picture: np.ndarray, where: np.ndarray) -> float:
        return float(picture.reshape(-1, 3)[where].mean())

    assert grey(dark, behind) == pytest.approx(grey(dark, before), abs=1.0)
    assert grey(light, behind) < 0.5 * grey(light, before)
    spot = lamp._replace(aim=np.array([4.0, -1.0, 0.0]), narrow=40.0)
    aimed = shaded(model, data, seen, Look(white, (spot,), 0.05), RNG)
    assert grey(aimed, before) < 0.6 * grey(light, before)


def test_a_seed_tells_all_and_another_one_something_else() -> None:
    def picture(seed: int, one_look: bool = False) -> np.ndarray:
        rng = np.random.default_rng(seed)
        scene = hall(rng)
        model, data = world(scene.xml)
        seen = traced(model, data, view(scene, rng), Lens())
        look = plain(model, scene.half) if one_look else drawn(model, scene.half, rng)
        return shaded(model, data, seen, look, rng)

    np.testing.assert_array_equal(picture(4), picture(4))
    assert (picture(4) != picture(5)).mean() > 0.5 < (picture(4) != picture(4, True)).mean()
    assert picture(4).std() > 5


def test_the_robot_takes_pictures_and_does_the_same_as_without() -> None:
    blind, seeing = LiveRobot("w3", 1), LiveRobot("w3", 1, pictures=2.0)
    seeing.knobs.tell("people=2", 0.0)
    blind.knobs.tell("people=2", 0.0)
    said = [(blind.advance(), seeing.advance()) for _ in range(11)]
    for without, both in said:
        assert [one for one in both if one.topic != "camera"] == without
    pictures = [one for _, both in said for one in both if one.topic == "camera"]
    assert [one.t for one in pictures] == [0.0, 0.5, 1.0] and len(seeing.shots) == 3
    assert {row[0] for _, one in seeing.shots for row in one.rows} <= {"", "box", "person", "table"}


def test_pictures_of_a_world_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "room.xml").write_text(BOX)
    rows = [f"{k * 10**8},{0.1 * k},0,0" for k in range(20)]
    (tmp_path / "poses.csv").write_text("\n".join(["t_ns,x,y,theta", *rows, "5,nan,0,0", ""]))
    out = tmp_path / "room.mcap"
    main(["--world", str(tmp_path / "room.xml"), "--poses", str(tmp_path / "poses.csv"),
          "--images", "5", "--out", str(out)])  # fmt: skip
    table = read_table(tmp_path / "room-objects.csv")
    assert (tmp_path / "room-objects.csv").read_text().startswith(",".join(COLUMNS))
    assert len(np.unique(table.column("t_ns"))) == 5
    assert {"box", "person"} <= set(table.text["label"]) <= {"", "box", "person"}
    own = [k for k, one in enumerate(table.text["label"]) if one == "box"]
    assert np.all(np.diff(table.column("distance")[own]) < 0), "it drives towards the box"
    with pytest.raises(ModelError, match=r"room\.csv"):
        list(of_poses(tmp_path / "room.csv", tmp_path / "poses.csv", 5, (1, False, 0.5)))
    (tmp_path / "poses.csv").write_text("t_ns,x,y,theta\n5,nan,0,0\n")
    with pytest.raises(DataError, match="expected poses, got none"):
        list(of_poses(tmp_path / "room.xml", tmp_path / "poses.csv", 5, (1, False, 0.5)))


def test_the_hall_is_the_same_whether_its_things_are_named_or_not() -> None:
    robot = LiveRobot("w3", 3)
    first = [robot.advance() for _ in range(30)]
    assert json.dumps(first[-1][0].values)  # still plain numbers
    assert {"wall1", "box4", "table2", "person1"} <= set(names(robot._model))
