"""Track: the machine's state, followed by simulation and measurement together.

One fused loop simulates a row, judges what was measured (`evertwin.sync.arbiter`) and adopts it
where that is asked for. State holds the model's state, its parameters, and everything the arbiter
remembers, in arrays of fixed shape: a shadow is a second state.

The marks that come out are those known at the row: a contested sample is marked at once, and the
record of the vote, keyed by the row where it was decided, names the first and the last row, so that
learning a correction can use them afterwards. Tuning never sees them.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel
>>> from evertwin.signals import Layout
>>> robot = FunctionModel(lambda x, u, dt, p: ([x[0] + u[0] * dt],) * 2,
...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
>>> t = np.arange(100)
>>> x = 0.1 * t + 0.01 * np.sin(7.0 * t)
>>> x[50] += 3.0
>>> rows = make_block(t=t * 10**8, u=np.ones((100, 1)), y=x[:, None])
>>> stage = Track(robot, Arbiter(Rule(use="tolerance", tolerance=0.05, sigma=0.01)))
>>> state, out = stage.step(stage.init(), rows)
>>> [(e.kind, e.evidence["onset"], e.evidence["samples"]) for e in out.records]
[('measurement_error', 50, 1)]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evertwin.fold import Block, Event, Out
from evertwin.models import Kernel, Model, kernel_of, remembers
from evertwin.models.functions.failures import failures_in
from evertwin.models.kernels.kernel import looped
from evertwin.signals import Channel, Layout
from evertwin.signals.mistaken import numbers
from evertwin.signals.units import powers
from evertwin.sync import places as at
from evertwin.sync.arbiter.arbiter import Arbiter, Rule, describe, members
from evertwin.sync.horizon.horizon import contiguous
from evertwin.sync.horizon.horizon_loop import NEVER
from evertwin.sync.track.track_loop import run
from evertwin.sync.track_state import (
    FAILED,
    FAILING,
    FIRST_FAILED,
    UNKNOWN,
    Notes,
    TrackRows,
    TrackSettings,
    TrackState,
)
from evertwin.types import Bools, ParameterVector

__all__ = ["Arbiter", "Rule", "Track"]


@dataclass(frozen=True)
class Track:
    """The fused stage. See the module for an example.

    >>> Track.__name__
    'Track'
    """

    model: Model
    arbiter: Arbiter = Arbiter()
    gates: tuple[tuple[int, int, float], ...] = ()
    """(output, input, threshold): the output moves where the input is larger."""

    def __post_init__(self) -> None:
        _ = self._settings

    @cached_property
    def _kernel(self) -> Kernel:
        return kernel_of(self.model)

    @cached_property
    def adopts(self) -> Bools:
        """Which outputs `observe` can adopt, found by trying, (ny,)."""
        p = self.model.parameters.values
        x = self.model.initial(p)
        tried = np.zeros(len(self.model.outputs), dtype=np.bool_)
        for j in range(len(tried)):
            y = np.full(len(tried), np.nan)
            y[j] = 0.4142
            tried[j] = bool((self.model.observe(x, y) != x).any())
        return tried

    @property
    def _moves(self) -> np.ndarray:
        """What says whether each output moves, (ny, 2)."""
        found = np.tile([-1.0, 0.0], (len(self.model.outputs), 1))
        for k, column, above in self.gates:
            found[k] = column, above
        return found

    @cached_property
    def _settings(self) -> TrackSettings:
        inputs, outputs, phases = self.model.inputs, self.model.outputs, self.arbiter.phases
        column = inputs.index(phases.channel) if phases else -1
        edges = np.array(phases.edges if phases else (), dtype=np.float64)
        return TrackSettings(
            np.hstack([
                self.arbiter.limits(outputs, self.adopts), self._moves, _moved_by(inputs, outputs),
                _tried(outputs),
            ]),
            self.arbiter.rules(outputs),
            np.array(self.arbiter.sentinels, dtype=np.float64), members(outputs), column, edges,
            np.array([_bounds(one) for one in inputs]).reshape(-1, 2 + len(at.FACTORS)),
            remembers(self.model),
        )  # fmt: skip

    def init(self) -> TrackState:
        """The state before the first row, with the model's own parameters."""
        p, outputs = self.model.parameters.values, self.model.outputs
        x0, ny, ng = self.model.initial(p), len(outputs), len(outputs.groups)
        nu = len(self.model.inputs)
        phases = self.arbiter.phases
        kinds = len(phases.edges) + 2 if phases else 1
        vote = int(self._settings.rules[:, at.VOTE].max()) if ng else 2
        sigma = self.arbiter.sigmas(outputs)
        variance, counts = np.zeros((kinds, ny)), np.zeros((kinds, ny), dtype=np.int64)
        # An innovation is the difference of two measurements.
        variance[-1], counts[-1] = 2.0 * sigma**2, np.where(sigma > 0, at.LEARN, 0)
        values = np.zeros((ny, at.VALUES))
        values[:, at.TOP], values[:, at.BOTTOM] = -np.inf, np.inf
        values[:, [at.AFTER, at.NU_BEFORE, at.OTHER]], values[:, at.BASE] = np.nan, np.inf
        values[:, at.SQUARE] = np.where(sigma > 0, sigma**2, np.inf)
        numbers = np.zeros((ng, at.NUMBERS), dtype=np.int64)
        numbers[:, [at.GOOD_AT, at.LAST_AT, at.HEARD]] = NEVER
        return TrackState(
            x0.copy(), p, x0, values, numbers, np.zeros((ng, at.FIGURES)), variance, counts,
            np.zeros((at.LEARN, ny)), np.zeros((vote, ny)), np.zeros((vote, ny)),
            np.zeros((vote, ng), dtype=np.int64), np.zeros((vote, ng), dtype=np.int64),
            np.zeros((vote, ny)), np.zeros((nu, at.RANGES)),
            np.zeros((nu, at.BELIEFS), dtype=np.int64), np.zeros(5, dtype=np.int64), x0.copy(),
            np.zeros((ny, at.ACCOUNT)), np.zeros(6, dtype=np.int64), np.zeros((ng, len(x0))),
        )  # fmt: skip

    def renew(self, state: TrackState, p: ParameterVector) -> TrackState:
        """The state with other parameters; everything else runs on. Consumes ``state``."""
        values = np.array(p, dtype=np.float64)
        return state._replace(p=values, x0=self.model.initial(values))

    def take_over(self, state: TrackState, other: Track, p: ParameterVector) -> TrackState:
        """The state of ``other`` (same outputs, another form of the model) for this stage.

        States of the same name keep their value, new ones start as the model says, and the
        arbiter's memory is kept. Consumes ``state``.
        """
        fresh = self.renew(self.init(), p)
        x = fresh.x0.copy()
        old = other.model.states.names
        for k, name in enumerate(self.model.states.names):
            if name in old:
                x[k] = state.x[old.index(name)]
        state.numbers[:, at.FREE] = 0
        anew = {name: getattr(fresh, name) for name in ("p", "x0", "beside", "matter", "free")}
        return state._replace(x=x, **anew)

    @property
    def here(self) -> bool:
        """Is its model simulated in this process?"""
        return self._kernel.remote is None

    def step(self, state: TrackState, block: Block) -> tuple[TrackState, Out]:
        n, ny = block.y.shape
        state, (ng, nu) = _whole(state), (len(state.numbers), block.u.shape[1])
        rows = TrackRows(
            np.empty((n, ny)), np.empty((n, ny)), np.empty((n, ny), dtype=np.uint8),
            np.zeros((n, ng), dtype=np.uint8), np.empty((n, ny)), np.empty((n, ng)),
            np.array(block.u, order="C"), np.array(block.mark[:, :nu], order="C"),
        )  # fmt: skip
        notes, whole = Notes.room(n, ng, nu, ny), contiguous(block)
        kernel, start = self._kernel, 0
        kept = tuple(failures_in(kernel))
        for one in kept:
            one.forget()
        records: list[Event] = []
        while start < n:
            start = looped(run, kernel, start, whole, self._settings, state, rows, notes)
            told = int(notes.extent[0])
            for note, more in zip(notes.found[:told], notes.detail[:told], strict=True):
                records.append(describe(self.model, note, more))
            notes.extent[0] = 0
        if kernel.remote is not None:
            row, time = block.row + n - 1, int(block.t[-1])
            records += [Event(row, time, FAILING, "", text) for text in kernel.remote.news()]
        new = int(state.clock[FIRST_FAILED])
        if state.clock[FAILED] and new >= block.row:
            why = next(filter(None, (one.why() for one in kept)), UNKNOWN)
            records.append(Event(new, int(block.t[new - block.row]), FAILING, "", why))
        return state, Out(rows, tuple(records))


