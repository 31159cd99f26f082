"""The fold of a whole twin: pieces between beats, decisions at beats, slow work when it is due.

The driver cuts blocks where the data sets its beats, so where a source cuts them cannot matter.
Slow work goes out with rows that are in the state (`evertwin.loop.slow_work`), so a checkpoint
holds all that is needed to go on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from evertwin.engine import Engine, InProcess
from evertwin.fold import Answer, Block, Event, Record, copy, take
from evertwin.gauges.rows.withdrawn import withdraw
from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.crossing import crossed
from evertwin.loop.decisions.decide import Decide
from evertwin.loop.decisions.follow import EMPTY, Follow, Followed
from evertwin.loop.decisions.former import none, with_live
from evertwin.loop.slow_work import SlowWork
from evertwin.outcome.course.changes import spelled
from evertwin.refit.work import Work
from evertwin.rows.ring import NO_ROWS
from evertwin.setup.deviation import begun_with, new_usual
from evertwin.setup.scores import new_scores
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import Agenda, Lane, Saved, TwinState
from evertwin.store import Checkpoint, Store

STRIDE = 8192
"""Most rows that are folded at once."""
WORTH = 3
"""Beats from which on it pays to fold over them at once."""
CAREFUL = 16
"""Beats that are taken one by one after one that decided something."""
Watcher = Callable[[TwinState, Block, Followed], None]


def _ignore(state: TwinState, piece: Block, out: Followed) -> None:
    """No one looks at the rows."""


class Outside(Protocol):
    """What comes into a fold from outside: answers that a log has, and what operators say.

    >>> Driver.__dataclass_fields__["outside"].type
    'Outside'
    """

    def answer(self, number: int) -> tuple[int, Answer] | None:
        """The row and the answer to a request, where it is known beforehand."""
        ...

    def knows_more(self) -> bool:
        """Has a log more of what this fold will say? Then it went on without other answers."""
        ...

    def next_order(self) -> float:
        """Row from which on the next order is in force; infinite: there is none."""
        ...

    def heed(self, row: int) -> tuple[Event, ...]:
        """The orders that are in force from a beat at ``row`` on; each is given once."""
        ...


class _Nobody:
    """A fold that is left alone."""

    def answer(self, number: int) -> tuple[int, Answer] | None:
        return None

    def knows_more(self) -> bool:
        return False

    def next_order(self) -> float:
        return np.inf

    def heed(self, row: int) -> tuple[Event, ...]:
        return ()


class _Lanes(NamedTuple):
    """What a checkpoint says of its lanes before their shape is known."""

    live: Lane
    first: Lane
    other: Lane


@dataclass
class Driver:
    """A twin at work. ``log`` gets what each beat or piece said; ``watch`` sees every piece.

    >>> Driver.__name__
    'Driver'
    """

    setup: Setup
    versions: Versions
    log: Callable[[int, Sequence[Record]], None]
    """``log(row, records)``: one decision, to be kept whole or not at all."""
    watch: Watcher = _ignore
    champion: int = 0
    """Version that is live at the start."""
    pinned: bool = False
    outside: Outside = field(default_factory=_Nobody)
    engine: Engine = field(default_factory=InProcess)
    """Where slow work runs; it serves one fold at a time."""
    live: bool = False
    """Are answers taken when they are there, and never waited for?"""
    follow: Follow = field(init=False)
    decide: Decide = field(init=False)
    slow: SlowWork = field(init=False)

    def __post_init__(self) -> None:
        self.follow = Follow(self.setup, self.versions)
        self.decide = Decide(self.follow)
        self.slow = SlowWork(Work(self.setup, self.versions), self.engine)

    def init(self) -> TwinState:
        """The state before the first row."""
        setup, outputs = self.setup, self.setup.model.outputs
        scale = setup.spec.prediction.scale
        sizes = np.array([scale.get(name, 1.0) for name in outputs.names])
        known = self.versions[self.champion].sizes
        usual = begun_with(new_usual(outputs.temperatures), outputs.names, known)
        return TwinState(
            row=0, task=-1, time=0, began=0, elapsed=0,
            live=self.follow.lane(self.champion, tracked=True),
            stream=self.follow.opens(self.champion),
            lives=with_live(none(), self.champion, 0), first=EMPTY, other=EMPTY,
            newest=setup.at_horizon.init(), waiting=setup.residual_filter.init(),
            detect=setup.detect.init(), external=setup.external.init(),
            kinematics=setup.kinematics.init(),
            still=setup.still.init(len(setup.model.inputs)), recurrence=setup.recurrence.init(),
            trial=setup.trial.init(), recovery=self.follow.recovery.init(),
            scores=new_scores(usual, np.zeros(2, dtype=np.int64), 0, sizes),
            agenda=Agenda(
                pinned=self.pinned, versions=self.versions.known, commissioned=self.champion > 0
            ),
            watched=np.zeros((0, 2)), ring=setup.ring.init(),
        )  # fmt: skip

    def template(self, live: int, first: int, other: int) -> TwinState:
        """A state in the shape of one with these versions in its lanes (−1: none), for loading."""
        lanes = [
            EMPTY if number < 0 else self.follow.lane(number, tracked=tracked)
            for number, tracked in ((live, True), (first, True), (other, False))
        ]
        return self.init()._replace(
            live=lanes[0], stream=self.follow.opens(live), first=lanes[1], other=lanes[2]
        )

    def restored(self, store: Store, run: int, feed: object = ()) -> Checkpoint | None:
        """The newest checkpoint of a run, what it has of its ``feed`` too; None if there is none.

        Raises:
            StoreError: it was saved by another version.
        """
        found = store.restore(Saved(_Lanes(EMPTY, EMPTY, EMPTY)), run)
        if found is None:
            return None
        numbers = [lane.version for lane in found.state.twin]
        return store.restore(Saved(self.template(*numbers), feed), run, found.row + 1)

    def run(self, blocks: Iterable[Block], state: TwinState | None = None) -> TwinState:
        """Folds the blocks; consumes ``state``."""
        state = self.init() if state is None else state
        for block in blocks:
            state = self.step(state, block)
        return state

    def step(self, state: TwinState, block: Block) -> TwinState:
        """One block, cut at its beats; over many beats at once while nothing has to be decided."""
        beats, end = self.setup.beat.rows(block, state.task), block.row + len(block.t)
        at, careful = block.row, block.row
        while at < end:
            rest = take(block, at - block.row, len(block.t))
            later = beats[beats.searchsorted(at) :]
            if at >= careful and len(later) >= WORTH:
                state, careful = self._stride(state, rest, later)
                if state.row > at:
                    at = state.row
                    continue
            if len(later) and later[0] == at:
                if state.row > 0:
                    state = self.beat(state, task_end=int(rest.task[0]) != state.task)
                later = later[1:]
            stop = int(later[0]) if len(later) else end
            piece = take(rest, 0, stop - at)
            state, out = self.follow.step(state, piece)
            state = self._seen(state, piece, out)
            at = stop
        return state

    def _stride(self, state: TwinState, rest: Block, beats: np.ndarray) -> tuple[TwinState, int]:
        """Rows over beats at which nothing is decided, and up to which row no more can be tried.

        They are folded on a copy, which counts unless a beat turns out to decide something; then
        they are folded up to that beat alone, and the beats after it are taken one by one.
        """
        at, task = rest.row, int(rest.task[0])
        opens = np.flatnonzero(rest.task != task)
        n = min(int(opens[0]) if len(opens) else len(rest.t), STRIDE)
        due = self.setup.schedule - (state.elapsed - state.agenda.fitted)
        if not self.decide.quiet(state) or task != state.task or state.row == 0:
            return state, at
        n = min(n, int(np.searchsorted(rest.t, state.time + due)))
        ordered = beats[beats >= self.outside.next_order()]
        n = min(n, int(ordered[0]) - at) if len(ordered) else n
        if self.decide.watches(state):
            left = crossed(self.setup, state, take(rest, 0, n), beats[beats < at + n])
            n = n if left < 0 else left - at
        inside = beats[beats < at + n]
        if len(inside) < WORTH:
            return state, at
        tried = copy(state._replace(ring=NO_ROWS))._replace(ring=state.ring)
        piece = take(rest, 0, n)
        tried, out = self.follow.step(tried, piece, inside)
        stop = out.stop
        if stop < 0:
            return self._seen(tried, piece, out), at + n
        if stop > at:
            piece = take(rest, 0, stop - at)
            state, out = self.follow.step(state, piece, inside[inside < stop])
            state = self._seen(state, piece, out)
        return state, stop + CAREFUL * self.setup.beat.every

    def _seen(self, state: TwinState, piece: Block, out: Followed) -> TwinState:
        """Rows that are folded for good: kept for slow work, told, shown."""
        state = self.follow.keep(state, out.judged)
        withdraw(state.ring, out.events, self.setup.model)
        self._say(state.row, out.events)
        self.watch(state, piece, out)
        return state

    def beat(self, state: TwinState, *, task_end: bool, ended: bool = False) -> TwinState:
        """The decisions before the next row; if none comes (``ended``), answers are waited for."""
        said: list[Record] = []
        for order in self.outside.heed(state.row):
            state, found = self.decide.order(state, order)
            said += found
        if task_end:
            state, found = self.follow.end_task(state)
            said += found
        answer = self._answer(state, ended) if state.agenda.open else None
        said += [] if answer is None else [answer]
        live = state.live.version
        state, events, requests = self.decide.step(state, answer, task_end)
        events = [spelled(event, self.setup, self.versions, live) for event in events]
        self._say(state.row, [*said, *events, *requests])
        if not state.agenda.open or self.outside.answer(state.agenda.open) is None:
            self.slow.send(state)
        return state

    def _say(self, row: int, records: Sequence[Record]) -> None:
        if records:
            self.log(row, records)

    def finish(self, state: TwinState) -> TwinState:
        """The end of the data: the last task ends, open work is answered, live too."""
        if state.row == 0:
            return state
        state = self.beat(state, task_end=True)
        for _ in range(4):
            if not state.agenda.open:
                break
            state = self.beat(state, task_end=False, ended=True)
        return state

    def _answer(self, state: TwinState, ended: bool) -> Answer | None:
        """The answer to the open request: from the log, when it is due, or when it is there."""
        told = self.outside.answer(state.agenda.open)
        if told is not None:
            row, answer = told
            return answer if state.row >= row else None
        if self.outside.knows_more() and not ended:
            return None
        wait = ended or (not self.live and state.row >= state.agenda.due)
        return self.slow.take(state, wait=wait) if wait or self.live else None
