"""The forward reading, compiled: one row in fixed sub-steps.

How many parts a row is cut into follows from its interval, the parameters and the temperatures at
its beginning alone, so where rows are cut changes no bit: as many as the fastest rate of the
assembly asks for (friction, spring, winding, controller), and none longer than the largest step
allowed. Smooth assemblies go by Runge-Kutta of fourth order, those with a sign by Euler with an
exact standstill.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.compiled.memory import reals
from evertwin.machines.assembly import context as slot
from evertwin.machines.assembly import shared
from evertwin.machines.assembly.boxes import address, run_boxes
from evertwin.machines.assembly.shared import (
    alone,
    bus_size,
    heated,
    ratio,
    reflected,
    show,
    warmth,
)
from evertwin.machines.assembly.slopes import slopes
from evertwin.machines.friction.kernel import steepness

PARTS = 4000
"""Most parts of one row; a row whose interval needs more is an error."""


@njit(cache=True)
def _steep(context: Any, j: int, inside: int, x: Any, u: Any, p: Any) -> float:
    """Largest slope of the friction on one side of axis ``j``; no load is known yet."""
    total = 0.0
    for f in range(context[slot.NF]):
        at = slot.HEAD + slot.AXIS * context[slot.N] + slot.RUB * f
        if context[at + slot.OWN] == j and context[at + slot.INSIDE] == inside:
            total += steepness(context, context[at + slot.LAW], p, 0.0, warmth(context, at, u, x))
    return float(total)


@njit(cache=True)
def _rate(context: Any, j: int, x: Any, u: Any, p: Any) -> float:
    """The fastest rate of axis ``j`` [1/s]; negative: a spring without a rotor."""
    at, rotor = slot.HEAD + slot.AXIS * j, reflected(context, slot.HEAD + slot.AXIS * j, p)
    elastic = context[at + slot.STIFF] >= 0
    if context[slot.ARM] == 1:
        inertia = 1.0 / reals(context[slot.REALS])[slot.AGILITY + j]
        # the least inertia over all postures; what the rotor adds, it adds in each of them
        body = inertia if elastic else inertia + rotor
    else:
        body = alone(context, at, p) + (0.0 if elastic else rotor)
    rate = _steep(context, j, 0, x, u, p) / body
    driven = body
    if elastic:
        if not rotor > 0.0:
            return -1.0
        driven = rotor
        both = 1.0 / rotor + 1.0 / body
        rate += _steep(context, j, 1, x, u, p) / rotor
        rate += p[context[at + slot.DAMP]] * both + math.sqrt(p[context[at + slot.STIFF]] * both)
    gain = 1.0
    if context[at + slot.MODE] != slot.FORCE:
        turns, k = ratio(context, at, p), p[context[at + slot.K]]
        gain = turns * k if context[at + slot.MODE] == slot.CURRENT else turns
        if context[at + slot.MODE] == slot.VOLTAGE:
            gain = turns * k / p[context[at + slot.R]]
            rate += gain * turns * k / driven
            if context[at + slot.X_L] >= 0:
                rate += p[context[at + slot.R]] / p[context[at + slot.L]]
    if context[at + slot.KP] >= 0:
        rate += gain * p[context[at + slot.KV]] / driven + p[context[at + slot.KP]]
        rate += math.sqrt(gain * p[context[at + slot.KI]] / driven)
    return float(rate)


@njit(cache=True)
def parts_of(context: Any, x: Any, u: Any, dt: float, p: Any) -> int:
    """Parts of a row; 0: too many, or something without a mass."""
    fastest = 0.0
    for j in range(context[slot.N]):
        rate = _rate(context, j, x, u, p)
        if not rate >= 0.0:
            return 0
        fastest = max(fastest, rate)
    # Euler: a tenth of the time constant; Runge-Kutta: half of it
    parts = math.ceil((10.0 if context[slot.DRY] == 1 else 2.0) * dt * fastest)
    parts = max(parts, math.ceil(dt / reals(context[slot.REALS])[slot.STEP_MAX] - 1e-6))
    if not 0.0 <= parts <= PARTS:
        return 0
    return max(1, int(parts))


@njit(cache=True)
def _euler(context: Any, x: Any, h: float, dx: Any, old: Any) -> None:
    """Speeds by Euler with an exact standstill, positions by the trapezoid, the rest by Euler."""
    for i in range(context[slot.NX]):
        old[i] = x[i]
        x[i] += h * dx[i]
    for j in range(context[slot.N]):
        at = slot.HEAD + slot.AXIS * j
        for side in range(2):
            place = context[at + (slot.X_Q if side == 0 else slot.X_QM)]
            speed = context[at + (slot.X_V if side == 0 else slot.X_VM)]
            if place < 0:
                continue
            # dx of the position is the speed before the step
            before, after = dx[place], dx[place] + h * dx[speed]
            if before * after < 0.0:
                after = 0.0
            x[place] = old[place] + h * 0.5 * (before + after)
            x[speed] = after


@njit(cache=True)
def _runge_kutta(
    context: Any, x: Any, u: Any, clock: Any, h: float, p: Any, work: Any, bus: Any
) -> None:
    """One step of fourth order; ``clock``: time of path or row, its pace; ``work``: (3, nx)."""
    nx = context[slot.NX]
    at, mean, dx = work[0], work[1], work[2]
    for i in range(nx):
        at[i], mean[i] = x[i], 0.0
    for stage in range(4):
        reach = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        slopes(context, at, u, clock[0] + reach * h * clock[1], p, dx, bus)
        share = 1.0 / 6.0 if stage == 0 or stage == 3 else 1.0 / 3.0
        ahead = 1.0 if stage == 2 else 0.5
        for i in range(nx):
            mean[i] += share * dx[i]
            at[i] = x[i] + ahead * h * dx[i]
    for i in range(nx):
        x[i] += h * mean[i]


@njit(cache=True)
def _slow(context: Any, x: Any, h: float, pace: float, p: Any, bus: Any) -> None:
    """Temperatures and the path's clock, after a part."""
    heated(context, x, h, p, bus, x)
    if context[slot.PATH_X] >= 0:
        x[context[slot.PATH_X]] += h * pace


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row."""  # pragma: compiled
    parts, nx, n = parts_of(context, x, u, dt, p), context[slot.NX], context[slot.N]
    if parts == 0:
        return 1
    h = dt / parts
    now, boxed, work = np.empty(nx), np.empty(nx), np.zeros((3, nx))
    bus, clock = np.zeros(bus_size(context)), np.zeros(2)
    for i in range(nx):
        now[i] = x[i]
    clock[1] = max(u[context[slot.OVERRIDE]], 0.0) if context[slot.OVERRIDE] >= 0 else 1.0
    for part in range(parts):
        clock[0] = now[context[slot.PATH_X]] if context[slot.PATH_X] >= 0 else (part - parts) * h
        if context[slot.NB] > 0:
            for j in range(n):
                bus[shared.QUANTITIES * j + shared.POSITION] = now[
                    context[slot.HEAD + slot.AXIS * j + slot.X_Q]
                ]
                bus[shared.QUANTITIES * j + shared.SPEED] = now[
                    context[slot.HEAD + slot.AXIS * j + slot.X_V]
                ]
            for i in range(nx):
                boxed[i] = now[i]
            given = address(p)
            at, after = now.ctypes.data, boxed.ctypes.data
            failed = int(run_boxes(context, at, u, h, given, after, bus))
            if failed != 0:
                return failed
        if context[slot.DRY] == 1:
            slopes(context, now, u, clock[0], p, work[2], bus)
            _euler(context, now, h, work[2], work[0])
        else:
            _runge_kutta(context, now, u, clock, h, p, work, bus)
        _slow(context, now, h, clock[1], p, bus)
        for i in range(context[slot.BOXED], nx):
            now[i] = boxed[i]
    clock[0] = now[context[slot.PATH_X]] if context[slot.PATH_X] >= 0 else 0.0
    slopes(context, now, u, clock[0], p, work[2], bus)
    for i in range(nx):
        ahead[i] = now[i]
    show(context, bus, y)
    return 0


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> int:
    """Positions and speeds adopt their measurements; a spring keeps its deflection."""
    # pragma: compiled
    n = context[slot.N]
    for j in range(n):
        at = slot.HEAD + slot.AXIS * j
        for order in range(2):
            measured = y[order * n + j]
            own = context[at + (slot.X_Q if order == 0 else slot.X_V)]
            motor = context[at + (slot.X_QM if order == 0 else slot.X_VM)]
            if math.isnan(measured):
                continue
            if motor >= 0:
                x[motor] += measured - x[own]
            x[own] = measured
    return 0
