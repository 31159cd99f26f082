"""The regressor of a static assembly: what each linear parameter is multiplied with.

A column belongs to an axis and to a group: the load of the structure, the rotor, or one component
that rubs. Efforts see all columns of their axis; a virtual sensor sees the group that it shows.

>>> Column(3, "load", ("mass", 0)).key
('mass', 0)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from evertwin.machines.arm import layout
from evertwin.machines.arm.base import body_columns
from evertwin.machines.arm.lanes import batch
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.assembly import shared
from evertwin.machines.assembly.context import friction_columns, place
from evertwin.machines.assembly.shared import QUANTITIES, RUBS
from evertwin.machines.assembly.train import Axis, Rub, Train
from evertwin.machines.friction.kernel import PLACE, fill
from evertwin.types import Inputs, ParameterVector, Vector

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
            for number, term in enumerate(friction_columns(train, rub)):
                found.append(Column(int(term[PLACE]), f"rub {f}", ("rub", f, number)))
    if train.base:
        for k, flat in enumerate(train.base):
            if flat // BODY >= j:
                found.append(Column(train.first_body + k, "load", ("body", k, j)))
    payload = train.at(train.load, "m")
    if payload >= 0:
        found += [Column(payload + k, "load", ("carried", k, j)) for k in range(BODY)]
    return tuple(found)


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


def features(
    train: Train, names: Sequence[str], u: Inputs, p: ParameterVector
) -> dict[Key, Vector]:
    """Features of every column by their key, each (n,)."""
    found: dict[Key, Vector] = {}
    for axis in train.axes:
        acceleration = u[:, names.index(f"qdd{axis.number + 1}")]
        found["acceleration", axis.number] = acceleration
        found["rotor", axis.number] = turns(train, axis, p) ** 2 * acceleration
    load = np.zeros((len(u), len(train.axes)))
    if train.chain is not None:
        motion = np.ascontiguousarray(u[:, : 3 * train.chain.n])
        if any("load" in rub.law.reads for rub in train.rubs):
            load = batch(train.chain.geometry, train.chain.inertia, motion)
        found |= _bodies(train, motion)
    for f, rub in enumerate(train.rubs):
        warmth, way = place(names, f"{rub.name}.T"), place(names, f"q{rub.axis + 1}")
        rows = np.full((4, len(u)), np.nan)
        rows[0], rows[1] = u[:, names.index(f"qd{rub.axis + 1}")], load[:, rub.axis]
        for row, column in ((2, warmth), (3, way)):
            rows[row] = u[:, column] if column >= 0 else np.nan
        width = _width(train, rub, p)
        for number, term in enumerate(friction_columns(train, rub)):
            out = np.empty(len(u))
            fill(term, p, rows, rub.law.standstill, width, out)
            found["rub", f, number] = out
    return found


def _width(train: Train, rub: Rub, p: ParameterVector) -> float:
    """Width of a friction's switch; 0: a sign."""
    name = f"{rub.name}.width"
    return float(p[train.parameters.names.index(name)]) if rub.law.switch == "tanh" else 0.0


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
