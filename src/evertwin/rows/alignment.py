"""The one way in: samples of all sources become the model's rows, recorded and live alike.

`Align` puts the samples onto one clock, `Derive` adds the channels that are computed from them.
Both judge sample by sample, so the same samples give the same rows bit for bit, whether they are
read from files or pushed one at a time.

>>> from evertwin.config.spec import ModelSpec, TwinSpec
>>> from evertwin.machines.mobile import Robot1D
>>> spec = TwinSpec("cart", ModelSpec("robot1d"))
>>> way = Alignment.of(spec, Robot1D(), (Feed("log", ("v", "x")),))
>>> chunk = Chunk("log", np.array([0, 10**9]), np.array([[0.1, 0.0], [0.1, 0.1]]))
>>> state, block, events = way.step(way.init(), chunk)
>>> block.u[:, 0].tolist(), block.y[:, 0].tolist()
([0.1, 0.1], [0.0, 0.1])
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from evertwin.config import TwinSpec
from evertwin.errors import ConfigError
from evertwin.features.images.confusion_drift import ConfusionDrift, DriftState
from evertwin.features.perception import PerceptionState
from evertwin.fold import Block, Chunk, Event, concatenate
from evertwin.models import Model, remembers
from evertwin.models.contract import is_adopted
from evertwin.rows.channels import is_held, is_kept, is_measured, recorded_as
from evertwin.rows.labelling import watched
from evertwin.rows.perceiving import Perceiving, with_pose
from evertwin.rows.smoothing import low_pass
from evertwin.signals import Channel, Layout
from evertwin.signals.units import compatible
from evertwin.sources.columns.scans import Lidar
from evertwin.sync import Align, AlignState, Feed, Rows
from evertwin.sync.alignment.align import TICK
from evertwin.sync.alignment.derive import Derive, DeriveState, Operation, Taken
from evertwin.sync.alignment.steady_loop import LONGEST
from evertwin.sync.horizon.horizon import nanoseconds

QUIET = ("task_shifted",)
"""Notes of the alignment that are no event of the machine."""
WIDE, FORGOTTEN = ("filter", "derivative", "slope"), 5.0
"""Operations that look at neighbouring rows; time constants after which nothing is left of one."""
SPEEDS, PLACES = ("derivative", "slope"), ("m", "rad")
"""Operations that take a difference; units of a place."""
DRIVEN = ("m/s", "rad/s")
"""Units of inputs that drive a machine."""
AT_ROW, HELD = "", "held "
"""Before the name of a column: the value at the row, or the one held over its interval."""


class AlignmentState(NamedTuple):
    """State of `Alignment`.

    >>> AlignmentState._fields
    ('align', 'derive', 'perceived', 'labelled')
    """

    align: AlignState
    derive: DeriveState
    perceived: PerceptionState | tuple[()] = ()
    """Empty where no pose is made of scans."""
    labelled: DriftState | tuple[()] = ()
    """Empty where no labels are watched."""


@dataclass(frozen=True)
class Alignment:
    """The stage. See the module for an example."""

    align: Align
    derive: Derive
    perceiving: Perceiving | None = None
    labels: ConfusionDrift | None = None

    @classmethod
    def of(
        cls, spec: TwinSpec, model: Model, feeds: Sequence[Feed], lidar: Lidar | None = None
    ) -> Alignment:
        """As the twin file says, for sources that bring ``feeds``; ``lidar``: where recorded beams
        look.

        Raises:
            ConfigError: a channel is neither recorded nor derived, or an operation lacks a rate.
        """
        every, feeds = feeds, with_pose(spec, recorded_for(spec, model), feeds)
        speeds = [recorded_as(spec, one.name) for one in model.inputs if one.unit in DRIVEN]
        perceiving = Perceiving.of(spec, every, feeds, lidar, speeds)
        operations = _operations(spec)
        dynamic = len(model.states) > 0
        computed = {one.name for one in operations}
        inputs = [_input(spec, name, computed, dynamic) for name in model.inputs.names]
        outputs = [
            Taken(recorded_as(spec, name) if is_measured(spec, name) else None)
            for name in model.outputs.names
        ]
        angles = {
            recorded_as(spec, c.name) for c in (*model.inputs, *model.outputs) if c.kind == "angle"
        } | {name for one in spec.derive if one.op == "unwrap" for name in one.source}
        # angles that are cut at a turn leap, and an output is judged by the model
        others = {*angles, *(one.column for one in outputs)}
        goes, read = _moving(operations, inputs), [] if dynamic else [n.column for n in inputs]
        # of a place whose speed is recorded that tells the rest, and its unit late
        some = [n for n in dict.fromkeys([*goes, *read]) if n and n in _places(spec) - others]
        operations = (*(Operation(n, "steady", (n,), float(n in goes)) for n in some), *operations)
        columns = _columns(operations, inputs, outputs, feeds)
        operations = _used(operations, [one.column for one in (*inputs, *outputs)])
        held, measured = (
            Layout(tuple(Channel(name, "1", _kind(name, angles)) for name in some))
            for some in (columns.inputs, columns.outputs)
        )
        lines = tuple(name for name in columns.inputs if not name.startswith(HELD))
        asked = (name for name in model.inputs.names if is_kept(spec, name))
        kept, clock = tuple(f"{HELD}{recorded_as(spec, name)}" for name in asked), spec.clock
        known = np.array([one.column is not None for one in outputs], dtype=bool)
        align = Align(
            held, measured, tuple(feeds), lines, kept, np.inf if clock.gap is None else clock.gap,
            clock.rate, recorded={n: n.removeprefix(HELD) for n in columns.inputs},
            cut=any(one.op in WIDE for one in operations),
            usual=clock.gap is None and (is_adopted(model, known) or remembers(model)),
        )  # fmt: skip
        span = tuple(
            nanoseconds(edge) if np.isfinite(edge) else int(np.sign(edge)) * 2**62
            for edge in (clock.start, clock.stop)
        )
        derive = Derive(
            (*columns.inputs, *columns.outputs), operations, tuple(inputs), tuple(outputs),
            clock.rate, (span[0], span[1]), static=not dynamic,
        )  # fmt: skip
        return cls(align, derive, perceiving, watched(spec))

    @cached_property
    def plain(self) -> bool:
        """Does the alignment give the model's rows already?"""
        taken = tuple(one.column for one in (*self.derive.inputs, *self.derive.outputs))
        uncut = self.derive.span == (-(2**62), 2**62)
        return taken == self.derive.columns and not self.derive.operations and uncut

    @property
    def delay(self) -> int:
        """Rows by which a row leaves late, beside the slack of the sources."""
        return 0 if self.plain else self.derive.delay

    def init(self) -> AlignmentState:
        """The state before the first sample."""
        perceived = () if self.perceiving is None else self.perceiving.init()
        labelled = () if self.labels is None else self.labels.init()
        return AlignmentState(self.align.init(), self.derive.init(), perceived, labelled)

    def takes(self, source: str) -> bool:
        """Are poses made of the arrays of a source, or are they labels that are watched?"""
        scan = self.perceiving is not None and source == self.perceiving.rule.scan
        return scan or self._labelled(source)

    def _labelled(self, source: str) -> bool:
        return self.labels is not None and source == self.labels.source

    def check(self, chunk: Chunk) -> None:
        """Does a chunk fit its source?

        Raises:
            DataError: the source is unknown, or has another number of columns.
        """
        if self.labels is not None and self._labelled(chunk.source):
            self.labels.check(chunk)
        elif self.perceiving is None or self.perceiving.check(chunk):
            self.align.check(chunk)

    def step(
        self, state: AlignmentState, chunk: Chunk
    ) -> tuple[AlignmentState, Block | None, tuple[Event, ...]]:
        """More samples of one source. Consumes ``state``.

        Raises:
            DataError: the source is unknown, or has another number of columns.
        """
        if self.labels is not None and self._labelled(chunk.source):
            assert isinstance(state.labelled, DriftState)
            labelled, out = self.labels.step(state.labelled, chunk)
            row, told = self.align.row(state.align), _told(out.records)
            events = tuple(replace(event, row=row) for event in told)
            return state._replace(labelled=labelled), None, events
        if self.perceiving is None or chunk.source == TICK:
            return self._aligned(state, chunk)
        self.check(chunk)
        assert isinstance(state.perceived, PerceptionState)
        state, given = self._taken(state, *self.perceiving.step(state.perceived, chunk))
        return state, *_joined(given)

    def _taken(
        self, state: AlignmentState, perceived: PerceptionState, pieces: Sequence[Chunk | Event]
    ) -> tuple[AlignmentState, list[_Given]]:
        """What came of each piece: of samples, or of what is to be told before the next row."""
        state, given = state._replace(perceived=perceived), []
        for piece in pieces:
            if isinstance(piece, Event):
                event = replace(piece, row=self.align.row(state.align))
                given.append(_Given(None, (event,)))
                continue
            state, rows, events = self._aligned(state, piece)
            given.append(_Given(rows, events))
        return state, given

    def _aligned(
        self, state: AlignmentState, chunk: Chunk
    ) -> tuple[AlignmentState, Block | None, tuple[Event, ...]]:
        aligned, out = self.align.step(state.align, chunk)
        derived, rows, wrong = self._derived(state.derive, out.rows, ends=False)
        state = state._replace(align=aligned, derive=derived)
        return state, rows, (*_told(out.records), *wrong)

    def flush(
        self, state: AlignmentState
    ) -> tuple[AlignmentState, Block | None, tuple[Event, ...]]:
        """The rows that wait leave, since the data ends here."""
        given = list[_Given]()
        if self.perceiving is not None:
            assert isinstance(state.perceived, PerceptionState)
            state, given = self._taken(state, *self.perceiving.flush(state.perceived))
        aligned, out = self.align.flush(state.align)
        derived, rows, wrong = self._derived(state.derive, out.rows, ends=True)
        given.append(_Given(rows, (*_told(out.records), *wrong)))
        return state._replace(align=aligned, derive=derived), *_joined(given)

    def _derived(
        self, state: DeriveState, rows: Rows | None, *, ends: bool
    ) -> tuple[DeriveState, Block | None, tuple[Event, ...]]:
        if self.plain:
            return state, None if rows is None else rows.block, ()
        parts, wrong = list[Rows | None](), tuple[Event, ...]()
        if rows is not None:
            state, left, wrong = self.derive.step(state, rows)
            parts.append(left)
        if ends:
            state, left, more = self.derive.flush(state)
            parts.append(left)
            wrong += more
        found = [part for part in parts if part is not None]
        if not found:
            return state, None, wrong
        whole = Rows(*(np.concatenate(column) for column in zip(*found, strict=True)))
        return state, whole.block, wrong


