"""Small compiled machines for the tests of this room."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import cfunc

from evertwin.fold import Block, make_block
from evertwin.models import OBSERVE, STEP, Compiled, Parameters
from evertwin.signals import Channel, Layout


@cfunc(STEP)
def _drive(c: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> int:
    ahead[0] = x[0] + p[0] * u[0] * dt
    y[0] = ahead[0]
    return 0


@cfunc(OBSERVE)
def _drive_observe(c: Any, x: Any, y: Any) -> int:
    if y[0] == y[0]:
        x[0] = y[0]
    return 0


@cfunc(STEP)
def _store(c: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> int:
    ahead[0] = x[0] + (p[0] * u[0] - x[0]) * min(dt, 1.0)
    y[0] = ahead[0]
    return 0


@cfunc(STEP)
def _unicycle(c: Any, x: Any, u: Any, dt: Any, p: Any, ahead: Any, y: Any) -> int:
    middle = x[2] + 0.5 * u[1] * dt
    ahead[0] = x[0] + p[0] * u[0] * math.cos(middle) * dt
    ahead[1] = x[1] + p[0] * u[0] * math.sin(middle) * dt
    ahead[2] = x[2] + u[1] * dt
    for k in range(3):
        y[k] = ahead[k]
    return 0


@cfunc(OBSERVE)
def _unicycle_observe(c: Any, x: Any, y: Any) -> int:
    for k in range(3):
        if y[k] == y[k]:
            x[k] = y[k]
    return 0


def drive(gain: float = 1.0, **limits: float) -> Compiled:
    """x' = gain·v; measured x [m]."""
    position = Layout((Channel("x", "m", **limits),))  # type: ignore[arg-type]
    return Compiled(
        Layout.of(v="m/s"), position, position, Parameters.of(gain=(gain, "1")),
        _drive.address, _drive_observe.address,
    )  # fmt: skip


def store(**limits: float) -> Compiled:
    """x' = u − x; measured x [m], as a model of one's own begins."""
    place = Layout((Channel("y", "m", **limits),))  # type: ignore[arg-type]
    return Compiled(
        Layout.of(u="m"), place, place, Parameters.of(gain=(1.0, "1/s")), _store.address,
        _drive_observe.address,
    )  # fmt: skip


def unicycle(gain: float = 1.0) -> Compiled:
    """A robot in the plane; pose adopted as one group, heading an angle."""
    pose = Layout(
        (
            Channel("x", "m", group="pose"),
            Channel("y", "m", group="pose"),
            Channel("heading", "rad", kind="angle", group="pose"),
        )
    )
    return Compiled(
        Layout.of(v="m/s", w="rad/s"), pose, pose, Parameters.of(gain=(gain, "1")),
        _unicycle.address, _unicycle_observe.address,
    )  # fmt: skip


def drive_rows(
    seed: int, n: int = 600, sigma: float = 0.01, rate: float = 10.0, speed: float = 0.3
) -> Block:
    """``n`` rows of a drive with true gain 1 under slowly changing speed, noisy position."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(n) * 1e9 / rate).astype(np.int64)
    v = speed * (1.0 + 0.6 * np.sin(0.4 * t * 1e-9))
    x = np.concatenate([[0.0], np.cumsum(v[1:] / rate)])
    return make_block(t=t, u=v[:, None], y=(x + rng.normal(0, sigma, n))[:, None])


def unicycle_rows(seed: int, n: int = 400) -> Block:
    """Rows of a robot that turns several times, with missing poses, a gap and a second task."""
    rng = np.random.default_rng(seed)
    model = unicycle()
    t = np.cumsum(rng.integers(10_000_000, 200_000_000, n))
    dt = np.diff(t, prepend=t[0]) * 1e-9
    u = np.stack([rng.uniform(0, 1, n), rng.uniform(-0.5, 2.5, n)], axis=1)
    _, y = model.simulate(np.zeros(3), u, dt, np.array([1.05]))
    y += rng.normal(0, 0.005, y.shape)
    y[:, 2] = np.arctan2(np.sin(y[:, 2]), np.cos(y[:, 2]))
    y[rng.random(n) < 0.4] = np.nan
    task = (np.arange(n) > 0.7 * n).astype(np.int64)
    block = make_block(t=t, u=u, y=y, task=task)
    block.gap[n // 3] = True
    return block
