"""From the command to the motor's effort, compiled: path, controller, motor with its winding.

v_set = clamp(kp·(q_set − q) + feedforward·q̇_set)
demand = clamp(kv·(v_set − v) + ki·∫(v_set − v))
demand is a voltage:  L·di/dt = U − R·i − k·ω     (L = 0: at once)
demand is a current:  i = demand                  effort at the joint = ratio·k·i
"""

from __future__ import annotations

from typing import Any

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import reals
from evertwin.machines.assembly import context as slot
from evertwin.machines.assembly import shared
from evertwin.machines.assembly.shared import losses, ratio


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
    if context[slot.PATH_ROWS] == 0:
        v[j] = u[context[at + slot.U_V]]
        q[j] = u[context[at + slot.U_Q]] + clock * v[j]
        return
    rows, n = context[slot.PATH_ROWS], context[slot.N]
    table, rate = reals(context[slot.PATH]), reals(context[slot.REALS])[slot.PATH_RATE]
    place = min(max(clock * rate, 0.0), rows - 1.0)
    i = min(int(place), rows - 2)
    s, h = place - i, 1.0 / rate
    a, b = 2 * n * i, 2 * n * (i + 1)
    q0, v0, q1, v1 = table[a + j], h * table[a + n + j], table[b + j], h * table[b + n + j]
    c, d = 3.0 * (q1 - q0) - 2.0 * v0 - v1, 2.0 * (q0 - q1) + v0 + v1
    q[j] = q0 + s * (v0 + s * (c + s * d))
    speed = (v0 + s * (2.0 * c + s * 3.0 * d)) * rate
    moving = clock * rate < rows - 1.0
    v[j] = speed * u[context[slot.OVERRIDE]] if moving else 0.0


@njit(cache=True)
def _demand(
    context: Any, at: int, p: Any, seen: Any, wanted: Any, x: Any, dx: Any, q: Any
) -> float:
    """What the controller demands; ``seen`` and ``wanted``: position and speed."""
    error = wanted[0] - seen[0]
    speed = p[context[at + slot.KP]] * error + p[context[at + slot.FEED]] * wanted[1]
    off = _clamp(speed, p[context[at + slot.TOP]]) - seen[1]
    limit, total = p[context[at + slot.LIMIT]], p[context[at + slot.KV]] * off
    if context[at + slot.X_I] >= 0:
        total += p[context[at + slot.KI]] * x[context[at + slot.X_I]]
        # at its limit the integral may only run back
        free = abs(total) < limit or total * off < 0.0
        dx[context[at + slot.X_I]] = off if free else 0.0
    q[shared.ERROR] = error
    return float(_clamp(total, limit))


@njit(cache=True)
def drive(
    context: Any, at: int, p: Any, u: Any, seen: Any, wanted: Any, x: Any, dx: Any, q: Any
) -> None:
    """Effort of the motor at the joint, and what is electrical, into the axis' quantities ``q``.

    ``seen``: position and speed at the controller's sensor, then the motor's speed at the joint.
    """
    if context[at + slot.KP] >= 0:
        demand = _demand(context, at, p, seen, wanted, x, dx, q)
    else:
        demand = u[context[at + slot.U_C]]
    q[shared.COMMAND] = demand
    turns, mode = ratio(context, at, p), context[at + slot.MODE]
    q[shared.MOTOR_SPEED] = turns * seen[2]
    if mode == slot.FORCE:
        q[shared.EFFORT] = demand
        q[shared.MOTOR_TORQUE] = demand / turns
        return
    k = p[context[at + slot.K]]
    if mode == slot.TORQUE:
        q[shared.MOTOR_CURRENT] = demand / k
    elif mode == slot.CURRENT:
        q[shared.MOTOR_CURRENT] = demand
    elif context[at + slot.X_L] >= 0:
        q[shared.MOTOR_CURRENT] = x[context[at + slot.X_L]]
        back = p[context[at + slot.R]] * q[shared.MOTOR_CURRENT] + k * q[shared.MOTOR_SPEED]
        dx[context[at + slot.X_L]] = (demand - back) / p[context[at + slot.L]]
    else:
        q[shared.MOTOR_CURRENT] = (demand - k * q[shared.MOTOR_SPEED]) / p[context[at + slot.R]]
    q[shared.MOTOR_TORQUE] = k * q[shared.MOTOR_CURRENT]
    q[shared.EFFORT] = turns * q[shared.MOTOR_TORQUE]
    if mode in (slot.TORQUE, slot.CURRENT):
        q[shared.MOTOR_VOLTAGE] = (
            p[context[at + slot.R]] * q[shared.MOTOR_CURRENT] + k * q[shared.MOTOR_SPEED]
        )
    else:
        q[shared.MOTOR_VOLTAGE] = demand
    losses(context, at, p, q)
