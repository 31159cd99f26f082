"""Small machines with known parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numba import cfunc

from evertwin.fold import Block, make_block
from evertwin.models import OBSERVE, STEP, Compiled, Parameter, Parameters
from evertwin.signals import Layout


@dataclass(frozen=True)
class Axes:
    """Axes with friction: torque_k = Fc_k tanh(v_k/w) + Bm_k v_k, linear in all but the width."""

    n: int = 6
    width: float = 0.02
    sigma: float = np.inf
    parameters: Parameters = field(default=Parameters())

    def __post_init__(self) -> None:
        if not len(self.parameters):
            items = [Parameter(f"Fc{k}", 1.0, "Nm", sigma=self.sigma) for k in range(self.n)]
            items += [Parameter(f"Bm{k}", 1.0, "Nms/rad", sigma=self.sigma) for k in range(self.n)]
            items += [Parameter("width", self.width, "rad/s", 1e-4, 1.0, editable=False)]
            object.__setattr__(self, "parameters", Parameters(tuple(items)))

    @property
    def inputs(self) -> Layout:
        return Layout.of(**{f"v{k}": "rad/s" for k in range(self.n)})

    @property
    def outputs(self) -> Layout:
        return Layout.of(**{f"t{k}": "Nm" for k in range(self.n)})

    @property
    def states(self) -> Layout:
        return Layout()

    @property
    def columns(self) -> Any:
        return np.array([[k, self.n + k] for k in range(self.n)])

    def initial(self, p: Any) -> Any:
        return np.zeros(0)

    def observe(self, x: Any, y: Any) -> Any:
        return x.copy()

    def regressor(self, x: Any, u: Any, dt: Any, p: Any) -> Any:
        # Element by element: NumPy's tanh of an array may differ in the last bit with its length.
        smooth = np.vectorize(math.tanh, otypes=[float])(u / p[-1])
        return np.zeros(u.shape), np.stack([smooth, u], axis=2)

    def simulate(self, x: Any, u: Any, dt: Any, p: Any) -> Any:
        _, phi = self.regressor(x, u, dt, p)
        return x.copy(), (phi * p[self.columns]).sum(axis=2)


@pytest.fixture
def axes() -> Any:
    return Axes


def rows(model: Any, u: Any, p: Any, noise: Any, hz: float = 10.0) -> Block:
    """Measured rows of a static map."""
    y = model.simulate(np.zeros(0), u, np.full(len(u), 1 / hz), p)[1] + noise
    return make_block(t=np.arange(len(u)) * round(1e9 / hz), u=u, y=y)


@pytest.fixture
def measured() -> Any:
    return rows


@cfunc(STEP, cache=True)
def robot_step(context: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> Any:
    ahead[0] = x[0] + dt * p[0] * u[0]
    y[0] = ahead[0]
    return 0


@cfunc(STEP, cache=True)
def wavy_step(context: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> Any:
    ahead[0] = x[0] + dt * math.sin(5 * p[0]) * u[0]
    y[0] = ahead[0]
    return 0


@cfunc(OBSERVE, cache=True)
def adopt(context: Any, x: Any, y: Any) -> Any:
    if y[0] == y[0]:
        x[0] = y[0]
    return 0


def on_a_line(step: Any, gain: Parameter) -> Compiled:
    place = Layout.of(x="m")
    command = Layout.of(command="m/s")
    return Compiled(command, place, place, Parameters((gain,)), step.address, adopt.address)


@pytest.fixture
def robot() -> Compiled:
    """A robot on a line: x' = gain · command."""
    return on_a_line(robot_step, Parameter("gain", 1.0, "1", 0.2, 3.0))


@pytest.fixture
def wavy() -> Compiled:
    """The same with a gain that acts through a sine: local minima."""
    return on_a_line(wavy_step, Parameter("gain", 1.0, "1", 0.9, 2.6))


def drive(model: Compiled, gain: float, seed: int, n: int = 300) -> Block:
    """A run of the robot at 10 Hz with 1 cm noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-0.3, 0.5, n // 10), 10)[:, None]
    dt = np.full(n, 0.1)
    dt[0] = 0.0
    _, y = model.simulate(np.zeros(1), u, dt, np.array([gain]))
    return make_block(t=np.arange(n) * 10**8, u=u, y=y + rng.normal(0, 0.01, y.shape))


@pytest.fixture
def run() -> Any:
    return drive


@cfunc(STEP, cache=True)
def one_sided_step(context: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> Any:
    y[0] = p[0] * np.sign(u[0]) + p[1] * u[0] + p[2]
    return 0


@cfunc(STEP, cache=True)
def two_sided_step(context: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> Any:
    s = np.sign(u[0])
    y[0] = p[0] * max(s, 0.0) + p[3] * min(s, 0.0) + p[1] * u[0] + p[2]
    return 0


@cfunc(STEP, cache=True)
def product_step(context: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> Any:
    y[0] = p[0] * p[1] * u[0]
    return 0


@cfunc(OBSERVE, cache=True)
def nothing(context: Any, x: Any, y: Any) -> Any:
    return 0


def static(step: Any, **parameters: Any) -> Compiled:
    return Compiled(
        Layout.of(speed="rad/s"), Layout.of(torque="Nm"), Layout(), Parameters.of(**parameters),
        step.address, nothing.address,
    )  # fmt: skip


@pytest.fixture
def friction() -> dict[str, Compiled]:
    """Friction as a nonlinear solver sees it: without a regressor."""
    one = {"Fc": (9.0, "Nm"), "Bm": (4.0, "Nms/rad"), "offset": (1.0, "Nm")}
    return {
        "one": static(one_sided_step, **one),
        "two": static(two_sided_step, **one, Fm=(9.0, "Nm")),
        "product": static(product_step, k1=(1.0, "1"), k2=(1.0, "1")),
    }
