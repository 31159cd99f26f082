"""One twin at work: samples in, what is new out. All of it runs in the twin's own thread, but
`AtWork.keep`.

Samples are durable when `AtWork.keep` returns: the twin stores each, and one flush of the store
stands for all that came together. `AtWork.fold` makes rows of them.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin.engine import EngineSpec, Pool
from evertwin.errors import DataError
from evertwin.fold import Block, Chunk, Event, interval, make_block, plain
from evertwin.ledger import Label
from evertwin.models import Model
from evertwin.outcome import View
from evertwin.outcome.result import OutputFigures
from evertwin.rows import Numbered
from evertwin.service.health.deviation_now import Now, looked_back, off_now, rows_of, told_now
from evertwin.service.health.sensor_faults import Faults
from evertwin.service.site.site_plan import Plan
from evertwin.service.twin.scene import scene_of
from evertwin.signals import wrap
from evertwin.signals.channels import same_turn
from evertwin.signals.spoken import as_recorded
from evertwin.store import Estimate, Kept, SharedStore, SqliteStore
from evertwin.store.spec import StoreSpec
from evertwin.store.sqlite.archive import DAY, Day
from evertwin.twin import Twin
from evertwin.types import Outputs

MOST = 256
"""Rows that are told at once."""
BACK = (0, 2 * 10**9, 60 * 10**9)
"""Stretches [ns] behind the newest sample in which the clock of its source is looked for."""
ALL = 200_000
"""More rows than are known at any time."""
OFTEN = 2.0
"""Seconds after which what came of it is told anew where rows came."""
WORKERS = 1
"""Processes of a twin's own for slow work, where nothing else is said."""


class Said(NamedTuple):
    """What became known with some samples.

    >>> Said(None, 0, (), 0).skipped
    0
    """

    rows: Mapping[str, Any] | None
    """The new rows by column, plain; None: there are none."""
    skipped: int
    """New rows before them, which are not told: too many came at once."""
    events: Sequence[tuple[int, Mapping[str, Any]]]
    """Position in the log and content of each."""
    row: int
    """Rows so far."""