class _Given(NamedTuple):
    """What came of one piece."""

    rows: Block | None
    events: tuple[Event, ...]


def _joined(given: Sequence[_Given]) -> _Given:
    blocks = [one.rows for one in given if one.rows is not None]
    events = tuple(event for one in given for event in one.events)
    return _Given(concatenate(blocks) if blocks else None, events)


class _Columns(NamedTuple):
    inputs: tuple[str, ...]
    """Held (with their prefix) and measured at the row."""
    outputs: tuple[str, ...]
    """There only where they were measured."""


def _input(spec: TwinSpec, name: str, computed: set[str], dynamic: bool) -> Taken:
    column = recorded_as(spec, name)
    if not is_held(spec, name, dynamic):
        return Taken(column, "line")
    return Taken(column, "step") if column in computed else Taken(f"{HELD}{column}", "held")


def _columns(
    operations: Sequence[Operation], inputs: Sequence[Taken], outputs: Sequence[Taken],
    feeds: Sequence[Feed],
) -> _Columns:  # fmt: skip
    """What the alignment has to give: each recorded channel as often as it is taken differently.

    What an output is made of is there where it was measured; what inputs alone are made of is
    taken at the row, interpolated where its source has nothing there.
    """
    recorded = {name for feed in feeds for name in feed.channels}
    of_outputs = _sources(operations, [one.column for one in outputs])
    of_inputs = _sources(operations, [one.column for one in inputs if one.how != "held"])
    held = dict.fromkeys(one.column or "" for one in inputs if one.how == "held")
    for name in (*(n.removeprefix(HELD) for n in held), *of_outputs, *of_inputs):
        if name not in recorded:
            there = ", ".join(sorted(recorded | {one.name for one in operations}))
            raise ConfigError(
                f"channel {name!r} is neither recorded nor derived: there are {there}; name it in "
                f"[source.channels] or [[derive]], or say [signals.{name}] from = …"
            )
    lines = [name for name in of_inputs if name not in of_outputs]
    return _Columns((*held, *lines), tuple(of_outputs))


