"""What a recording may have been multiplied by: a channel, all of one unit, or the stamps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from evertwin.fold import Block
from evertwin.gauges.delays.clock_unit import others, stretched
from evertwin.signals import Layout
from evertwin.signals.mistaken import SIGN, numbers
from evertwin.types import Vector

STAMPS = "the stamps"
NANO = 9.0
"""Power of ten that is a broken cell, not a unit of a whole recording."""


@dataclass(frozen=True)
class Suspect:
    """Columns that are scaled together, or the stamps, whose unit is one of time.

    >>> [said for factor, said in Suspect((STAMPS,), "s", (), ()).factors("s")][0]
    '0.001 (ms read as s)'
    """

    names: tuple[str, ...]
    unit: str
    u: tuple[int, ...]
    y: tuple[int, ...]

    @property
    def time(self) -> bool:
        """Is it the stamps?"""
        return not (self.u or self.y)

    def factors(self, recorded: str) -> Iterator[tuple[float, str]]:
        """What a recording, said to be in ``recorded``, may have to be multiplied by, and what that
        stands for."""
        if self.time:
            for other in others(recorded):
                yield other.factor, f"{other.factor:g} ({other.text})"
            return
        for number, told in numbers(self.unit, recorded):
            if number == SIGN:
                yield SIGN, "-1 (the sign is reversed)"
            elif told == "a decimal prefix" and abs(math.log10(number)) < NANO:
                yield 1.0 / number, f"10^{-round(math.log10(number))}"
            elif told != "a decimal prefix":
                said = f"{1.0 / number:.6g}" if number < 1.0 else f"1/{number:g}"
                yield 1.0 / number, f"{said} ({told.replace(' for ', ' taken for ')})"


Factor: TypeAlias = tuple[Suspect, float]


class Hypothesis(NamedTuple):
    """A factor on some channels, and the mismatch that it leaves.

    >>> Hypothesis._fields
    ('suspect', 'factor', 'said', 'after')
    """

    suspect: Suspect
    factor: float
    said: str
    after: Vector

    @property
    def text(self) -> str:
        """In a person's words."""
        return f"{', '.join(self.suspect.names)} times {self.said}"


def scaled(window: Block, by: tuple[Factor, ...]) -> Block:
    """The window, as it would be if each suspect were multiplied by its factor."""
    window = window._replace(u=window.u.copy(), y=window.y.copy())
    for suspect, factor in by:
        if suspect.time:
            window = stretched(window, factor)
        window.u[:, suspect.u] *= factor
        window.y[:, suspect.y] *= factor
    return window


def suspects(inputs: Layout, outputs: Layout, time: str = "") -> list[Suspect]:
    """Single channels first, then channels that share a unit, then the stamps, read in ``time``;
    empty: their unit is beyond doubt."""
    out = [Suspect((one.name,), one.unit, (k,), ()) for k, one in enumerate(inputs)]
    out += [Suspect((one.name,), one.unit, (), (k,)) for k, one in enumerate(outputs)]
    for layout, side in ((inputs, "u"), (outputs, "y")):
        for unit in dict.fromkeys(layout.units):
            where = tuple(k for k, other in enumerate(layout.units) if other == unit)
            if len(where) > 1:
                names = tuple(layout.names[k] for k in where)
                u, y = (where, ()) if side == "u" else ((), where)
                out.append(Suspect(names, unit, u, y))
    return out + [Suspect((STAMPS,), time, (), ())] * bool(time)
