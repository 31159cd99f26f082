"""The forward reading's equations, compiled: derivatives of all states of an assembly.

Rigid axis:    (m + ratio²·J)·v̇ = effort of the motor − friction − black boxes      (alone)
               (M(q) + diag(ratio²·J))·v̇ = efforts − bodies(q, v, 0)                 (an arm)
Elastic axis:  ratio²·J·v̇m = effort of the motor − friction inside − spring
               spring = stiffness·(qm − q) + damping·(vm − v), which drives the joint

The motor's side is counted at the joint (divided by the ratio). Where friction is a sign, an axis
at rest stays there while no more pulls at it than its friction holds, exactly as in
`evertwin.machines.drive`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from evertwin.machines.arm.mass import KEPT, mass_matrix
from evertwin.machines.arm.memory import reals
from evertwin.machines.arm.rnea import BODY, joint_torques
from evertwin.machines.assembly.boxes import box_axis
from evertwin.machines.assembly.command import drive, set_points
from evertwin.machines.assembly.context import (
    ARM,
    AXIS,
    CARRIED,
    DAMP,
    DRY,
    GEOMETRY,
    HEAD,
    INERTIAS,
    INSIDE,
    JOINT,
    KP,
    MASS,
    NB,
    NF,
    OWN,
    RUB,
    SHARES,
    STIFF,
    X_Q,
    X_QM,
    X_V,
    X_VM,
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
    reflected,
    rub,
    warmth,
)

_TINY = 1e-300
ROUNDS, SETTLED = 20, 1e-9
"""Most turns between load and friction, and the change [Nm] at which they end."""


@njit(cache=True)
def _drag(context: Any, j: int, inside: int, x: Any, u: Any, p: Any, v: float) -> float:
    """Friction of axis ``j`` on one side of its spring, without a standstill."""
    total, axis = 0.0, HEAD + AXIS * j
    q = x[context[axis + X_QM]] if inside == 1 else x[context[axis + X_Q]]
    for f in range(context[NF]):
        at = HEAD + AXIS * context[N] + RUB * f
        if context[at + OWN] == j and context[at + INSIDE] == inside:
            total += rub(context, at, p, (q, v), 0.0, warmth(context, at, u, x), 0.0)
    return float(total)


@njit(cache=True)
def _net(context: Any, j: int, inside: int, x: Any, u: Any, p: Any, v: float, pull: float) -> float:
    """Pull less friction; zero for what is at rest and held by dry friction."""
    if v == 0.0 and context[DRY] == 1:
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
    n = context[N]
    geometry = reals(context[GEOMETRY])
    motion, body, kept = np.zeros(3 * n), np.empty(BODY * n), np.empty(KEPT * n)
    bias, mass = np.empty(n), np.empty((n, n))
    bodies(context, p, body)
    for j in range(n):
        at = HEAD + AXIS * j
        motion[j], motion[n + j] = x[context[at + X_Q]], x[context[at + X_V]]
    joint_torques(n, geometry, body, motion, bias, kept)
    mass_matrix(n, geometry, body, motion, mass, kept)
    for j in range(n):
        at = HEAD + AXIS * j
        if context[at + STIFF] < 0:
            mass[j, j] += reflected(context, at, p)
        net[j] -= bias[j]
    before = net.copy()
    _factor(n, mass)
    _solve(n, mass, net)
    if _shares(context):
        _share(context, x, u, p, (mass, before, motion, kept), net, carried)
    for j in range(n):
        at = HEAD + AXIS * j
        rotor = reflected(context, at, p) if context[at + STIFF] < 0 else 0.0
        bus[QUANTITIES * j + LOAD] = before[j] + bias[j] - rotor * net[j]


@njit(cache=True)
def _shares(context: Any) -> bool:
    """Does a friction take a share of the load?"""
    found = False
    for f in range(context[NF]):
        found |= context[HEAD + AXIS * context[N] + RUB * f + SHARES] == 1
    return found


@njit(cache=True)
def _share(context: Any, x: Any, u: Any, p: Any, known: Any, net: Any, carried: Any) -> None:
    """Friction by the share of the load, which depends on the accelerations that it changes.

    ``known``: factor of the mass matrix, net efforts without the share (then with it), motion,
    working memory. The share is small, so that taking turns closes in fast.
    """
    mass, before, motion, kept = known
    n = context[N]
    taken, now = np.zeros(n), np.empty(n)
    for _ in range(ROUNDS):
        for j in range(n):
            motion[2 * n + j] = net[j]
            now[j] = 0.0
        given = reals(context[INERTIAS])
        joint_torques(n, reals(context[GEOMETRY]), given, motion, carried, kept)
        for f in range(context[NF]):
            at = HEAD + AXIS * n + RUB * f
            j = context[at + OWN]
            if context[at + SHARES] == 1:
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
def _alone(context: Any, at: int, p: Any) -> float:
    """Mass that an axis without an arm accelerates."""
    total = p[context[at + MASS]]
    if context[at + CARRIED] >= 0:
        total += p[context[at + CARRIED]]
    return float(total)


@njit(cache=True)
def slopes(context: Any, x: Any, u: Any, clock: float, p: Any, dx: Any, bus: Any) -> None:
    """Derivatives ``dx`` of positions, speeds, integrals and currents; quantities onto the bus.

    Efforts of black boxes are on the bus already.
    """
    # longer than the budget: one pass over the axes, in the order in which cause leads to effect.
    n, nf = context[N], context[NF]
    net, seen, wanted = np.empty(n), np.empty(3), np.zeros(2)
    place, speed, carried = np.zeros(n), np.zeros(n), np.zeros(n)
    for j in range(n):
        at, first = HEAD + AXIS * j, QUANTITIES * j
        q = bus[first : first + QUANTITIES]
        elastic = context[at + STIFF] >= 0
        q[POSITION], q[SPEED] = x[context[at + X_Q]], x[context[at + X_V]]
        qm = x[context[at + X_QM]] if elastic else q[POSITION]
        vm = x[context[at + X_VM]] if elastic else q[SPEED]
        at_joint = context[at + JOINT] == 1
        seen[0] = q[POSITION] if at_joint else qm
        seen[1] = q[SPEED] if at_joint else vm
        seen[2] = vm
        if context[at + KP] >= 0:
            set_points(context, clock, u, place, speed, at, j)
            wanted[0], wanted[1] = place[j], speed[j]
        drive(context, at, p, u, seen, wanted, x, dx, q)
        pull = q[EFFORT]
        if elastic:
            q[DEFLECTION] = qm - q[POSITION]
            spring = p[context[at + STIFF]] * q[DEFLECTION] + p[context[at + DAMP]] * (
                vm - q[SPEED]
            )
            rotor = reflected(context, at, p)
            dx[context[at + X_QM]] = vm
            dx[context[at + X_VM]] = _net(context, j, 1, x, u, p, vm, pull - spring) / rotor
            pull = spring
        for k in range(context[NB]):
            if box_axis(context, k) == j:
                pull -= bus[QUANTITIES * n + RUBS * nf + k]
        net[j] = _net(context, j, 0, x, u, p, q[SPEED], pull)
        dx[context[at + X_Q]] = q[SPEED]
    if context[ARM] == 1:
        _arm(context, x, u, p, net, bus, carried)
    for j in range(n):
        at, first = HEAD + AXIS * j, QUANTITIES * j
        if context[ARM] == 0:
            mass = _alone(context, at, p)
            rotor = reflected(context, at, p) if context[at + STIFF] < 0 else 0.0
            net[j] /= mass + rotor
            bus[first + LOAD] = mass * net[j]
        dx[context[at + X_V]] = net[j]
        bus[first + ACCELERATION] = net[j]
    for f in range(nf):
        at, b = HEAD + AXIS * n + RUB * f, QUANTITIES * n + RUBS * f
        own, inside = HEAD + AXIS * context[at + OWN], context[at + INSIDE] == 1
        v = x[context[own + X_VM]] if inside else x[context[own + X_V]]
        q = x[context[own + X_QM]] if inside else x[context[own + X_Q]]
        t = warmth(context, at, u, x)
        drag = rub(context, at, p, (q, v), carried[context[at + OWN]], t, 0.0)
        bus[b + RUB_FORCE], bus[b + HEAT], bus[b + TEMPERATURE] = drag, drag * v, t
