"""Something outside acts on the machine: a contact, a push. Not wear, not a wrong form.

What sets it apart is when it comes and goes:

* moving, it sets in and ends while the motion goes on as before; what belongs to the model begins
  and ends with a motion, a direction or a speed, or stays. Where one motion after the other begins
  off, it is the machine;
* one that begins a motion has the actuator brake what the model expects it to drive;
* standing, friction holds up to a limit, the one way and the other. What is beyond is not held by
  the machine. The limit is the model's own: the outputs of a motion just begun each way, and once
  more their distance, since friction at rest is up to twice that of motion.

Size is judged by the running rms of each output's own residual, so a rough model sees less and says
nothing false, and one that is out of scale (what moves is measured more than twice as large as
predicted, or less than half) nothing at all; what stays for longer than ``longest`` is no contact,
and goes to tuning. Rows are marked once more than half of the newest `WINDOW` seconds are off.

>>> rng = np.random.default_rng(0)
>>> r = rng.normal(size=(2000, 1)); r[1500:1530] += 5.0
>>> stage = External(("tau",), rate=100.0)
>>> state, marked = stage.step(stage.init(), Seen.of(r, interval=0.01))
>>> found = stage.found(state)
>>> found.outputs, bool(1490 < found.first <= 1505), int(np.flatnonzero(marked)[0]) < 1520
(('tau',), True, True)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from evertwin.anomaly import external_loop as loop
from evertwin.types import Bool, Bools, Float64, Int64, Outputs, Stamps

WINDOW = 0.2
"""Seconds within which a contact is told."""
LEARN, MEMORY, BASE = 2.0, 10.0, 1.0
"""Seconds of motion until the residual's rms is known; its memory, and that of the mean."""
LEAST = 100
"""Rows that an rms needs."""
TIMES = 2.5
"""Times the rms that counts as off, where the window has many rows."""
CHANCE = 1e-9
"""Share of windows of normal noise that may be off, where it has few."""


class Seen(NamedTuple):
    """Consecutive rows as an observer of contacts sees them.

    >>> Seen.of(np.zeros((2, 1)), interval=0.1).moving.tolist()
    [[True], [True]]
    """

    row: int
    t: Stamps
    r: Outputs
    """Measured − predicted, unfiltered, (n, ny); of what stands only what friction cannot hold."""
    half: Outputs
    """Half the width of what friction can hold; 0 where the output moves, or none is known."""
    v: Outputs
    """Speed of each output's own motion; NaN where it has none."""
    moving: Bool[np.ndarray, "n ny"]
    expected: Outputs
    """What the model predicts, (n, ny); NaN where its scale is out of the question."""

    @classmethod
    def of(cls, r: Outputs, interval: float) -> Seen:
        """Residuals of outputs that always move, at a fixed ``interval`` [s], from row 0 on."""
        t = np.arange(len(r), dtype=np.int64) * round(interval * 1e9)
        moving = np.ones(r.shape, dtype=np.bool_)
        unknown = np.full(r.shape, np.nan)
        return cls(0, t, r, np.zeros(r.shape), unknown, moving, unknown)


class ExternalState(NamedTuple):
    """State of `External`. See `evertwin.anomaly.external_loop` for the places.

    >>> External(("x",), 10.0).init().ring.shape
    (3, 3, 1)
    """

    ring: Float64[np.ndarray, "columns window ny"]
    numbers: Int64[np.ndarray, "ny numbers"]
    figures: Float64[np.ndarray, "ny figures"]
    machine: Int64[np.ndarray, " places"]


class Contact(NamedTuple):
    """What was found.

    >>> Contact(("tau1",), (12.0,), 10, 40).last
    40
    """

    outputs: tuple[str, ...]
    levels: tuple[float, ...]
    """Mean residual of each while it was off, without its sign, in its unit."""
    first: int
    last: int
    """Rows; −1: it goes on."""


class Own(NamedTuple):
    """One motion after the other began off: so is the machine.

    >>> Own("tau1", 40).first
    40
    """

    output: str
    first: int
    """Row since which no motion began calm."""


class Told(NamedTuple):
    """What a beat has to say.

    >>> Told(None, False, -1, None, False).lasts
    -1
    """

    contact: Contact | None
    new: bool
    """Was it not told at a beat before?"""
    lasts: int
    """First row of what was taken for one and lasts; −1: there is none."""
    own: Own | None
    """What turned out to be the machine's own."""
    blind: bool
    """Was there a standing output, for long, of which no friction is known?"""


