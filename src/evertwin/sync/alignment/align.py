"""Alignment: samples of several sources, as they arrive, become rows on one clock.

The clock is the union of all stamps (or a uniform grid). A row leaves when every source's newest
stamp less its slack has passed it, judged after each sample: so how the samples were cut into
chunks never matters, only their order of arrival, which is part of a recording. What comes later is
recorded and not folded. A silent source is waited for until a tick (a logged input, never the
machine's clock) says that its time-out is over. Memory is bounded: where a source would have to
keep more than ``depth`` samples, rows leave without the others.

What a row holds:

* a command (``hold``) acts from its stamp on, so a row's input is the newest one before its
  interval, and on a grid the mean over an interval that it changes within; it is marked held where
  it is older than the row before, and unknown where its value was lost
  (`evertwin.sync.alignment.lost_loop`);
* a measured input (``lines``) is the one at the row, interpolated where its source has none; where
  rows are cut at holes, it is marked late in a hole of its source: a lost sample or more;
* a number beyond `LARGEST` is no measurement: it counts as infinite;
* an output is there only where it was measured at that stamp (on a grid: interpolated).

>>> feeds = (Feed("wheels", ("v",)), Feed("camera", ("x",)))
>>> align = Align(Layout.of(v="m/s"), Layout.of(x="m"), feeds)
>>> state = align.init()
>>> state, out = align.step(state, Chunk("wheels", np.array([0, 20, 40]), np.ones((3, 1))))
>>> out.rows is None        # the camera may still send something earlier
True
>>> state, out = align.step(state, Chunk("camera", np.array([10, 30]), np.zeros((2, 1))))
>>> out.rows.t.tolist(), out.rows.block.y[:, 0].tolist()
([0, 10, 20, 30], [nan, 0.0, nan, 0.0])
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.fold import Chunk, Event, Out
from evertwin.fold.block import LARGEST
from evertwin.signals import Layout
from evertwin.sync.alignment import align_loop as loop
from evertwin.sync.alignment import lost_loop, pace_loop
from evertwin.sync.alignment import on_row_loop as on_row
from evertwin.sync.alignment.align_state import AlignNotes, AlignSettings, AlignState, Rows
from evertwin.sync.horizon.horizon import nanoseconds
from evertwin.sync.horizon.horizon_loop import NEVER
from evertwin.types import Float64, Stamps

NOTES = 64
WORTH = 64
"""Samples from which on whole columns are faster than the compiled loop."""
TICK = ""
"""Name of the source of ticks: chunks whose stamps say how late it is."""


@dataclass(frozen=True)
class Feed:
    """What one source brings.

    >>> Feed("camera", ("x", "y"), slack=0.05).timeout
    inf
    """

    name: str
    channels: tuple[str, ...]
    """Its columns in order; names that are no channel of the model are left out."""
    slack: float = 0.0
    """How far behind its newest sample another one may still come [s]."""
    timeout: float = float("inf")
    """Silent for this long before a tick, it is no longer waited for [s]."""
    offset: float = 0.0
    """Added to its stamps [s]: what its clock is behind, or minus its known transport lag."""
    framed: bool = False
    """Does a last column, beside the channels, number the frame that they are told in (NaN: as
    before)? Behind a border the state starts anew."""

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.channels) + self.framed


@dataclass(frozen=True)
class Align:
    """The stage. See the module for an example.

    >>> Align(Layout.of(v="m/s"), Layout.of(x="m"), (Feed("log", ("v", "x")),)).gap
    inf
    """

    inputs: Layout
    outputs: Layout
    feeds: tuple[Feed, ...]
    lines: tuple[str, ...] = ()
    """Inputs that are measurements: taken at the row, interpolated between their samples."""
    kept: tuple[str, ...] = ()
    """Inputs that are commands of which an empty cell is never one that was lost."""
    gap: float = float("inf")
    """Longest interval that is simulated over [s]; after a longer one the state starts anew."""
    rate: float | None = None
    """Rows per second on a uniform grid; None: the union of the stamps."""
    jump: float = float("inf")
    """Stamps further than this behind or ahead of all others [s] are kept out; when a source goes
    on like that, its clock was set anew and is followed."""
    cut: bool = False
    """Does a grid start anew behind a hole too (`evertwin.sync.alignment.align_loop.CUT`)? For rows
    that are differentiated or filtered: a straight line is no motion."""
    usual: bool = False
    """Does the state start anew too where nothing came for far longer than usual
    (`evertwin.sync.alignment.pace_loop.is_unusual`)?"""
    depth: int = 4096
    """Samples per source that may wait."""
    recorded: Mapping[str, str] = field(default_factory=dict)
    """Channel → what its source calls it; one that is not named is called the same."""

    def __post_init__(self) -> None:
        names = [name for feed in self.feeds for name in feed.channels]
        for name in (*self.inputs.names, *self.outputs.names):
            called = self.recorded.get(name, name)
            if names.count(called) != 1:
                raise UsageError(
                    f"channel {called!r}: expected exactly one source for it, got "
                    f"{names.count(called)}: the sources bring {', '.join(names)}"
                )
        for name in self.lines:
            self.inputs.index(name)
        if self.depth < 2 or not self.gap > 0 or not self.jump > 0:
            raise UsageError(
                f"expected depth ≥ 2, gap and jump above 0 s, got {self.depth}, {self.gap}, "
                f"{self.jump}"
            )
        if self.rate is not None and not 0 < self.rate < 1e9:
            raise UsageError(f"rate: expected a number of rows per second, got {self.rate}")

    @cached_property
    def _fixed(self) -> AlignSettings:
        plan = [(nanoseconds(feed.slack), nanoseconds(feed.timeout)) for feed in self.feeds]
        table = []
        for channel in self.inputs:
            how = loop.LINE if channel.name in self.lines else loop.HOLD
            loses = how == loop.HOLD and channel.name not in self.kept
            table.append((*self._place(channel.name), how, channel.kind == "angle", loses))
        for channel in self.outputs:
            table.append(
                (*self._place(channel.name), loop.MEASURED, channel.kind == "angle", False)
            )
        return AlignSettings(
            np.array(plan, dtype=np.int64), np.array(table, dtype=np.int64),
            nanoseconds(self.gap), 0.0 if self.rate is None else 1e9 / self.rate,
            nanoseconds(self.jump), self.cut and self.rate is not None, self.usual,
        )  # fmt: skip

    def _place(self, channel: str) -> tuple[int, int]:
        name = self.recorded.get(channel, channel)
        s = next(s for s, feed in enumerate(self.feeds) if name in feed.channels)
        return s, self.feeds[s].channels.index(name)

    @cached_property
    def _sources(self) -> dict[str, int]:
        return {feed.name: s for s, feed in enumerate(self.feeds)}

    def init(self) -> AlignState:
        """The state before the first sample."""
        ns, nc = len(self.feeds), len(self.inputs) + len(self.outputs)
        width = max(feed.width for feed in self.feeds)
        clock = np.zeros(11, dtype=np.int64)
        clock[[loop.TASK, loop.NOW]] = NEVER
        sources = np.zeros((ns, 16), dtype=np.int64)
        sources[:, on_row.NEWEST] = NEVER
        sources[:, on_row.FRAMED] = [len(one.channels) if one.framed else -1 for one in self.feeds]
        waiting = np.zeros((ns, self.depth), dtype=np.int64), np.zeros((ns, self.depth, width))
        known = np.full(nc, NEVER), np.full(nc, np.nan), np.full(nc, NEVER)
        habits = np.zeros((nc, lost_loop.TIMES + 1), dtype=np.int64)
        pace = np.zeros(pace_loop.FIRST + pace_loop.KNOWN, dtype=np.int64)
        pace[pace_loop.TAKEN] = NEVER
        return AlignState(clock, sources, *waiting, *known, habits, pace)

    def step(self, state: AlignState, block: Chunk) -> tuple[AlignState, Out]:
        """A chunk of samples, or of ticks (source ``""``).

        Raises:
            DataError: the source is unknown, or has another number of columns.
        """
        s = self.check(block)
        if s == loop.TICK:
            return self._run(state, block, s)
        if self.feeds[s].offset:
            block = block._replace(t=block.t + nanoseconds(self.feeds[s].offset))
        rows = self._straight(state, block)
        return (state, Out(rows)) if rows is not None else self._run(state, block, s)

    def check(self, block: Chunk) -> int:
        """Place of the source that a chunk is of; `TICK` has one of its own.

        Raises:
            DataError: the source is unknown, or has another number of columns.
        """
        if block.source == TICK:
            return loop.TICK
        s = self._sources.get(block.source, -1)
        if s < 0:
            known = ", ".join(self._sources)
            raise DataError(f"source {block.source!r}: expected one of {known}")
        width = self.feeds[s].width
        if block.v.shape != (len(block.t), width):
            raise DataError(
                f"source {block.source!r}: expected {width} columns "
                f"({', '.join(self.feeds[s].channels)}), got values of shape {block.v.shape}"
            )
        return s

    def row(self, state: AlignState) -> int:
        """Number of the next row."""
        return int(state.clock[loop.ROW])

    def flush(self, state: AlignState) -> tuple[AlignState, Out]:
        """Everything that waits, at the end of the data."""
        none = Chunk(TICK, np.zeros(1, dtype=np.int64), np.zeros((1, 0)))
        return self._run(state, none, loop.FINISH)

    def _run(self, state: AlignState, chunk: Chunk, s: int) -> tuple[AlignState, Out]:
        samples = np.ascontiguousarray(chunk.t), np.ascontiguousarray(chunk.v, dtype=np.float64)
        parts, events, start, count = [], [], 0, len(chunk.t)
        while start < count:
            rows = self._room(count - start + sum(state.sources[:, on_row.COUNT].tolist()) + 1)
            channels = len(self.inputs) + len(self.outputs)
            found = np.empty((NOTES + len(self.feeds) + channels, 6), dtype=np.int64)
            notes = AlignNotes(found, np.zeros(2, dtype=np.int64))
            start = loop.push(s, start, (*samples, chunk.task), self._fixed, state, rows, notes)
            given, said = notes.extent.tolist()
            if given:
                parts.append(Rows(*[column[:given] for column in rows]))
            events += [self._event(note) for note in found[:said].tolist()]
        if len(parts) < 2:
            return state, Out(parts[0] if parts else None, tuple(events))
        columns: Sequence[Any] = list(zip(*parts, strict=True))
        return state, Out(Rows(*map(np.concatenate, columns)), tuple(events))

    def _room(self, n: int) -> Rows:
        nu, ny = len(self.inputs), len(self.outputs)
        return Rows(
            np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n), np.empty((n, nu)),
            np.empty((n, ny)), np.empty((n, nu + ny), np.uint8), np.empty(n, np.int64),
            np.empty(n, np.bool_),
        )  # fmt: skip

    def _straight(self, state: AlignState, chunk: Chunk) -> Rows | None:
        """The rows of a single source without fault, whole columns at a time; None: not so."""
        clock, source = state.clock, state.sources[0]
        first = self.feeds[0]
        plain = len(self.feeds) == 1 and not (first.slack or first.framed) and self.rate is None
        if not plain or self.jump < float("inf") or len(chunk.t) < WORTH:
            return None
        begun = clock[loop.BEGUN] == 1 and clock[loop.TASK] == chunk.task
        calm = source[on_row.RUN] == 0 and source[on_row.QUIET] == 0 and source[on_row.COUNT] == 0
        if not (begun and calm and clock[loop.ANEW] == 0):
            return None
        t = chunk.t + (source[on_row.OFFSET] + clock[loop.SHIFT])
        columns = self._fixed.channels[:, on_row.COLUMN]
        values = chunk.v[:, columns]
        sound = np.isfinite(values).all() and not (np.abs(chunk.v) > LARGEST).any()
        if not (sound and t[0] > clock[loop.LAST] and (t[1:] > t[:-1]).all()):
            return None
        if self.usual or self.gap < float("inf"):
            pace = state.pace.copy()
            if not pace_loop.is_steady(pace, np.diff(t, prepend=clock[loop.LAST])):
                return None
            state.pace[:] = pace
        return self._columns(state, t, values, chunk)

    def _columns(
        self, state: AlignState, t: Stamps, values: Float64[np.ndarray, "n channels"], chunk: Chunk
    ) -> Rows:
        n, nu, clock = len(t), len(self.inputs), state.clock
        held = self._fixed.channels[:nu, on_row.HOW] == loop.HOLD
        u, mark = values[:, :nu].copy(), np.zeros(values.shape, dtype=np.uint8)
        u[1:, held] = values[:-1, :nu][:, held]
        u[0, held] = state.known_v[:nu][held]
        old = state.known_t[:nu] != clock[loop.LAST]
        mark[0, :nu][held & old] = on_row.HELD
        mark[0, :nu][held & np.isnan(state.known_v[:nu])] = on_row.ABSENT
        steps = np.diff(t, prepend=clock[loop.LAST])
        number = clock[loop.ROW] + np.arange(n)
        clock[loop.ROW] += n
        clock[loop.STEP] += n
        clock[loop.LAST] = state.sources[0, on_row.NEWEST] = t[-1]
        clock[loop.FORCED] = 0
        state.sources[0, on_row.TIMELY] += n
        # The ring turns by n places, as it does sample by sample.
        kept = min(n, self.depth)
        places = (state.sources[0, on_row.HEAD] + np.arange(n - kept, n)) % self.depth
        state.times[0, places], state.values[0, places] = t[-kept:], chunk.v[-kept:]
        state.sources[0, on_row.HEAD] = (state.sources[0, on_row.HEAD] + n) % self.depth
        state.known_t[:], state.known_v[:] = t[-1], values[-1]
        for k in np.flatnonzero(self._fixed.channels[:, on_row.LOSES]).tolist():
            lost_loop.given_all(
                state.habits, chunk.v, k, int(self._fixed.channels[k, on_row.COLUMN])
            )
        tasks, gap = np.full(n, chunk.task, dtype=np.int64), steps > self._fixed.gap
        state.pace[pace_loop.TAKEN] = t[-1]
        return Rows(
            number, t, steps * 1e-9, u, np.ascontiguousarray(values[:, nu:]), mark, tasks, gap
        )

    def _event(self, note: Sequence[int]) -> Event:
        row, s, kind, first, last, number = note
        if kind == loop.LOST:
            name = self.inputs.names[s]
            name = self.recorded.get(name, name)
        else:
            name = self.feeds[s].name if kind != loop.HOLE else ""
        word, text = _SAYS[kind]
        began = None if first == NEVER else first
        evidence: dict[str, Any] = {"first": began, "last": last, "samples": number}
        if kind == loop.HOLE:
            evidence = {"first": first, "last": last, "seconds": (last - first) * 1e-9}
        if kind == loop.LOST and number > lost_loop.SINGLY:
            text += f"; {number} times so far"
        if kind in (loop.JUMPED, loop.SHIFTED):
            evidence = {"stamp": first, "followed_as": last, "shift": number}
        return Event(
            row,
            last,
            word,
            name,
            text.format(name=name, number=number, seconds=(last - first) * 1e-9),
            evidence,
        )


_SAYS = {
    loop.IS_LATE: ("late", "{name}: {number} samples came after their row had left"),
    loop.IS_REPEATED: ("repeated", "{name}: {number} samples repeat a stamp"),
    loop.IS_FUTURE: ("future", "{name}: {number} stamps far ahead of all others"),
    loop.JUMPED: ("clock_jump", "{name}: its clock was set anew"),
    loop.IS_QUIET: ("silent", "{name}: silent beyond its time-out, no longer waited for"),
    loop.BACK: ("back", "{name}: sends again"),
    loop.OVERFLOW: ("overflow", "{number} samples wait: rows leave without the silent sources"),
    loop.HOLE: (
        "gap",
        "nothing came for {seconds:.4g} s, far longer than usual: the state is measured "
        "anew behind such a gap, and no prediction runs over it",
    ),
    loop.LOST: (
        "unknown",
        "{name} has no value here, and had one beside each measurement before: what acts until its "
        "next one is unknown, and predictions begin anew behind it",
    ),
    loop.SHIFTED: ("task_shifted", "the task's stamps lie before the one before: moved behind it"),
}
