"""Where the numbers of a model start from: what the recording says of them, roughly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import scipy

from evertwin.machines.drive import Drive, DriveForce
from evertwin.machines.thermal import POWER, ThermalBox
from evertwin.models import Model
from evertwin.signals import to_si
from evertwin.starter.looks.relations import wraps
from evertwin.starter.looks.seen import Seen
from evertwin.starter.numbers.foretold import buried
from evertwin.starter.numbers.mass_guess import Mass, guess_mass
from evertwin.starter.numbers.oscillator_guess import Oscillator, guess_oscillator
from evertwin.starter.numbers.store_guess import UNKNOWN, Store, guess_store
from evertwin.starter.proposal import ASK, Match
from evertwin.types import Vector

HEATER, QUICK = 0.1, 50.0
"""Of a box: the heater's capacity as a share of the box's, and so many times as fast as the box the
heater takes its heat to it."""
NEARER = 0.5
"""Share of what a store's run is off by up to which one that swings, or is a mass, is taken."""
LOST = 0.5
"""Share of the spread that the run of a store leaves from which on it may be a mass."""
ENOUGH = 500
"""Rows that tell what swings, at least."""
STRETCHES = 60
"""Of an axis: stretches of the recording that its numbers are told from, at least."""
STILL = 0.02
"""Share of its usual fastest speed up to which it does not move."""
Own: TypeAlias = Store | Oscillator | Mass


def own_of(found: Sequence[Match], seen: Sequence[Seen]) -> Own:
    """Of a model of one's own, by what drives and what answers: a store, or a mass on a spring
    where that runs far nearer to the recording; a free mass where a store does not follow it, and
    that runs far nearer over stretches of it."""
    told = _columns(("u", "y"), found, seen)
    if told is None:
        return UNKNOWN
    part = tuple(one[: max(len(one) // 3, ENOUGH)] for one in told)  # it may change later
    (spring, swings), (_, leaks) = guess_oscillator(*part), guess_store(*part)
    if spring is not None and swings < NEARER**2 * leaks:
        return spring
    if leaks > LOST**2 * float(np.nanvar(part[2])):
        mass, share = guess_mass(*part)
        if mass is not None and share < NEARER**2:
            return mass
    return guess_store(*told)[0]


def starts_of(
    model: Model | None, found: Sequence[Match], seen: Sequence[Seen]
) -> Mapping[str, tuple[float, str]]:
    """Of a heated box, and of an axis, with units [SI]; of other models nothing."""
    if model is None or not all(isinstance(one.scale, float) for one in found):
        return {}
    values = dict[str, float]()
    if isinstance(model, ThermalBox):
        if told := _columns(("heater", "box", "room"), found, seen):
            values = _box(model, *told)
    elif isinstance(model, Drive | DriveForce):
        effort = (model.inputs if isinstance(model, Drive) else model.outputs).names[0]
        inertia = model.parameters.names[0]
        if told := _columns(("speed", effort), found, seen):
            values = _axis(inertia, *told)
        elif told := _columns(("position", effort), found, seen):
            t, position, pushed = told
            values = _axis(inertia, t, _speed(t, position), pushed)
    numbers = {one.name: one for one in model.parameters}
    return {
        name: (float(f"{value:.3g}"), numbers[name].unit) for name, value in values.items()
        if name in numbers and numbers[name].low < value < numbers[name].high
    }  # fmt: skip


def _box(
    model: ThermalBox, t: Vector, heater: Vector, box: Vector, room: Vector
) -> dict[str, float]:
    """A store of what it is warmer by than the room. Heater and box can change places: from afar a
    fit ends with a heater that is slower than what it heats."""
    store, _ = guess_store(t, heater, box - room)
    if not (store.gain > 0.0 and store is not UNKNOWN):
        return {}
    capacity = float(model.parameters.values[POWER]) / store.gain
    own = HEATER * capacity
    return {
        "heater_capacity": own, "heater_conductance": own * QUICK * store.leak,
        "box_capacity": capacity - own, "box_conductance": capacity * store.leak,
    }  # fmt: skip


def _axis(inertia: str, t: Vector, speed: Vector, effort: Vector) -> dict[str, float]:
    """What moves it and what rubs: the sums of its effort over stretches so long that its speed
    changes by far more than its noise; sums, because an acceleration is mostly noise."""
    known = np.isfinite(t) & np.isfinite(speed) & np.isfinite(effort)
    t, speed, effort = t[known], speed[known], effort[known]
    size = 1
    while size < len(t) // STRETCHES and buried(speed, size):
        size *= 2
    if len(t) < STRETCHES or buried(speed, size):
        return {}
    still = np.abs(speed) <= STILL * np.quantile(np.abs(speed), 0.95)
    sides = (np.sign(speed), speed, np.ones(len(t)), effort, still.astype(float))
    sums = scipy.integrate.cumulative_trapezoid(np.array(sides), t, initial=0)[:, ::size]
    *columns, right, stood = np.diff(sums, axis=1)
    table = np.column_stack([np.diff(speed[::size]), *columns])[stood == 0.0]
    if len(table) < STRETCHES // 2:
        return {}
    scale = np.linalg.norm(table, axis=0) + 1e-300
    mass, coulomb, viscous, _ = np.linalg.lstsq(table / scale, right[stood == 0.0])[0] / scale
    if min(coulomb, viscous) < 0.0:  # what pushes is no friction: something else is in it
        return {inertia: float(mass)}
    return {inertia: float(mass), "Fc": float(coulomb), "Fv": float(viscous)}


def _speed(t: Vector, position: Vector) -> Vector:
    """How fast it goes where only its place is recorded; an angle may wrap."""
    known = np.isfinite(t) & np.isfinite(position)
    out, where = np.full(len(t), np.nan), position[known]
    if np.count_nonzero(known) > 1:
        out[known] = np.gradient(np.unwrap(where) if wraps(where) else where, t[known])
    return out


def _columns(
    names: Sequence[str], found: Sequence[Match], seen: Sequence[Seen]
) -> tuple[Vector, ...] | None:
    """Time [s] and channels in SI, of one table; None where it does not hold them all."""
    matches: dict[str, Match] = {match.channel: match for match in found if match.column != ASK}
    sources = {matches[name].source for name in names if name in matches}
    if not matches.keys() >= set(names) or len(sources) != 1:
        return None
    (source,) = sources
    values = tuple(_in_si(seen[source], matches[name]) for name in names)
    t = seen[source].clock
    return None if t is None else (t, *values)


def _in_si(seen: Seen, match: Match) -> Vector:
    scale = match.scale if isinstance(match.scale, float) else 1.0  # an open question
    values: Vector = to_si(seen.values(match.column) * scale + match.offset, match.unit)
    return values
