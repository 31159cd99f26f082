"""Kinematics of mobile bases, compiled. Heading at the middle of a row is used over the row, which
is exact for the direction of an arc and second order in its length. The context is the number of
states, which every base shows; of those with a pose also where their numbers say how far before
and to the left of their own point it is measured (0: they do not); then of three wheels the first
input that the pose follows, of a steered base whether its steered wheel drives.
"""

from __future__ import annotations

import math
from typing import Any

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit


@cfunc(OBSERVE)
def observe(context: Any, x: Any, y: Any) -> int:
    """Every state is adopted."""
    for i in range(context[0]):
        if not math.isnan(y[i]):
            x[i] = y[i]
    return 0


@cfunc(STEP)
def travel_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """Each state moves with its own speed: travel' = gain·v, heading' = turn_gain·w."""
    for i in range(context[0]):
        ahead[i] = x[i] + p[i] * u[i] * dt
        y[i] = ahead[i]
    return 0


@njit(cache=True)
def moved(context: Any, x: Any, p: Any, way: Any, ahead: Any, y: Any) -> None:
    """The pose after a way forward and to the left and a turn, ``way``, which moves a point off the
    base's own sideways."""
    forward, left, turn = way
    if context[1] > 0:
        left += p[context[1]] * turn
    if context[2] > 0:
        forward -= p[context[2]] * turn
    middle = x[2] + 0.5 * turn
    ahead[0] = x[0] + forward * math.cos(middle) - left * math.sin(middle)
    ahead[1] = x[1] + forward * math.sin(middle) + left * math.cos(middle)
    ahead[2] = x[2] + turn
    for i in range(3):
        y[i] = ahead[i]


@cfunc(STEP)
def twist_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """Differential base with speed and turn rate."""
    moved(context, x, p, (p[0] * u[0] * dt, 0.0, p[1] * u[1] * dt), ahead, y)
    return 0


@cfunc(STEP)
def wheel_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """Differential base with wheel speeds; parameters are radius and distance of the wheels."""
    turn = p[0] * (u[1] - u[0]) / p[1] * dt
    moved(context, x, p, (p[0] * 0.5 * (u[0] + u[1]) * dt, 0.0, turn), ahead, y)
    return 0


@cfunc(STEP)
def steered_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """Steered base; parameters are gain, steering gain and offset, distance of the axles. The
    context says whether the steered wheel drives."""
    angle = p[1] * u[1] + p[2]
    way = p[0] * u[0] * dt
    forward, side = way, way * math.tan(angle)
    if context[3] > 0:
        forward, side = way * math.cos(angle), way * math.sin(angle)
    turn = side / p[3]
    moved(context, x, p, (forward, 0.0, turn), ahead, y)
    return 0


@cfunc(STEP)
def omni_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """Omnidirectional base with forward speed, speed to the left, turn rate."""
    moved(context, x, p, (p[0] * u[0] * dt, p[1] * u[1] * dt, p[2] * u[2] * dt), ahead, y)
    return 0


@cfunc(STEP)
def three_wheel_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """Omnidirectional base with motor speeds; after the gains: load, radius, distance of the wheels
    from the centre, gear. A wheel at angle a drives with −sin(a)·vx + cos(a)·vy + distance·w. The
    floor's resistance is against the way, so each motor has its share of it."""
    size = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    left_over = max(1.0 - p[3] / size, 0.0) if size > 0.0 else 1.0
    for i in range(3):
        y[3 + i] = left_over * u[i]
    first = context[3]
    forward, left, turn = 0.0, 0.0, 0.0
    for i in range(3):
        at = math.pi * (1 + 2 * i) / 3.0
        speed = u[first + i] if first > 0 else y[3 + i]
        forward -= math.sin(at) * speed
        left += math.cos(at) * speed
        turn += speed
    way = dt * p[4] / p[6] / 3.0
    forward, left = 2.0 * p[0] * way * forward, 2.0 * p[1] * way * left
    moved(context, x, p, (forward, left, p[2] * way * turn / p[5]), ahead, y)
    return 0
