"""The forward reading's equations, compiled: derivatives of all states of an assembly.

Rigid axis:    (m + ratio²·J)·v̇ = effort of the motor − friction − black boxes      (alone)
               (M(q) + diag(ratio²·J))·v̇ = efforts − bodies(q, v, 0)                 (an arm)
Elastic axis:  ratio²·J·v̇m = effort of the motor − friction inside − spring
               spring = stiffness·(qm − q) + damping·(vm − v), which drives the joint

The motor's side is counted at the joint (divided by the ratio). Where friction is a sign, an axis
at rest stays there while no more pulls at it than its friction holds, exactly as in
`evertwin.machines.drive`.

The motor's effort follows from the command through path, controller and winding:

v_set = clamp(kp·(q_set − q) + feedforward·q̇_set)
demand = clamp(kv·(v_set − v) + ki·∫(v_set − v))
demand is a voltage:  L·di/dt = U − R·i − k·ω     (L = 0: at once)
demand is a current:  i = demand                  effort at the joint = ratio·k·i
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import reals
from evertwin.machines.arm.rnea import BODY, KEPT, joint_torques
from evertwin.machines.assembly import context as slot
from evertwin.machines.assembly import shared
from evertwin.machines.assembly.boxes import box_axis
from evertwin.machines.assembly.shared import alone, bodies, losses, ratio, reflected, rub, warmth


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


_TINY = 1e-300
ROUNDS, SETTLED = 20, 1e-9
"""Most turns between load and friction, and the change [Nm] at which they end."""


@njit(cache=True)
def _drag(context: Any, j: int, inside: int, x: Any, u: Any, p: Any, v: float) -> float:
    """Friction of axis ``j`` on one side of its spring, without a standstill."""
    total, axis = 0.0, slot.HEAD + slot.AXIS * j
    q = x[context[axis + slot.X_QM]] if inside == 1 else x[context[axis + slot.X_Q]]
    for f in range(context[slot.NF]):
        at = slot.HEAD + slot.AXIS * context[slot.N] + slot.RUB * f
        if context[at + slot.OWN] == j and context[at + slot.INSIDE] == inside:
            total += rub(context, at, p, (q, v), 0.0, warmth(context, at, u, x), 0.0)
    return float(total)


@njit(cache=True)
def _net(context: Any, j: int, inside: int, x: Any, u: Any, p: Any, v: float, pull: float) -> float:
    """Pull less friction; zero for what is at rest and held by dry friction."""
    if v == 0.0 and context[slot.DRY] == 1:
        forwards = pull - _drag(context, j, inside, x, u, p, _TINY)
        if forwards > 0.0:
            return float(forwards)
        backwards = pull - _drag(context, j, inside, x, u, p, -_TINY)
        return float(min(backwards, 0.0))
    return float(pull - _drag(context, j, inside, x, u, p, v))


@njit(cache=True)
def _factor(n: int, a: Any) -> None:
    """The Cholesky factor of a symmetric positive ``a`` (n, n), into its lower triangle."""
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = math.sqrt(total) if i == j else total / a[j, j]


@njit(cache=True)
def _solve(n: int, a: Any, b: Any) -> None:
    """``a x = b`` by the factor of ``a``, in place: ``b`` becomes x."""
    for i in range(n):
        for k in range(i):
            b[i] -= a[i, k] * b[k]
        b[i] /= a[i, i]
    for back in range(n):
        i = n - 1 - back
        for k in range(i + 1, n):
            b[i] -= a[k, i] * b[k]
        b[i] /= a[i, i]


@njit(cache=True)
def _arm(context: Any, x: Any, u: Any, p: Any, net: Any, bus: Any, carried: Any) -> None:
    """Accelerations of an arm's joints from the net efforts, into ``net``; loads onto the bus.

    ``carried``: the loads that friction takes its share of, filled where a friction has one.
    """
    n = context[slot.N]
    geometry = reals(context[slot.GEOMETRY])
    motion, body, kept = np.zeros(3 * n), np.empty(BODY * n), np.empty(KEPT * n)
    bias, mass = np.empty(n), np.empty((n, n))
    bodies(context, p, body)
    for j in range(n):
        at = slot.HEAD + slot.AXIS * j
        motion[j], motion[n + j] = x[context[at + slot.X_Q]], x[context[at + slot.X_V]]
    joint_torques(n, geometry, body, motion, bias, kept)
    for j in range(n):  # a column of the mass matrix: what a unit acceleration adds
        motion[2 * n + j] = 1.0
        joint_torques(n, geometry, body, motion, mass[j], kept)
        motion[2 * n + j] = 0.0
        for i in range(n):
            mass[j, i] -= bias[i]
        at = slot.HEAD + slot.AXIS * j
        if context[at + slot.STIFF] < 0:
            mass[j, j] += reflected(context, at, p)
        net[j] -= bias[j]
    before = net.copy()
    _factor(n, mass)
    _solve(n, mass, net)
    if _shares(context):
        _share(context, x, u, p, (mass, before, motion, kept), net, carried)
    for j in range(n):
        at = slot.HEAD + slot.AXIS * j
        rotor = reflected(context, at, p) if context[at + slot.STIFF] < 0 else 0.0
        bus[shared.QUANTITIES * j + shared.LOAD] = before[j] + bias[j] - rotor * net[j]


@njit(cache=True)
def _shares(context: Any) -> bool:
    """Does a friction take a share of the load?"""
    found = False
    for f in range(context[slot.NF]):
        found |= context[slot.HEAD + slot.AXIS * context[slot.N] + slot.RUB * f + slot.SHARES] == 1
    return found


@njit(cache=True)
def _share(context: Any, x: Any, u: Any, p: Any, known: Any, net: Any, carried: Any) -> None:
    """Friction by the share of the load, which depends on the accelerations that it changes.

    ``known``: factor of the mass matrix, net efforts without the share (then with it), motion,
    working memory. The share is small, so that taking turns closes in fast.
    """
    mass, before, motion, kept = known
    n = context[slot.N]
    taken, now = np.zeros(n), np.empty(n)
    for _ in range(ROUNDS):
        for j in range(n):
            motion[2 * n + j] = net[j]
            now[j] = 0.0
        given = reals(context[slot.INERTIAS])
        joint_torques(n, reals(context[slot.GEOMETRY]), given, motion, carried, kept)
        for f in range(context[slot.NF]):
            at = slot.HEAD + slot.AXIS * n + slot.RUB * f
            j = context[at + slot.OWN]
            if context[at + slot.SHARES] == 1:
                here, warm = (motion[j], motion[n + j]), warmth(context, at, u, x)
                whole = rub(context, at, p, here, carried[j], warm, 0.0)
                now[j] += whole - rub(context, at, p, here, 0.0, warm, 0.0)
        moved = 0.0
        for j in range(n):
            moved = max(moved, abs(now[j] - taken[j]))
            before[j] -= now[j] - taken[j]
            taken[j], net[j] = now[j], before[j]
        _solve(n, mass, net)
        if moved < SETTLED:
            return


@njit(cache=True)
def slopes(context: Any, x: Any, u: Any, clock: float, p: Any, dx: Any, bus: Any) -> None:
    """Derivatives ``dx`` of positions, speeds, integrals and currents; quantities onto the bus.

    Efforts of black boxes are on the bus already.
    """
    # longer than the budget: one pass over the axes, in the order in which cause leads to effect.
    n, nf = context[slot.N], context[slot.NF]
    net, seen, wanted = np.empty(n), np.empty(3), np.zeros(2)
    place, speed, carried = np.zeros(n), np.zeros(n), np.zeros(n)
    for j in range(n):
        at, first = slot.HEAD + slot.AXIS * j, shared.QUANTITIES * j
        q = bus[first : first + shared.QUANTITIES]
        elastic = context[at + slot.STIFF] >= 0
        q[shared.POSITION], q[shared.SPEED] = x[context[at + slot.X_Q]], x[context[at + slot.X_V]]
        qm = x[context[at + slot.X_QM]] if elastic else q[shared.POSITION]
        vm = x[context[at + slot.X_VM]] if elastic else q[shared.SPEED]
        at_joint = context[at + slot.JOINT] == 1
        seen[0] = q[shared.POSITION] if at_joint else qm
        seen[1] = q[shared.SPEED] if at_joint else vm
        seen[2] = vm
        if context[at + slot.KP] >= 0:
            set_points(context, clock, u, place, speed, at, j)
            wanted[0], wanted[1] = place[j], speed[j]
        drive(context, at, p, u, seen, wanted, x, dx, q)
        pull = q[shared.EFFORT]
        if elastic:
            q[shared.DEFLECTION] = qm - q[shared.POSITION]
            spring = p[context[at + slot.STIFF]] * q[shared.DEFLECTION] + p[
                context[at + slot.DAMP]
            ] * (vm - q[shared.SPEED])
            rotor = reflected(context, at, p)
            dx[context[at + slot.X_QM]] = vm
            dx[context[at + slot.X_VM]] = _net(context, j, 1, x, u, p, vm, pull - spring) / rotor
            pull = spring
        for k in range(context[slot.NB]):
            if box_axis(context, k) == j:
                pull -= bus[shared.QUANTITIES * n + shared.RUBS * nf + k]
        net[j] = _net(context, j, 0, x, u, p, q[shared.SPEED], pull)
        dx[context[at + slot.X_Q]] = q[shared.SPEED]
    if context[slot.ARM] == 1:
        _arm(context, x, u, p, net, bus, carried)
    for j in range(n):
        at, first = slot.HEAD + slot.AXIS * j, shared.QUANTITIES * j
        if context[slot.ARM] == 0:
            mass = alone(context, at, p)
            rotor = reflected(context, at, p) if context[at + slot.STIFF] < 0 else 0.0
            net[j] /= mass + rotor
            bus[first + shared.LOAD] = mass * net[j]
        dx[context[at + slot.X_V]] = net[j]
        bus[first + shared.ACCELERATION] = net[j]
    for f in range(nf):
        at, b = slot.HEAD + slot.AXIS * n + slot.RUB * f, shared.QUANTITIES * n + shared.RUBS * f
        own, inside = slot.HEAD + slot.AXIS * context[at + slot.OWN], context[at + slot.INSIDE] == 1
        v = x[context[own + slot.X_VM]] if inside else x[context[own + slot.X_V]]
        q = x[context[own + slot.X_QM]] if inside else x[context[own + slot.X_Q]]
        t = warmth(context, at, u, x)
        drag = rub(context, at, p, (q, v), carried[context[at + slot.OWN]], t, 0.0)
        bus[b + shared.RUB_FORCE], bus[b + shared.HEAT], bus[b + shared.TEMPERATURE] = (
            drag,
            drag * v,
            t,
        )
