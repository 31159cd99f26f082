"""What a twin has in its store: versions, who is live, which runs there were, what was said.

Who is live follows from the log alone (promotions, roll-backs, pins): log and twin cannot differ.
A decision is one batch: its versions, its records and the parameter history that follows from them
are durable together or not at all.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from evertwin.errors import StoreDamaged, StoreError, UsageError
from evertwin.fold import Answer, Event, Record
from evertwin.ledger.begun import Begun
from evertwin.ledger.history import estimates
from evertwin.ledger.label import Label, acts
from evertwin.ledger.owner import check_owner
from evertwin.ledger.reconfigured import carried
from evertwin.ledger.versions import Versions
from evertwin.machines.friction.resisting import not_physical
from evertwin.models.form import Form, Size, Version
from evertwin.store import Batch, Entry, Kept, Store
from evertwin.store.sqlite.archive import Day

log = logging.getLogger("evertwin")

SWITCHES = ("promoted", "rolled_back", "configured")
ORDERS = (*SWITCHES, "pinned")


class Ledger:
    """The store of one twin, read once and kept in step.

    >>> from evertwin.models import FunctionModel, Parameters
    >>> from evertwin.signals import Layout
    >>> from evertwin.store import SqliteStore
    >>> model = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(u="1"),
    ...     Layout.of(y="1"), Layout(), Parameters.of(gain=(1.0, "1")))
    >>> ledger = Ledger(SqliteStore(":memory:"), Versions(model), "cart")
    >>> ledger.champion, ledger.runs
    (0, [])
    """

    def __init__(
        self, store: Store, versions: Versions, name: str = "", *, reading: bool = False
    ) -> None:
        """Reads the store; what it lacks of the model as configured is added.

        Args:
            store: that of this twin alone.
            versions: with the model as configured.
            name: of the twin.
            reading: nothing is written; a changed model is known to this process alone.

        Raises:
            StoreError: the log is that of another twin, or names no known version.
        """
        self.store = store
        self.versions = versions
        self._name = name
        self.lives: list[int] = []
        """Versions that have been live, in order; the last one is."""
        self._back: list[int] = []  # to where one may go, the live one last
        self.pinned = False
        self.runs: list[Begun] = []
        self.reading = reading
        self.orders: list[Event] = []
        """What was said from outside and no run has heeded yet."""
        self.spoken = 0
        """Position of the newest switch from outside of any run."""
        self.at = 0
        """Row that a run of this process has come to."""
        self.now = 0
        """Its stamp [ns], the time of what a person says meanwhile; 0: no run is at work."""
        configured = self.versions[0]
        try:
            self._open(configured)
        except StoreDamaged:
            if reading:
                raise
            store.recover()
            self.lives, self._back, self.runs, self.pinned = [], [], [], False
            self._open(configured)
        if not reading:
            self.hear()
            self.orders.clear()  # a run begins with what they say

    def _open(self, configured: Version) -> None:
        entries = self.store.entries(kinds=("event", "version"))
        records = [(entry, self.store.record(entry)) for entry in entries]
        kept = [record for _, record in records if isinstance(record, Version)]
        self.kept = len(kept)
        """Versions in the log."""
        if kept:
            self.versions.restore(kept)
        for entry, record in records:
            if isinstance(record, Event):
                check_owner(record, self._name)
                self._follow(record, entry)
        newest = [v for v in self.versions if v.parent is None][-1]
        if kept and newest.hash != configured.hash:
            now = replace(configured, number=len(self.versions))
            live = self.versions[self.champion] if self.lives else newest
            self.versions.restore([*self.versions, now])
            self._configured(now.number, *self._carried(live, newest, now))
        elif not self.lives:
            self._configured(newest.number)

    def _configured(self, number: int, *more: Event) -> None:
        if self.reading:
            self._live(more[-1].evidence["version"] if more else number)  # type: ignore[arg-type]
        else:
            self.say(self._switch(number, "configured", "as the twin file says"), *more)

    def _carried(self, live: Version, before: Version, now: Version) -> Iterator[Event]:
        """What was found of the model as it was goes on where it holds; else it is said."""
        if live.parent is None:
            return
        model = self.versions.model_of(live.form)
        holds = None if self.pinned else carried(model, live, before, now)
        if holds is None:
            log.warning(
                "the model is not the one that version %d was tuned for, so version %d is live, "
                "as the twin file says: `evertwin fit --keep` finds its numbers anew",
                live.number, now.number,
            )  # fmt: skip
            return
        found, more = holds
        reason = f"numbers of version {live.number}"
        reason += f", beside new ones: {', '.join(more)}" if more else ""
        kept = self.versions.add(
            live.form, found, parent=now.number, reason=reason, sizes=live.sizes
        )
        yield self._switch(kept.number, "promoted", reason, replaced=now.number)

    @property
    def champion(self) -> int:
        """Number of the live version."""
        return self.lives[-1]

    @property
    def before(self) -> int | None:
        """The version that was live before the present one, and was not rolled back since."""
        return self._back[-2] if len(self._back) > 1 else None

    @property
    def unfinished(self) -> Begun | None:
        """The newest run, if it has not ended."""
        return self.runs[-1] if self.runs and not self.runs[-1].over else None

    # ------------------------------------------------------------------ writing

    def batch(self, records: Sequence[Record], row: int, run: int = 0) -> list[Kept]:
        """What a decision adds to the log: new versions, records, the estimates in answers."""
        said: list[Kept] = [self.versions[n] for n in range(self.kept, self.versions.known)]
        for record in records:
            said.append(record)
            if isinstance(record, Answer):
                said += estimates(record.content, record.version, row, self.counts(run))
            elif isinstance(record, Event) and record.kind == "followed":
                version: Any = record.evidence["version"]
                said += estimates(record.evidence, version, row, self.counts(run))
        return said

    def commit(self, batch: Batch, *, wait: bool = True) -> None:
        """Takes a batch of entries as `batch` gives them; raises before anything is written."""
        begin = self.store.head.length
        for record in batch.records:
            if isinstance(record, Event):
                self._check(record)
        self.store.commit(batch, wait=wait)
        for k, record in enumerate(batch.records):
            if isinstance(record, Version):
                self.kept += 1
            if isinstance(record, Event):
                self._follow(record, Entry(begin + k + 1, batch.run, "event", record.row, "", ""))

    def say(self, *events: Event) -> None:
        """Keeps what is said from outside of any run, with versions that are new.

        Where another process works with the store it is asked to: it heeds at its next beat.
        """
        if self.reading:
            self.store.ask(events)
            return
        batch = self.batch(events, 0)
        if batch:
            self.commit(Batch(batch))
        self.orders += [e for e in events if e.kind in ORDERS or acts(e)]

    def keep(
        self, form: Form, values: Mapping[str, float], reason: str, sizes: tuple[Size, ...] = ()
    ) -> Version:
        """A version of what was found outside of any run, its parent the live one; nothing more.

        Raises:
            UsageError: a value lies outside its bounds, or the store is only looked at.
        """
        if self.reading:
            raise UsageError("the twin is open to look at: a version needs its store")
        self.versions.model_of(form).parameters.with_values(values)
        version = self.versions.add(form, values, parent=self.champion, reason=reason, sizes=sizes)
        self.say()
        return version

    def hear(self) -> None:
        """What other processes have asked for goes into the log."""
        asked, last = self.store.asked()
        if not last:
            return
        events = [
            replace(event, row=self.row, time=event.time or self.now)
            for event in asked if self._can(event)
        ]  # fmt: skip
        self.commit(Batch(events, heard=last))
        self.orders += [e for e in events if e.kind in ORDERS or acts(e)]

    def _can(self, event: Event) -> bool:
        """Does an order name a version that there is? What cannot be heeded is dropped."""
        try:
            self._check(event)
        except StoreError as error:
            log.warning("%s", error)
            return False
        return True

    # ------------------------------------------------------------------ the operator's hand

    def promote(self, number: int, reason: str, person: str = "") -> Event:
        """Makes a version live, whatever the gate says.

        Raises:
            UsageError: there is no such version, another one is pinned, or it is not physical.
        """
        self._refuse_pinned(self.versions[number].number)
        self._refuse_unphysical(number)
        return self.switch(number, "promoted", reason, person)

    def roll_back(self, reason: str, person: str = "") -> Event:
        """Makes the champion before the present one live again.

        Raises:
            UsageError: there was none before, or the present one is pinned.
        """
        if self.before is None:
            raise UsageError(f"roll back: no other version has been live before {self.champion}")
        self._refuse_pinned(self.before)
        self._refuse_another(self.before)
        return self.switch(self.before, "rolled_back", reason, person)

    def _refuse_pinned(self, number: int) -> None:
        if self.pinned and number != self.champion:
            raise UsageError(
                f"version {self.champion} is pinned and stays live: unpin it first, or pin "
                f"version {number}"
            )

    def _refuse_unphysical(self, number: int) -> None:
        """What has been live may be so again: a roll-back asks nothing."""
        self._refuse_another(number)
        p = self.versions[number].p
        wrong = "" if number in self.lives else not_physical(self.versions.model(number), p)
        if wrong:
            raise UsageError(
                f"version {number} is not physical: {wrong}: fit it with bounds on these numbers, "
                "or on rows that tell them apart"
            )

    def _refuse_another(self, number: int) -> None:
        """Numbers of a model that the twin file said once, and no longer says."""
        own, now = self.versions[number].names, self.versions.model(number).parameters.names
        if own != now:
            differ = ", ".join(sorted(set(own) ^ set(now))) or "their order"
            raise UsageError(f"version {number} is of another model, which differs in {differ}")

    def switch(self, number: int, kind: str, reason: str, person: str = "") -> Event:
        """Makes a version live by an event."""
        event = self._switch(number, kind, reason, person, self.champion)
        self.say(event)
        return event

    def _switch(
        self, number: int, kind: str, reason: str, person: str = "", replaced: int = -1
    ) -> Event:
        evidence: dict[str, Any] = {"version": number, "hash": self.versions[number].hash}
        if kind == "configured":
            evidence["twin"] = self._name
        else:
            evidence["replaced"] = replaced
        how = "rolled back to " if kind == "rolled_back" else ""
        return self._order(kind, f"{how}version {number}: {reason}", evidence, person)

    def pin(self, number: int | None, reason: str, person: str = "") -> Event:
        """Pins a version, or lets go."""
        if number is not None and not 0 <= number < len(self.versions):
            raise UsageError(f"pin: there are versions 0 to {len(self.versions) - 1}")
        chosen = self.champion if number is None else number
        self._refuse_unphysical(chosen)
        evidence = {"version": chosen, "pinned": number is not None}
        said = f"version {chosen} pinned: {reason}" if number is not None else f"unpinned: {reason}"
        return self._ordered("pinned", said, evidence, person)

    def label(self, said: Label) -> Event:
        """Keeps what a person says to an event of the log; a run heeds what acts.

        Raises:
            UsageError: there is no such event, or it is about no rows where some are called faulty.
        """
        number = said.event
        (entry,) = (self.store.entries(number - 1, most=1) if number > 0 else ()) or (None,)
        if entry is None or entry.number != number or entry.kind != "event":
            raise UsageError(f"label: the log has no event {number}")
        about = self.store.record(entry)
        assert isinstance(about, Event)
        since = [one.ended["rows"] for one in self.runs if one.ended and one.number >= entry.run]
        evidence = dict(said.evidence(about, sum(since)))
        named = f"{said.verdict} {said.cause}".rstrip()
        return self._ordered("labelled", f"{about.kind}: {named}: {said.reason}", evidence, "")

    def labels(self, run: Begun, position: int) -> list[Event]:
        """Labels from between a run and the one before it, which it heeds first; none that it had
        heeded when the log was at ``position``."""
        before = max((one.last for one in self.runs if one.number < run.number), default=0)
        found = list[Event]()
        for entry in self.store.entries(before, ("event",)):
            record = self.store.record(entry)
            assert isinstance(record, Event)
            if entry.run == 0 and entry.number < run.position and acts(record):
                found.append(record)
            if entry.run == run.number and entry.number <= position and record.kind == "heeded":
                return []
        return found

    def archived(self, day: Day) -> Event:
        """Names a file of samples in the log; they leave the store with it."""
        event = day.event(self.row)
        self.commit(Batch([event], moved=(day.gone,)))
        return event

    def _order(self, kind: str, said: str, evidence: dict[str, Any], person: str) -> Event:
        told = evidence | ({"person": person} if person else {})
        return Event(self.row, self.now, kind, "", said, told)

    def _ordered(self, kind: str, said: str, evidence: dict[str, Any], person: str) -> Event:
        event = self._order(kind, said, evidence, person)
        self.say(event)
        return event

    @property
    def row(self) -> int:
        """Row from which on a run heeds what is said now: behind all that it has said and seen."""
        run, seen = self.unfinished, self.store.progress()
        if run is None:
            return 0
        said = [e.row for e in self.store.entries(run.position - 1) if e.run == run.number]
        come = seen.rows if seen is not None and seen.run == run.number else 0
        return max(*said, come - 1, self.at - 1) + 1

    # ------------------------------------------------------------------ following

    def _check(self, event: Event) -> None:
        number: Any = event.evidence.get("version")
        known = isinstance(number, int) and number < len(self.versions)
        if event.kind in SWITCHES and not known:
            raise StoreError(f"log: event {event.kind!r} names no known version: {number}")

    def _follow(self, event: Event, entry: Entry) -> None:
        self._check(event)
        number: Any = event.evidence.get("version")
        if event.kind in ORDERS and entry.run == 0:
            self.spoken = entry.number
        if event.kind in SWITCHES:
            while event.kind == "rolled_back" and self._back[-1:] not in ([], [number]):
                del self._back[-1]
            self._live(number)
        elif event.kind == "pinned":
            self.pinned = bool(event.evidence["pinned"])
            if isinstance(number, int) and number != self.champion:
                self._live(number)
        elif event.kind == "started":
            self.runs.append(Begun(entry.run, entry.number, dict(event.evidence)))
        elif event.kind == "ran":
            self.runs[-1] = replace(self.runs[-1], ended=dict(event.evidence), last=entry.number)

    def _live(self, number: int) -> None:
        self.lives.append(number)
        if self._back[-1:] != [number]:
            self._back.append(number)

    def counts(self, run: int) -> tuple[int, int]:
        """Tasks of the runs before a run, and the time within them [ns]."""
        ended = [one.ended for one in self.runs if one.ended is not None and one.number < run]
        return sum(e["tasks"] for e in ended), sum(e["elapsed"] for e in ended)
