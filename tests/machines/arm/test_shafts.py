"""Shafts that turn with several axes: the laws of a model, what they do, what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.machines.arm import Arm, kernel
from evertwin.machines.arm.base import base_parameters
from evertwin.models import check_model

ROW = [0, 0, 0, 0, 1, 1]
WRIST = [*np.eye(6)[:5].tolist(), [0, 0, 0, 0, -1, 1]]


def motion(rows: int) -> np.ndarray:
    return np.random.default_rng(3).uniform(-2, 2, (rows, 18))


def planted(arm: Arm) -> Arm:
    rng, p = np.random.default_rng(0), arm.parameters.values
    linear = np.unique(arm.columns[arm.columns >= 0])
    p[linear] += rng.normal(size=len(linear))
    return replace(arm, parameters=arm.parameters.with_values(p))


@pytest.mark.parametrize("law", ["sign", "tanh+load+position"])
@pytest.mark.parametrize("extra", [{}, {"base": True, "payload": True, "delay": True}])
def test_the_laws_of_a_model_hold(law: str, extra: dict[str, bool]) -> None:
    arm = planted(Arm.of("ur5_like", law=law, shafts={"m6": ROW}, **extra))
    u, p, none = motion(40), arm.parameters.values, np.zeros(0)
    check_model(arm, u, np.full(40, 0.01))
    y0, phi = arm.regressor(none, u, np.zeros(40), p)
    sums = y0 + np.where(arm.columns >= 0, phi * p[arm.columns], 0.0).sum(axis=2)
    np.testing.assert_allclose(arm.simulate(none, u, np.zeros(40), p)[1], sums, atol=1e-11)


def test_the_kernel_and_its_plain_twin_agree(run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    options = {"coupling": WRIST, "motion": "motor", "shafts": {"j6": WRIST[5]}}
    arm = planted(Arm.of("ur5_like", law="tanh", **options))
    u, p = motion(3), arm.parameters.values
    _, compiled = arm.simulate(np.zeros(0), u, np.zeros(3), p)
    for row, y in zip(u, compiled, strict=True):
        plain = np.zeros(6)
        kernel.step.plain(arm.kernel().context, np.zeros(0), row, 0.0, p, np.zeros(0), plain)
        np.testing.assert_allclose(plain, y, rtol=1e-14, atol=1e-14)


def test_a_joint_beside_coupled_motors_and_a_motor_beside_joints_are_one_machine() -> None:
    """Joints rub in one, motors in the other: with all four frictions both give the same torque."""
    joints = Arm.of("ur5_like", shafts={"m6": ROW})
    motors = Arm.of("ur5_like", coupling=WRIST, motion="joint", shafts={"j6": WRIST[5]})
    u, none, dt = motion(30), np.zeros(0), np.zeros(30)
    own = {"Fv6": 2.0, "Fc6": 3.0, "Fv_m6": 5.0, "Fc_m6": 7.0}
    turned = {"Fv6": 5.0, "Fc6": 7.0, "Fv_j6": 2.0, "Fc_j6": 3.0}
    tau = joints.simulate(none, u, dt, joints.parameters.with_values(own).values)[1]
    felt = motors.simulate(none, u, dt, motors.parameters.with_values(turned).values)[1]
    np.testing.assert_allclose(felt, tau @ np.array(WRIST), atol=1e-12)


def test_its_friction_is_asked_whether_it_resists() -> None:
    arm = Arm.of("ur5_like", shafts={"m6": ROW})
    p = arm.parameters.with_values({"Fc_m6": -2.0}).values
    rubbed = arm.rubbed(motion(20), np.zeros((20, 6)), p)[-1]
    assert rubbed.name == "shaft m6" and (rubbed.power < 0).all()


def test_it_is_a_rung_of_its_last_axis() -> None:
    arm = Arm.of("ur5_like", law="tanh+load", shafts={"m6": ROW})
    assert (arm.rungs()[0].output, arm.rungs()[0].add[0]) == (5, "Ia_m6")
    assert arm.law_name(5, ("shaft", "load")) == "tanh+load+m6"


@pytest.mark.parametrize("row", [[0, 0, 0, 0, 0, 1], [1, 1]])
def test_a_row_of_one_axis_or_of_another_arm_is_refused(row: list[float]) -> None:
    with pytest.raises(UsageError, match="expected a name such as 'm6' and 6 numbers"):
        Arm.of("ur5_like", shafts={"m6": row})


def test_angles_of_a_few_digits_leave_the_base_parameters_as_they_are() -> None:
    arm = Arm.of("ur5_like")
    exact = arm.chain.geometry
    for digits in (6, 9, 12):
        assert len(base_parameters(exact.round(digits), True)) == len(base_parameters(exact, True))
