"""The tables that stand around a MuJoCo model as inputs of it: another room is another compiled
model with the same state.

The rooms that were simulated in of late are kept compiled. A machine is in one for many rows, so
rows are cut where the tables change.

>>> from evertwin.models.mujoco.guard import read_text
>>> cart = read_text('<mujoco><worldbody><body><joint type="slide"/><geom size=".1" pos="0 0 .2"/>'
...                  '</body></worldbody></mujoco>')
>>> rooms = Rooms(cart, compiled(cart), (), Plate())
>>> here = np.array([[1.0, 0.0, 0.0, 1.2, 0.7, 0.03], np.zeros(6)])
>>> rooms.engines(here.ravel()).model.ngeom, rooms.engines(np.zeros(12)).model.ngeom
(6, 1)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from evertwin.models.mujoco.base import EnginePool
from evertwin.models.mujoco.engine import compiled
from evertwin.models.mujoco.guard import Source
from evertwin.models.mujoco.knobs import Knob
from evertwin.models.tables.bodies import UNITS, Plate, parts
from evertwin.types import Float64

KEPT = 32
"""Rooms that are kept compiled."""
LENGTH, WIDTH, LEG = (list(UNITS).index(name) for name in ("length", "width", "leg"))


@dataclass(frozen=True, eq=False)
class Rooms:
    """Engines of one model, by the tables that stand around it. See the module for an example."""

    source: Source
    bare: Any
    """Compiled without tables."""
    knobs: tuple[Knob, ...]
    plate: Plate
    threads: int = 0

    def engines(self, tables: Float64[np.ndarray, " n"]) -> EnginePool:
        """In the room of one row: the numbers of each place for a table in turn."""
        return self._known(tables.tobytes())

    @cached_property
    def _known(self) -> Callable[[bytes], EnginePool]:
        return lru_cache(KEPT)(self._made)

    def _made(self, room: bytes) -> EnginePool:
        tables = np.frombuffer(room).reshape(-1, len(UNITS))
        # a table without legs, or with legs that touch, is none
        sides, leg = tables[:, [LENGTH, WIDTH]].min(axis=1), tables[:, LEG]
        stand = tables[(leg > 0) & (sides > 2 * leg)]
        model = self.bare
        if len(stand):
            shifts = any(".com_" in knob.name for knob in self.knobs)
            there = [
                (one[:3].tolist(), [*parts(one[:5], float(one[LEG]), self.plate)]) for one in stand
            ]
            model = compiled(self.source, shifts=shifts, tables=there)
            model.opt.timestep = self.bare.opt.timestep
            model.opt.disableflags = self.bare.opt.disableflags
        return EnginePool(model, self.knobs, self.threads)


def stretches_of(tables: Float64[np.ndarray, "rows n"]) -> Iterator[tuple[int, int]]:
    """[first, stop) of the rows between which no table changes.

    >>> [*stretches_of(np.array([[0.0], [0.0], [1.0]]))]
    [(0, 2), (2, 3)]
    """
    cuts: Sequence[int] = (np.flatnonzero((tables[1:] != tables[:-1]).any(axis=1)) + 1).tolist()
    yield from pairwise([0, *cuts, len(tables)])
