"""Where an update moves a base and the frame of its odometry."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest

from evertwin.publishers.contract import About, News
from evertwin.publishers.ros import RosOut
from evertwin.publishers.ros_base import Base, Placing
from evertwin.publishers.ros_spec import RosOutSettings
from evertwin.ros.transforms import Past, Transform, beyond, transforms, within
from tests.publishers.test_opcua_out import LIFE

NAMES = ("x", "y", "heading")


def rows(
    poses: list[tuple[float, float, float]], measured: dict[int, tuple[float, float, float]],
    updates: dict[int, int],
) -> dict[str, Any]:  # fmt: skip
    outputs = {
        name: {
            "predicted": [pose[i] for pose in poses],
            "measured": [measured[k][i] if k in measured else None for k in range(len(poses))],
            "sigma": [0.01] * len(poses),
            "update": [updates.get(k, 0) for k in range(len(poses))],
        }
        for i, name in enumerate(NAMES)
    }
    return {"t": [k * 10**9 for k in range(len(poses))], "outputs": outputs}


def test_an_update_is_where_it_goes_on_from_and_its_jump_is_no_speed() -> None:
    base = Base(NAMES, size=0.4)
    poses = [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.55, 0.0, 0.1)]
    told = rows(poses, {0: poses[0], 1: (0.3, 0.1, 0.0)}, {0: 4, 1: 1})
    first, second, third = base.steps(told)
    assert not first.moved and all(map(math.isnan, first.speed))
    assert second.moved and second.after == (0.3, 0.1, 0.0) and second.speed[0] == 0.2
    np.testing.assert_allclose(third.speed, (0.25, -0.1, 0.1))
    assert list(base.jumps) == [((0.2, 0.0, 0.0), (0.3, 0.1, 0.0))]


def test_each_component_has_a_status_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    async def nobody(*_: object) -> dict[str, object]:
        return {}

    said: list[dict[str, Any]] = []
    out = RosOut(RosOutSettings("ros"), About("arm", ()), nobody)
    monkeypatch.setattr(out, "_say", lambda topic, message: said.append(message))
    out.publish(News("arm", "life", LIFE))
    health = {"condition": "good", "why": "", "stale": False, "age": 0.1, "state": "running",
              "rows": 5, "champion": 2, "versions": 3, "headline": "better"}  # fmt: skip
    out.publish(News("arm", "health", health))
    _, gearbox, belt = said[0]["status"]
    assert (gearbox["name"], gearbox["level"]) == ("evertwin/arm: life of gearbox", 1)
    assert gearbox["message"] == "60 h left" and (belt["level"], belt["message"]) == (0, "unknown")
    told = {one["key"]: one["value"] for one in gearbox["values"]}
    assert told["low [h]"] == "40" and told["high [h]"] == "inf"


def test_only_an_update_moves_the_frame_of_the_odometry() -> None:
    placing = Placing("odom", "base_link")
    rng = np.random.default_rng(3)
    way = np.cumsum(rng.normal(0.1, 0.05, (40, 3)), axis=0)
    placed = []
    for k, (x, y, turn) in enumerate(way):
        placing.heard(Transform("odom", "base_link", k * 10**9, (x, y, turn)), own=False)
        at = (x + 0.01 * k, y, turn)  # the simulation leaves the odometry
        placing.anchor(k * 10**9, at, update=k in (0, 17, 30))
        placed.append(placing.odom)
    assert [k for k in range(1, 40) if placed[k] != placed[k - 1]] == [17, 30]
    at_update = beyond(placing.odom or (0.0, 0.0, 0.0), tuple(way[30]))
    np.testing.assert_allclose(at_update[:2], (way[30, 0] + 0.30, way[30, 1]))


def test_an_update_waits_for_the_odometry_of_its_time() -> None:
    placing = Placing("odom", "base_link")
    placing.anchor(5 * 10**8, (3.0, 0.0, 0.0), update=True)
    assert placing.odom is None and "odom → base_link" in placing.reason
    placing.heard(Transform("odom", "base_link", 0, (0.0, 0.0, 0.0)), own=False)
    assert placing.odom is None
    placing.heard(Transform("odom", "base_link", 10**9, (1.0, 0.0, 0.0)), own=False)
    assert placing.odom == (2.5, 0.0, 0.0) and placing.due == 10**9 and not placing.reason


def test_a_frame_that_another_node_places_is_left_to_it() -> None:
    placing = Placing("odom", "base_link")
    placing.heard(Transform("map", "odom", 0, (0.0, 0.0, 0.0)), own=True)
    placing.anchor(0, (3.0, 0.0, 0.0), update=True)
    placing.heard(Transform("odom", "base_link", 0, (0.0, 0.0, 0.0)), own=False)
    assert placing.due == 0
    placing.due = None
    placing.heard(Transform("map", "odom", 10**9, (0.0, 0.0, 0.0)), own=False)
    placing.heard(Transform("odom", "base_link", 10**9, (0.0, 0.0, 0.0)), own=False)
    assert placing.due is None and "another node places odom" in placing.reason


def test_transforms_of_a_message_and_of_what_is_none() -> None:
    def text(said: str) -> bytes:
        return struct.pack("<I", len(said)) + said.encode()

    turn = 0.6
    pose = (1.0, 2.0, 0.3, 0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2))
    one = struct.pack("<3I", 7, 5, 250) + text("/odom") + text("base_link")
    data = struct.pack("<I", 1) + one + struct.pack("<7d", *pose)
    (found,) = transforms(data)
    assert found[:3] == ("odom", "base_link", 5_000_000_250)
    np.testing.assert_allclose(found.pose, (1.0, 2.0, turn))
    for k in range(len(data)):
        with pytest.raises(ValueError, match="no message of transforms"):
            transforms(data[:k])
    with pytest.raises(ValueError, match="2 bytes are left"):
        transforms(data + b"ab")


def test_the_past_is_bounded_and_begins_anew_when_the_clock_goes_back() -> None:
    past = Past()
    for k in range(5000):
        past.add(k * 10**8, (k * 0.1, 0.0, 0.0))
    assert past.at(0) is None and past.at(500_000_000_000) is None
    np.testing.assert_allclose(past.at(499_850_000_000) or (), (499.85, 0.0, 0.0))
    past.add(10**9, (7.0, 0.0, 0.0))
    assert past.at(10**9) == (7.0, 0.0, 0.0) and past.at(499_850_000_000) is None


def test_the_group_of_the_plane() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        one, other = (tuple(rng.uniform(-3, 3, 3)) for _ in range(2))
        np.testing.assert_allclose(beyond(one, within(one, other)), other, atol=1e-12)
