"""The inverse reading, compiled: motion in, the effort that it needs out, and what lies between.

    effort = bodies(q, q̇, q̈) + ratio²·J·q̈ + friction + black boxes
    motor torque = effort / ratio,   i = torque / k,   U = R·i + k·ratio·q̇

A spring in a gearbox is taken as quasi-static here: the motion that is given is the motor's, the
deflection is what the transmitted load bends it by.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.compiled.memory import reals
from evertwin.machines.arm.rnea import BODY, KEPT, joint_torques
from evertwin.machines.assembly import context as slot
from evertwin.machines.assembly import shared
from evertwin.machines.assembly.boxes import address, box_axis, run_boxes
from evertwin.machines.assembly.shared import (
    alone,
    bodies,
    bus_size,
    heated,
    motor_side,
    reflected,
    rub,
    show,
    warmth,
)


@njit(cache=True)
def _motion(context: Any, u: Any, bus: Any) -> None:
    for j in range(context[slot.N]):
        at, q = slot.HEAD + slot.AXIS * j, shared.QUANTITIES * j
        bus[q + shared.POSITION] = u[context[at + slot.U_Q]] if context[at + slot.U_Q] >= 0 else 0.0
        bus[q + shared.SPEED] = u[context[at + slot.U_V]]
        bus[q + shared.ACCELERATION] = u[context[at + slot.U_A]]


@njit(cache=True)
def _loads(context: Any, p: Any, bus: Any, carried: Any) -> None:
    """What the structure needs, and the described load that friction takes its share of."""
    n = context[slot.N]
    if context[slot.ARM] == 0:
        for j in range(n):
            at, q = slot.HEAD + slot.AXIS * j, shared.QUANTITIES * j
            bus[q + shared.LOAD] = alone(context, at, p) * bus[q + shared.ACCELERATION]
            carried[j] = 0.0
        return
    geometry, described = reals(context[slot.GEOMETRY]), reals(context[slot.INERTIAS])
    motion, body, kept, tau = np.empty(3 * n), np.empty(BODY * n), np.empty(KEPT * n), np.empty(n)
    for j in range(n):
        motion[j] = bus[shared.QUANTITIES * j + shared.POSITION]
        motion[n + j] = bus[shared.QUANTITIES * j + shared.SPEED]
        motion[2 * n + j] = bus[shared.QUANTITIES * j + shared.ACCELERATION]
    bodies(context, p, body)
    joint_torques(n, geometry, body, motion, tau, kept)
    for j in range(n):
        bus[shared.QUANTITIES * j + shared.LOAD] = tau[j]
        carried[j] = tau[j]
    if context[slot.SHARED] == 0:
        joint_torques(n, geometry, described, motion, carried, kept)


@njit(cache=True)
def row(context: Any, x: Any, u: Any, p: Any, bus: Any) -> None:
    """All quantities of one row; motion and efforts of the black boxes are on the bus already."""
    n, nf = context[slot.N], context[slot.NF]
    standstill = reals(context[slot.REALS])
    carried = np.empty(n)
    _loads(context, p, bus, carried)
    for j in range(n):
        at, q = slot.HEAD + slot.AXIS * j, shared.QUANTITIES * j
        bus[q + shared.EFFORT] = bus[q + shared.LOAD]
    for f in range(nf):
        at, b = slot.HEAD + slot.AXIS * n + slot.RUB * f, shared.QUANTITIES * n + shared.RUBS * f
        j = context[at + slot.OWN]
        q = shared.QUANTITIES * j
        v, t, rest = (
            bus[q + shared.SPEED],
            warmth(context, at, u, x),
            standstill[slot.AGILITY + n + f],
        )
        drag = rub(context, at, p, (bus[q + shared.POSITION], v), carried[j], t, rest)
        bus[b + shared.RUB_FORCE], bus[b + shared.HEAT], bus[b + shared.TEMPERATURE] = (
            drag,
            drag * v,
            t,
        )
        bus[q + shared.EFFORT] += drag
    for k in range(context[slot.NB]):
        bus[shared.QUANTITIES * box_axis(context, k) + shared.EFFORT] += bus[
            shared.QUANTITIES * n + shared.RUBS * nf + k
        ]
    for j in range(n):
        at, q = slot.HEAD + slot.AXIS * j, shared.QUANTITIES * j
        spring = context[at + slot.STIFF]
        bus[q + shared.DEFLECTION] = bus[q + shared.LOAD] / p[spring] if spring >= 0 else 0.0
        bus[q + shared.EFFORT] += reflected(context, at, p) * bus[q + shared.ACCELERATION]
        motor_side(context, at, p, bus[q + shared.SPEED], bus[q : q + shared.QUANTITIES])


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row."""  # pragma: compiled
    bus = np.zeros(bus_size(context))
    _motion(context, u, bus)
    if context[slot.NB] > 0:
        there, given, after = address(x), address(p), address(ahead)
        failed = int(run_boxes(context, there, u, dt, given, after, bus))
        if failed != 0:
            return failed
    row(context, x, u, p, bus)
    heated(context, x, dt, p, bus, ahead)
    show(context, bus, y)
    return 0


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> int:
    """Temperatures and black boxes run on: nothing to adopt."""  # pragma: compiled
    return 0
