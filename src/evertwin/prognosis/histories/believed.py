"""Which numbers of the log tell of wear: of versions that went live, and of fits that nothing
speaks against.

A fit's numbers are an estimate. Where the machine fitted before and its form no longer does, where
the tuned numbers miss what is asked, or where a sensor would look the same, they wait until a trial
on unseen rows has proven them. They leave again where that trial refutes them, where their rows
turn out to be a sensor's or faulty, and where they were a sensor's as likely as the machine's, and
the machine went back by itself to what it was.

All of it follows from the log in its order; nothing is taken out of that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from evertwin.fold import Answer, Event, Request
from evertwin.ledger.caveats import in_doubt_of
from evertwin.models.form import Version
from evertwin.store import Estimate, Store

WORSE = -0.1
"""Gain on unseen rows up to which a trial refutes the numbers; that they gain little does not."""
SWITCHES = ("configured", "promoted", "rolled_back", "pinned")
NEAR = 0.05
"""Share by which numbers differ at most that are what they were."""
MORE = 1.5
"""So many times what was in doubt a number has to have moved for the rest to be the machine's."""
WEIGHS = (*SWITCHES, "rejected", "abnormal", "normal", "labelled", "maintained")
"""Events after which other numbers may count."""
LEARNED = ("alarm", "drift", "normal", "promoted", "tuned")
"""Events that tell of the machine: who calls one true says that it is no sensor."""


DROPPED = "it was not taken up"
"""Why an answer does not count of which the decision said nothing, as in a probation."""


@dataclass
class Told:
    """What one fit, or the recursion at one time, said.

    >>> Told([], 1, 90, (10, 90)).counts
    True
    """

    estimates: list[Estimate]
    run: int
    row: int
    """At which it became known."""
    window: tuple[int, int]
    """Rows that it looked at."""
    outputs: Mapping[str, Any] = field(default_factory=dict)
    """What it left of each output."""
    version: int | None = None
    """That carries its numbers: of its candidate, or the one that it followed."""
    waits: str = ""
    """What speaks against it until its version is live; empty: nothing."""
    live: bool = False
    """Has its version been live since?"""
    alike: tuple[str, ...] = ()
    """What would look the same."""
    alone: bool = True
    """Is nothing of this said by its own answer, but by the live version's?"""
    beyond: set[str] = field(default_factory=set)
    """Numbers that have moved on by far more than was in doubt."""
    gone: str = ""
    """Why it left; empty: it did not."""
    by: str = ""
    """Channel whose sensor it is told of as, which later rows may refute."""
    unsaid: list[str] = field(default_factory=list)
    """Kinds of events of its answer that the decision has not said: then it was not taken up."""

    @property
    def counts(self) -> bool:
        """Does it tell of the machine?"""
        return not self.against

    @property
    def against(self) -> str:
        """Why it does not count; empty: it does."""
        waits = "" if self.live else self.waits
        return self.gone or waits or (DROPPED if self.unsaid else "")


def believed(store: Store) -> tuple[Told, ...]:
    """All that fits have said, in the order of the log, with what became of it."""
    log = _Log()
    for entry in store.entries():
        if entry.kind in _READ:
            log.read(entry.run, entry.row, store.record(entry))
    return tuple(log.told)


_READ = ("answer", "estimate", "event", "request", "version")


