"""Rows as an observer of contacts sees them, and what a beat does about what was found.

Judged is the residual before any filter, of an output that is a function of its inputs alone. Where
``[moving]`` names the motion that an output belongs to and it stands, friction may hold anything
between the outputs of a motion just begun the one way and the other, and the residual is what lies
beyond; by how much more is decided in `evertwin.anomaly.external`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from evertwin.anomaly.external import Contact, ExternalState, Seen, Told
from evertwin.anomaly.recurrence import Place
from evertwin.fold import Block, Event, Mark
from evertwin.models import Model, kernel_of
from evertwin.models.kernels.kernel import Restart
from evertwin.models.kernels.rollout import roll
from evertwin.rows.ring import Rows, kept
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TwinState
from evertwin.signals import wrap
from evertwin.sync.horizon.horizon import finite
from evertwin.types import Outputs, ParameterVector

BEHIND = 3
"""Memories of the residual's rms that it is learned of again."""


def watched(
    setup: Setup, twin: TwinState, model: Model, p: ParameterVector, rows: Block, y: Outputs
) -> tuple[ExternalState, Block]:
    """The rows, marked where something outside acts on the machine. Consumes ``twin.external``.

    Args:
        setup: of the twin.
        twin: the state of all that is observed.
        model: of the champion, with its parameters ``p``.
        rows: judged rows; their marks are written.
        y: what the champion predicts of them.
    """
    if setup.external.longest == 0:
        return twin.external, rows
    seen = _seen(setup, twin, model, p, rows, y)
    state, marked = setup.external.step(twin.external, seen)
    if marked.any():
        mark = rows.mark[:, rows.u.shape[1] :]
        mark[marked[:, None] & _measured(mark)] = Mark.EXTERNAL
    return state, rows


def known_of(setup: Setup, twin: TwinState, model: Model, p: ParameterVector) -> ExternalState:
    """How far a version that goes live is usually off, by the kept rows: else the machine would be
    unwatched until that is learned. Of one with states nothing is known."""
    state, stage = setup.external.init(), setup.external
    if stage.longest == 0 or len(model.states):
        return state
    first = max(twin.row - BEHIND * int(stage.rule[2]), twin.agenda.since)
    # what is at work is not told yet; what was before that was, of the version before
    at_work = stage.since(twin.external) if stage.on(twin.external) else twin.row
    for start, stop in ((first, at_work), (at_work, twin.row)):
        state, _ = stage.beat(state)
        for rows in setup.ring.between(twin.ring, max(start, first), stop):
            never = Restart.never(len(rows.t), len(model.outputs))
            y = roll(kernel_of(model), np.empty(0), rows.u, rows.dt, p, never)[1]
            seen = _seen(setup, twin, model, p, rows, y)
            external = rows.mark[:, rows.u.shape[1] :] == Mark.EXTERNAL
            seen.r[external & (start < at_work)] = np.nan
            state, _ = stage.step(state, seen)
    return state if at_work < twin.row else stage.beat(state)[0]


def _measured(mark: np.ndarray) -> np.ndarray:
    return np.asarray((mark != Mark.ABSENT) & (mark != Mark.ERROR))


def _seen(
    setup: Setup, twin: TwinState, model: Model, p: ParameterVector, rows: Block, y: Outputs
) -> Seen:
    mark, u = rows.mark[:, rows.u.shape[1] :], rows.u
    measured = np.where(_measured(mark), rows.y, np.nan)
    columns, unsaid = setup.judged_by
    measured[:, unsaid] = np.nan
    measured[~finite(u)] = np.nan  # an unknown speed is not one of what stands
    r, half, moving = wrap(measured - y, model.outputs.angles), np.zeros(y.shape), setup.moving(u)
    v = np.where(unsaid, np.nan, u.take(columns, axis=1))
    stands = np.flatnonzero(~moving.all(axis=1))
    if len(stands):
        low, high = (_just(setup, model, p, rows, stands, way) for way in (-1.0, 1.0))
        width = 0.5 * np.abs(high - low)
        off = wrap(measured[stands] - 0.5 * (low + high), model.outputs.angles)
        beyond = np.sign(off) * np.maximum(np.abs(off) - width, 0.0)
        r[stands] = np.where(moving[stands], r[stands], beyond)
        half[stands] = np.where(moving[stands], 0.0, width)
    r[setup.recurrence.inside(twin.recurrence, u)] = np.nan
    return Seen(rows.row, rows.t, r, half, v, moving, y)


def _just(
    setup: Setup, model: Model, p: ParameterVector, rows: Block, at: np.ndarray, way: float
) -> Outputs:
    """Outputs of rows ``at``, all that stands just moving one way."""
    rule = setup.spec.moving
    assert rule is not None
    u = rows.u[at]
    for name in dict.fromkeys(rule.channels.values()):
        k = model.inputs.index(name)
        u[:, k] = np.where(np.abs(u[:, k]) > rule.above, u[:, k], way * rule.above)
    never = Restart.never(len(at), len(model.outputs))
    return roll(kernel_of(model), np.empty(0), u, rows.dt[at], p, never)[1]


