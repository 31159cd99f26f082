"""An arm from its Denavit-Hartenberg table equals the arm from its URDF."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.errors import ModelError, UsageError
from evertwin.machines.arm import Arm
from evertwin.machines.arm.chain import Chain, serial
from evertwin.machines.arm.dh import robot_of
from evertwin.machines.arm.urdf import parse
from planted.arms import row_by_row, table


def words(*numbers: float) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def placed(frame: np.ndarray) -> str:
    r = frame[:3, :3]
    angles = np.arctan2(r[2, 1], r[2, 2]), np.arcsin(-r[2, 0]), np.arctan2(r[1, 0], r[0, 0])
    return f'rpy="{words(*angles)}" xyz="{words(*frame[:3, 3])}"'


def about(axis: int, angle: float, along: float) -> np.ndarray:
    """A turn about an axis and a shift along it."""
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    frame = np.eye(4)
    frame[i, i] = frame[j, j] = np.cos(angle)
    frame[i, j], frame[j, i] = -np.sin(angle), np.sin(angle)
    frame[axis, 3] = along
    return frame


def urdf(rows: list[dict[str, Any]], modified: bool) -> str:
    """The same arm written down link by link, each in the frame of its joint."""
    text, after = '<robot name="dh"><link name="base"/>', np.eye(4)
    for i, row in enumerate(rows):
        z, x = about(2, row["theta"], row["d"]), about(0, row["alpha"], row["a"])
        before = after @ (x @ z if modified else z)
        after = np.eye(4) if modified else x
        body = after @ about(0, 0.0, 0.0)
        body[:3, 3] = (after @ np.array([*row["com"], 1.0]))[:3]
        keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        own = " ".join(f'{k}="{words(v)}"' for k, v in zip(keys, row["inertia"], strict=True))
        parent = f"link{i}" if i else "base"
        text += (
            f'<link name="link{i + 1}"><inertial><origin {placed(body)}/>'
            f'<mass value="{words(row["mass"])}"/><inertia {own}/></inertial></link>'
            f'<joint name="joint{i + 1}" type="{row["kind"]}"><parent link="{parent}"/>'
            f'<child link="link{i + 1}"/><axis xyz="0 0 1"/><origin {placed(before)}/></joint>'
        )
    return text + (
        f'<link name="tool"/><joint name="flange" type="fixed"><parent link="link{len(rows)}"/>'
        f'<child link="tool"/><origin {placed(after)}/></joint></robot>'
    )


def torques(chain: Chain, u: np.ndarray) -> np.ndarray:
    return np.asarray(row_by_row(chain.geometry, chain.inertia, u))


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("seed", range(8))
def test_a_table_equals_its_urdf(convention: str, seed: int) -> None:
    rows = table(np.random.default_rng(seed), 6, seed % 6)
    by_table = serial(robot_of(rows, convention), tip="tool")
    by_urdf = serial(parse(urdf(rows, convention == "modified")), tip="tool")
    np.testing.assert_allclose(by_table.geometry, by_urdf.geometry, atol=1e-12)
    np.testing.assert_allclose(by_table.inertia, by_urdf.inertia, atol=1e-12)
    np.testing.assert_allclose(by_table.tool, by_urdf.tool, atol=1e-12)
    u = np.random.default_rng(seed).uniform(-1, 1, (30, 18))
    np.testing.assert_allclose(torques(by_table, u), torques(by_urdf, u), atol=1e-12)


def test_both_conventions_describe_one_arm() -> None:
    """A planar arm of two links: where the frames lie differs, the torques do not."""
    half = {"mass": 2.0, "inertia": [0.01, 0.02, 0.02]}
    standard = [{"a": 0.5, "com": [-0.25, 0, 0], **half}, {"a": 0.4, "com": [-0.2, 0, 0], **half}]
    modified = [{"com": [0.25, 0, 0], **half}, {"a": 0.5, "com": [0.2, 0, 0], **half}]
    u = np.random.default_rng(0).uniform(-1, 1, (20, 6))
    one = serial(robot_of(standard), gravity=(0.0, -9.81, 0.0))
    two = serial(robot_of(modified, "modified"), gravity=(0.0, -9.81, 0.0))
    np.testing.assert_allclose(torques(one, u), torques(two, u), atol=1e-12)


def test_a_pendulum_has_its_closed_form() -> None:
    chain = serial(
        robot_of([{"a": "1 m", "alpha": "0 deg", "mass": "2 kg", "com": [-0.5, 0, 0]}]),
        gravity=(0.0, -9.81, 0.0),
    )
    q = np.linspace(-3, 3, 7)
    u = np.stack([q, np.zeros(7), np.ones(7)], axis=1)
    np.testing.assert_allclose(torques(chain, u)[:, 0], 0.5 + 9.81 * np.cos(q), atol=1e-12)


def test_a_table_is_an_option_of_the_arm() -> None:
    rows = [{"a": 0.5, "mass": 2.0, "com": [-0.25, 0.0, 0.0], "low": -1.0, "high": 1.0}] * 2
    rows = [row | {"name": f"axis{k}"} for k, row in enumerate(rows)]
    arm = Arm.of(dh=rows, law="tanh", payload=True, tool={"xyz": [0, 0, 0.1]}, tip="tool")
    assert arm.joints == ("axis0", "axis1") and arm.parameters.names[0] == "Ia1"
    assert arm.inputs.channels[0].high == pytest.approx(1.05)
    assert "no inertia" in arm.chain.notes[0]
    np.testing.assert_allclose(arm.chain.tool[:3, 3], [0.5, 0, 0.1])


GOOD = {"a": 0.5, "mass": 2.0, "com": [0, 0, 0], "inertia": [1, 1, 1]}


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (GOOD | {"alfa": 1}, "row 2: unknown key 'alfa', did you mean 'alpha'"),
        (GOOD | {"mass": 0}, "row 2 .link .link2.. has mass 0 kg"),
        (GOOD | {"mass": -1}, "row 2 .link .link2.. has mass -1 kg"),
        (GOOD | {"inertia": [1, 1, -1]}, "row 2 .* has an inertia with principal values -1, 1, 1"),
        (GOOD | {"inertia": [1, 1]}, "row 2: inertia: expected 3 or 6 numbers"),
        (GOOD | {"com": 3}, "row 2: com: expected 3 numbers"),
        (GOOD | {"a": "2 s"}, "row 2: a: expected a number in m"),
        (GOOD | {"a": float("nan")}, "row 2: a: expected a number in m"),
        (GOOD | {"kind": "helical"}, "row 2: kind 'helical'"),
        (GOOD | {"low": 2.0, "high": 1.0}, "row 2: expected low < high"),
        (GOOD | {"name": "joint1"}, "2 joints are called 'joint1'"),
        ({"a": 0.5, "com": [0, 0, 0]}, "row 2: expected 'mass'"),
        ({"a": 0.5, "mass": 1.0}, "row 2: expected 'com'"),
        (7, "row 2: expected a table"),
    ],
)
def test_what_no_arm_can_be_is_refused_by_row(row: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        robot_of([GOOD, row])


def test_options_that_do_not_go_together_are_refused() -> None:
    with pytest.raises(ModelError, match="convention 'craig'"):
        robot_of([GOOD], "craig")
    with pytest.raises(UsageError, match="either 'urdf' or 'dh'"):
        Arm.of("ur5_like", dh=[GOOD])
    with pytest.raises(UsageError, match="either 'urdf' or 'dh'"):
        Arm.of()


def test_moments_that_no_body_has_are_told_with_their_link() -> None:
    """Published tables have some (the third link of Armstrong's Puma 560): a remark, no refusal."""
    robot = robot_of([GOOD, GOOD | {"inertia": [0.066, 0.086, 0.0125]}])
    assert robot.notes == (
        "dh: row 2 (link 'link2') has principal moments 0.0125, 0.066, 0.086 kg m²: no body has "
        "one above the sum of the others",
    )
