"""The regressor of a static assembly: what each linear parameter is multiplied with.

A column belongs to an axis and to a group: the load of the structure, the rotor, or one component
that rubs. Efforts see all columns of their axis; a virtual sensor sees the group that it shows.

>>> Column(3, "load", ("mass", 0)).key
('mass', 0)
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numba import njit

from evertwin.machines.arm import layout
from evertwin.machines.arm.base import body_columns
from evertwin.machines.arm.lanes import batch
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.assembly import shared
from evertwin.machines.assembly.join import Axis, Train
from evertwin.machines.assembly.plan import Places, friction_tables
from evertwin.machines.assembly.shared import QUANTITIES, RUBS
from evertwin.machines.friction import COLUMNS, INERTIA, VS, WIDTH, feature, switch
from evertwin.types import Inputs, ParameterVector, Vector

__all__ = ["Column", "axis_columns", "features", "scales"]

Key: TypeAlias = tuple[Any, ...]
_WHOLE = (shared.EFFORT, shared.MOTOR_TORQUE, shared.MOTOR_CURRENT, shared.MOTOR_VOLTAGE)


class Column(NamedTuple):
    """One linear parameter of an axis.

    >>> Column(0, "rub 0", ("rub", 0, 2)).acts_on(0, 1)
    False
    """

    place: int
    """Index in ``p``."""
    group: str
    key: Key
    """Which feature it is multiplied with."""

    def acts_on(self, code: int, axes: int) -> bool:
        """Does the quantity ``code`` on the bus change with it?"""
        if code < QUANTITIES * axes:
            kind = code % QUANTITIES
            return kind in _WHOLE or (kind == shared.LOAD and self.group == "load")
        f, kind = divmod(code - QUANTITIES * axes, RUBS)
        return kind == shared.RUB_FORCE and self.group == f"rub {f}"


def axis_columns(train: Train, axis: Axis) -> tuple[Column, ...]:
    """The linear parameters of an axis."""
    j, found = axis.number, []
    for part, name in ((axis.structure, "mass"), (axis.payload, "mass")):
        place = train.at(part, name if axis.slides else "inertia")
        if place >= 0:
            found.append(Column(place, "load", ("acceleration", j)))
    if axis.motor is not None:
        found.append(Column(train.at(axis.motor, "J"), "rotor", ("rotor", j)))
    for f, rub in enumerate(train.rubs):
        if rub.axis == j:
            for heat, table in enumerate(friction_tables(train, rub)):
                slots = [s for s in range(COLUMNS) if table[s] >= 0 and s != INERTIA]
                found += [Column(table[s], f"rub {f}", ("rub", f, s, heat)) for s in slots]
    if train.arm is not None and train.base:
        first = train.parameters.names.index(_first_base(train))
        for k, flat in enumerate(train.base):
            if flat // BODY >= j:
                found.append(Column(first + k, "load", ("body", k, j)))
    payload = train.at(train.load, "m")
    if payload >= 0:
        found += [Column(payload + k, "load", ("carried", k, j)) for k in range(BODY)]
    return tuple(found)


def _first_base(train: Train) -> str:
    assert train.chain is not None and train.arm is not None
    return f"{train.arm.name}.{layout.base_items(train.chain, train.base)[0].name}"


def turns(train: Train, axis: Axis, p: ParameterVector) -> float:
    """Motor turns for each unit of joint motion."""
    lead, ratio = train.at(axis.gearbox, "lead"), train.at(axis.gearbox, "ratio")
    if lead >= 0:
        return float(2.0 * np.pi / p[lead])
    return float(p[ratio]) if ratio >= 0 else 1.0


def scales(train: Train, codes: tuple[int, ...], p: ParameterVector) -> list[float]:
    """Of every output: its change with the effort at the joint."""
    found = []
    for code in codes:
        kind, factor = code % QUANTITIES, 1.0
        if code < QUANTITIES * len(train.axes) and kind in _WHOLE[1:]:
            axis = train.axes[code // QUANTITIES]
            factor = 1.0 / turns(train, axis, p)
            if kind != shared.MOTOR_TORQUE:
                factor /= float(p[train.at(axis.motor, "k")])
            if kind == shared.MOTOR_VOLTAGE:
                factor *= float(p[train.at(axis.motor, "R")])
        found.append(factor)
    return found


def features(train: Train, places: Places, u: Inputs, p: ParameterVector) -> dict[Key, Vector]:
    """Features of every column by their key, each (n,)."""
    found: dict[Key, Vector] = {}
    for axis, columns in zip(train.axes, places.columns, strict=True):
        acceleration = u[:, columns.acceleration]
        found["acceleration", axis.number] = acceleration
        found["rotor", axis.number] = turns(train, axis, p) ** 2 * acceleration
    load = np.zeros((len(u), len(train.axes)))
    if train.chain is not None:
        motion = np.ascontiguousarray(u[:, : 3 * train.chain.n])
        if any(rub.law.load for rub in train.rubs):
            load = batch(train.chain.geometry, train.chain.inertia, motion)
        found |= _bodies(train, motion)
    for f, rub in enumerate(train.rubs):
        speed = np.ascontiguousarray(u[:, places.columns[rub.axis].speed])
        table, warm = friction_tables(train, rub)
        width = float(p[table[WIDTH]]) if table[WIDTH] >= 0 else 0.0
        vs = float(p[table[VS]]) if table[VS] >= 0 else 1.0
        above = _above(train, f, places, u, p)
        for heat, own in enumerate((table, warm)):
            for slot in (s for s in range(COLUMNS) if own[s] >= 0 and s != INERTIA):
                out = np.empty(len(u))
                shape = (width, vs, rub.law.standstill)
                _feature(slot, speed, np.ascontiguousarray(load[:, rub.axis]), shape, out)
                found["rub", f, slot, heat] = out * above if heat else out
    return found


def _above(train: Train, f: int, places: Places, u: Inputs, p: ParameterVector) -> Vector:
    """Temperature of a friction above its reference [K]."""
    column = places.heat_inputs[f]
    if column < 0:
        return np.zeros(len(u))
    name = f"{train.rubs[f].name}.T0"
    return np.asarray(u[:, column] - p[train.parameters.names.index(name)])


def _bodies(train: Train, motion: Inputs) -> dict[Key, Vector]:
    """Columns of the inertial numbers that are parameters, then of the payload's."""
    assert train.chain is not None
    n, geometry, found = train.chain.n, train.chain.geometry, {}
    if train.base:
        columns = body_columns(geometry, train.base, motion)
        found = {("body", k, j): columns[:, j, k] for k in range(len(train.base)) for j in range(n)}
    if train.load is not None:
        last = tuple(BODY * (n - 1) + k for k in range(BODY))
        carried = body_columns(geometry, last, motion) @ layout.payload_map(train.chain)
        found |= {("carried", k, j): carried[:, j, k] for k in range(BODY) for j in range(n)}
    return found


@njit(cache=True)
def _feature(slot: int, v: Any, load: Any, shape: Any, out: Any) -> None:
    """One feature over rows; ``shape``: width, vs, standstill."""
    for i in range(v.shape[0]):
        s = switch(v[i], shape[0], shape[2])
        out[i] = feature(slot, v[i], s, load[i], shape[1])