def remembered(rows: Rows, told: Told, on: int) -> None:
    """Marks the kept rows of what was found, of what is at work since row ``on`` (−1: nothing) too;
    what lasts is the machine's own: its rows count again. Writes into ``rows``."""
    marks: list[tuple[int, int, Any]] = []
    if told.lasts >= 0:
        marks.append((told.lasts, rows.end, Mark.OK))
    if told.own is not None:
        marks.append((told.own.first, rows.end, Mark.OK))
    if told.contact is not None and told.contact.last >= 0:
        marks.append((told.contact.first, told.contact.last + 1, Mark.EXTERNAL))
    if on >= 0:
        marks.append((on, rows.end, Mark.EXTERNAL))
    nu = rows.u.shape[1]
    for first, stop, mark in marks:
        places = kept(rows, first, stop)
        old = rows.mark[places, nu:]
        counts = _measured(old) if mark == Mark.EXTERNAL else old == Mark.EXTERNAL
        rows.mark[places, nu:] = np.where(counts, np.uint8(mark), old)


def kept_out(rows: Rows, first: int) -> bool:
    """Is a kept row since ``first`` taken for one of something outside?"""
    places = kept(rows, first)
    return bool((rows.mark[places] == Mark.EXTERNAL).any())


def unsure(events: Sequence[Event], ring: Rows, rows: Block) -> tuple[Event, ...]:
    """What a vote, or a factor, told of a sensor, where something outside was at work on most of
    the rows that it was told of: which of both it was is not told by them.

    Args:
        events: of the arbiter.
        ring: the rows before ``rows``.
        rows: judged.
    """
    said = "far off and back again while something outside seems to act: it, or the sensor"
    return tuple(
        replace(event, kind="not_judged", reason=said) if doubted else event
        for event in events
        for doubted in (_blames(event) and _outside(event, ring, rows),)
        if not doubted or event.kind == "measurement_error"
    )


def _blames(event: Event) -> bool:
    """Does it say of a sensor what something outside looks like, too, or that this is over?"""
    told = event.kind in ("measurement_error", "measurement_restored")
    return told and event.evidence.get("cause") in ("vote", "factor")


def _outside(event: Event, ring: Rows, rows: Block) -> bool:
    """Was something outside at work on most of the rows that an event is of?"""
    found: Any = event.evidence
    first, last, nu = found["onset"], found["end"], rows.u.shape[1]
    marks = np.concatenate([
        ring.mark[kept(ring, first, min(last + 1, rows.row)), nu:],
        rows.mark[max(first - rows.row, 0) : max(last + 1 - rows.row, 0), nu:],
    ])  # fmt: skip
    return 2 * int((marks == Mark.EXTERNAL).any(axis=1).sum()) > len(marks)


def recurring(
    setup: Setup, state: TwinState, contact: Contact
) -> tuple[TwinState, Place | None, bool]:
    """One more contact: a place at which they come again, whose kept rows count from now on; and
    was it at one that is known? Writes into the ring."""
    rows = state.ring
    first, middle = max(rows.first, rows.end - len(rows.t)), (contact.first + contact.last) // 2
    if not first <= middle < rows.end:
        return state, None, False
    at = rows.u[middle % len(rows.t)]
    columns = [setup.model.outputs.index(name) for name in contact.outputs]
    if not setup.moving(at[None])[0, columns].any():
        return state, None, False  # a machine that stands has no worn place
    if setup.recurrence.inside(state.recurrence, at[None]).any():
        return state, None, True
    places = kept(rows, first)
    u = rows.u[places]
    moving, stage = u[setup.moving(u).any(axis=1)], setup.recurrence
    recurrence, place = stage.found(stage.met(state.recurrence, at), moving, stage.noise(u))
    if place is not None:
        mark, there = rows.mark[places], setup.recurrence.inside(recurrence, u)
        own = there[:, None] & (mark == Mark.EXTERNAL)
        rows.mark[places] = np.where(own, np.uint8(Mark.OK), mark)
    return state._replace(recurrence=recurrence), place, False


def place_in_words(setup: Setup, contact: Contact, place: Place) -> str:
    """Where contacts come again, and what that means."""
    channel = setup.model.inputs.channels[place.column]
    where = f"{channel.name} is {place.low:.3g} to {place.high:.3g} {channel.unit}"
    return (
        f"what moves {', '.join(contact.outputs)} came {place.times} times where {where}: it is "
        "the machine's own (worn or dirty there), or work that it does; its rows count"
    )


def in_words(setup: Setup, contact: Contact) -> str:
    """What acts from outside, on what, by how much and from when."""
    units = dict(zip(setup.model.outputs.names, setup.model.outputs.units, strict=True))
    sizes = ", ".join(
        f"{name} by {level:.3g} {units[name]}"
        for name, level in zip(contact.outputs, contact.levels, strict=True)
    )
    until = "" if contact.last < 0 else f" to {contact.last}"
    return f"something outside moves {sizes} from row {contact.first}{until}"
