"""Virtual sensors: the quantities inside an assembly, by ``<component>.<quantity>``.

>>> from evertwin.machines.assembly.train import join
>>> train = join([{"name": "table", "kind": "mass", "axis": 1},
...               {"name": "guide", "kind": "guide", "axis": 1}])
>>> sensors_of(train)["guide.friction"].unit
'N'
"""

from __future__ import annotations

from typing import NamedTuple

from evertwin.machines.assembly import shared
from evertwin.machines.assembly.shared import QUANTITIES, RUBS
from evertwin.machines.assembly.train import Axis, Train


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


def _motor(axis: Axis) -> dict[str, Sensor]:
    q, j = QUANTITIES * axis.number, axis.number
    return {
        "torque": Sensor(q + shared.MOTOR_TORQUE, "Nm", j),
        "current": Sensor(q + shared.MOTOR_CURRENT, "A", j),
        "voltage": Sensor(q + shared.MOTOR_VOLTAGE, "V", j),
        "speed": Sensor(q + shared.MOTOR_SPEED, "rad/s", j),
        "loss": Sensor(q + shared.LOSS, "W", j, linear=False),
        "power": Sensor(q + shared.POWER, "W", j, linear=False),
    }


def _joint(axis: Axis) -> dict[str, Sensor]:
    q, j = QUANTITIES * axis.number, axis.number
    place, effort = ("m", "N") if axis.slides else ("rad", "Nm")
    return {
        "position": Sensor(q + shared.POSITION, place, j),
        "speed": Sensor(q + shared.SPEED, f"{place}/s", j),
        "acceleration": Sensor(q + shared.ACCELERATION, f"{place}/s**2", j),
        "load": Sensor(q + shared.LOAD, effort, j),
        "effort": Sensor(q + shared.EFFORT, effort, j),
    }


def _gearbox(axis: Axis) -> dict[str, Sensor]:
    q, place = QUANTITIES * axis.number, "m" if axis.slides else "rad"
    return {
        "load": _joint(axis)["load"],
        "effort": _joint(axis)["effort"],
        "deflection": Sensor(q + shared.DEFLECTION, place, axis.number, linear=False),
    }


def _controller(axis: Axis, unit: str) -> dict[str, Sensor]:
    q, place = QUANTITIES * axis.number, "m" if axis.slides else "rad"
    return {
        "demand": Sensor(q + shared.COMMAND, unit, axis.number, False, True),
        "error": Sensor(q + shared.ERROR, place, axis.number, False, True),
    }


def sensors_of(train: Train) -> dict[str, Sensor]:
    """Every quantity that can be read, by name."""
    found: dict[str, Sensor] = {}
    for axis in train.axes:
        owner = axis.structure.name if axis.structure else f"{train.arm.name}.{axis.number + 1}"  # type: ignore[union-attr]
        groups = {owner: _joint(axis)}
        if axis.motor is not None:
            groups[axis.motor.name] = _motor(axis)
        if axis.gearbox is not None:
            groups[axis.gearbox.name] = _gearbox(axis)
        if axis.controller is not None:
            unit = str(axis.controller.options["demand"])
            groups[axis.controller.name] = _controller(axis, unit)
        for name, group in groups.items():
            found |= {f"{name}.{key}": sensor for key, sensor in group.items()}
    first = QUANTITIES * len(train.axes)
    for f, rub in enumerate(train.rubs):
        at, effort = first + RUBS * f, "N" if train.axes[rub.axis].slides else "Nm"
        found[f"{rub.name}.friction"] = Sensor(at + shared.RUB_FORCE, effort, rub.axis)
        found[f"{rub.name}.heat"] = Sensor(at + shared.HEAT, "W", rub.axis, linear=False)
        if rub.temperature:
            found[f"{rub.name}.temperature"] = Sensor(at + shared.TEMPERATURE, "K", rub.axis)
    for k, box in enumerate(train.boxes):
        at, effort = (
            first + RUBS * len(train.rubs) + k,
            "N" if train.axes[box.axis].slides else "Nm",
        )
        found[f"{box.name}.effort"] = Sensor(at, effort, box.axis, linear=False)
    return found
