"""One twin of the service: its sources feed a bounded queue, one thread stores, another folds.

The event loop never waits for either. Samples are durable before their source hears `committed`,
and before they are folded: a fold that takes long holds up no acknowledgement, and what was not
folded when the process died is folded from the store. A twin that fails, at its start or at any
sample, is quarantined with the reason; the others do not notice.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

from evertwin.backoff import Backoff
from evertwin.errors import EvertwinError, NotYet, OwnershipLost, StoreUnwritable, UsageError
from evertwin.fold import Chunk, Event
from evertwin.publishers.contract import Kind, News, Publisher, Told
from evertwin.rows import Numbered
from evertwin.service.health.condition import Condition
from evertwin.service.site.site_plan import Plan
from evertwin.service.twin.archiving import keep_days
from evertwin.service.twin.life_watch import tell_lives
from evertwin.service.twin.live_twin import AtWork, Said, place_of, told
from evertwin.service.twin.log_lines import Sayings
from evertwin.service.twin.process import Process
from evertwin.service.twin.publishing import tellers
from evertwin.service.twin.questions import answer
from evertwin.service.twin.queue_drain import PATIENCE, Gathering, at_rest
from evertwin.service.twin.quiet_sources import Silence, timeouts_of
from evertwin.service.twin.twin_status import LONG, status_of
from evertwin.service.twin.twin_thread import Lane
from evertwin.sources.live.contract import Around, Health, LiveSource
from evertwin.sources.live.registry import open_live
from evertwin.store import SqlStore, looked_at

T = TypeVar("T")
State: TypeAlias = Literal["starting", "running", "ended", "quarantined", "stopped"]
LOG = logging.getLogger("evertwin.service")
HANGS = 60.0
"""Seconds at one piece of samples, from which on a model is taken to hang."""
GRACE, CLOSES = 2.0, 60.0
"""Seconds in which a model that hangs may come back yet when its twin is stopped; and in which any
other lets go of its store."""
KEPT = 64
"""Messages with rows, and times as many events, that a slow reader may be behind."""


class Runner:
    """A twin with its sources and publishers.

    >>> Runner.__name__
    'Runner'
    """

    def __init__(
        self, plan: Plan, store: Path | str, process: Process, token: int | None = None
    ) -> None:
        self.plan = plan
        self.process = process
        self.token = token
        """Under which it writes to a store that nodes share."""
        self.name = plan.name
        self.state: State = "starting"
        self.reason = ""
        self.hopeless = False
        """Did it fail at its start, for a reason that lies with this process or the twin?"""
        self.store = store
        self.dropped = 0
        """Samples that were dropped because too many waited."""
        self.row = 0
        timeouts = {} if plan.spec is None else timeouts_of(plan.spec)
        self._silence = Silence(timeouts, time.monotonic())
        asked = plan.spec is not None and math.isfinite(plan.spec.anomaly.requirement)
        self.condition = Condition(timeouts, plan.entry.stale, asked=asked)
        self.durable: deque[float] = deque(maxlen=1000)
        """Seconds from the arrival of samples until they were durable."""
        self.folded: deque[float] = deque(maxlen=1000)
        """Seconds from their arrival until what the twin says of them was durable too."""
        self.rows: deque[tuple[int, Mapping[str, Any]]] = deque(maxlen=KEPT)
        """(serial number, rows) as they were told."""
        self.serial = 0
        self.events: deque[tuple[int, Mapping[str, Any]]] = deque(maxlen=16 * KEPT)
        self.sources: list[LiveSource] = []
        self.before: Mapping[str, Health] = {}
        """What the sources of the same twin counted before it was taken anew."""
        self.publishers: list[Publisher] = []
        self.work: AtWork | None = None
        self.turn = asyncio.Semaphore(1)
        """One question after the other."""
        self.again = Backoff(1.0, 30.0)
        self.due: float | None = None
        """When it is tried again, because its store could not be written; None: not by itself."""
        self._told = ""
        """The reason that the log has."""
        self._sayings = Sayings(plan.name)
        self.warm = process.warm
        self.began = time.monotonic()
        """When it was started."""
        self._reader: SqlStore | None = None
        self.lane = Lane(f"twin {plan.name}")
        self._storing = ThreadPoolExecutor(1, thread_name_prefix=f"keep {plan.name}")
        most = plan.entry.queue
        self._came: Gathering[tuple[LiveSource | None, Chunk, float]] = Gathering(
            process.storing, most
        )
        self._kept: Gathering[tuple[Numbered, float]] = Gathering(process.folding, most)
        """Stored, not folded yet."""
        self.open = 0
        """Pieces of samples that came and are not folded yet."""
        self._reading: list[asyncio.Task[None]] = []
        self._working: list[asyncio.Task[None]] = []

    # ------------------------------------------------------------------ its life

    async def start(self) -> None:
        """Opens the twin, its sources and publishers; what fails puts it into quarantine."""
        self.began = time.monotonic()
        with self._guarded():
            if self.plan.spec is None:
                raise UsageError(self.plan.wrong)
            self.work = work = await self.lane.do(self._opened)
            self.events.extend(work.before)
            looks = await self.lane.do(lambda: work.looks)
            self.condition.recalled((event for _, event in work.before), looks)
            self.condition.looked(work.now)
            self.row = self.work.row
            newest = await self.lane.do(self.work.newest)
            around = Around(Path(self.plan.spec.folder), twin=self.name)
            specs = {s.name: s for s in self.plan.spec.source + self.plan.spec.array}
            for one in self.plan.sources:
                source = open_live(one, specs[one.source], around)
                self.sources.append(source)
                source.open()
                if one.source in newest:
                    task, stamp, clock = newest[one.source]
                    source.resume(stamp, task)
                    if clock is not None and hasattr(source, "go_on"):
                        source.go_on(clock)
            self.publishers = tellers(self.plan, self.work, self.answer)
            self.state, self.lane.worked = "running", 0.0  # a start costs other than the rest
            self._reading = [asyncio.create_task(self._read(source)) for source in self.sources]
            every = (self._store(), self._fold(), self._wait())
            self._working = [asyncio.create_task(one) for one in every]
            if self.plan.entry.days is not None:
                self._working.append(asyncio.create_task(keep_days(self, self.plan.entry.days)))
            if self.plan.spec.indicator:
                self._working.append(asyncio.create_task(tell_lives(self)))
            took = time.monotonic() - self.began
            after = f" after {took:.0f} s" if took > LONG else ""
            LOG.info("%s: running%s", self.name, after, extra={"twin": self.name})

    def _opened(self) -> AtWork:
        if self.warm is not None:
            assert self.plan.spec is not None
            self.warm(self.plan.spec)
        return AtWork(self.plan, self.store, self.process.pool, self.token)

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        """Whatever a twin raises ends that twin alone."""
        starts = self.state == "starting"
        try:
            yield
        except OwnershipLost as error:
            self._quarantine(str(error))
        except StoreUnwritable as error:
            self.due = time.monotonic() + self.again.next()
            self._quarantine(str(error))
        except Exception as error:  # noqa: BLE001  (a model or plug-in of the user's may raise any)
            self.hopeless, known = starts, isinstance(error, EvertwinError)
            self._quarantine(str(error) if known else f"{type(error).__name__}: {error}")

    def _quarantine(self, reason: str) -> None:
        self.state, self.reason = "quarantined", reason
        if self.due is None or not self._told:  # one line, however often it is tried again
            LOG.error("%s: quarantined: %s", self.name, reason, extra={"twin": self.name})
        self._told = reason
        for source in self.sources:
            source.close()
        for task in (*self._reading, *self._working):
            if task is not asyncio.current_task():
                task.cancel()
        self._tell()

    async def abandon(self, reason: str) -> None:
        """Drops everything at once: the twin is another node's."""
        self._quarantine(reason)
        await self.stop()

    def anew(self) -> Runner:
        """The same twin, to be tried again."""
        fresh = Runner(self.plan, self.store, self.process, self.token)
        fresh.again, fresh._told, fresh.row, fresh.warm = self.again, self._told, self.row, None
        return fresh.carry(self)

    def carry(self, old: Runner) -> Runner:
        """Counts go on from those of the same twin before."""
        counted = {one.name: one.health.after(old.before.get(one.name)) for one in old.sources}
        self.before, self.dropped = {**old.before, **counted}, old.dropped
        return self

    async def stop(self) -> None:
        """Sources closed, what waits folded and durable, a checkpoint kept, the store released."""
        for source in self.sources:
            source.close()
        running = self.state == "running"
        if running and self._reading:
            patience = PATIENCE if self.stuck < PATIENCE or self.lane.slow else 0.0
            await at_rest(self._reading, (self._came, self._kept), self._working, patience)
        self.state = self.state if self.state == "quarantined" else "stopped"
        for publisher in self.publishers:
            await publisher.close()
        if self.work is not None:
            close = self.work.close if running else self.work.twin.close
            closing = self.lane.submit(close)
            if await self.lane.ends(closing, GRACE, CLOSES, lambda: self.stuck > PATIENCE):
                with self._guarded():
                    closing.result()
            else:  # it is closed when it comes back; what was not folded is folded from the store
                LOG.error("%s: left: %s", self.name, self.hanging, extra={"twin": self.name})
        if self._reader is not None:
            self._reader.close()
        for thread in (self.lane, self._storing):
            thread.shutdown(wait=False)
        self._tell()

    @property
    def stuck(self) -> float:
        """Seconds that its thread has been at one piece of samples, or at one question."""
        piece = 0.0 if self.work is None else self.work.since
        since = self.lane.busy_since
        return 0.0 if since is None else time.monotonic() - max(since, piece)

    @property
    def hanging(self) -> str:
        """That it does not come back, and where it is."""
        what = "it is at slow work" if self.lane.slow else "its model has not come back"
        return f"{what} for {self.stuck:.0f} s: {self.lane.place}"

    def watch(self) -> None:
        """A model that does not come back is put into quarantine."""
        if self.state == "running" and self.stuck > HANGS and not self.lane.slow:
            self._quarantine(self.hanging)

    # ------------------------------------------------------------------ samples

    async def _read(self, source: LiveSource) -> None:
        """The samples of one source into the queue."""
        with self._guarded():
            async for chunk in source.chunks():
                if self._came.full() and self.plan.entry.full == "drop":
                    self.dropped += len(self._came.get_nowait()[1].t)
                    self._came.task_done()
                    self.open -= 1
                self.open += 1
                await self._came.put((source, chunk, time.perf_counter()))
                self._silence.came(chunk, time.monotonic())
                self.condition.came(chunk.source)

    async def _wait(self) -> None:
        """For sources that stay away, no longer than the twin file says."""
        with self._guarded():
            async for tick in self._silence.ticks():
                self.open += 1
                await self._came.put((None, tick, time.perf_counter()))

    async def _store(self) -> None:
        """What came, into the store, whatever the twin does meanwhile."""
        assert self.work is not None
        loop = asyncio.get_running_loop()
        with self._guarded():
            async for taken in self._came.together(self.process.pause):
                chunks = [chunk for _, chunk, _ in taken]
                kept = await loop.run_in_executor(self._storing, self.work.keep, chunks)
                self.again.reset()
                self._told = ""
                now = time.perf_counter()
                for source, chunk, came in taken:
                    if source is not None:
                        source.committed(chunk)
                    self.durable.append(now - came)
                for one, (_, _, came) in zip(kept, taken, strict=True):
                    await self._kept.put((one, came))

    async def _fold(self) -> None:
        """What is stored, through the twin."""
        assert self.work is not None
        with self._guarded():
            async for taken in self._kept.together(lambda: 0.0):
                kept = [one for one, _ in taken]
                said = await self.lane.do(partial(self.work.fold, kept))
                now = time.perf_counter()
                self.folded.extend(now - came for _, came in taken)
                self._take(said)
                self.open -= len(taken)

    def _take(self, said: Said) -> None:
        """What became known goes to whoever listens."""
        self.row = max(self.row, said.row)
        if said.rows is not None:
            self.serial += 1
            self.rows.append((self.serial, {**said.rows, "skipped": said.skipped}))
            self._out("rows", said.rows)
        self._remember(said.events)
        for _, event in said.events:
            self._sayings.log(event)
        if said.events and self.publishers:
            self._out("events", {"events": [event for _, event in said.events]})
        self._tell()

    def _remember(self, events: Sequence[tuple[int, Mapping[str, Any]]]) -> None:
        self.events.extend(events)
        for _, event in events:
            self.condition.heard(event)
        if self.work is not None:
            self.condition.looked(self.work.now)

    def _out(self, kind: Told, content: Mapping[str, Any]) -> None:
        for publisher in self.publishers:
            publisher.publish(News(self.name, kind, content))

    def beat(self) -> None:
        """Once in a while: health goes out."""
        if self.publishers:
            self._out("health", self.status())

    def _tell(self) -> None:
        for listener in self.process.listeners:
            listener.set()

    # ------------------------------------------------------------------ questions

    async def ask(self, question: Callable[[AtWork], T]) -> T:
        """Of the twin at work, in its thread; UsageError where it is not, `NotYet` as it starts."""
        if self.work is None or self.state not in ("running", "ended"):
            kind = NotYet if self.state == "starting" else UsageError
            raise kind(f"{self.name} is {self.state}: {self.reason}".rstrip(": "))
        return await self.lane.do(partial(question, self.work))

    async def done(self, work: Callable[[AtWork], tuple[Event, Said]]) -> Mapping[str, Any]:
        """Something that goes into the log; the event that says it."""
        event, said = await self.ask(work)
        self._take(said)
        return told(said.events[-1][0] if said.events else 0, event)

    async def lives(self, found: Mapping[str, Any]) -> None:
        """How long its components last: alarms into the log, all of it to publishers."""
        if found["events"]:
            self._take(await self.ask(lambda work: work.said(found["events"])))
        self.condition.lived(found["life"]["alarms"])
        self._out("life", found["life"])

    async def answer(self, kind: Kind, question: Mapping[str, Any]) -> Mapping[str, Any]:
        """The answer to a question, from the newest rows."""
        return await answer(self, kind, question)

    @property
    def reader(self) -> SqlStore:
        """Its store to look at, from any thread, whatever the twin does meanwhile.

        Raises:
            StoreError: there is none yet, or it cannot be read.
        """
        if self._reader is None:
            self._reader = looked_at(place_of(self.store, self.name), self.name)
        return self._reader

    def events_after(self, cursor: int, most: int) -> Sequence[tuple[int, Mapping[str, Any]]]:
        """Events behind a position in the log, from memory where they are still there, else from
        the store."""
        newest = list(self.events)
        if newest and newest[0][0] <= cursor + 1:
            return [one for one in newest if one[0] > cursor][:most]
        store = self.reader
        found = store.entries(cursor, ("event",), most)
        return [(entry.number, told(entry.number, store.record(entry))) for entry in found]

    @property
    def waiting(self) -> int:
        """Pieces of samples that wait."""
        return self._came.qsize() + self._kept.qsize()

    def status(self) -> dict[str, Any]:
        """How it is, in plain values."""
        return status_of(self)
