"""The machine's clock against ours: in real time, or in time-lapse by a factor.

Stamps are of the machine's clock. A machine that cannot be computed as fast as asked falls behind,
and its stamps with it: nothing is left out.

>>> pace = Pace(speed=10.0, machine=0.0, ours=100.0)
>>> pace.due(5.0)
100.5
>>> pace.change(20.0, ours=100.5)
>>> pace.due(25.0)
101.5
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Pace:
    """Where both clocks stood when the factor began. See the module for an example."""

    speed: float
    """Seconds of the machine in one of ours; infinite: as fast as it can be computed."""
    machine: float
    ours: float

    def due(self, machine: float) -> float:
        """Our time at which the machine's clock shows ``machine``."""
        return self.ours + (machine - self.machine) / self.speed

    def change(self, speed: float, ours: float) -> None:
        """Another factor from now on."""
        self.machine += (ours - self.ours) * self.speed
        self.ours, self.speed = ours, speed

    def slip(self, machine: float, ours: float) -> None:
        """The machine is late: its clock shows ``machine`` now."""
        self.machine, self.ours = machine, ours
