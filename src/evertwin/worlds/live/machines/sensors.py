"""What the sensors of a machine give of what is: each may lie in five ways.

>>> knobs = Knobs(faults(("x", "y")))
>>> sensors = Sensors(knobs)
>>> sensors.give({"x": 1.0, "y": 2.0})
{'x': 1.0, 'y': 2.0}
>>> knobs.tell("bias.x=0.5 freeze.y=1", now=0.0)
'bias.x=0.5 freeze.y=1'
>>> sensors.give({"x": 3.0, "y": 4.0})
{'x': 3.5, 'y': 2.0}
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from evertwin.worlds.live.orders import Knob, Knobs


def faults(signals: tuple[str, ...]) -> dict[str, Knob]:
    """The knobs of sensor faults, for each of the ``signals``."""
    return {
        "factor": Knob("a sensor's value times this: a wrong unit", neutral=1.0, about=signals),
        "bias": Knob("added to a sensor's value, in its unit", about=signals),
        "spike": Knob("added to one sample of a sensor, in its unit", about=signals),
        "freeze": Knob("1: a sensor keeps its newest value", 0.0, 1.0, about=signals),
        "dropout": Knob("1: a sensor gives no value", 0.0, 1.0, about=signals),
    }


@dataclass
class Sensors:
    """The sensors with their faults. See the module for an example."""

    knobs: Knobs
    _newest: dict[str, float] = field(default_factory=dict)

    def give(self, true: Mapping[str, float]) -> dict[str, float]:
        """What is published of what is; NaN for no value."""
        return {name: self._one(name, value) for name, value in true.items()}

    def _one(self, name: str, value: float) -> float:
        knobs = self.knobs
        if name not in knobs.known["bias"].about:
            return value
        if knobs.of("freeze", name) and name in self._newest:
            value = self._newest[name]
        else:
            value = knobs.of("factor", name) * value + knobs.of("bias", name)
            self._newest[name] = value
        value += knobs.of("spike", name)
        knobs.set("spike", name, 0.0)
        return math.nan if knobs.of("dropout", name) else value
