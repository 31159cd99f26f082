"""From the command to the motor's effort, compiled: path, controller, motor with its winding.

v_set = clamp(kp·(q_set − q) + feedforward·q̇_set)
demand = clamp(kv·(v_set − v) + ki·∫(v_set − v))
demand is a voltage:  L·di/dt = U − R·i − k·ω     (L = 0: at once)
demand is a current:  i = demand                  effort at the joint = ratio·k·i
"""

from __future__ import annotations

from typing import Any

from numba import njit

from evertwin.machines.arm.memory import reals
from evertwin.machines.assembly.context import (
    CURRENT,
    FEED,
    FORCE,
    KI,
    KP,
    KV,
    LIMIT,
    MODE,
    OVERRIDE,
    PATH,
    PATH_RATE,
    PATH_ROWS,
    REALS,
    TOP,
    TORQUE,
    U_C,
    U_Q,
    U_V,
    X_I,
    X_L,
    K,
    L,
    N,
    R,
)
from evertwin.machines.assembly.shared import (
    COMMAND,
    EFFORT,
    ERROR,
    MOTOR_CURRENT,
    MOTOR_SPEED,
    MOTOR_TORQUE,
    MOTOR_VOLTAGE,
    losses,
    ratio,
)


@njit(cache=True)
def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


@njit(cache=True)
def set_points(context: Any, clock: float, u: Any, q: Any, v: Any, at: int, j: int) -> None:
    """Position and speed that axis ``j`` shall have, into ``q[j]`` and ``v[j]``.

    From the inputs, which hold at the row's end (``clock`` 0) and are reached at their own speed;
    or from the planned path at time ``clock``: cubic between its rows, which knows positions and
    speeds. ``at``: the axis' integers.
    """
    if context[PATH_ROWS] == 0:
        v[j] = u[context[at + U_V]]
        q[j] = u[context[at + U_Q]] + clock * v[j]
        return
    rows, n = context[PATH_ROWS], context[N]
    table, rate = reals(context[PATH]), reals(context[REALS])[PATH_RATE]
    place = min(max(clock * rate, 0.0), rows - 1.0)
    i = min(int(place), rows - 2)
    s, h = place - i, 1.0 / rate
    a, b = 2 * n * i, 2 * n * (i + 1)
    q0, v0, q1, v1 = table[a + j], h * table[a + n + j], table[b + j], h * table[b + n + j]
    c, d = 3.0 * (q1 - q0) - 2.0 * v0 - v1, 2.0 * (q0 - q1) + v0 + v1
    q[j] = q0 + s * (v0 + s * (c + s * d))
    speed = (v0 + s * (2.0 * c + s * 3.0 * d)) * rate
    moving = clock * rate < rows - 1.0
    v[j] = speed * u[context[OVERRIDE]] if moving else 0.0


@njit(cache=True)
def _demand(
    context: Any, at: int, p: Any, seen: Any, wanted: Any, x: Any, dx: Any, q: Any
) -> float:
    """What the controller demands; ``seen`` and ``wanted``: position and speed."""
    error = wanted[0] - seen[0]
    speed = p[context[at + KP]] * error + p[context[at + FEED]] * wanted[1]
    off = _clamp(speed, p[context[at + TOP]]) - seen[1]
    limit, total = p[context[at + LIMIT]], p[context[at + KV]] * off
    if context[at + X_I] >= 0:
        total += p[context[at + KI]] * x[context[at + X_I]]
        # at its limit the integral may only run back
        free = abs(total) < limit or total * off < 0.0
        dx[context[at + X_I]] = off if free else 0.0
    q[ERROR] = error
    return float(_clamp(total, limit))


@njit(cache=True)
def drive(
    context: Any, at: int, p: Any, u: Any, seen: Any, wanted: Any, x: Any, dx: Any, q: Any
) -> None:
    """Effort of the motor at the joint, and what is electrical, into the axis' quantities ``q``.

    ``seen``: position and speed at the controller's sensor, then the motor's speed at the joint.
    """
    if context[at + KP] >= 0:
        demand = _demand(context, at, p, seen, wanted, x, dx, q)
    else:
        demand = u[context[at + U_C]]
    q[COMMAND] = demand
    turns, mode = ratio(context, at, p), context[at + MODE]
    q[MOTOR_SPEED] = turns * seen[2]
    if mode == FORCE:
        q[EFFORT] = demand
        q[MOTOR_TORQUE] = demand / turns
        return
    k = p[context[at + K]]
    if mode == TORQUE:
        q[MOTOR_CURRENT] = demand / k
    elif mode == CURRENT:
        q[MOTOR_CURRENT] = demand
    elif context[at + X_L] >= 0:
        q[MOTOR_CURRENT] = x[context[at + X_L]]
        back = p[context[at + R]] * q[MOTOR_CURRENT] + k * q[MOTOR_SPEED]
        dx[context[at + X_L]] = (demand - back) / p[context[at + L]]
    else:
        q[MOTOR_CURRENT] = (demand - k * q[MOTOR_SPEED]) / p[context[at + R]]
    q[MOTOR_TORQUE] = k * q[MOTOR_CURRENT]
    q[EFFORT] = turns * q[MOTOR_TORQUE]
    if mode in (TORQUE, CURRENT):
        q[MOTOR_VOLTAGE] = p[context[at + R]] * q[MOTOR_CURRENT] + k * q[MOTOR_SPEED]
    else:
        q[MOTOR_VOLTAGE] = demand
    losses(context, at, p, q)