@dataclass
class _Log:
    """The log as far as it was read."""

    told: list[Told] = field(default_factory=list)
    live: int = 0
    lives: set[int] = field(default_factory=lambda: {0})
    """Versions that have been live."""
    alike: dict[int, tuple[str, ...]] = field(default_factory=dict)
    """Version → what would look the same."""
    values: dict[int, dict[str, float]] = field(default_factory=dict)
    """Version → its numbers."""
    clean: dict[str, float] = field(default_factory=dict)
    """Those of the newest live version that nothing would look the same as."""
    doubted: dict[str, float] = field(default_factory=dict)
    """By how much the live ones in doubt have differed from these, at most."""
    fresh: int | None = None
    """The newest version, until an answer has taken it."""
    windows: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Request of the run → its rows."""
    run: int = 0
    ended: bool = True
    """Is no run under way?"""
    rows: int = 0
    """Of the run that ended last."""
    off: int = 0
    """Row from which on the live version was off when that was last said."""
    maintained: int = 0
    """Fits when something was last maintained."""

    def read(self, run: int, row: int, record: object) -> None:
        """One entry of the log."""
        match record:
            case Request():
                self.windows[record.id] = record.window
            case Version():
                self.fresh = record.number
                self.values[record.number] = dict(zip(record.names, record.values, strict=True))
                self.clean = self.clean or self.values[record.number]
                self.alike[record.number] = in_doubt_of(record.reason)
            case Answer():
                self._answered(run, row, record)
            case Estimate():
                self._estimated(run, record)
            case Event():
                self._said(run, record)

    def _answered(self, run: int, row: int, answer: Answer) -> None:
        content: Any = answer.content
        if content.get("fit"):
            events = content.get("events") or ()
            own = tuple(said for one in events for said in in_doubt_of(one["reason"]))
            candidate = content.get("candidate") or {}
            number = candidate.get("version", self.fresh) if candidate else None
            self.told.append(Told(
                [], run, row, self.windows.get(answer.id, (row, row)),
                content["fit"].get("outputs", {}), number,
                content.get("against") or (own[0] if own else ""),
                alike=tuple(dict.fromkeys((*own, *self.alike.get(self.live, ())))),
                alone=not own, unsaid=[one["kind"] for one in events],
            ))  # fmt: skip
        self.fresh = None

    def _estimated(self, run: int, one: Estimate) -> None:
        last = self.told[-1] if self.told else None
        same = last is not None and (not last.estimates or _key(last.estimates[0]) == _key(one))
        if last is None or not same or one.name in {other.name for other in last.estimates}:
            last = Told([], run, one.row, (one.row, one.row))
            self.told.append(last)
        last.estimates.append(one)
        moved = abs(one.value - self.clean.get(one.name, one.value))
        far = moved > MORE * self.doubted.get(one.name, 0.0) and moved > NEAR * abs(one.value)
        if last.alone and far:
            last.beyond.add(one.name)

    def _said(self, run: int, event: Event) -> None:
        evidence: Any = event.evidence
        newest = self.told[-1] if self.told else None
        at_once = newest is not None and (newest.run, newest.row) == (run, event.row)
        if newest is not None and at_once and event.kind in newest.unsaid:
            newest.unsaid.remove(event.kind)
        if event.kind == "started":
            self.run, self.ended, self.windows, self.off = run, False, {}, 0
        elif event.kind == "ran":
            self.ended, self.rows = True, int(evidence["rows"])
        elif event.kind == "followed":
            alike = self.alike.get(self.live, ())
            rows = (event.row, event.row)
            outputs = evidence["fit"].get("outputs", {})
            self.told.append(Told([], run, event.row, rows, outputs, self.live, alike=alike))
        elif event.kind == "maintained":
            self.maintained = len(self.told)
        elif event.kind == "labelled":
            self._labelled(evidence)
        elif event.kind == "rejected" and evidence.get("gain", 0.0) <= WORSE:
            self._leave(self._of(evidence.get("version")), event.reason)
        elif event.kind == "suspected":
            self.off = int(evidence.get("first", event.row))
        elif event.kind == "abnormal" and "number" in evidence:  # of a channel
            since = evidence.get("since")
            since = self.off if since is None else since
            late = [one for one in self._in(run) if one.row > since]
            self._leave(late, event.reason, event.signal)
        elif event.kind == "normal" and evidence.get("doubt"):
            for one in self._in(run):
                if one.by == evidence["doubt"]:
                    one.gone = one.by = ""
        elif event.kind in SWITCHES and isinstance(evidence.get("version"), int):
            self._switched(event, evidence["version"])

    def _switched(self, event: Event, number: int) -> None:
        old = self.live
        if number == old:
            return
        alike = self.alike.get(old, ())
        back = number if number in self.lives else self._as_before(number)
        if event.kind == "rolled_back" and "since" not in event.evidence:
            self._leave(self._of(old), event.reason)
        elif alike and back is not None and not self.alike.get(back):
            said = f"{'; '.join(alike)}, and {event.reason}"
            hit = {*alike}.intersection
            self._leave((one for one in self.told[self.maintained :] if hit(one.alike)), said)
            self.alike[number] = ()
        for one in self._of(number):
            one.live, one.alike = True, one.alike if self.alike.get(number) else ()
        if number in self.lives and event.kind != "configured":
            self._again(event, number)
        self.live = number
        self.lives.add(number)
        new = self.values.get(number, {})
        if not self.alike.get(number):
            self.clean, self.doubted = new, {}
        for name, value in new.items():
            moved = abs(value - self.clean.get(name, value))
            self.doubted[name] = max(self.doubted.get(name, 0.0), moved)

    def _again(self, event: Event, number: int) -> None:
        """A version that was live is so again: its numbers are told anew."""
        known = next((one for one in reversed(self._of(number)) if one.counts), None)
        last = self.told[-1].estimates[:1] if self.told else []
        if known is None or not last:
            return
        passed = max(event.time - last[0].time, 0)
        when: dict[str, Any] = {
            "row": event.row, "time": event.time, "task": last[0].task,
            "elapsed": last[0].elapsed + passed, "tasks_before": last[0].tasks_before,
            "elapsed_before": last[0].elapsed_before,
        }  # fmt: skip
        told = [replace(one, **when) for one in known.estimates]
        rows = event.row, event.row
        self.told.append(Told(told, self.run, event.row, rows, version=number, live=True))

    def _as_before(self, number: int) -> int | None:
        """A version that was live, with about the numbers of this one."""
        new = self.values.get(number, {})
        for one in sorted(self.lives, reverse=True):
            old = self.values.get(one, {})
            if old.keys() == new.keys() and all(
                math.isclose(new[name], old[name], rel_tol=NEAR) for name in new
            ):
                return one
        return None

    def _labelled(self, evidence: Any) -> None:
        machine = evidence["verdict"] == "true" and evidence["kind"] in LEARNED
        if machine or evidence["verdict"] == "cause":
            self.alike = {}
            for one in self.told:
                one.alike = ()
        elif evidence["verdict"] in ("faulty", "false alarm") and evidence.get("rows"):
            # counted from the run that heeds it
            first, last = (int(row) + (self.rows if self.ended else 0) for row in evidence["rows"])
            hit = [one for one in self._in(self.run)
                   if one.window[0] <= last and one.window[1] > first]  # fmt: skip
            self._leave(hit, f"{evidence['verdict']}, as was said of its rows")

    def _in(self, run: int) -> Iterator[Told]:
        """Of a run."""
        return (one for one in self.told if one.run == run)

    def _of(self, number: int | None) -> list[Told]:
        """With a version's numbers."""
        return [one for one in self.told if one.version is not None and one.version == number]

    def _leave(self, which: Any, why: str, by: str = "") -> None:
        for one in which:
            if not one.gone:
                one.gone, one.by = why, by


def _key(one: Estimate) -> tuple[int, int, int, int]:
    return one.row, one.time, one.task, one.elapsed
