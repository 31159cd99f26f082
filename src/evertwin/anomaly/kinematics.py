"""Do a measured position and its measured speed still say the same?

Over stretches of time the change of the position is compared with the integral of the speed, in
which noise and the steps of an encoder vanish. Once they have agreed, stretch by stretch, three in
a row that differ by more than half are a contradiction: a unit, a sign, a frozen or a swapped
channel. A model that takes both as inputs cannot be judged by them, nor learn from them. A
position that leaps within one row, further than it ever went in one, and stays where it is is told
by itself: before or behind it the position is off.

>>> t = 0.01 * np.arange(6000)
>>> speed = np.where(t < 40.0, 1.0, 1000.0) * np.cos(t)
>>> stage = Kinematics((("position", "speed"),), ((0, 1, 0),), rate=100.0)
>>> u, dt = np.column_stack([np.sin(t), speed]), np.full(6000, 0.01)
>>> state, marked = stage.step(stage.init(), 0, dt, u)
>>> _, (told,) = stage.beat(state)
>>> told.signal, round(told.factor), 3950 <= told.first <= 4000, bool(marked[-1])
('speed', 1000, True, True)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.anomaly import kinematics_loop as loop
from evertwin.signals.mistaken import SIGN, numbers
from evertwin.types import Bools, Float64, Inputs, Int64, Vector

STRETCH, FEWEST = 0.5, 10
"""Length of a stretch [s], and the fewest rows of one."""
GAP = 3.0
"""Rows whose time a gap may take, within a stretch."""
CLEARLY = 5.0
"""How much nearer to its usual way the one has to be than the other to be believed."""
NEAR = 0.02
"""Logarithm of what a factor may be beside that of two units to be taken for it."""
STANDS = 1e-4
"""Share of its usual way below which a channel stands."""


class KinematicsState(NamedTuple):
    """State of `Kinematics`. See `evertwin.anomaly.kinematics_loop` for the places.

    >>> Kinematics((), (), 1.0).init().numbers.shape
    (0, 12)
    """

    numbers: Int64[np.ndarray, "pairs numbers"]
    figures: Float64[np.ndarray, "pairs figures"]
    machine: Int64[np.ndarray, " one"]


class Leap(NamedTuple):
    """A position that leaps while its speed says nothing of it.

    >>> Leap("q3", "qd3", 2000, True, 0.07, "rad").reason
    'q3 leaps by +0.07 rad (+4.01°) within one row, against qd3: it is off since, or was before'
    """

    signal: str
    other: str
    """Its speed."""
    first: int
    """Row at which."""
    open: bool
    """False: it leapt back."""
    by: float
    """How far, in SI."""
    unit: str

    @property
    def reason(self) -> str:
        """In words."""
        if not self.open:
            return f"{self.signal} leaps back to where it was"
        turned = f" ({math.degrees(self.by):+.3g}°)" if self.unit == "rad" else ""
        return (
            f"{self.signal} leaps by {self.by:+.3g} {self.unit}{turned} within one row, against "
            f"{self.other}: it is off since, or was before"
        )


class Contradiction(NamedTuple):
    """What a beat tells of a pair.

    >>> Contradiction("speed", "position", 0, True, -1.0, False).factor
    -1.0
    """

    signal: str
    """The channel that is wrong, or may be."""
    other: str
    """The channel that contradicts it."""
    first: int
    """Row since which."""
    open: bool
    """False: it is over."""
    factor: float
    """The signal over what the other one says of it; 0: it stands; infinite: the other does."""
    known: bool
    """Is it known which of the two is wrong?"""
    unit: str = ""
    """Of the signal, in SI."""

    @property
    def reason(self) -> str:
        """In words."""
        if not self.open:
            return f"{self.signal} and {self.other} agree with each other again"
        if self.factor == 0:
            said = f"{self.signal} stands while {self.other} says that it moves"
        elif math.isinf(self.factor):
            said = f"{self.signal} says that it moves while {self.other} stands"
        else:
            said = f"{self.signal} is {self.factor:.4g} times what {self.other} says{self._unit()}"
        which = "" if self.known else "; which of the two is wrong cannot be told"
        return f"{said}{which}"

    def _unit(self) -> str:
        """What would make it so; nothing where no unit that is known does."""
        near = [
            (abs(math.log(self.factor / number)), told)
            for number, told in (numbers(self.unit) if self.unit else ())
            if number * self.factor > 0 and number != SIGN
        ]
        off, told = min(near, default=(math.inf, ""))
        return f", as {told} would make it" if off < NEAR else ""


@dataclass(frozen=True)
class Kinematics:
    """The stage. See the module for an example."""

    names: tuple[tuple[str, str], ...]
    """Position and speed of each pair."""
    columns: tuple[tuple[int, int, int], ...]
    """Their columns in the inputs, and 1 where the position is an angle."""
    rate: float
    """Rows per second."""
    units: tuple[str, ...] = ()
    """Of the inputs, in SI."""

    @cached_property
    def _pairs(self) -> Int64[np.ndarray, "pairs three"]:
        return np.array(self.columns, dtype=np.int64).reshape(-1, 3)

    @cached_property
    def _rule(self) -> Vector:
        return np.array([max(FEWEST, round(STRETCH * self.rate)), GAP / self.rate])

    def init(self) -> KinematicsState:
        """Nothing seen."""
        pairs = len(self.names)
        numbers, figures = (
            np.zeros((pairs, loop.NUMBERS), dtype=np.int64),
            np.zeros((pairs, loop.FIGURES)),
        )
        return KinematicsState(numbers, figures, np.zeros(1, dtype=np.int64))

    def handed_on(self, state: KinematicsState) -> KinematicsState:
        """What a next run begins with: how far the machine usually goes. Consumes ``state``."""
        kept = state.numbers[:, loop.AGREED].copy()
        state.numbers[:] = 0
        state.numbers[:, loop.AGREED] = kept
        return state

    def step(
        self, state: KinematicsState, row: int, dt: Vector, u: Inputs
    ) -> tuple[KinematicsState, Bools]:
        """Rows from ``row`` on, and which of them are contradicted. Consumes ``state``."""
        marked = np.zeros(len(u), dtype=np.bool_)
        if state.numbers.shape[1] != loop.NUMBERS:  # of an older checkpoint
            state = self.init()
        if self.names:
            loop.watch(row, dt, u, self._pairs, self._rule, tuple(state), marked)
        return state, marked

    def known(self, state: KinematicsState) -> int:
        """Row after the first since the newest beat that has something for the next; 0: none."""
        return int(state.machine[loop.NEWS])

    def since(self, state: KinematicsState) -> int:
        """First row of what is contradicted; −1: nothing is."""
        first = state.numbers[state.numbers[:, loop.OPEN] != 0, loop.FIRST]
        return int(first.min()) if len(first) else -1

    def doubted(self, state: KinematicsState) -> int:
        """The same, where stretches differ that are too few yet."""
        bad = (state.numbers[:, loop.BAD] != 0) & (state.numbers[:, loop.AGREED] >= loop.KNOWN)
        first = state.numbers[bad | (state.numbers[:, loop.OPEN] != 0), loop.FIRST]
        return int(first.min()) if len(first) else -1

    def beat(
        self, state: KinematicsState
    ) -> tuple[KinematicsState, tuple[Contradiction | Leap, ...]]:
        """What opened or closed since the last beat. Consumes ``state``."""
        numbers, told = state.numbers, list[Contradiction | Leap]()
        for k in np.flatnonzero(numbers[:, loop.LEAPT] != numbers[:, loop.LEAP_SAID]).tolist():
            (position, speed), first = self.names[k], int(numbers[k, loop.LEAPT])
            by, unit = float(state.figures[k, loop.LEAP]), self._units(k)[0]
            begins = (first or int(numbers[k, loop.LEAP_SAID])) - 1
            told.append(Leap(position, speed, begins, first > 0, by, unit))
        numbers[:, loop.LEAP_SAID] = numbers[:, loop.LEAPT]
        for k in np.flatnonzero(numbers[:, loop.OPEN] != numbers[:, loop.SAID]).tolist():
            told.append(self._of(k, numbers[k], state.figures[k]))
        numbers[:, loop.SAID] = numbers[:, loop.OPEN]
        state.machine[loop.NEWS] = 0
        return state, tuple(told)

    def _of(self, k: int, number: np.ndarray, figure: np.ndarray) -> Contradiction:
        position, speed = self.names[k]
        xx, xy, yy = (float(figure[place]) for place in (loop.XX, loop.XY, loop.YY))
        ways = (xx / figure[loop.USUAL_GONE], yy / figure[loop.USUAL_WAY])
        sizes = [max(math.sqrt(way / (loop.SURE - 1)), 1e-12) for way in ways]
        still = [size < STANDS for size in sizes]
        far = [abs(math.log(size)) for size in sizes]
        first, is_open = int(number[loop.FIRST]), bool(number[loop.OPEN])
        units = self._units(k)
        if far[0] - far[1] > math.log(CLEARLY):
            factor = 0.0 if still[0] else math.inf if still[1] else xy / yy
            return Contradiction(position, speed, first, is_open, factor, True, units[0])
        factor = 0.0 if still[1] else math.inf if still[0] else xy / xx
        known = far[1] - far[0] > math.log(CLEARLY)
        return Contradiction(speed, position, first, is_open, factor, known, units[1])

    def _units(self, k: int) -> list[str]:
        return [self.units[c] if self.units else "" for c in self.columns[k][:2]]