class AtWork:
    """A twin beside its machine. See the module.

    >>> AtWork.__name__
    'AtWork'
    """

    def __init__(
        self, plan: Plan, store: Path | str, pool: Pool | None = None, token: int | None = None
    ) -> None:
        """Opens the twin with its store; what a process before left goes on.

        Args:
            plan: which twin.
            store: the folder of its file; or the server, then with the ``token`` of this node.
            pool: processes for slow work, where neither the site file nor the twin file asks for
                others.
            token: what the server holds each commit against.
        """
        assert plan.spec is not None
        workers, rule = plan.entry.workers, plan.spec.engine
        shared = pool if workers is None and rule == EngineSpec() else None
        if workers is None:
            workers = rule.workers or WORKERS
        self.spec = dataclasses.replace(
            plan.spec, store=StoreSpec(str(place_of(store, plan.name))),
            engine=dataclasses.replace(rule, workers=workers),
        )  # fmt: skip
        kept = None if token is None else SharedStore(str(store), plan.name, token)
        self.twin = Twin(self.spec, store=kept, engine=None if shared is None else shared.share())
        self._estimates: dict[tuple[str, float], Estimate] = {}
        """The newest of each number's values: the live one need not be of the newest fit."""
        self._read = self.estimates = 0
        """Entries of the log that are known; values of numbers in them."""
        self._faults = Faults()
        self._row = -1
        self._stored = self.since = self._when = 0.0
        """When what came of it was last told (monotonic) [s]."""
        self.now = Now("not yet")
        """How the live version does on its newest rows."""
        self._judged: tuple[int, str] = -1, ""
        """A version, and whether it was within what is asked when that could be told last."""
        self.about: Mapping[str, Any] = {}
        """Versions, parameters, what is live: as the newest entry of the log left it; what came
        of it as it was at most `OFTEN` ago, of a trial too."""
        self.going = self.twin.going()
        view = self.going.view(1)
        self._row = int(view.row[-1]) if len(view.row) else -1
        self.going.ledger.now = int(view.t[-1]) if len(view.t) else 0
        self.before = self._news()
        """Events that the log had already."""

    @property
    def looks(self) -> Sequence[tuple[int, Now]]:
        """How the live version did over all rows that are known still."""
        setup, view = self.going.at_rate, self._sound(self.going.view(ALL))
        asked = setup is not None and len(view.row) and np.isfinite(setup.requirement)
        return looked_back(setup, view, self.going.outcome[1]) if setup and asked else ()

    @property
    def row(self) -> int:
        """Rows so far."""
        return self._row + 1

    @property
    def scene(self) -> Mapping[str, Any]:
        """What its machine looks like."""
        return scene_of(self.twin.model, self.spec.arbiter.tolerance)

    def newest(self) -> dict[str, tuple[int, int, tuple[int, ...] | None]]:
        """Task, newest stamp and clock of each source that the store has samples of."""
        every = self.spec.source + self.spec.array
        found = {one.name: self.twin.store.newest(one.name) for one in every}
        return {name: (*at, self._clock(name, at[1])) for name, at in found.items() if at}

    def _clock(self, source: str, newest: int) -> tuple[int, ...] | None:
        for back in BACK:
            last = self.twin.store.samples(source, newest - back, newest)
            clocks = [chunk.clock for chunk in last if chunk.clock is not None]
            if clocks:
                return clocks[-1]
        return None

    def keep(self, chunks: Sequence[Chunk]) -> Sequence[Numbered]:
        """Samples as they came; durable when it returns. In any one thread.

        Raises:
            EvertwinError: they do not fit, or cannot be stored.
        """
        began = time.thread_time()
        kept = [self.going.keep(chunk) for chunk in chunks]
        self.twin.store.flush()
        self._stored += time.thread_time() - began
        return kept

    @property
    def beside(self) -> float:
        """Seconds of work for this twin outside of its thread: samples kept, slow work."""
        engine = self.going.engine
        return self._stored + (engine.seconds if isinstance(engine, Pool) else 0.0)

    def fold(self, kept: Sequence[Numbered]) -> Said:
        """What was kept, through the twin; events are durable when it returns.

        Raises:
            EvertwinError: the model, or the store, fails.
        """
        for left, one in enumerate(kept, 1 - len(kept)):
            self.since = time.monotonic()
            self.going.fold(one, more=left < 0)
        rows, skipped = self._fresh(self.going.view(MOST))
        news = self._news()
        if (rows is not None or not self.row) and time.monotonic() >= self._when + OFTEN:
            self.looked_at()
        return Said(rows, skipped, news, self.row)

    def _fresh(self, view: View) -> tuple[Mapping[str, Any] | None, int]:
        new = view.row > self._row
        if not new.any():
            return None, 0
        skipped = max(int(view.row[0]) - self._row - 1, 0)
        self._row = int(view.row[-1])
        self.going.ledger.now = int(view.t[-1])
        return shown(view, self.twin.model, new), skipped

    def rows(self, count: int, points: int) -> Mapping[str, Any]:
        """The newest rows, thinned to at most so many points; the newest one stays."""
        view = self.going.view(count)
        step = max(-(-len(view.row) // points), 1)
        return shown(view, self.twin.model, np.arange(len(view.row))[::-1][::step][::-1])

    def between(self, first: int, last: int) -> View:
        """Rows stamped in [first, last] [ns]."""
        return self.going.between(first, last)

    def looked_at(self) -> Mapping[str, Any]:
        """`about` as it is now: a trial goes on between two entries of the log."""
        self.about = {**self.about, **self._outcome()}
        return self.about

    def _outcome(self) -> Mapping[str, Any]:
        self._when = time.monotonic()
        said, found = self.going.outcome
        judged, limit = self._judge(found), self.going.setup.requirement
        beyond = any(one.judged > limit for one in found.values())
        return {
            "trial": plain(self.going.trial), "judged": judged,
            "headline": told_now(said, self.now, beyond=beyond),
            "changed": self.going.changed,
            "figures": {name: plain(dataclasses.asdict(one)) for name, one in found.items()},
        }  # fmt: skip

    def _judge(self, found: Mapping[str, OutputFigures]) -> str:
        """Is the live version within what is asked, by its newest rows that can tell?"""
        setup, live = self.going.at_rate, self.twin.champion.number
        if setup is None:
            return self.going.judged
        self.now = off_now(setup, self._sound(self.going.view(rows_of(setup))), live, found)
        if self.now.judged in ("held", "off"):
            self._judged = live, self.now.judged
        return self._judged[1] if self._judged[0] == live else self.going.judged

    def _sound(self, view: View) -> View:
        """Rows without what predictions were off by while a sensor was in error."""
        lies = self._faults.at(view.row, self.twin.model)
        return view._replace(off=np.where(lies, np.nan, view.off))

    def newest_blocks(self, count: int) -> Sequence[Block]:
        """The newest rows, one block a task.

        Raises:
            DataError: there are none yet.
        """
        view = self.going.view(count)
        if not len(view.task):
            raise DataError(f"{self.spec.name}: no row yet to answer from: ask again later")
        found = [view.task == task for task in dict.fromkeys(view.task.tolist())]
        return [make_block(t=view.t[on], u=view.inputs[on], y=view.measured[on]) for on in found]

    def _news(self) -> tuple[tuple[int, Mapping[str, Any]], ...]:
        """Events since the last call, durable; where the log went on, `about` follows."""
        store, found = self.twin.store, []
        if store.head.length == self._read and self.about:
            return ()
        for entry in store.entries(self._read, ("event", "estimate")):
            record = store.record(entry)
            if isinstance(record, Estimate):
                self._estimates[record.name, record.value] = record
                self.estimates += 1
            elif isinstance(record, Event):
                found.append((entry.number, told(entry.number, record)))
                self._faults.heard(record.kind, record.signal, record.row, record.evidence)
        self._read = store.head.length
        self.about = self._about()
        return tuple(found)

    def _about(self) -> Mapping[str, Any]:
        live, first = self.twin.champion, self.twin.parameters_of(0)
        stated = dict(zip(first.names, first.values.tolist(), strict=True))
        setup, outputs = self.going.setup, self.twin.model.outputs
        return {
            "champion": live.number, "pinned": self.twin.pinned, "model": self.spec.model.kind,
            "outputs": [
                {"name": c.name, "unit": c.unit, "shown": as_recorded(c.unit, recorded)}
                for c, recorded in zip(outputs, setup.recorded, strict=True)
            ],
            "inputs": [{"name": c.name, "unit": c.unit} for c in self.twin.model.inputs],
            "versions": [_version(one) for one in self.twin.versions],
            "causes": self.twin.causes,
            "asked": None if setup.relative else plain(setup.requirement),
            "horizon": None if setup.static else plain(setup.horizon),
            "judges": [c.name for c, on in zip(outputs, setup.watched, strict=True) if on],
            "parameters": [
                {"name": item.name, "value": plain(item.value), "unit": item.unit,
                 "learned": stated.get(item.name) != item.value,
                 **self._interval(item.name, item.value)}
                for item in self.twin.parameters_of(live.number)
            ],
            **self._outcome(),
            "entries": self._read,
        }  # fmt: skip

    def _interval(self, name: str, value: float) -> Mapping[str, Any]:
        """What the fit that a value comes from said of it."""
        known = self._estimates.get((name, value))
        if known is None:
            return {"interval95": None, "verdict": None}
        return {"interval95": plain(interval((known.low, known.high))), "verdict": known.verdict}

    def ordered(
        self, order: str, number: int | None, reason: str, person: str
    ) -> tuple[Event, Said]:
        """An operator's order: promote, rollback, pin (None: unpin).

        Raises:
            UsageError: it cannot be heeded.
        """
        if order == "promote":
            event = self.twin.promote(-1 if number is None else number, reason, person)
        elif order == "rollback":
            event = self.twin.rollback(reason, person)
        else:
            event = self.twin.pin(number, reason, person)
        return event, Said(None, 0, self._news(), self.row)

    def labelled(self, said: Label) -> tuple[Event, Said]:
        """What a person says to an event.

        Raises:
            UsageError: as `Twin.label`.
        """
        event = self.twin.label(said)
        return event, Said(None, 0, self._news(), self.row)

    def said(self, events: Sequence[Event]) -> Said:
        """What was found beside its work goes into the log."""
        row = self.going.ledger.row
        self.going.ledger.say(*(dataclasses.replace(event, row=row) for event in events))
        return Said(None, 0, self._news(), self.row)

    def old(self, days: int) -> Sequence[tuple[str, str, Sequence[str]]]:
        """Source, day and columns of samples that are older than the newest so many days."""
        store = self.twin.store
        if not isinstance(store, SqliteStore):
            return ()
        newest = max((stamp for _, stamp, _ in self.newest().values()), default=0)
        names = {one.name: tuple(one.channels) for one in self.spec.source}
        every = names | {one.name: () for one in self.spec.array}
        before = newest - days * DAY
        return [(one, day, every[one]) for one in every for day in store.whole(one, before)]

    def archived(self, day: Day) -> tuple[Event, Said]:
        """Samples that lie in a file now leave the store."""
        event = self.going.ledger.archived(day)
        return event, Said(None, 0, self._news(), self.row)

    def close(self) -> None:
        """A last checkpoint, then the store is let go."""
        try:
            self.going.rest()
        finally:
            self.twin.close()


def place_of(store: Path | str, twin: str) -> Path | str:
    """Where a twin's store is: a file in a folder, or a server."""
    return store / f"{twin}.db" if isinstance(store, Path) else store


def shown(view: View, model: Model, which: np.ndarray) -> Mapping[str, Any]:
    """Some rows by column, as plain values: what is not a number is None."""
    told: dict[str, Any] = {
        "row": view.row[which].tolist(), "t": view.t[which].tolist(),
        "version": view.version[which].tolist(),
    }  # fmt: skip
    predicted, before = (
        same_turn(one, view.measured, model.outputs.angles) for one in (view.predicted, view.first)
    )
    columns = {"measured": view.measured, "predicted": predicted,
               "residual": off(view.measured, view.predicted, model), "sigma": view.band,
               "before": before, "off": view.off}  # fmt: skip
    groups = model.outputs.group_of
    told["outputs"] = {
        name: {key: plain(column[which, k]) for key, column in columns.items()}
        | {"mark": view.mark[which, k].tolist(), "update": view.update[which, groups[k]].tolist()}
        for k, name in enumerate(model.outputs.names)
    }
    told["inputs"] = {
        name: plain(view.inputs[which, k]) for k, name in enumerate(model.inputs.names)
    }
    return told


def off(measured: Outputs, predicted: Outputs, model: Model) -> Outputs:
    """Measured less predicted."""
    return wrap(measured - predicted, model.outputs.angles)


def told(number: int, record: Kept) -> Mapping[str, Any]:
    """An event of the log, in plain values."""
    assert isinstance(record, Event)
    return {
        "number": number, "row": record.row, "time": record.time, "kind": record.kind,
        "signal": record.signal, "reason": record.reason, "evidence": plain(record.evidence),
    }  # fmt: skip


def _version(version: Any) -> Mapping[str, Any]:
    return {
        "number": version.number, "hash": version.hash, "parent": version.parent,
        "reason": version.reason, "row": version.row,
    }  # fmt: skip
