"""The ladder of friction laws of an assembly: steps by component, each for its axis.

>>> from evertwin.machines.assembly.train import join
>>> axis = Laddered()
>>> axis.train = join([{"name": "table", "kind": "mass", "axis": 1},
...     {"name": "guide", "kind": "guide", "axis": 1, "friction": "sign+direction"}])
>>> axis.rungs()[0].add, axis.law_name(0, ()), axis.joints
(('guide.Fv_back',), 'sign', ('table',))
"""

from __future__ import annotations

from collections.abc import Sequence

from evertwin.machines.assembly.train import Rub, Train
from evertwin.machines.friction import Rung


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
