"""What both readings of an assembly compute alike, compiled: friction, bodies, the motor's side.

Quantities of a row are collected on a *bus*, so that any of them can be an output (a virtual
sensor): `QUANTITIES` for every axis, `RUBS` for every friction, one for every black box.
"""

from __future__ import annotations

import math
from typing import Any

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import reals
from evertwin.machines.arm.kernel import carry
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.assembly import context as slot
from evertwin.machines.friction.kernel import force

(POSITION, SPEED, ACCELERATION, LOAD, EFFORT, DEFLECTION, MOTOR_SPEED, MOTOR_TORQUE, MOTOR_CURRENT,
 MOTOR_VOLTAGE, LOSS, POWER, COMMAND, ERROR) = range(14)  # fmt: skip
QUANTITIES = 14
"""Quantities of an axis on the bus."""
RUB_FORCE, HEAT, TEMPERATURE = range(3)
RUBS = 3
"""Quantities of a friction on the bus."""


@njit(cache=True)
def bus_size(context: Any) -> int:
    """Reals of a bus."""
    return int(QUANTITIES * context[slot.N] + RUBS * context[slot.NF] + context[slot.NB])


@njit(cache=True)
def ratio(context: Any, at: int, p: Any) -> float:
    """Motor turns for each unit of joint motion; ``at``: the axis' integers."""
    if context[at + slot.RATIO] < 0:
        return 1.0
    value = p[context[at + slot.RATIO]]
    return float(2.0 * math.pi / value if context[at + slot.SCREW] == 1 else value)


@njit(cache=True)
def reflected(context: Any, at: int, p: Any) -> float:
    """The rotor's inertia as the joint feels it."""
    if context[at + slot.ROTOR] < 0:
        return 0.0
    turns = ratio(context, at, p)
    return float(turns * turns * p[context[at + slot.ROTOR]])


@njit(cache=True)
def alone(context: Any, at: int, p: Any) -> float:
    """Mass that an axis without an arm accelerates."""
    total = p[context[at + slot.MASS]]
    if context[at + slot.CARRIED] >= 0:
        total += p[context[at + slot.CARRIED]]
    return float(total)


@njit(cache=True)
def rub(context: Any, at: int, p: Any, motion: Any, load: float, T: float, rest: float) -> float:
    """Friction of one component.

    Args:
        at: where its integers begin.
        motion: position and speed.
        rest: speed below which it stands still.
    """
    q, v = motion
    return float(force(context, context[at + slot.LAW], p, v, load, T, q, rest))


@njit(cache=True)
def warmth(context: Any, at: int, u: Any, x: Any) -> float:
    """Temperature of a friction [K]: measured, or from its heat balance; NaN: nobody asks."""
    if context[at + slot.T_U] >= 0:
        return float(u[context[at + slot.T_U]])
    if context[at + slot.T_X] >= 0:
        return float(x[context[at + slot.T_X]])
    return math.nan


@njit(cache=True)
def cooled(context: Any, at: int, p: Any, now: float, heat: float, dt: float) -> float:
    """Temperature after ``dt`` under ``heat`` [W]: exact while the heat is held."""
    loss = p[context[at + slot.CONDUCTANCE]]
    if loss == 0.0:
        return float(now + dt * heat / p[context[at + slot.CAPACITY]])
    end = p[context[at + slot.AMBIENT]] + heat / loss
    return float(end + (now - end) * math.exp(-dt * loss / p[context[at + slot.CAPACITY]]))


@njit(cache=True)
def heated(context: Any, x: Any, h: float, p: Any, bus: Any, ahead: Any) -> None:
    """Temperatures that follow from heat, ``h`` later, into ``ahead`` (which may be ``x``)."""
    n = context[slot.N]
    for f in range(context[slot.NF]):
        at = slot.HEAD + slot.AXIS * n + slot.RUB * f
        if context[at + slot.T_X] >= 0:
            heat = bus[QUANTITIES * n + RUBS * f + HEAT]
            ahead[context[at + slot.T_X]] = cooled(
                context, at, p, x[context[at + slot.T_X]], heat, h
            )


@njit(cache=True)
def bodies(context: Any, p: Any, out: Any) -> None:
    """An arm's inertias in force: given ones, then chosen ones from ``p``, then the payload's."""
    n = context[slot.N]
    given, carried = reals(context[slot.INERTIAS]), reals(context[slot.MAP])
    for k in range(BODY * n):
        out[k] = given[k]
    at = slot.HEAD + slot.AXIS * n + slot.RUB * context[slot.NF]
    for k in range(context[slot.CHOSEN]):
        out[context[at + 2 * k]] = p[context[at + 2 * k + 1]]
    if context[slot.PAYLOAD] >= 0:
        carry(n, carried, 0, p, context[slot.PAYLOAD], out)


@njit(cache=True)
def motor_side(context: Any, at: int, p: Any, speed: float, q: Any) -> None:
    """Current, voltage and losses from the motor's torque, into the axis' quantities ``q``."""
    turns = ratio(context, at, p)
    q[MOTOR_SPEED] = turns * speed
    q[MOTOR_TORQUE] = q[EFFORT] / turns
    if context[at + slot.K] < 0:
        return
    q[MOTOR_CURRENT] = q[MOTOR_TORQUE] / p[context[at + slot.K]]
    back = p[context[at + slot.K]] * q[MOTOR_SPEED]
    q[MOTOR_VOLTAGE] = p[context[at + slot.R]] * q[MOTOR_CURRENT] + back
    losses(context, at, p, q)


@njit(cache=True)
def losses(context: Any, at: int, p: Any, q: Any) -> None:
    """Heat of the winding and electrical power [W]."""
    q[LOSS] = p[context[at + slot.R]] * q[MOTOR_CURRENT] * q[MOTOR_CURRENT]
    q[POWER] = q[MOTOR_VOLTAGE] * q[MOTOR_CURRENT]


@njit(cache=True)
def show(context: Any, bus: Any, y: Any) -> None:
    """The outputs: quantities picked from the bus."""
    at = (
        slot.HEAD
        + slot.AXIS * context[slot.N]
        + slot.RUB * context[slot.NF]
        + 2 * context[slot.CHOSEN]
    )
    for k in range(context[slot.NY]):
        y[k] = bus[context[at + k]]
