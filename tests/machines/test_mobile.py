"""Mobile bases: laws of the contract, kernels against their plain twins, and plain geometry."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.machines.mobile import Bicycle, Differential, Odometer, Omni, Robot1D, kernels
from evertwin.models import Compiled, check_model

BASES = [
    Robot1D(), Odometer(), Differential(), Differential(wheels=True), Omni(),
    Omni(wheels=True, gear=16.0), Omni(wheels=True, odometry=True),
    Bicycle(1.4, 0.3), Bicycle(1.4, front_drive=True, aside=-0.2),
    Differential(ahead=0.2, aside=0.1), Differential(wheels=True, aside=0.1), Omni(ahead=-0.2),
    Omni(wheels=True, odometry=True, ahead=0.1, aside=-0.2),
]  # fmt: skip
STEPS = [
    kernels.travel_step, kernels.travel_step, kernels.twist_step, kernels.wheel_step,
    kernels.omni_step, kernels.three_wheel_step, kernels.three_wheel_step,
    kernels.steered_step, kernels.steered_step, kernels.twist_step, kernels.wheel_step,
    kernels.omni_step, kernels.three_wheel_step,
]  # fmt: skip


@pytest.mark.parametrize("base", BASES, ids=lambda b: type(b).__name__)
def test_laws(base: Compiled) -> None:
    check_model(base)


@pytest.mark.parametrize("number", range(len(BASES)))
def test_kernel_equals_its_plain_twin(number: int, run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    base, rng = BASES[number], np.random.default_rng(1)
    p = base.parameters.values * 1.1
    x = rng.normal(size=len(base.states))
    ahead, y, context = np.zeros_like(x), np.zeros(len(base.outputs)), np.array(base.context)
    for _ in range(20):
        u = rng.normal(size=len(base.inputs))
        end, out = base.simulate(x, u[None], np.array([0.07]), p)
        assert STEPS[number].plain(context, x, u, 0.07, p, ahead, y) == 0
        assert np.array_equal(end, ahead) and np.array_equal(out[0], y)
        x = ahead.copy()
    measured = rng.normal(size=len(base.outputs))
    measured[0] = np.nan
    adopted = base.observe(x, measured)
    kernels.observe.plain(context, x, measured)
    assert np.array_equal(adopted, x)


def test_wheels_agree_with_twist() -> None:
    twist, wheels = Differential(), Differential(wheels=True, wheel_radius=0.3, wheel_base=1.2)
    u = np.random.default_rng(0).normal(size=(50, 2))
    speeds = np.stack([(u[:, 0] - 0.6 * u[:, 1]) / 0.3, (u[:, 0] + 0.6 * u[:, 1]) / 0.3], axis=1)
    dt, x = np.full(50, 0.1), np.zeros(3)
    a = twist.simulate(x, u, dt, twist.parameters.values)[1]
    b = wheels.simulate(x, speeds, dt, wheels.parameters.values)[1]
    assert np.allclose(a, b, atol=1e-12)


@pytest.mark.parametrize("front_drive", [False, True])
def test_a_steered_base_goes_round_the_centre_of_its_curve(front_drive: bool) -> None:
    """The rear axle at a distance of b/tan(angle), the front wheel at b/sin(angle)."""
    base, angle = Bicycle(wheel_base=1.4, front_drive=front_drive), 0.3
    ahead = Bicycle(1.4, 1.4, front_drive)
    u, dt = np.tile([0.5, angle], (4000, 1)), np.full(4000, 0.01)
    _, rear = base.simulate(np.zeros(3), u, dt, base.parameters.values)
    _, front = ahead.simulate(np.array([1.4, 0.0, 0.0]), u, dt, ahead.parameters.values)
    centre = np.array([0.0, 1.4 / math.tan(angle)])
    assert np.hypot(*(rear[:, :2] - centre).T) == pytest.approx(1.4 / math.tan(angle), rel=1e-4)
    assert np.hypot(*(front[:, :2] - centre).T) == pytest.approx(1.4 / math.sin(angle), rel=1e-4)
    driven = np.diff(front if front_drive else rear, axis=0)[:, :2]
    assert np.hypot(*driven.T) == pytest.approx(0.005, rel=1e-4)


def test_an_omni_base_without_side_speed_is_a_differential_base() -> None:
    u = np.random.default_rng(0).normal(size=(50, 2))
    side = np.insert(u, 1, 0.0, axis=1)
    a = Differential().simulate(np.zeros(3), u, np.full(50, 0.1), np.ones(2))[1]
    b = Omni().simulate(np.zeros(3), side, np.full(50, 0.1), np.ones(3))[1]
    assert np.array_equal(a, b)


def test_three_wheels_agree_with_the_speeds_of_the_base() -> None:
    base, wheels = Omni(), Omni(wheels=True, wheel_radius=0.04, wheel_distance=0.125, gear=16.0)
    u = np.random.default_rng(0).normal(size=(50, 3))
    at = np.pi * np.array([1.0, 3.0, 5.0]) / 3.0
    share = np.stack([-np.sin(at), np.cos(at), np.full(3, 0.125)])
    speeds = u @ share * 16.0 / 0.04
    dt, x = np.full(50, 0.1), np.zeros(3)
    a = base.simulate(x, u, dt, base.parameters.values)[1]
    b = wheels.simulate(x, speeds, dt, wheels.parameters.values)[1]
    assert np.allclose(a, b[:, :3], atol=1e-12) and np.array_equal(b[:, 3:], speeds)


def test_each_motor_bears_its_share_of_what_resists_the_way() -> None:
    base = Omni(wheels=True)
    p = base.parameters.with_values({"load": 5.0}).values
    speeds = np.array([[6.0, -8.0, 0.0], [1.5, -2.0, 0.0], [0.0, 0.0, 0.0]])
    y = base.simulate(np.zeros(3), speeds, np.full(3, 0.1), p)[1]
    assert np.allclose(y[:, 3:], [[3.0, -4.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert np.ptp(y[:, 0]) == 0.0 < abs(y[0, 0])


def test_a_full_circle_comes_back() -> None:
    n = 1000
    u = np.tile([0.5, 2 * math.pi / 10], (n, 1))
    y = Differential().simulate(np.zeros(3), u, np.full(n, 10 / n), np.ones(2))[1]
    assert np.abs(y[-1, :2]).max() < 1e-9
    assert y[:, 1].max() == pytest.approx(2 * 0.5 * 10 / (2 * math.pi), rel=1e-4)


def test_a_wheel_has_a_size() -> None:
    with pytest.raises(UsageError, match="above 0 m"):
        Differential(wheels=True, wheel_radius=0.0)
    with pytest.raises(UsageError, match="expected gear above 0 1, got 0"):
        Omni(wheels=True, gear=0.0)


OFF = {
    "differential": (Differential(), Differential(ahead=0.3, aside=-0.2)),
    "wheels": (Differential(wheels=True), Differential(wheels=True, ahead=0.3, aside=-0.2)),
    "steered": (Bicycle(1.4), Bicycle(1.4, 0.3, aside=-0.2)),
    "omni": (Omni(), Omni(ahead=0.3, aside=-0.2)),
    "three wheels": (Omni(wheels=True), Omni(wheels=True, ahead=0.3, aside=-0.2)),
}


@pytest.mark.parametrize("name", OFF)
def test_a_point_off_the_base_goes_with_it(name: str) -> None:
    """Its position is that of the base and the turned lever, at every row."""
    (own, off), rng = OFF[name], np.random.default_rng(0)
    u, dt = np.repeat(rng.normal(size=(20, len(own.inputs))), 50, axis=0), np.full(1000, 0.002)
    _, base = own.simulate(np.zeros(3), u, dt, own.parameters.values)
    _, seen = off.simulate(np.array([0.3, -0.2, 0.0]), u, dt, off.parameters.values)
    c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
    x, y = base[:, 0] + 0.3 * c + 0.2 * s, base[:, 1] + 0.3 * s - 0.2 * c
    assert np.allclose(seen[:, 0], x, atol=1e-3) and np.allclose(seen[:, 1], y, atol=1e-3)
    assert set(off.parameters.names) - set(own.parameters.names) <= {"ahead", "aside"}
    assert off.parameters.editable == own.parameters.editable
