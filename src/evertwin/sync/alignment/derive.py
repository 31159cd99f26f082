"""Channels computed from others, in the stream: filters, derivatives, sums, ways.

Behind the alignment each row holds what was recorded. Here columns are added, one operation after
the other, and what the model takes leaves. An operation that looks ahead (a symmetric filter, a
derivative) makes rows leave later: `Derive.delay` says how much. Nothing waits longer, so watching
a machine and reading its recording give the same rows.

A gap ends a stretch: no operation looks across it. At both ends a derivative is one-sided and a
filter goes on with the point reflection of the stretch; outputs there are absent, so that what a
filter makes of an end is compared with nothing. What a speed is derived from goes ``steady``: a few
rows that leave it and are back are taken from their neighbours.

>>> from evertwin.sync.alignment.align_state import Rows
>>> t = np.arange(5) * 10**9
>>> one = np.ones(5)
>>> rows = Rows(np.arange(5), t, one, np.zeros((5, 0)), np.arange(5.0)[:, None] ** 2,
...             np.zeros((5, 1), np.uint8), np.zeros(5, np.int64), np.arange(5) == 0)
>>> stage = Derive(("x",), (Operation("v", "derivative", ("x",)),), (), (Taken("v"),))
>>> state, left, _ = stage.step(stage.init(), rows)
>>> left.y[:, 0].tolist()
[1.0, 2.0, 4.0, 6.0]
>>> stage.flush(state)[1].y[:, 0].tolist()
[7.0]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from evertwin.errors import ConfigError
from evertwin.fold import Event
from evertwin.signals.fir import Symmetric, slopes
from evertwin.sync.alignment import derive_loop as loop
from evertwin.sync.alignment.align_state import Rows
from evertwin.sync.alignment.steady_loop import LONGEST
from evertwin.types import Vector

CODES = {
    "filter": loop.FILTER, "derivative": loop.DERIVATIVE, "slope": loop.SLOPE,
    "middle": loop.MIDDLE, "along": loop.ALONG, "way": loop.WAY, "path": loop.PATH, "sum": loop.SUM,
    "mean": loop.MEAN, "difference": loop.DIFFERENCE, "product": loop.PRODUCT,
    "scale": loop.SCALE, "norm": loop.NORM, "max": loop.MAX, "unwrap": loop.UNWRAP,
    "steady": loop.STEADY, "lag": loop.LAG,
}  # fmt: skip
"""The operations, by name."""
SOURCES = {"along": 3, "way": 3, "path": 3, "difference": 2}
"""Channels that an operation needs, where it is not any number; one where it takes one row each."""
ONE = ("filter", "derivative", "slope", "middle", "scale", "unwrap", "steady", "lag")
HOW = {"held": loop.HELD_INPUT, "line": loop.LINE_INPUT, "step": loop.STEP_INPUT}
FOREVER = 2**62
SAYS = {
    loop.BEGINS: (
        "measurement_error",
        "leaves where it was far faster than it ever went, and comes back as fast: taken from "
        "the rows around",
    ),
    loop.ENDS: ("measurement_restored", "back between the rows around"),
    loop.LEAPS: (
        "leapt",
        "went far faster than ever from one row to the next, and goes on from there: its zero "
        "moved, which is taken away",
    ),
    loop.THAWS: (
        "measurement_restored",
        "went on at once from far away: what was wrong until then, frozen or in another unit, is "
        "over",
    ),
    loop.SCALED: (
        "measurement_error",
        "place and speed are {:.3g} times what they were one row before, as in another unit; "
        "nothing is learned from it",
    ),
}
"""Kind and reason of an event."""


@dataclass(frozen=True)
class Operation:
    """One computed column.

    >>> Operation("qdd", "derivative", ("qd",)).value
    1.0
    """

    name: str
    op: str
    """One of `CODES`."""
    source: tuple[str, ...]
    """Columns that it is computed from, recorded or computed before."""
    value: float = 1.0
    """Factor of ``scale``; 0: of ``steady`` only the unit; seconds of ``slope`` and of ``lag``, a
    first-order low pass."""
    low_pass: Symmetric | None = None
    """Of ``filter``."""

    def __post_init__(self) -> None:
        needed = 1 if self.op in ONE else SOURCES.get(self.op)
        if needed is not None and len(self.source) != needed:
            raise ConfigError(
                f"[[derive]] {self.name}: {self.op} takes {needed} channels in 'from', got "
                f"{len(self.source)}"
            )


class Taken(NamedTuple):
    """A column as the model takes it.

    >>> Taken("v", "step").how
    'step'
    """

    column: str | None
    """None: an output that nothing measures."""
    how: Literal["held", "line", "step"] = "line"
    """Inputs: ``held`` by the alignment already, measured at the row, or a command whose newest
    value before the interval counts."""


class DeriveState(NamedTuple):
    """State of `Derive`: rows that wait, in a ring.

    >>> DeriveState._fields
    ('counters', 'ring', 'memory')
    """

    counters: loop.Counters
    ring: loop.Lines
    memory: loop.Memory


@dataclass(frozen=True)
class Derive:
    """The stage. See the module for an example.

    >>> Derive(("x",), (), (Taken("x"),), ()).delay
    0
    """

    columns: tuple[str, ...]
    """What the alignment gives, in order: its inputs, then its outputs."""
    operations: tuple[Operation, ...]
    inputs: tuple[Taken, ...]
    outputs: tuple[Taken, ...]
    rate: float | None = None
    """Rows per second on a uniform grid; None: as they come."""
    span: tuple[int, int] = field(default=(-FOREVER, FOREVER))
    """First and last stamp that stay, from the start of their task [ns]."""
    static: bool = False
    """Are inputs taken as they are, by no state? One in another unit is not known then."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All columns, recorded and computed."""
        return (*self.columns, *(one.name for one in self.operations))

    def _column(self, name: str, before: int) -> int:
        """The newest column of that name among the first ``before``.

        Raises:
            ConfigError: it is neither recorded nor computed.
        """
        known = self.names[:before]
        if name not in known:
            raise ConfigError(
                f"channel {name!r} is neither recorded nor derived: there are "
                f"{', '.join(dict.fromkeys(known))}; name it in [source.channels] or [[derive]], "
                f"or say [signals.{name}] from = …"
            )
        return before - 1 - known[::-1].index(name)

    def _weights(self, one: Operation) -> tuple[int, Vector]:
        """Rows that the operation looks ahead, and its weights."""
        if one.op in ("derivative", "steady"):
            return 1 if one.op == "derivative" else LONGEST, np.zeros(0)
        if one.op == "filter":
            assert one.low_pass is not None
            return one.low_pass.delay, one.low_pass.half
        if one.op != "slope":
            return 0, np.zeros(0)
        if self.rate is None:
            raise ConfigError(f"[[derive]] {one.name}: a slope needs a [clock] rate")
        window = 2 * round(0.5 * one.value * self.rate) + 1
        if not 5 <= window <= 4097:
            raise ConfigError(
                f"[[derive]] {one.name}: value = {one.value:g} s is {window} rows, a cubic needs "
                "5 to 4097"
            )
        return window // 2, slopes(window, self.rate).ravel()

    @cached_property
    def _lags(self) -> tuple[int, ...]:
        """Rows by which each column comes late."""
        lags = [0] * len(self.columns)
        for k, one in enumerate(self.operations):
            before = len(self.columns) + k
            sources = [lags[self._column(name, before)] for name in one.source]
            lags.append(max(sources) + int(self.program.ahead[k]))
        return tuple(lags)

    @cached_property
    def program(self) -> loop.Program:
        """The operations as numbers.

        Raises:
            ConfigError: a channel is not there, or an operation needs what is missing.
        """
        most = max((len(one.source) for one in self.operations), default=1)
        sources = np.full((len(self.operations), most), -1, dtype=np.int64)
        ahead, start, weights = [], [], [np.zeros(1)]
        for k, one in enumerate(self.operations):
            for m, name in enumerate(one.source):
                sources[k, m] = self._column(name, len(self.columns) + k)
            rows, found = self._weights(one)
            ahead.append(rows)
            start.append(sum(len(part) for part in weights))
            weights.append(found)
        table = [(self._place(one), HOW[one.how]) for one in self.inputs]
        table += [(self._place(one), loop.OUTPUT) for one in self.outputs]
        edge = max((a for a, one in zip(ahead, self.operations) if one.op == "filter"), default=0)
        return loop.Program(
            np.array([CODES[one.op] for one in self.operations], dtype=np.int64), sources,
            np.array([one.value for one in self.operations], dtype=np.float64),
            np.array(ahead, dtype=np.int64), np.array(start, dtype=np.int64),
            np.concatenate(weights), np.array(table, dtype=np.int64).reshape(-1, 2),
            np.array([*self.span, edge, self.static], dtype=np.int64),
        )  # fmt: skip

    def _place(self, one: Taken) -> int:
        return -1 if one.column is None else self._column(one.column, len(self.names))

    @property
    def delay(self) -> int:
        """Rows by which a row leaves late; more only at the start of a stretch."""
        return max(self._lags, default=0)

    def init(self) -> DeriveState:
        """Nothing waits."""
        wide, depth = len(self.names), 2 * self.delay + 2 * int(self.program.ahead.sum()) + 3
        counters = np.zeros(8, dtype=np.int64)
        counters[loop.TASK] = -1
        ring = loop.Lines(
            np.zeros(depth, np.int64), np.zeros(depth), np.zeros((depth, wide)),
            np.zeros((depth, wide), np.uint8),
        )  # fmt: skip
        memory = loop.Memory(
            np.zeros(wide, np.int64), np.zeros((len(self.operations), 10)),
            np.full(len(self.inputs) + len(self.outputs), np.nan),
        )  # fmt: skip
        return DeriveState(counters, ring, memory)

    def step(
        self, state: DeriveState, rows: Rows
    ) -> tuple[DeriveState, Rows | None, tuple[Event, ...]]:
        """Aligned rows in, the model's rows out ``delay`` later, and what of them was wrong.
        Consumes ``state``."""
        return self._advance(state, rows, ends=False)

    def flush(self, state: DeriveState) -> tuple[DeriveState, Rows | None, tuple[Event, ...]]:
        """The rows that wait leave, since the data ends here."""
        raw = len(self.columns)
        none = Rows(
            np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 0)),
            np.zeros((0, raw)), np.zeros((0, raw), np.uint8), np.zeros(0, np.int64),
            np.zeros(0, np.bool_),
        )  # fmt: skip
        return self._advance(state, none, ends=True)

    def _advance(
        self, state: DeriveState, rows: Rows, *, ends: bool
    ) -> tuple[DeriveState, Rows | None, tuple[Event, ...]]:
        v = np.concatenate([rows.u, rows.y], axis=1)
        lines = loop.Lines(rows.t, rows.dt, v, rows.mark)
        room = self._room(len(rows.t) + len(state.ring.t))
        left = loop.advance(
            self.program, state.ring, state.memory, state.counters, lines, rows.task, rows.gap,
            room, ends,
        )  # fmt: skip
        if not left:
            return state, None, ()
        return state, Rows(*(column[:left] for column in room[:-2])), self._told(room, left)

    def _told(self, room: loop.Room, left: int) -> tuple[Event, ...]:
        """Of what goes steadily: where it was wrong, and right again."""
        return tuple(
            Event(
                int(room.number[row]), int(room.t[row]), kind, self.operations[k].name,
                reason.format(room.times[row, k]),
                {"onset": int(room.number[row]), "open": True} if code == loop.SCALED else {},
            )
            for row, k in np.argwhere(room.wrong[:left]).tolist()
            for code in (int(room.wrong[row, k]),)
            for kind, reason in (SAYS[code],)
        )  # fmt: skip

    def _room(self, n: int) -> loop.Room:
        nu, ny = len(self.inputs), len(self.outputs)
        return loop.Room(
            np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n), np.empty((n, nu)),
            np.empty((n, ny)), np.empty((n, nu + ny), np.uint8), np.empty(n, np.int64),
            np.empty(n, np.bool_), np.zeros((n, len(self.operations)), np.uint8),
            np.zeros((n, len(self.operations))),
        )  # fmt: skip