def _moving(operations: Sequence[Operation], inputs: Sequence[Taken]) -> list[str]:
    """Recorded channels of which an input's speed is derived."""
    of_inputs = _sources(operations, [one.column for one in inputs])
    derived = {s for one in operations if one.op in SPEEDS for s in one.source}
    return [name for name in of_inputs if name in derived]


def _places(spec: TwinSpec) -> set[str | None]:
    """Channels that are recorded as ways or angles: a push may change a speed at once, no place."""
    units = {name: c.unit for source in spec.source for name, c in source.channels.items()}
    return {name for name, unit in units.items() if any(compatible(unit, of) for of in PLACES)}


def _used(operations: Sequence[Operation], wanted: Iterable[str | None]) -> tuple[Operation, ...]:
    """The operations that a wanted column comes from, in order."""
    needed, kept = set(wanted), []
    for one in reversed(operations):
        if one.name in needed:
            needed.update(one.source)
            kept.append(one)
    return tuple(reversed(kept))


def _sources(operations: Sequence[Operation], wanted: Iterable[str | None]) -> dict[str, None]:
    """Recorded channels that these columns are made of, in order."""
    computed: dict[str, list[Operation]] = {}
    for one in operations:
        computed.setdefault(one.name, []).append(one)
    found: dict[str, None] = {}
    seen: set[str] = set()
    waiting = [name for name in wanted if name is not None]
    while waiting:
        name = waiting.pop(0)
        if name in seen:
            continue
        seen.add(name)
        sources = [s for one in computed.get(name, ()) for s in one.source]
        if name not in computed or name in sources:
            found[name] = None
        waiting += sources
    return found


