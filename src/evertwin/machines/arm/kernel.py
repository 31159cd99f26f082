"""The arm's compiled step: motion in, joint torques or motor currents out.

Per joint, torque = rigid bodies + rotor inertia · q̈ + friction; divided by the motor constant where
the output is a current. Integers in the context say where everything lies; three addresses in it
lead to the real constants (geometry, inertias, the rest).

Where motors and joints are coupled, q = C·θ and the motors feel Cᵀ times the joints' torques; rotor
inertia and friction then belong to the motors and follow their motion θ.
"""

from __future__ import annotations

import math
from typing import Any

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.compiled.memory import reals, room, scratch
from evertwin.machines.arm.rnea import BODY, KEPT, joint_torques
from evertwin.machines.friction.kernel import force, switch, width_of

N, GEOMETRY, INERTIAS, OTHERS, CHOSEN, PAYLOAD, DELAY, MOTOR, SHARED, COUPLED, SHAFTS = range(11)
HEAD = 11
"""Places of single integers; then n drives of `DRIVE`, then ``CHOSEN`` pairs (number, index in p),
then ``SHAFTS`` pairs (axis, index in p of its three numbers), then the friction laws' records.

``PAYLOAD``, ``DELAY``, ``MOTOR``: index in ``p`` or −1. ``SHARED``: 1 when the friction's load is
the same torque as the rigid bodies', so that it is computed once. ``COUPLED``: 0, or 1 where the
motion comes from the joints, 2 where it comes from the motors. ``OTHERS``: standstill of each
joint, the payload's map (100), C and its inverse (n²) where coupled, the shafts' rows (n).
"""
INERTIA, LAW = range(2)
DRIVE = 2
"""Integers of a drive: place of the rotor inertia in ``p`` or −1, where its law's record begins."""


@njit(cache=True)
def moved_motion(n: int, delay: float, u: Any, out: Any) -> None:
    """The motion ``delay`` earlier, by its own velocity and acceleration."""
    for j in range(n):
        out[2 * n + j] = u[2 * n + j]
        out[n + j] = u[n + j] - delay * u[2 * n + j]
        out[j] = u[j] - delay * (u[n + j] - 0.5 * delay * u[2 * n + j])


@njit(cache=True)
def bodies(context: Any, inertias: Any, others: Any, p: Any, out: Any) -> None:
    """The inertias in force: given ones, then chosen ones from ``p``, then the payload's."""
    n = context[N]
    for k in range(BODY * n):
        out[k] = inertias[k]
    at = HEAD + DRIVE * n
    for k in range(context[CHOSEN]):
        out[context[at + 2 * k]] = p[context[at + 2 * k + 1]]
    if context[PAYLOAD] >= 0:
        carry(n, others, n, p, context[PAYLOAD], out)


@njit(cache=True)
def carry(n: int, numbers: Any, at: int, p: Any, first: int, out: Any) -> None:
    """Adds the payload ``p[first:]`` to the last link; its map stands at ``numbers[at:]``."""
    for i in range(BODY):
        total = 0.0
        for j in range(BODY):
            total += numbers[at + BODY * i + j] * p[first + j]
        out[BODY * (n - 1) + i] += total


@njit(cache=True)
def turned(n: int, matrix: Any, at: int, u: Any, out: Any) -> None:
    """Position, velocity and acceleration times the matrix at ``matrix[at:]``, row by row."""
    for order in range(3):
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += matrix[at + n * i + j] * u[order * n + j]
            out[order * n + i] = total


@njit(cache=True)
def felt(n: int, matrix: Any, at: int, tau: Any, kept: Any) -> None:
    """Joint torques become the motors': the transposed matrix times ``tau``, in place."""
    for i in range(n):
        kept[i] = tau[i]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += matrix[at + n * j + i] * kept[j]
        tau[i] = total


@njit(cache=True)
def shafts(context: Any, others: Any, p: Any, motion: Any, y: Any) -> None:
    """Adds inertia and friction of shafts that turn with several axes."""
    n = context[N]
    at = n + BODY * BODY + (2 * n * n if context[COUPLED] > 0 else 0)
    own = HEAD + DRIVE * n + 2 * context[CHOSEN]
    for k in range(context[SHAFTS]):
        axis, place = context[own + 2 * k], context[own + 2 * k + 1]
        v, a = 0.0, 0.0
        for j in range(n):
            v += others[at + n * k + j] * motion[n + j]
            a += others[at + n * k + j] * motion[2 * n + j]
        s = switch(v, width_of(context, context[HEAD + DRIVE * axis + LAW], p), others[axis])
        total = p[place] * a + p[place + 1] * v + p[place + 2] * s
        for j in range(n):
            y[j] += others[at + n * k + j] * total


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row: u = q, q̇, q̈."""  # pragma: compiled
    n = context[N]
    geometry, inertias = reals(context[GEOMETRY]), reals(context[INERTIAS])
    others = reals(context[OTHERS])
    motion, body, load, joint = scratch(), scratch(), scratch(), scratch()
    kept = room(KEPT * n)
    at, coupled = n + BODY * BODY, context[COUPLED]
    moved_motion(n, p[context[DELAY]] if context[DELAY] >= 0 else 0.0, u, motion)
    for k in range(3 * n):
        joint[k] = motion[k]
    if coupled == 2:
        turned(n, others, at, motion, joint)
    elif coupled == 1:
        turned(n, others, at + n * n, joint, motion)
    bodies(context, inertias, others, p, body)
    joint_torques(n, geometry, body, joint, y, kept)
    if context[SHARED] == 0:
        joint_torques(n, geometry, inertias, joint, load, kept)
    if coupled > 0:
        felt(n, others, at, y, kept)
        felt(n, others, at, load, kept)
    for j in range(n):
        drive = HEAD + DRIVE * j
        carried = y[j] if context[SHARED] == 1 else load[j]
        v, q = motion[n + j], motion[j]
        y[j] += force(context, context[drive + LAW], p, v, carried, math.nan, q, others[j])
        if context[drive + INERTIA] >= 0:
            y[j] += p[context[drive + INERTIA]] * motion[2 * n + j]
    shafts(context, others, p, motion, y)
    if context[MOTOR] >= 0:
        for j in range(n):
            y[j] /= p[context[MOTOR] + j]
    return 0


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> int:
    """A static map has no state to adopt anything into."""  # pragma: compiled
    return 0
