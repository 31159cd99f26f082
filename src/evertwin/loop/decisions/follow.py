"""Between two beats: the versions run side by side over the rows. Nothing is decided here.

The champion's `Track` judges every measurement once; its marks hold for all versions, so that they
are compared on the same trusted rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from evertwin.fold import Block, Event, Mark, Record, copy
from evertwin.gauges.rows.withdrawn import believed, divided
from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.contacts import unsure, watched
from evertwin.loop.decisions.contradictions import compared
from evertwin.loop.decisions.in_stream import following
from evertwin.models import hidden_of, observed
from evertwin.models.form import Form
from evertwin.rows.channels import is_measured
from evertwin.setup.released import Released
from evertwin.setup.scores import NEVER, accumulate
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import PROBATION, TRIAL, Lane, TwinState
from evertwin.sync import Horizon, Track
from evertwin.sync.horizon.horizon_loop import SEGMENTS
from evertwin.trial import Recovery
from evertwin.tuning import Following
from evertwin.types import Outputs

EMPTY = Lane(-1, (), ())
NONE = np.zeros(0, dtype=np.int64)


def proven(state: TwinState) -> bool:
    """Is a deviation asked about before its whole window has come? Of a version that held, and of
    one behind such a one, once its probation, which tells whether it is to blame, is over."""
    return state.agenda.commissioned and state.agenda.phase != PROBATION


def early(setup: Setup, state: TwinState) -> bool:
    """May a deviation be told before its whole window has come? Once; of a share not before the
    size of what is measured is known as well as after a window."""
    usual = state.scores.usual.samples[setup.watched]
    known = not setup.relative or int(usual.min(initial=setup.enough)) >= setup.enough
    return known and not state.agenda.told


class Followed(NamedTuple):
    """What came out of a piece: the displayed rows, and what became known.

    >>> Followed._fields
    ('rows', 'first', 'judged', 'off', 'events', 'stop')
    """

    rows: Any
    """Rows of the champion's `Track`."""
    first: Any
    """Rows of the first champion's `Track`; None while it is live."""
    judged: Block
    """The piece with the marks of inputs and outputs after judging."""
    off: tuple[Outputs, Outputs]
    """What the live and the first version are off by where a prediction has reached its horizon, as
    the figures have it; (n, ny) each, NaN elsewhere."""
    events: tuple[Event, ...]
    stop: int = -1
    """Row of the first beat at which something has to be decided; −1: there is none."""


