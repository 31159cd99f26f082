"""Slow work on its way: sent at the beat that asks for it, taken at a later one.

A recorded run takes the answer at the row where it is due, and waits for it there: which row an
answer precedes follows from the data alone, wherever the work runs. A live run never waits: it
takes the answer at the first beat at which it is there. The log says which row that was, so a
repeated run takes it there again. The job goes out with a copy of its rows; one that a restored
state asks for goes out again, and one that nobody waits for any more is dropped.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

from evertwin.engine import Engine
from evertwin.fold import Answer, Request
from evertwin.ledger.caveats import caveats_of
from evertwin.loop.decisions.former import former
from evertwin.loop.decisions.in_stream import as_is
from evertwin.models.form import Version
from evertwin.refit.answer_events import undone
from evertwin.refit.work import Work
from evertwin.setup.task import Doubt, Task
from evertwin.setup.twin_state import TwinState

NEAR = 5
"""A machine changed so much of what a deviation is judged on before it rose at most."""


@dataclass
class SlowWork:
    """The slow work of one fold.

    >>> SlowWork.__name__
    'SlowWork'
    """

    work: Work
    engine: Engine
    _sent: int = field(default=0, init=False)
    """Id of the request whose work is under way; 0: none."""

    def send(self, state: TwinState) -> None:
        """The work on the state's open request begins, unless it has; other work ends."""
        agenda = state.agenda
        if agenda.open == self._sent:
            return
        for number in {self._sent, agenda.open} - {0}:
            self.engine.drop(number)
        self._sent = agenda.open
        if not agenda.open:
            return
        window = (agenda.start, agenda.stop)
        version = as_is(self.work.versions, state)
        ring = self.work.setup.ring
        rows, earlier = (ring.between(state.ring, *some) for some in (window, (0, window[0])))
        request = Request(agenda.open, agenda.kind, version.number, state.row, agenda.due, window)
        rival = self.work.versions[agenda.rival] if agenda.rival else None
        risen = agenda.risen > agenda.start
        earliest = max(agenda.rose - self.work.setup.enough // NEAR, 1)
        task = Task(
            agenda.kind, version, rows, agenda.tunings, agenda.held or risen,
            agenda.again > 0, rival,
            agenda.commissioned, agenda.cause, earlier,
            None if version.parent is None else self.work.versions[version.parent],
            Doubt(agenda.doubt, agenda.doubted, agenda.doubted_at),
            former(self.work.versions, state, version.number),
            earliest if risen and not agenda.held else 0,
            state.ring.seen[1].copy(), state.ring.stayed.copy(),
            not (agenda.again or agenda.told or agenda.risen), self._untold(version),
        )  # fmt: skip
        self.engine.submit(request, partial(self.work.content, task))

    def _untold(self, version: Version) -> Version | None:
        """The newest before it of which nobody said that a sensor would look the same."""
        versions, told = self.work.versions, version
        while caveats_of(told.reason) and told.parent is not None:
            told = versions[told.parent]
        return None if told is version else told

    def take(self, state: TwinState, *, wait: bool) -> Answer | None:
        """The answer to the state's open request; None if it is not there, and not waited for."""
        self.send(state)
        number = state.agenda.open
        for answer in self.engine.answers(number if wait else None):
            if answer.id == number:
                self._sent = 0
                return self._known(answer, state)
        return None

    def _known(self, answer: Answer, state: TwinState) -> Answer:
        """The answer as it is logged: with the moment when it became known."""
        content = dict(answer.content)
        if "error" in content:
            content = undone(state.agenda.kind, content["error"])
        # the parameter history is read by these
        when = {"time": state.time, "elapsed": state.elapsed, "task": state.task}
        return Answer(answer.id, answer.version, content | when)
