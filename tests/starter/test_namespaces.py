"""Several machines in one bag: the channels of one are proposed, never a mix that nobody asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from evertwin.errors import UsageError
from evertwin.machines.catalog import machine
from evertwin.starter import (
    Proposal,
    Seen,
    belonging,
    look,
    mapped,
    of_namespace,
    of_one_machine,
)
from evertwin.starter.channels.namespaces import namespaces
from planted.draws import first_of

from .test_bags import STORE, TYPES, odometry, vector

TWIST, ODOMETRY = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"
MODEL = machine("differential", {})
STEP = 0.2


def drive(seed: int, rows: int = 600) -> list[tuple[Any, Any]]:
    """Messages of a command and of the odometry that it leads to."""
    rng = np.random.default_rng(seed)
    told = np.repeat(rng.uniform([0.0, -0.8], [0.5, 0.8], (rows // 12 + 1, 2)), 12, axis=0)[:rows]
    heading = np.cumsum(STEP * 0.9 * told[:, 1]) + rng.normal(0, 2e-3, rows)
    way = STEP * 0.9 * told[:, :1] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    place = np.cumsum(way, axis=0) + rng.normal(0, 3e-3, (rows, 2))
    out = []
    for i in range(rows):
        pose = odometry(10**9 + int(i * STEP * 1e9), 0.0, heading[i], told[i, 0])
        pose.pose.pose.position.x, pose.pose.pose.position.y = place[i]
        out.append((TYPES[TWIST](vector(told[i, 0]), vector(0.0, told[i, 1])), pose))
    return out


def bag(path: Path, topics: dict[str, int], seed: int, mcap: bool = False) -> tuple[Seen, ...]:
    """Topics and which of the drawn machines each is of; one that ends in a command is told."""
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    runs = {number: drive(1000 * number + seed) for number in set(topics.values())}
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for topic, number in topics.items():
            told = "cmd" in topic or "command" in topic
            kind = TWIST if told else ODOMETRY
            link = writer.add_connection(topic, kind, typestore=STORE)
            for i, messages in enumerate(runs[number]):
                stamp = 10**9 + int(i * STEP * 1e9)
                writer.write(link, stamp, STORE.serialize_cdr(messages[0 if told else 1], kind))
    return look([path])[0]


def proposed(seen: tuple[Seen, ...]) -> Proposal | None:
    found = belonging(mapped(MODEL, seen), seen)
    return None if found.questions else found


def taken(seen: tuple[Seen, ...]) -> tuple[Proposal, tuple[str, ...]]:
    mine, notes = of_one_machine(seen, proposed)
    return belonging(mapped(MODEL, mine), mine), notes


def homes(found: Proposal) -> set[str]:
    return {match.column.split("/")[1] for match in found.matches}


WHOLE = {"/beta/base_controller/command": 2, "/beta/wheel_odometry/filtered": 2}


@pytest.mark.parametrize("mcap", [False, True])
@first_of("seed", range(5))
def test_a_whole_machine_is_taken_rather_than_a_mix(tmp_path: Path, seed: int, mcap: bool) -> None:
    found, notes = taken(bag(tmp_path / "two", {"/alpha/odom": 1, **WHOLE}, seed, mcap))
    assert homes(found) == {"beta"} and len(found.matches) == 5 and not found.questions
    assert "/alpha" in notes[0]


@first_of("seed", range(10))
def test_a_command_and_a_pose_of_two_machines_are_asked(tmp_path: Path, seed: int) -> None:
    seen = bag(tmp_path / "two", {"/alpha/cmd_vel": 1, "/beta/odom": 2}, seed)
    found, _ = taken(seen)
    assert found.questions == ("v: column", "w: column")
    assert "/beta" in found.matches[0].reason


@first_of("seed", range(10))
def test_topics_of_parts_of_one_machine_are_no_question(tmp_path: Path, seed: int) -> None:
    seen = bag(tmp_path / "one", {"/controller/cmd_vel": 1, "/filter/odom": 1}, seed)
    found, notes = taken(seen)
    assert not found.questions and not notes
    assert homes(found) == {"controller", "filter"}


def test_two_whole_machines_are_named_and_either_can_be_chosen(tmp_path: Path) -> None:
    both = {"/alpha/cmd_vel": 1, "/alpha/odom": 1, **WHOLE, "/odom_of_nobody": 1}
    seen = bag(tmp_path / "two", both, 0)
    found, notes = taken(seen)
    (mine,) = homes(found)
    (other,) = {"alpha", "beta"} - {mine}
    assert f"--namespace /{other}" in notes[0]
    assert homes(mapped(MODEL, of_namespace(seen, other))) == {other}
    with pytest.raises(UsageError, match=r"/gamma.*/alpha"):
        of_namespace(seen, "gamma")


def test_a_namespace_is_what_topics_begin_with() -> None:
    assert namespaces(["/tf", "odom", "/a/b/c", "/a/d"]) == ["/a/b", "/a"]
