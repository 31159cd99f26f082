"""The compiled rigid bodies against Pinocchio, and the base parameters against all parameters."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files

import numpy as np
import pinocchio
import pytest

from evertwin.errors import ModelError
from evertwin.machines.arm.base import base_parameters, body_columns
from evertwin.machines.arm.chain import Chain, aligned, serial
from evertwin.machines.arm.model import robot
from evertwin.machines.arm.rnea import KEPT, joint_torques
from evertwin.machines.arm.urdf import parse
from planted.arms import row_by_row

MATRIX = np.ndarray


def random_urdf(seed: int, joints: int) -> str:
    """A chain with random frames, axes, inertias and kinds of joints."""
    rng = np.random.default_rng(seed)

    def three(scale: float = 1.0) -> str:
        return " ".join(f"{v:.6f}" for v in scale * rng.normal(size=3))

    parts = ['<link name="l0"/>']
    for j in range(joints):
        kind = rng.choice(["revolute", "continuous", "prismatic", "fixed"], p=[0.5, 0.2, 0.2, 0.1])
        xx, yy, zz = rng.uniform(0.1, 0.2, 3)
        parts.append(
            f'<link name="l{j + 1}"><inertial><origin xyz="{three(0.1)}" rpy="{three()}"/>'
            f'<mass value="{rng.uniform(0.5, 3):.4f}"/><inertia ixx="{xx}" ixy="0.01" ixz="0.02" '
            f'iyy="{yy}" iyz="-0.01" izz="{zz}"/></inertial></link>'
            f'<joint name="j{j}" type="{kind}"><origin xyz="{three(0.3)}" rpy="{three()}"/>'
            f'<parent link="l{j}"/><child link="l{j + 1}"/><axis xyz="{three()}"/>'
            '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        )
    return f'<robot name="random">{"".join(parts)}</robot>'


def reference(text: str, u: MATRIX) -> MATRIX:
    """Inverse dynamics by Pinocchio; a continuous joint's position is a cosine and a sine there."""
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    n = model.nv
    rows = []
    for row in u:
        q = []
        for joint, angle in zip(list(model.joints)[1:], row[:n], strict=True):
            q += [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        rows.append(pinocchio.rnea(model, data, np.array(q), row[n : 2 * n], row[2 * n :]))
    return np.array(rows)


def motion(n: int, rows: int, seed: int = 0) -> MATRIX:
    return np.random.default_rng(seed).uniform(-2, 2, (rows, 3 * n))


def ur5() -> tuple[str, Chain]:
    text = files("evertwin.machines").joinpath("data", "ur5_like.urdf").read_text("utf-8")
    return text, serial(robot("ur5_like"))


def test_the_built_in_arm_agrees_with_pinocchio() -> None:
    text, chain = ur5()
    u = motion(6, 200)
    np.testing.assert_allclose(
        row_by_row(chain.geometry, chain.inertia, u), reference(text, u), rtol=0, atol=1e-9
    )


@pytest.mark.parametrize("seed", range(12))
def test_random_chains_agree_with_pinocchio(seed: int) -> None:
    text = random_urdf(seed, 2 + seed % 6)
    try:
        chain = serial(parse(text))
    except ModelError as error:
        assert "moving joints, got 0" in str(error)
        return
    u = motion(chain.n, 20, seed)
    np.testing.assert_allclose(
        row_by_row(chain.geometry, chain.inertia, u), reference(text, u), rtol=0, atol=1e-9
    )


def test_compiled_and_plain_python_give_the_same_bits(run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    _, chain = ur5()
    u = motion(6, 5)
    compiled = row_by_row(chain.geometry, chain.inertia, u)
    for row, tau in zip(u, compiled, strict=True):
        plain = np.zeros(6)
        joint_torques.plain(6, chain.geometry, chain.inertia, row, plain, np.zeros(6 * KEPT))
        assert plain.tobytes() == tau.tobytes()


@pytest.mark.parametrize(("rotor", "expected"), [(True, 34), (False, 36)])
def test_the_number_of_base_parameters(rotor: bool, expected: int) -> None:
    # 36 for this kind of arm; the inertias of the first two rotors replace two of them.
    assert len(base_parameters(ur5()[1].geometry, rotor)) == expected


def test_base_parameters_say_what_all_parameters_say() -> None:
    _, chain = ur5()
    base = base_parameters(chain.geometry, rotor=True)
    u = motion(6, 100, seed=5)
    wrong = np.random.default_rng(1).normal(size=60)
    target = row_by_row(chain.geometry, wrong, u)
    rotors = np.zeros((100, 6, 6))
    for j in range(6):
        rotors[:, j, j] = u[:, 12 + j]
    columns = np.concatenate([body_columns(chain.geometry, base, u), rotors], axis=2)
    flat = columns.reshape(600, -1)
    solution, *_ = np.linalg.lstsq(flat, target.ravel(), rcond=None)
    np.testing.assert_allclose(flat @ solution, target.ravel(), atol=1e-9)
    short, *_ = np.linalg.lstsq(np.delete(flat, 3, axis=1), target.ravel(), rcond=None)
    assert np.abs(np.delete(flat, 3, axis=1) @ short - target.ravel()).max() > 1e-3


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.6, 0, -0.8), (0, 1, 0)])
def test_frames_turn_onto_the_axis(axis: tuple[float, float, float]) -> None:
    turn = aligned(np.array(axis, dtype=np.float64))
    np.testing.assert_allclose(turn @ [0, 0, 1], axis, atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