def _whole(state: TrackState) -> TrackState:
    """The state, with what a checkpoint of an older version does not know yet: nothing of it."""
    widths = {
        "values": at.VALUES, "numbers": at.NUMBERS, "figures": at.FIGURES, "account": at.ACCOUNT,
        "ranges": at.RANGES, "beliefs": at.BELIEFS,
    }  # fmt: skip
    known = {name: getattr(state, name) for name in widths}
    return state._replace(**{
        name: np.pad(one, ((0, 0), (0, widths[name] - one.shape[1])))
        for name, one in known.items() if one.shape[1] < widths[name]
    })  # fmt: skip


def _bounds(one: Channel) -> list[float]:
    """What an input may be, and which of `at.FACTORS` divide two units of its quantity."""
    return [one.low, one.high, *(_decimal() | _divides(one.unit)).astype(float).tolist()]


def _moved_by(inputs: Layout, outputs: Layout) -> np.ndarray:
    """Is every input a rate of the output, the same quantity, or one of turning? (ny, 1). Of any
    other a number of the model says how much it does, and that may be off by any factor until it
    is tuned."""
    sources = [powers(unit) for unit in inputs.units]
    found = []
    for unit in outputs.units:
        own = powers(unit)
        rate = {name: n for name, n in {**own, "s": own.get("s", 0) - 1}.items() if n}
        moves = [one in (own, rate) for one in sources]
        known = all(moved or "rad" in one for moved, one in zip(moves, sources, strict=True))
        found.append([bool(own) and any(moves) and known])
    return np.array(found, dtype=np.float64)


def _tried(outputs: Layout) -> np.ndarray:
    """Which of `at.FACTORS` an output is suspected of, (ny, factors): those of its quantity."""
    own = np.array([_divides(unit) for unit in outputs.units]).reshape(-1, len(at.FACTORS))
    anyone = _decimal() | (at.FACTORS[at.TURN] == at.FACTORS)  # a turn is taken for anything
    return np.where(anyone, at.ANY, np.where(own, at.OWN, at.NEVER)).astype(np.float64)


def _decimal() -> Bools:
    return np.asarray(np.log10(np.abs(at.FACTORS)) % 1.0 == 0.0)


def _divides(unit: str) -> Bools:
    """Which of `at.FACTORS` divide two units of a quantity."""
    own = np.array([number for number, _ in numbers(unit)])
    return np.asarray((np.abs(at.FACTORS[:, None] / own - 1.0) < 1e-3).any(axis=1))