@dataclass(frozen=True)
class Follow:
    """The stages between beats, built once per form of the model.

    >>> Follow.__name__
    'Follow'
    """

    setup: Setup
    versions: Versions
    _stages: dict[Form, tuple[Track, Horizon]] = field(default_factory=dict, repr=False)
    _of: dict[int, tuple[Track, Horizon]] = field(default_factory=dict, repr=False)
    _following: dict[int, Following | None] = field(default_factory=dict, repr=False)

    @cached_property
    def recovery(self) -> Recovery:
        """What weighs the first champion while another version is live."""
        return Recovery(segments=self.setup.trial.least // 2)

    def stages(self, number: int) -> tuple[Track, Horizon]:
        """The stages that run a version."""
        if number not in self._of:
            form = self.versions[number].form
            if form not in self._stages:
                model = self.versions.model_of(form)
                outputs = [is_measured(self.setup.spec, one) for one in model.outputs.names]
                horizon = Horizon(observed(model, np.array(outputs)), self.setup.horizon)
                self._stages[form] = self.setup.track(model), horizon
            self._of[number] = self._stages[form]
        return self._of[number]

    def following(self, number: int) -> Following | None:
        """What lets a version follow the machine in the stream; None: it stays as it is."""
        if number not in self._following:
            self._following[number] = following(self.setup, self.versions, number)
        return self._following[number]

    def opens(self, number: int) -> Any:
        """The state of a version's stream before anything was learned."""
        stage = self.following(number)
        return () if stage is None else stage.init()

    def loosened(self, state: TwinState) -> TwinState:
        """Between two recordings: the machine may be another one by then. Consumes ``state``."""
        stage = self.following(state.live.version)
        return state if stage is None else state._replace(stream=stage.loosened(state.stream))

    def renew(self, state: TwinState, *, back: bool = False) -> TwinState:
        """At a beat: what was learned in the stream predicts from here on. Consumes ``state``.

        Args:
            state: after rows.
            back: may the newest rows not be the machine's own?
        """
        number = state.live.version
        stage = self.following(number)
        if stage is None:
            return state
        stream = stage.init() if state.agenda.pinned else stage.beat(state.stream, back=back)
        return self.predicting(state._replace(stream=stream))

    def predicting(self, state: TwinState) -> TwinState:
        """The live version predicts with what its stream says. Consumes ``state``."""
        number = state.live.version
        stage = self.following(number)
        if stage is None:
            return state
        p, (track, horizon) = stage.live(state.stream), self.stages(number)
        live = state.live._replace(
            track=track.renew(state.live.track, p), horizon=horizon.renew(state.live.horizon, p)
        )
        return state._replace(live=live)

    def goes_on(self, state: TwinState, number: int) -> Any:
        """The stream of a version that goes live: after a state came or went (`brief`), as sure of
        what it had followed as it was."""
        before, after = self.following(state.live.version), self.following(number)
        same = before is not None and after is not None and before.names == after.names
        if after is None or not same or state.agenda.brief < 0.0:
            return self.opens(number)
        return after.as_sure(copy(state.stream))

    def here(self, state: TwinState) -> bool:
        """Are all versions simulated in this process, so that rows may be folded twice?"""
        lanes = (state.live, state.first, state.other)
        return all(self.stages(lane.version)[0].here for lane in lanes if lane.version >= 0)

    def beside(self, live: Lane, number: int) -> Lane:
        """A version in step with the champion: its predictions begin and end with the champion's.

        Otherwise the one would be judged nearer to what was measured last than the other.
        """
        lane, of = self.lane(number, tracked=False), live.horizon
        models = self.stages(number)[0].model, self.stages(live.version)[0].model
        shared = min(len(model.states) for model in models)
        lane.horizon.x[:shared] = of.x[:shared]
        horizon = lane.horizon._replace(adopted=of.adopted.copy(), clock=of.clock.copy())
        if set(hidden_of(self.stages(number)[1].model)) - set(range(shared)):
            horizon.clock[SEGMENTS] = 0  # a state of its own, which is estimated first
        return lane._replace(horizon=horizon)

    def lane(self, number: int, *, tracked: bool) -> Lane:
        """A version from its start: nothing adopted yet."""
        track, horizon = self.stages(number)
        p = self.versions[number].p
        followed = track.renew(track.init(), p) if tracked else ()
        state = horizon.renew(horizon.init(), p)
        state.x[:] = state.x0
        return Lane(number, followed, state)

    def step(
        self, state: TwinState, piece: Block, beats: np.ndarray = NONE
    ) -> tuple[TwinState, Followed]:
        """The piece through all lanes. Consumes ``state``, but for its newest rows (`keep`).

        ``beats``: rows of the piece before which nothing has to be decided unless `Followed.stop`
        says so; then the state is of no use.
        """
        track, _ = self.stages(state.live.version)
        tracked, out = track.step(state.live.track, piece)
        external, judged = watched(
            self.setup, state, track.model, tracked.p, out.rows.judged(piece), out.rows.y
        )
        kinematics, judged = compared(self.setup, state.kinematics, judged, piece.u)
        still = self.setup.still.step(state.still, piece.row, piece.u)
        stage = self.following(state.live.version)
        stream = state.stream if stage is None else stage.step(state.stream, judged)
        known = out.rows.y if self.setup.static else None
        live, a = self._predict(state.live._replace(track=tracked), judged, known)
        first, before = self._track(state.first, piece._replace(u=judged.u))
        seen = before.y if known is not None and before is not None else None
        first, b = self._predict(first, judged, seen)
        other, c = self._predict(state.other, judged)
        opens = state.row == 0 or int(piece.task[0]) != state.task
        began = int(piece.t[0]) if opens else state.began
        none = np.empty(piece.y.shape)
        none.fill(np.nan)
        rows = Released(
            np.arange(piece.row, piece.row + len(piece.t)), piece.t,
            self.setup.phase(judged.u, piece.t, began), piece.y, a.residual,
            none if b is None else b.residual, none if c is None else c.residual,
            self.setup.moving(judged.u), a.end, (judged.mark == Mark.EXTERNAL).any(axis=1),
        )  # fmt: skip
        newest, rows = self.setup.at_horizon.step(state.newest, rows)
        off = rows.live, rows.live if b is None else rows.first
        waiting, released = self.setup.residual_filter.step(state.waiting, rows)
        before_piece = int(piece.t[0]) if opens else state.time
        state = state._replace(
            elapsed=state.elapsed + int(piece.t[-1]) - before_piece,
            row=piece.row + len(piece.t), task=int(piece.task[-1]), time=int(piece.t[-1]),
            began=began, live=live, stream=stream, first=first, other=other, newest=newest,
            waiting=waiting, external=external, kinematics=kinematics,
            still=still,
        )  # fmt: skip
        state, found, stop = self._judge(state, released, beats)
        news: tuple[int, ...] = (
            self.setup.external.known(external), self.setup.kinematics.known(kinematics),
            self.setup.still.known(still),
        )  # fmt: skip
        told = unsure(_events(out.records), state.ring, judged)
        for event, outputs in believed(told, self.setup.model):
            state.scores.spoiled[outputs] = True
            news += (event.row + 1,)
        for event, _ in divided(told, self.setup.model):
            state.scores.spoiled[:] = True
            news += (event.row + 1,)
        for known in news:
            after = beats[beats >= known]
            if known and len(after) and (stop < 0 or after[0] < stop):
                stop = int(after[0])
        events = _by_beat(told, found, beats, self.setup.residual_filter.delay)
        return state, Followed(out.rows, before, judged, off, events, stop)

    def keep(self, state: TwinState, judged: Block) -> TwinState:
        """The newest rows are kept for slow work. Consumes ``state``."""
        return state._replace(ring=self.setup.ring.push(state.ring, judged))

    def end_task(self, state: TwinState) -> tuple[TwinState, tuple[Event, ...]]:
        """What waits for the end of its task is released. Consumes ``state``."""
        waiting, released = self.setup.residual_filter.flush(state.waiting)
        state = state._replace(waiting=waiting)
        return (state, ()) if released is None else self._judge(state, released, NONE)[:2]

    def _judge(
        self, state: TwinState, rows: Released, beats: np.ndarray
    ) -> tuple[TwinState, tuple[Event, ...], int]:
        """Released rows into scores, detectors and the trial; the first beat that must decide."""
        if len(rows.row) == 0:
            return state, (), -1
        delay = self.setup.residual_filter.delay
        soon = proven(state) or early(self.setup, state)
        watch = self.setup.watch(beats - delay, soon) if len(beats) else NEVER
        scores, pairs, back, off = accumulate(state.scores, rows, watch)
        detect, found = self.setup.detect.step(state.detect, rows)
        stop = -1 if off < 0 else int(beats[off])
        news = [detect.pending.row] if detect.pending.kind else []
        news += [detect.risen.row] if detect.risen.name else []
        for row in news:
            after = beats[beats > row + delay]
            if len(after) and (stop < 0 or after[0] < stop):
                stop = int(after[0])
        decides = self.recovery.step(state.recovery, back) if len(back) else -1
        if len(beats) and decides >= 0:
            after = beats[beats > back[decides, 2] + delay]
            if len(after) and (stop < 0 or after[0] < stop):
                stop = int(after[0])
        trial, phase = state.trial, state.agenda.phase
        if len(pairs) and phase == TRIAL:
            trial, _ = self.setup.trial.step(trial, pairs)
        elif len(pairs) and phase == PROBATION:
            trial, _ = self.setup.probation.step(trial, pairs)
        return state._replace(scores=scores, detect=detect, trial=trial), found, stop

    def _track(self, lane: Lane, piece: Block) -> tuple[Lane, Any]:
        if lane.version < 0:
            return lane, None
        track, _ = self.stages(lane.version)
        tracked, out = track.step(lane.track, piece)
        return lane._replace(track=tracked), out.rows

    def _predict(
        self, lane: Lane, judged: Block, known: np.ndarray | None = None
    ) -> tuple[Lane, Any]:
        """``known``: the predictions of a lane without state, made by its track already."""
        if lane.version < 0:
            return lane, None
        _, horizon = self.stages(lane.version)
        if known is None or len(lane.horizon.x):
            predicted, out = horizon.step(lane.horizon, judged)
        else:
            predicted, out = horizon.judge(lane.horizon, judged, known)
        return lane._replace(horizon=predicted), out.rows


def _events(records: tuple[Record, ...]) -> tuple[Event, ...]:
    return tuple(record for record in records if isinstance(record, Event))


def _by_beat(
    judged: tuple[Event, ...], detected: tuple[Event, ...], beats: np.ndarray, delay: int
) -> tuple[Event, ...]:
    """In the order in which pieces between beats would have told them."""
    if len(beats) == 0 or not judged or not detected:
        return judged + detected
    known = [(event.row, event) for event in judged]
    known += [(event.row + delay, event) for event in detected]
    known.sort(key=lambda one: int(np.searchsorted(beats, one[0], side="right")))
    return tuple(event for _, event in known)
