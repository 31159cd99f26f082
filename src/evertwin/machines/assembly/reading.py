"""What both readings of an assembly share, and the ladder of friction laws where one is climbed.

>>> from evertwin.machines.assembly.train import join
>>> axis = Laddered()
>>> axis.train = join([{"name": "table", "kind": "mass", "axis": 1},
...     {"name": "guide", "kind": "guide", "axis": 1, "friction": "sign+direction"}])
>>> axis.rungs()[0].add, axis.law_name(0, ()), axis.joints
(('guide.Fv_back',), 'sign', ('table',))
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from evertwin.machines.assembly.boxed import box_channels
from evertwin.machines.assembly.sensors import Sensor
from evertwin.machines.assembly.train import Rub, Train
from evertwin.machines.friction import Rung
from evertwin.models import Kernel, Parameters
from evertwin.signals import Channel, Layout
from evertwin.types import ParameterVector


@dataclass(frozen=True, eq=False)
class Reading:
    """Base of the readings of joined components.

    >>> Reading.__name__
    'Reading'
    """

    train: Train
    sensors: tuple[tuple[str, Sensor], ...]
    parameters: Parameters

    @cached_property
    def _kernel(self) -> Kernel:
        raise NotImplementedError

    def kernel(self) -> Kernel:
        """Addresses for the fused loop."""
        return self._kernel

    def __getstate__(self) -> dict[str, Any]:
        """Without what is computed: addresses mean nothing in another process."""
        made = ("_kernel", "_given")
        return {key: value for key, value in self.__dict__.items() if key not in made}

    def _shown(self, own: Iterable[Channel]) -> Layout:
        """Outputs of the reading's own, then the virtual sensors."""
        return Layout((*own, *(Channel(name, sensor.unit) for name, sensor in self.sensors)))

    def _codes(self, own: Iterable[int]) -> tuple[int, ...]:
        return (*own, *(sensor.code for _, sensor in self.sensors))

    def _outside(self) -> list[Channel]:
        """Temperatures that are measured, and what black boxes read from outside."""
        measured = [rub.name for rub in self.train.rubs if rub.temperature == "input"]
        return [*(Channel(f"{name}.T", "K") for name in measured), *box_channels(self.train)]

    @cached_property
    def _heated(self) -> tuple[str, ...]:
        """What rubs at a temperature that follows from its heat."""
        return tuple(rub.name for rub in self.train.rubs if rub.temperature == "state")

    def _ambient(self, p: ParameterVector) -> list[float]:
        return [float(p[self.parameters.index(f"{name}.ambient")]) for name in self._heated]


class Laddered:
    """Base of readings whose friction laws are chosen on unseen data. See the module.

    >>> Laddered.__name__
    'Laddered'
    """

    train: Train

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Friction's coefficients."""
        return tuple(f"{rub.name}.{n}" for rub in self.train.rubs for n in rub.law.rubbing())

    def rungs(self) -> tuple[Rung, ...]:
        """Steps up the ladders; each has to pay on unseen data of its axis' output."""
        found: list[Rung] = []
        for rub in _first(self.train).values():
            for step in rub.law.rungs():
                names = tuple(f"{rub.name}.{name}" for name in step.add)
                found.append(Rung(step.name, names, rub.axis))
        return tuple(found)

    def law_name(self, output: int, terms: Sequence[str]) -> str:
        """The law of an axis' friction that has these of its terms; empty where nothing rubs."""
        rub = _first(self.train).get(output)
        if rub is None:
            return ""
        return str(rub.law.only(terms))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the axes: an arm's joints, or what moves on them."""
        if self.train.chain is not None:
            return self.train.chain.joints
        return tuple(axis.structure.name for axis in self.train.axes if axis.structure is not None)


def _first(train: Train) -> dict[int, Rub]:
    """One friction for each axis: the one that its ladder is climbed with."""
    first = {rub.axis: rub for rub in reversed(train.rubs)}
    return {j: first[j] for j in sorted(first)}
