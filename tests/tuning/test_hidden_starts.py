"""Windows that are cut from a motion, and machines that run away without a look at them."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, Twin, TwinSpec
from evertwin.config.spec import ModelSpec, PredictionSpec
from evertwin.fold import Block, make_block, take
from evertwin.models.functions.translated import translated
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of


def swung(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    """A pendulum, of which the angle is measured."""
    angle, speed = x[0], x[1]
    for _ in range(4):
        speed = speed + dt / 4 * (p[2] * u[0] - p[0] * np.sin(angle) - p[1] * speed)
        angle = angle + dt / 4 * speed
    return [angle, speed], [angle]


def pendulum(stiffness: float, damping: float, gain: float) -> FunctionModel:
    return translated(FunctionModel(
        swung, Layout.of(torque="Nm"), Layout.of(angle="rad"),
        Layout.of(angle="rad", speed="rad/s"),
        Parameters.of(
            stiffness=(stiffness, "1/s^2"), damping=(damping, "1/s"), gain=(gain, "1/(kg*m^2)")
        ),
    ))  # fmt: skip


TRUE = (40.0, 0.4, 20.0)
SPEC = TwinSpec("pendulum", ModelSpec("python"), prediction=PredictionSpec(1.0))


def moved(seed: int, rows: int = 2000) -> Block:
    rng = np.random.default_rng(seed)
    torque = np.repeat(rng.uniform(-0.3, 0.3, rows // 40), 40)[:, None]
    model, dt = pendulum(*TRUE), np.full(rows, 0.01)
    y = model.simulate(np.zeros(2), torque, dt, model.parameters.values)[1]
    return make_block(np.arange(rows) * 10**7, torque, y + rng.normal(0.0, 1e-3, y.shape))


@pytest.mark.parametrize("seed", range(5))
def test_rows_that_begin_in_motion_tell_the_machine(seed: int) -> None:
    rows = take(moved(seed), 900, 1900)
    with Twin(SPEC, pendulum(44.0, 0.3, 18.0)) as twin:
        found = twin.fit((rows._replace(row=0),), [(rows._replace(row=0),)])
    assert found.fit.values[:3] == pytest.approx(TRUE, rel=0.01)
    assert found.test[0].rms < 5e-3
    assert "start of speed" in found.starts[0][0]


@pytest.mark.parametrize("seed", range(3))
def test_a_known_rest_is_found(seed: int) -> None:
    with Twin(SPEC, pendulum(44.0, 0.3, 18.0)) as twin:
        fit = twin.fit((moved(seed),)).fit
    assert abs(fit["start of speed in recording 1"]) < 0.1


def levitated(
    x: Vector, u: Vector, dt: float, p: ParameterVector
) -> tuple[list[float], list[float]]:
    """An iron ball below a magnet, of which the gap is measured."""
    gap, speed = x[0], x[1]
    for _ in range(4):
        speed = speed + dt / 4 * (9.81 - p[0] * (u[0] / max(gap, 1e-3)) ** 2 - p[1] * speed)
        gap = gap + dt / 4 * speed
    return [gap, speed], [gap]


def magnet(strength: float, damping: float) -> FunctionModel:
    return translated(FunctionModel(
        levitated, Layout.of(current="A"), Layout.of(gap="m"), Layout.of(gap="m", speed="m/s"),
        Parameters.of(strength=(strength, "m^3/(s^2*A^2)"), damping=(damping, "1/s")),
    ))  # fmt: skip


def held(seed: int, rows: int = 5000) -> Block:
    """In a closed loop, without which it falls."""
    rng, model = np.random.default_rng(seed), magnet(1.1e-3, 3.0)
    wanted = np.repeat(rng.uniform(7e-3, 13e-3, rows // 250), 250)
    x, u, y = np.array([0.01, 0.0]), np.empty((rows, 1)), np.empty((rows, 1))
    for i, gap in enumerate(wanted.tolist()):
        y[i] = x[0] + rng.normal(0.0, 5e-6)
        u[i] = np.clip(gap * np.sqrt(9.81 / 1.1e-3) + 260 * (y[i, 0] - gap) + 7 * x[1], 0.0, 3.0)
        x = model.simulate(x, u[i : i + 1], np.array([2e-3]), model.parameters.values)[0]
    return make_block(np.arange(rows) * 2 * 10**6, u, y)


@first_of("seed", range(3))
def test_an_unstable_machine_is_followed_and_tuned(seed: int) -> None:
    spec = TwinSpec("magnet", ModelSpec("python"), prediction=PredictionSpec(0.04))
    with Twin(spec, magnet(1.08e-3, 2.5)) as twin:
        found = twin.fit((held(seed),))
    assert found.fit["strength"] == pytest.approx(1.1e-3, rel=1e-2)
    assert found.train[0].rms < 3e-4
