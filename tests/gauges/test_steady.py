"""A motor at its steady speed: what a model that is off expects there is no missing answer."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import AnomalySpec, ModelSpec, TwinSpec
from evertwin.errors import TooFew
from evertwin.fold import Windows, make_block
from evertwin.gauges.gauge import silent
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.models.functions.translated import translated
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve

ROWS, AT = 2600, 2000
NUMBERS = (1.6, 0.055, 0.012, 3e-4)


def turned(x: Any, u: Any, dt: float, p: Any, root: float) -> Any:
    speed = x[0]
    for _ in range(10):
        current = (u[0] - p[1] * speed) / p[0]
        drag = p[2] * math.tanh(speed) + root * math.copysign(abs(speed) ** 0.6, speed)
        speed += 0.1 * dt * (p[1] * current - drag) / p[3]
    return [speed], [speed, (u[0] - p[1] * speed) / p[0]]


def step(x: Any, u: Any, dt: float, p: Any) -> Any:
    return turned(x, u, dt, p, 0.0)


def motor(size: float, root: float = 0.0) -> FunctionModel:
    """Speed by voltage against friction; the room's temperature does nothing."""
    units, (r, k, drag, inertia) = ("ohm", "V*s/rad", "Nm", "kg*m^2"), NUMBERS
    values = (r, k * size, drag * size, inertia * size * size)
    items = zip(("R", "k", "Tc", "J"), values, units, strict=True)
    return translated(FunctionModel(
        partial(turned, root=root) if root else step,
        Layout.of(volts="V", room="K"), Layout.of(speed="rad/s", current="A"),
        Layout.of(speed="rad/s"), Parameters(tuple(Parameter(*item) for item in items)),
    ))  # fmt: skip


def told(seed: int, size: float, end: int, *, rubs: float = 0.0, stuck: bool = False) -> str:
    """What is told of a silent sensor at row ``end``. Voltages are held for 4.5 s, of which
    predictions begin in the sixth row; from AT on it rubs by a power of its speed, or its current
    stays."""
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(-22.0, 22.0, ROWS // 45 + 2), 45)[6 : ROWS + 6]
    u = np.c_[volts, np.full(ROWS, 295.0)]
    u[:, 1] = np.round(u[:, 1] + rng.normal(0.0, 0.05, ROWS), 1)
    model, dt = motor(size), np.r_[0.0, np.full(ROWS - 1, 0.1)]
    p = model.parameters.values
    x, old = model.simulate(np.zeros(1), u[:AT], dt[:AT], p)
    _, new = motor(size, rubs * size).simulate(x, u[AT:], np.full(ROWS - AT, 0.1), p)
    y = np.concatenate([old, new])
    if stuck:
        y[AT:, 1] = 1.3
    y += rng.normal(size=y.shape) * [0.4 / size, 0.02]
    block = make_block(t=np.arange(end) * 10**8, u=u[:end], y=y[:end])
    setup = Setup(TwinSpec("motor", ModelSpec("python"), anomaly=AnomalySpec(0.08)), model)

    def pose(windows: Windows) -> Problem:
        return Problem(model, windows, horizon=4.5)

    windows = (block,)
    rows = Rows(setup, pose, windows, pose(windows), solve(pose(windows)), solve, begins=AT)
    found = silent(rows)
    return found.said if found else ""


@pytest.mark.parametrize(("seed", "end"), [(0, 2289), (0, 2424), (1, 2334)])
def test_a_motor_that_rubs_otherwise_has_no_silent_sensor(seed: int, end: int) -> None:
    for size in (1.0, 5.0):
        with suppress(TooFew):  # it is waited for
            assert not told(seed, size, end, rubs=2.4e-3)


def test_a_current_that_stays_is_told() -> None:
    assert told(0, 1.0, 2430, stuck=True).startswith("current stays at 1.3")