def recorded_for(spec: TwinSpec, model: Model) -> tuple[str, ...]:
    """The recorded channels that a model's inputs and measured outputs are made of.

    >>> from evertwin.config.spec import ModelSpec, TwinSpec
    >>> from evertwin.machines.mobile import Robot1D
    >>> recorded_for(TwinSpec("cart", ModelSpec("robot1d")), Robot1D())
    ('v', 'x')
    """
    measured = [name for name in model.outputs.names if is_measured(spec, name)]
    wanted = [recorded_as(spec, name) for name in (*model.inputs.names, *measured)]
    return tuple(_sources(_operations(spec), wanted))


def _operations(spec: TwinSpec) -> tuple[Operation, ...]:
    """The filter over recorded channels first, then what is derived, in the order written."""
    rule = spec.filter
    filtered, lagged, lag = ((), (), 0.0) if rule is None else (rule.inputs, rule.lagged, rule.lag)
    smooth = low_pass(spec) if filtered else None
    first = [Operation(name, "filter", (name,), low_pass=smooth) for name in filtered]
    first += [Operation(name, "lag", (name,), lag) for name in lagged]
    derived = (
        Operation(
            o.name, o.op, tuple(o.source), o.value, low_pass(spec) if o.op == "filter" else None
        )
        for o in spec.derive
    )  # fmt: skip
    return (*first, *derived)


def reach(spec: TwinSpec) -> int:
    """Rows on either side that a row is computed from, at most."""
    wide, rate = [one for one in _operations(spec) if one.op in WIDE], spec.clock.rate or 0.0
    rows, lag = {"derivative": LONGEST + 1}, 0.0 if spec.filter is None else spec.filter.lag
    return math.ceil(FORGOTTEN * lag * rate) + sum(
        one.low_pass.delay if one.low_pass else rows.get(one.op, round(0.5 * one.value * rate))
        for one in wide
    )


def apart(spec: TwinSpec) -> int:
    """Rows apart from which on two rows share hardly any noise: none is left where a filter has
    passed half a period of its cutoff."""
    rule, rate = spec.filter, spec.clock.rate or 0.0
    band = 0 if rule is None else math.ceil(0.5 * rate / rule.cutoff)
    wide = (1 if one.op == "derivative" else round(0.5 * one.value * rate)
            for one in spec.derive if one.op in WIDE and one.op != "filter")  # fmt: skip
    return band + 2 * sum(wide) + 1


def _kind(name: str, angles: set[str]) -> Literal["angle", "linear"]:
    return "angle" if name.removeprefix(HELD) in angles else "linear"


def _told(records: Iterable[object]) -> tuple[Event, ...]:
    return tuple(r for r in records if isinstance(r, Event) and r.kind not in QUIET)