@dataclass(frozen=True)
class External:
    """The stage. See the module for an example."""

    names: tuple[str, ...]
    rate: float
    """Rows per second."""
    longest: float = 5.0
    """What lasts longer is no contact [s]; 0: nothing is looked for."""

    @cached_property
    def window(self) -> int:
        """Rows of it."""
        return max(3, round(WINDOW * self.rate))

    @cached_property
    def times(self) -> float:
        """Times the rms from which on a row counts as off: more where a window has few rows."""
        half = self.window // 2 + 1
        tail = math.exp(math.log(CHANCE / math.comb(self.window, half)) / half)
        return max(TIMES, -NormalDist().inv_cdf(tail)) if tail < 0.5 else TIMES

    @cached_property
    def rule(self) -> Int64[np.ndarray, " five"]:
        """What the loop is told: longest excursion [ns], and rows, see `external_loop.watch`."""
        rows = [round(span * self.rate) for span in (LEARN, MEMORY, BASE, WINDOW)]
        least = (LEAST, LEAST, self.window, self.window)
        return np.array([round(self.longest * 1e9), *map(max, rows, least)], dtype=np.int64)

    def init(self) -> ExternalState:
        """Nothing seen."""
        ny = len(self.names)
        ring = np.zeros((3, self.window, ny))
        figures = np.zeros((ny, loop.FIGURES))
        figures[:, loop.USUAL] = 0.5
        numbers = np.zeros((ny, loop.NUMBERS), np.int64)
        return ExternalState(ring, numbers, figures, np.zeros(loop.PLACES, np.int64))

    def step(self, state: ExternalState, rows: Seen) -> tuple[ExternalState, Bools]:
        """More rows, and which of them are marked. Consumes ``state``."""
        marked = np.zeros(len(rows.t), dtype=np.bool_)
        less, fewer = (wide - had.shape[1] for wide, had in (
            (loop.NUMBERS, state.numbers), (loop.FIGURES, state.figures)
        ))  # fmt: skip
        if less > 0 or fewer > 0:  # of a checkpoint of an older version
            state = state._replace(
                numbers=np.pad(state.numbers, ((0, 0), (0, less))),
                figures=np.pad(state.figures, ((0, 0), (0, fewer))),
            )
        if self.longest > 0:
            loop.watch(rows, self.times, self.rule, state, marked)
        return state, marked

    def known(self, state: ExternalState) -> int:
        """Row after the first since the newest beat that has something for the next; 0: none."""
        return int(state.machine[loop.NEWS])

    def on(self, state: ExternalState) -> bool:
        """Is something at work that may be a contact?"""
        machine = state.machine
        return bool(machine[loop.OURS]) and machine[loop.STATE] in (loop.ON, loop.ENDS)

    def since(self, state: ExternalState) -> int:
        """First row of what is at work."""
        return int(state.machine[loop.START])

    def found(self, state: ExternalState) -> Contact | None:
        """What is known to be from outside: contacts that ended; on a standing machine at once."""
        machine, numbers, figures = state.machine, state.numbers, state.figures
        if machine[loop.FOUND]:
            part, levels = figures[:, loop.TOLD] > 0, figures[:, loop.TOLD]
            first, last = int(machine[loop.FIRST]), int(machine[loop.LAST])
        elif machine[loop.STATE] == loop.ON and self.on(state):
            part, last = numbers[:, loop.PART] != 0, -1
            if machine[loop.LATE] or (numbers[part, loop.BEGAN] != 0).any():
                return None
            levels = figures[:, loop.LEVEL] / np.maximum(figures[:, loop.ROWS], 1.0)
            first = self.since(state)
        else:
            return None
        which = np.flatnonzero(part).tolist()
        return Contact(
            tuple(self.names[k] for k in which), tuple(levels[which].tolist()), first, last
        )

    def beat(self, state: ExternalState) -> tuple[ExternalState, Told]:
        """What a beat has to say. Consumes ``state``."""
        contact, machine = self.found(state), state.machine
        goes_on = contact is not None and contact.last < 0
        lasts = machine[loop.STATE] == loop.LASTS and machine[loop.NEWS] > 0
        blind, own = machine[loop.BLIND] > self.rule[1], None
        if machine[loop.OWN]:
            own = Own(self.names[machine[loop.WHOSE]], int(machine[loop.OWN]) - 1)
            if contact is not None and contact.first >= own.first:
                contact = None
        told = Told(
            contact, contact is not None and not machine[loop.SAID],
            self.since(state) if lasts else -1, own, bool(blind),
        )  # fmt: skip
        machine[loop.SAID], machine[loop.OWN] = goes_on, 0
        machine[loop.FOUND], machine[loop.NEWS], state.figures[:, loop.TOLD] = 0, 0, 0.0
        machine[loop.BLIND] = -(2**62) if blind else machine[loop.BLIND]
        return state, told
