"""What one pass of the fused loop over a block works with.

All arrays are borrowed: see `evertwin.compiled.memory.borrowed`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.fold import Block
from evertwin.sync.options import HOT
from evertwin.sync.track_state import TrackRows


class Case(NamedTuple):
    """What a group's sample is judged by, and the state that may adopt it. Compiling takes as long
    as what is passed is wide, so that this stands for itself.

    >>> Case._fields[:3]
    ('settings', 'memory', 'statistics')
    """

    settings: tuple[Any, ...]
    """Limits, rules and sentinels of `TrackSettings`."""
    memory: tuple[Any, ...]
    """Values, numbers and figures of `TrackState`, as are the next three;"""
    statistics: tuple[Any, ...]
    """variance, counts and warm;"""
    board: tuple[Any, ...]
    """ring, paths, times, rows and expected;"""
    told: tuple[Any, ...]
    """account and matter, of what was believed last."""
    notes: tuple[Any, ...]
    """Found, detail and extent."""
    sample: tuple[Any, ...]
    """Of this row: room for the outputs of a group, all that is measured, predicted and taken."""
    expects: Any
    """Outputs of a second prediction."""
    x: Any
    """The model's state, and the one beside."""
    beside: Any


class Workspace(NamedTuple):
    """All of one pass over a block.

    >>> Workspace._fields[:3]
    ('case', 'block', 'out')
    """

    case: Case
    block: Block
    out: TrackRows
    step: Any
    observe: Any
    context: int
    parameters: int
    """The model, by its addresses."""
    members: Any
    column: int
    edges: Any
    possible: Any
    keeps: bool
    """As in `TrackSettings`."""
    x0: Any
    free: Any
    clock: Any
    known: tuple[Any, ...]
    """As in `TrackState`; ranges and beliefs of the inputs."""
    marked: Any
    """Marks of this row's outputs, and the state that is predicted."""
    ahead: Any
    spare: tuple[Any, ...]
    """Inputs, state, outputs and another state of a second prediction."""
    moves: Any
    """How far each output is predicted to move."""


@njit(**HOT)
def case_of(settings: Any, state: Any, notes: Any, sample: tuple[Any, ...], expects: Any) -> Case:
    """What `TrackSettings`, `TrackState` and `Notes` lend, with room for a row."""
    return Case(
        (settings.limits, settings.rules, settings.sentinels),
        (state.values, state.numbers, state.figures), (state.variance, state.counts, state.warm),
        (state.ring, state.paths, state.times, state.rows, state.expected),
        (state.account, state.matter), (notes.found, notes.detail, notes.extent), sample, expects,
        state.x, state.beside,
    )  # fmt: skip


@njit(**HOT)
def fill(to: Any, values: Any) -> None:
    """Copies values; a slice costs more."""
    for k in range(to.shape[0]):
        to[k] = values[k]


@njit(**HOT)
def advance(work: Workspace, x: Any, u: Any, dt: float, ahead: Any, y: Any) -> int:
    """The model's step, from a state and the inputs that start at an address."""
    return int(call(
        work.step, work.context, x.ctypes.data, u, dt, work.parameters, ahead.ctypes.data,
        y.ctypes.data,
    ))  # fmt: skip
