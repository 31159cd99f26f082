"""What a twin has in its store: versions, who is live, what happened.

Who is live follows from the log alone (promotions, roll-backs, pins): log and twin cannot differ.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from evertwin.errors import StoreError, UsageError
from evertwin.fold import Answer, Event, Record
from evertwin.loop.versions import Versions
from evertwin.models.form import Version
from evertwin.store import Estimate, Store

__all__ = ["Ledger"]

SWITCHES = ("promoted", "rolled_back", "configured", "resumed")


class Ledger:
    """The store of one twin, read once and kept in step.

    >>> Ledger.__name__
    'Ledger'
    """

    def __init__(self, store: Store, versions: Versions, name: str = "") -> None:
        """Opens the store.

        Args:
            store: that of this twin alone.
            versions: with the model as configured.
            name: of the twin.

        Raises:
            StoreError: the log was changed, or is that of another twin.
        """
        self._store = store
        self._versions = versions
        self._name = name
        self._kept = 0
        self.lives: list[int] = []
        """Versions that have been live, in order; the last one is."""
        self.pinned = False
        self._runs: list[Event] = []
        self._before = (0, 0)
        self._open()

    def _open(self) -> None:
        self._store.verify()  # nothing is built on a log that was changed
        kept = [r for r in self._store.read("version") if isinstance(r, Version)]
        configured = self._versions[0]
        if kept:
            self._versions.restore(kept)
            self._kept = len(kept)
        for event in self._store.read("event"):
            if isinstance(event, Event):
                self._own(event)
                self._follow(event)
        newest = [v for v in self._versions if v.parent is None][-1]
        if not kept or newest.hash != configured.hash:
            number = 0 if not kept else len(self._versions)
            if kept:
                again = [*self._versions, replace(configured, number=number)]
                self._versions.restore(again)
            self.keep_versions()
            self.switch(number, "configured", "as the twin file says")

    @property
    def champion(self) -> int:
        """Number of the live version."""
        return self.lives[-1]

    @property
    def before(self) -> int | None:
        """The version that was live before the present one."""
        others = [number for number in self.lives if number != self.champion]
        return others[-1] if others else None

    def add(self, record: Record, row: int) -> None:
        """Keeps a record; what it needs (its version) first."""
        self.keep_versions()
        self._store.append([record], row)
        if isinstance(record, Event):
            self._follow(record)
        if isinstance(record, Answer):
            self._estimates(record, row)

    def begin(self, row: int, time: int) -> None:
        """A run begins, or goes on where one ended at ``row``: counts what was before it."""
        goes_on = bool(
            row and self._runs and (self._runs[-1].row, self._runs[-1].time) == (row, time)
        )
        before = [event.evidence for event in (self._runs[:-1] if goes_on else self._runs)]
        self._before = _total(before, "tasks"), _total(before, "elapsed")

    def end(self, row: int, time: int, tasks: int, elapsed: int) -> None:
        """A run ends; the next one counts its tasks from here, whether or not it was tuned in."""
        before = {"tasks_before": self._before[0], "elapsed_before": self._before[1]}
        evidence = {"tasks": tasks, "elapsed": elapsed, **before}
        self.add(Event(row, time, "ran", "", f"{tasks} tasks", evidence), row)

    def keep_versions(self) -> None:
        """Keeps versions that are new."""
        new = [self._versions[n] for n in range(self._kept, len(self._versions))]
        self._store.append(new)
        self._kept += len(new)

    def _own(self, event: Event) -> None:
        """Refuses the log of another twin: its history would be taken for this one's."""
        other = event.evidence.get("twin", self._name) if event.kind == "configured" else self._name
        if other != self._name:
            raise StoreError(
                f"the store is that of the twin {other!r}, and this is {self._name!r}: give it a "
                "[store] path of its own (a twin keeps its store only under its name)"
            )

    def _follow(self, event: Event) -> None:
        number: Any = event.evidence.get("version")
        if event.kind in SWITCHES:
            if not isinstance(number, int) or number >= len(self._versions):
                raise StoreError(f"log: event {event.kind!r} names no known version: {number}")
            self.lives.append(number)
        if event.kind == "ran":
            started = event.evidence["tasks_before"]
            self._runs = [e for e in self._runs if e.evidence["tasks_before"] != started] + [event]
        if event.kind == "pinned":
            self.pinned = bool(event.evidence["pinned"])
            if isinstance(number, int) and number != self.champion:
                self.lives.append(number)

    def _estimates(self, answer: Answer, row: int) -> None:
        """The parameter history: one entry per tuned parameter."""
        content: Any = answer.content
        fit = content.get("fit")
        if not fit:
            return
        found = []
        for name, item in fit["parameters"].items():
            low, high = item["interval95"]
            bounds = (-math.inf if low is None else low, math.inf if high is None else high)
            when = [int(content.get(key, 0)) for key in ("time", "task", "elapsed")]
            value, verdict = item["value"], item["verdict"]
            counts = (*when[1:], *self._before)
            found.append(
                Estimate(row, when[0], answer.version, name, value, *bounds, verdict, *counts)
            )
        self._store.append(found)

    def switch(self, number: int, kind: str, reason: str) -> Event:
        """Makes a version live by an event."""
        version = self._versions[number]
        evidence: dict[str, Any] = {"version": number, "hash": version.hash}
        if kind == "configured":
            evidence["twin"] = self._name
        event = Event(
            version.row, 0, kind, "", f"version {number}: {reason}", evidence
        )  # fmt: skip
        self.add(event, version.row)
        return event

    def pin(self, number: int | None, reason: str) -> Event:
        """Pins a version, or lets go."""
        if number is not None and not 0 <= number < len(self._versions):
            raise UsageError(f"pin: there are versions 0 to {len(self._versions) - 1}")
        chosen = self.champion if number is None else number
        evidence = {"version": chosen, "pinned": number is not None}
        said = f"version {chosen} pinned: {reason}" if number is not None else f"unpinned: {reason}"
        event = Event(0, 0, "pinned", "", said, evidence)
        self.add(event, 0)
        return event


def _total(runs: Sequence[Mapping[str, Any]], key: str) -> int:
    return sum(int(run[key]) for run in runs)
