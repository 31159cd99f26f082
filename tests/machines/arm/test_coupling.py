"""Motors that drive more than one joint: power, the laws of a model, recovery."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.machines.arm import Arm, kernel
from evertwin.machines.arm.coupling import Coupling
from evertwin.models import check_model
from evertwin.models.parameters import Parameters

MATRIX = np.eye(6)
MATRIX[4, 3], MATRIX[5, 3], MATRIX[5, 4] = -0.02, 0.015, -1.0
ROWS = MATRIX.tolist()


def motion(rows: int, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2, 2, (rows, 18))


def planted(arm: Arm) -> Arm:
    rng, p = np.random.default_rng(0), arm.parameters.values
    linear = np.unique(arm.columns[arm.columns >= 0])
    p[linear] += rng.normal(size=len(linear))
    return replace(arm, parameters=arm.parameters.with_values(p))


@pytest.mark.parametrize("where", ["joint", "motor"])
@pytest.mark.parametrize("law", ["sign", "tanh+stribeck+load"])
@pytest.mark.parametrize("extra", [{}, {"base": True, "payload": True, "delay": True}])
def test_the_laws_of_a_model_hold(where: str, law: str, extra: dict[str, bool]) -> None:
    arm = planted(Arm.of("ur5_like", law=law, coupling=ROWS, motion=where, **extra))
    check_model(arm, motion(40), np.full(40, 0.01))


@pytest.mark.parametrize("where", ["joint", "motor"])
def test_the_kernel_and_its_plain_twin_agree(where: str, run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    arm = planted(Arm.of("ur5_like", law="tanh+load", base=True, coupling=ROWS, motion=where))
    u, p = motion(3), arm.parameters.values
    _, compiled = arm.simulate(np.zeros(0), u, np.zeros(3), p)
    for row, y in zip(u, compiled, strict=True):
        plain = np.zeros(6)
        kernel.step.plain(arm.kernel().context, np.zeros(0), row, 0.0, p, np.zeros(0), plain)
        np.testing.assert_allclose(plain, y, rtol=1e-14, atol=1e-14)


def test_power_of_the_motors_is_the_power_of_the_joints() -> None:
    bare = Arm.of("ur5_like", rotor=False)
    coupled = Arm.of("ur5_like", rotor=False, coupling=ROWS, motion="motor")
    motors = motion(50)
    joints = Coupling.of(ROWS).of_motors(motors)
    none = np.zeros(0)
    _, tau = bare.simulate(none, joints, np.zeros(50), bare.parameters.values)
    _, felt = coupled.simulate(none, motors, np.zeros(50), coupled.parameters.values)
    at_joints = (tau * joints[:, 6:12]).sum(axis=1)
    at_motors = (felt * motors[:, 6:12]).sum(axis=1)
    np.testing.assert_allclose(at_motors, at_joints, atol=1e-10)


def test_either_side_of_the_coupling_gives_the_same_torques() -> None:
    law = "tanh+direction+load"
    by_motors = planted(Arm.of("ur5_like", law=law, coupling=ROWS, motion="motor"))
    by_joints = replace(by_motors, coupling=Coupling.of(ROWS))
    motors = motion(50)
    joints = Coupling.of(ROWS).of_motors(motors)
    p, none, dt = by_motors.parameters.values, np.zeros(0), np.zeros(50)
    np.testing.assert_allclose(
        by_joints.simulate(none, joints, dt, p)[1], by_motors.simulate(none, motors, dt, p)[1],
        atol=1e-10,
    )  # fmt: skip


def test_friction_follows_the_motor_and_not_the_joint() -> None:
    """A motor that turns against its joint's other motor: the joint rests, the motor rubs."""
    arm = Arm.of("ur5_like", rotor=False, coupling=ROWS, motion="motor", gravity=(0.0, 0.0, 0.0))
    p = arm.parameters.values
    p[arm.parameters.index("Fv5")] = 3.0
    u = np.zeros((1, 18))
    u[0, 6 + 4] = 0.5
    _, with_friction = arm.simulate(np.zeros(0), u, np.zeros(1), p)
    _, without = arm.simulate(np.zeros(0), u, np.zeros(1), arm.parameters.values)
    np.testing.assert_allclose(with_friction - without, [[0, 0, 0, 0, 1.5, 0]], atol=1e-12)


def test_no_coupling_is_the_identity() -> None:
    bare = planted(Arm.of("ur5_like", law="tanh+load", base=True))
    same = replace(bare, coupling=Coupling.of(np.eye(6).tolist()))
    u, p, dt = motion(20), bare.parameters.values, np.zeros(20)
    one, two = (arm.simulate(np.zeros(0), u, dt, p)[1] for arm in (bare, same))
    np.testing.assert_allclose(one, two, atol=1e-12)
    assert Arm.of("ur5_like", base=True, coupling=np.eye(6).tolist()).base == bare.base


def test_coupled_friction_is_recovered_and_an_uncoupled_model_misses_it() -> None:
    truth = planted(Arm.of("ur5_like", coupling=ROWS, motion="joint"))
    u, dt = motion(400), np.full(400, 0.01)
    _, y = truth.simulate(np.zeros(0), u, dt, truth.parameters.values)

    def solved(arm: Arm) -> tuple[np.ndarray, float]:
        y0, phi = arm.regressor(np.zeros(0), u, dt, arm.parameters.values)
        rows = np.zeros((*y.shape, len(arm.parameters)))
        for k, row in enumerate(arm.columns.tolist()):
            for place, column in zip(row, phi[:, k].T, strict=True):
                rows[:, k, place] += column
        flat = rows.reshape(y.size, -1)
        found, *_ = np.linalg.lstsq(flat, (y - y0).ravel(), rcond=None)
        return found, float(np.abs(flat @ found - (y - y0).ravel()).max())

    found, off = solved(replace(truth, parameters=Parameters()))
    np.testing.assert_allclose(found, truth.parameters.values, atol=1e-8)
    assert off < 1e-8 and solved(Arm.of("ur5_like"))[1] > 0.05


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"coupling": [[1.0, 0.0], [0.0, 1.0]]}, "expected 6 rows"),
        ({"coupling": [[1.0, 0.0]]}, "expected 1 rows of 1 numbers"),
        ({"coupling": np.zeros((6, 6)).tolist()}, "has no inverse"),
        ({"motion": "motor"}, "needs a 'coupling'"),
        ({"motion": "gear", "coupling": ROWS}, "expected 'joint' or 'motor'"),
    ],
)
def test_a_coupling_that_cannot_be_is_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        Arm.of("ur5_like", **options)  # type: ignore[arg-type]
