"""Kinematics of mobile bases, compiled. Heading at the middle of a row is used over the row, which
is exact for the direction of an arc and second order in its length.
"""

from __future__ import annotations

import math
from typing import Any

from evertwin.models.native import OBSERVE, STEP, cfunc


@cfunc(STEP)
def line_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """x' = gain·v."""
    ahead[0] = x[0] + p[0] * u[0] * dt
    y[0] = ahead[0]
    return 0


@cfunc(OBSERVE)
def line_observe(context: Any, x: Any, y: Any) -> int:
    """The position is adopted."""
    if not math.isnan(y[0]):
        x[0] = y[0]
    return 0


@cfunc(STEP)
def odometer_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """travel' = gain·v, heading' = turn_gain·w."""
    ahead[0] = x[0] + p[0] * u[0] * dt
    ahead[1] = x[1] + p[1] * u[1] * dt
    y[0] = ahead[0]
    y[1] = ahead[1]
    return 0


@cfunc(OBSERVE)
def pair_observe(context: Any, x: Any, y: Any) -> int:
    """Travel and heading are adopted."""
    for i in range(2):
        if not math.isnan(y[i]):
            x[i] = y[i]
    return 0


@cfunc(OBSERVE)
def pose_observe(context: Any, x: Any, y: Any) -> int:
    """Position and heading are adopted."""
    for i in range(3):
        if not math.isnan(y[i]):
            x[i] = y[i]
    return 0


@cfunc(STEP)
def twist_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """x' = gain·v·cos θ, y' = gain·v·sin θ, θ' = turn_gain·w."""
    turn = p[1] * u[1] * dt
    way = p[0] * u[0] * dt
    middle = x[2] + 0.5 * turn
    ahead[0] = x[0] + way * math.cos(middle)
    ahead[1] = x[1] + way * math.sin(middle)
    ahead[2] = x[2] + turn
    for i in range(3):
        y[i] = ahead[i]
    return 0


@cfunc(STEP)
def wheel_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """The same from wheel speeds: v = r·(left + right)/2, w = r·(right − left)/b."""
    turn = p[0] * (u[1] - u[0]) / p[1] * dt
    way = p[0] * 0.5 * (u[0] + u[1]) * dt
    middle = x[2] + 0.5 * turn
    ahead[0] = x[0] + way * math.cos(middle)
    ahead[1] = x[1] + way * math.sin(middle)
    ahead[2] = x[2] + turn
    for i in range(3):
        y[i] = ahead[i]
    return 0


@cfunc(STEP)
def omni_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """x' = gain·vx·cos θ − side_gain·vy·sin θ, y' likewise, θ' = turn_gain·w."""
    turn = p[2] * u[2] * dt
    forward = p[0] * u[0] * dt
    left = p[1] * u[1] * dt
    middle = x[2] + 0.5 * turn
    ahead[0] = x[0] + forward * math.cos(middle) - left * math.sin(middle)
    ahead[1] = x[1] + forward * math.sin(middle) + left * math.cos(middle)
    ahead[2] = x[2] + turn
    for i in range(3):
        y[i] = ahead[i]
    return 0
