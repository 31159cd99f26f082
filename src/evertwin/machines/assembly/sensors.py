"""Virtual sensors: the quantities inside an assembly, by ``<component>.<quantity>``.

>>> from evertwin.machines.assembly.train import join
>>> train = join([{"name": "table", "kind": "mass", "axis": 1},
...               {"name": "guide", "kind": "guide", "axis": 1}])
>>> sensors_of(train)["guide.friction"].unit
'N'
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

from evertwin.errors import UsageError
from evertwin.machines.assembly import shared
from evertwin.machines.assembly.shared import QUANTITIES, RUBS
from evertwin.machines.assembly.train import Train
from evertwin.signals.channels import position


class Sensor(NamedTuple):
    """A quantity: where it lies on the bus, its unit, and whether it is linear in friction.

    >>> Sensor(0, "A", 0).linear
    True
    """

    code: int
    unit: str
    axis: int
    linear: bool = True
    forward: bool = False
    """Only where commands are followed?"""


_PLACES = (
    ("structure", "position", shared.POSITION, "{place}"),
    ("structure", "speed", shared.SPEED, "{place}/s"),
    ("structure", "acceleration", shared.ACCELERATION, "{place}/s**2"),
    ("structure", "load", shared.LOAD, "{effort}"),
    ("structure", "effort", shared.EFFORT, "{effort}"),
    ("motor", "torque", shared.MOTOR_TORQUE, "Nm"),
    ("motor", "current", shared.MOTOR_CURRENT, "A"),
    ("motor", "voltage", shared.MOTOR_VOLTAGE, "V"),
    ("motor", "speed", shared.MOTOR_SPEED, "rad/s"),
    ("motor", "loss", shared.LOSS, "W"),
    ("motor", "power", shared.POWER, "W"),
    ("gearbox", "load", shared.LOAD, "{effort}"),
    ("gearbox", "effort", shared.EFFORT, "{effort}"),
    ("gearbox", "deflection", shared.DEFLECTION, "{place}"),
    ("controller", "demand", shared.COMMAND, "{demand}"),
    ("controller", "error", shared.ERROR, "{place}"),
)
"""Component of an axis, quantity, its place among the axis' on the bus, unit."""
_FORWARD = (shared.COMMAND, shared.ERROR)
_CURVED = (shared.LOSS, shared.POWER, shared.DEFLECTION, *_FORWARD)
"""Not linear in friction."""


def sensors_of(train: Train) -> dict[str, Sensor]:
    """Every quantity that can be read, by name."""
    found: dict[str, Sensor] = {}
    efforts = ["N" if axis.slides else "Nm" for axis in train.axes]
    for axis, effort in zip(train.axes, efforts, strict=True):
        j, place = axis.number, "m" if axis.slides else "rad"
        units = {"place": place, "effort": effort, "demand": axis.demand}
        for role, name, code, unit in _PLACES:
            part = getattr(axis, role)
            owner = f"{train.arm.name}.{j + 1}" if train.arm and role == "structure" else ""
            if part is not None or owner:
                found[f"{owner or part.name}.{name}"] = Sensor(
                    QUANTITIES * j + code, unit.format(**units), j, code not in _CURVED,
                    code in _FORWARD,
                )  # fmt: skip
    first = QUANTITIES * len(train.axes)
    for at, rub in zip(itertools.count(first, RUBS), train.rubs):
        found[f"{rub.name}.friction"] = Sensor(at + shared.RUB_FORCE, efforts[rub.axis], rub.axis)
        found[f"{rub.name}.heat"] = Sensor(at + shared.HEAT, "W", rub.axis, linear=False)
        if rub.temperature:
            found[f"{rub.name}.temperature"] = Sensor(at + shared.TEMPERATURE, "K", rub.axis)
    for at, box in enumerate(train.boxes, start=first + RUBS * len(train.rubs)):
        found[f"{box.name}.effort"] = Sensor(at, efforts[box.axis], box.axis, linear=False)
    return found


def chosen(train: Train, names: Sequence[str], *, forward: bool) -> tuple[tuple[str, Sensor], ...]:
    """Sensors of a reading by name.

    Raises:
        UsageError: no such quantity, or none of this reading.
    """
    known = sensors_of(train)
    for name in names:
        position(tuple(known), name, "virtual sensor")
        if known[name].forward and not forward:
            raise UsageError(f"assembly: {name} exists only where commands are followed: forward")
    return tuple((name, known[name]) for name in names)
