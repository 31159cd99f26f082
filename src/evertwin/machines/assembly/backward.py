"""The inverse reading, compiled: motion in, the effort that it needs out, and what lies between.

    effort = bodies(q, q̇, q̈) + ratio²·J·q̈ + friction + black boxes
    motor torque = effort / ratio,   i = torque / k,   U = R·i + k·ratio·q̇

A spring in a gearbox is taken as quasi-static here: the motion that is given is the motor's, the
deflection is what the transmitted load bends it by.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from evertwin.machines.arm.memory import reals
from evertwin.machines.arm.rnea import BODY, joint_torques
from evertwin.machines.assembly.boxes import address, box_axis, run_boxes
from evertwin.machines.assembly.context import (
    AGILITY,
    ARM,
    AXIS,
    CARRIED,
    GEOMETRY,
    HEAD,
    INERTIAS,
    MASS,
    NB,
    NF,
    OWN,
    REALS,
    RUB,
    SHARED,
    STIFF,
    U_A,
    U_Q,
    U_V,
    N,
)
from evertwin.machines.assembly.shared import (
    ACCELERATION,
    DEFLECTION,
    EFFORT,
    HEAT,
    LOAD,
    POSITION,
    QUANTITIES,
    RUB_FORCE,
    RUBS,
    SPEED,
    TEMPERATURE,
    bodies,
    bus_size,
    heated,
    motor_side,
    reflected,
    rub,
    show,
    warmth,
)
from evertwin.models.native import OBSERVE, STEP, cfunc


@njit(cache=True)
def _motion(context: Any, u: Any, bus: Any) -> None:
    for j in range(context[N]):
        at, q = HEAD + AXIS * j, QUANTITIES * j
        bus[q + POSITION] = u[context[at + U_Q]] if context[at + U_Q] >= 0 else 0.0
        bus[q + SPEED] = u[context[at + U_V]]
        bus[q + ACCELERATION] = u[context[at + U_A]]


@njit(cache=True)
def _loads(context: Any, p: Any, bus: Any, carried: Any) -> None:
    """What the structure needs, and the described load that friction takes its share of."""
    n = context[N]
    if context[ARM] == 0:
        for j in range(n):
            at, q = HEAD + AXIS * j, QUANTITIES * j
            mass = p[context[at + MASS]]
            if context[at + CARRIED] >= 0:
                mass += p[context[at + CARRIED]]
            bus[q + LOAD] = mass * bus[q + ACCELERATION]
            carried[j] = 0.0
        return
    geometry, described = reals(context[GEOMETRY]), reals(context[INERTIAS])
    motion, body, kept, tau = np.empty(3 * n), np.empty(BODY * n), np.empty(8 * n), np.empty(n)
    for j in range(n):
        motion[j] = bus[QUANTITIES * j + POSITION]
        motion[n + j] = bus[QUANTITIES * j + SPEED]
        motion[2 * n + j] = bus[QUANTITIES * j + ACCELERATION]
    bodies(context, p, body)
    joint_torques(n, geometry, body, motion, tau, kept)
    for j in range(n):
        bus[QUANTITIES * j + LOAD] = tau[j]
        carried[j] = tau[j]
    if context[SHARED] == 0:
        joint_torques(n, geometry, described, motion, carried, kept)


@njit(cache=True)
def row(context: Any, x: Any, u: Any, p: Any, bus: Any) -> None:
    """All quantities of one row; motion and efforts of the black boxes are on the bus already."""
    n, nf = context[N], context[NF]
    standstill = reals(context[REALS])
    carried = np.empty(n)
    _loads(context, p, bus, carried)
    for j in range(n):
        at, q = HEAD + AXIS * j, QUANTITIES * j
        bus[q + EFFORT] = bus[q + LOAD]
    for f in range(nf):
        at, b = HEAD + AXIS * n + RUB * f, QUANTITIES * n + RUBS * f
        j = context[at + OWN]
        q = QUANTITIES * j
        v, t, rest = bus[q + SPEED], warmth(context, at, u, x), standstill[AGILITY + n + f]
        drag = rub(context, at, p, (bus[q + POSITION], v), carried[j], t, rest)
        bus[b + RUB_FORCE], bus[b + HEAT], bus[b + TEMPERATURE] = drag, drag * v, t
        bus[q + EFFORT] += drag
    for k in range(context[NB]):
        bus[QUANTITIES * box_axis(context, k) + EFFORT] += bus[QUANTITIES * n + RUBS * nf + k]
    for j in range(n):
        at, q = HEAD + AXIS * j, QUANTITIES * j
        spring = context[at + STIFF]
        bus[q + DEFLECTION] = bus[q + LOAD] / p[spring] if spring >= 0 else 0.0
        bus[q + EFFORT] += reflected(context, at, p) * bus[q + ACCELERATION]
        motor_side(context, at, p, bus[q + SPEED], bus[q : q + QUANTITIES])


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row."""  # pragma: compiled
    bus = np.zeros(bus_size(context))
    _motion(context, u, bus)
    if context[NB] > 0:
        there, given, after = address(x), address(p), address(ahead)
        if run_boxes(context, there, u, dt, given, after, bus) != 0:
            return 1
    row(context, x, u, p, bus)
    heated(context, x, dt, p, bus, ahead)
    show(context, bus, y)
    return 0


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> int:
    """Temperatures and black boxes run on: nothing to adopt."""  # pragma: compiled
    return 0
