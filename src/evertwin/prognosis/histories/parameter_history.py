"""The parameter history as series on one clock: what the store has kept of every fit.

A run of the twin counts its tasks and its time from zero, so runs are joined: where the count does
not rise a new run has begun, and goes on after the last. Stamps are taken as they are where they
rise with the time in tasks; recordings that each begin at zero are counted by the time in tasks.

What the operator said and did, as the store's log keeps it.

The log only grows, so nothing is taken out of it: a label that was withdrawn, or that cannot be
read, stays there and does not count. What counts and what does not is told here, in one place.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from evertwin.errors import ConfigError
from evertwin.fold import Event
from evertwin.models import Parameters
from evertwin.prognosis.histories.believed import Told, believed
from evertwin.prognosis.laws.series.calendar import FIRST, LAST, UNITS, Calendar
from evertwin.signals.units import conversion
from evertwin.store import Estimate, Store
from evertwin.types import Vector

DECISIONS = ("confirmed", "postponed", "declined")
DONE = ("replaced", "adjusted", "failed")
MAINTAINED, WITHDRAWN = "maintained", "withdrawn"

State = Literal["holds", "superseded", "withdrawn", "other clock", "unreadable"]


class Label(NamedTuple):
    """One thing that was said or done.

    >>> Label._fields
    ('event', 'state', 'problem')
    """

    event: Event
    state: State
    problem: str = ""
    """Why it cannot be read."""

    @property
    def verdict(self) -> str:
        """confirmed, postponed, declined, replaced or adjusted."""
        kind = self.event.evidence.get("kind")
        return kind if self.event.kind == MAINTAINED and isinstance(kind, str) else self.event.kind


def labels(events: Sequence[Event], clock: str) -> tuple[Label, ...]:
    """Every label in the order of the log, and whether it counts.

    A decision holds until the next one on its component, or until that is maintained.

    >>> when = {"clock": "run", "at": 9.0}
    >>> late = Event(0, 0, "postponed", "pump", "no spare part", when)
    >>> [one.state for one in labels([late, Event(0, 0, "withdrawn", "pump", "came")], "run")]
    ['withdrawn']
    """
    found: list[Label] = []
    for event in events:
        if event.kind == WITHDRAWN:
            last = newest(found, event.signal)
            if last is not None:
                found[last] = found[last]._replace(state="withdrawn")
        elif event.kind in (*DECISIONS, MAINTAINED):
            problem = _problem(event)
            other = event.evidence.get("clock") != clock
            state: State = "unreadable" if problem else "other clock" if other else "holds"
            found.append(Label(event, state, problem))
    later: set[str] = set()
    for k in reversed(range(len(found))):
        event, state, _ = found[k]
        if state == "holds":
            if event.kind != MAINTAINED and event.signal in later:
                found[k] = found[k]._replace(state="superseded")
            later.add(event.signal)
    return tuple(found)


def newest(found: Sequence[Label], component: str) -> int | None:
    """Place of the newest label on a component that was not withdrawn."""
    for k in reversed(range(len(found))):
        if found[k].event.signal == component and found[k].state != "withdrawn":
            return k
    return None


def standing(found: Sequence[Label]) -> tuple[Event, ...]:
    """Those that count."""
    return tuple(one.event for one in found if one.state == "holds")


def notes(found: Sequence[Label], clock: str) -> tuple[str, ...]:
    """On what does not count, though nobody took it back."""
    told = []
    for one in found:
        said = f"{one.event.signal}: {one.verdict} ({one.event.reason})"
        if one.state == "unreadable":
            told.append(
                f"{said} was left out, {one.problem}: take it back with 'evertwin decide … "
                f"{one.event.signal} withdraw'"
            )
        if one.state == "other clock":
            other = one.event.evidence.get("clock")
            told.append(f"{said} was left out: it is kept on the clock {other}, not {clock}")
    return tuple(told)


def _problem(event: Event) -> str:
    """Why a label cannot be read; empty: it can."""
    evidence: Any = event.evidence
    at = evidence.get("at")
    if not isinstance(at, int | float) or isinstance(at, bool) or not math.isfinite(at):
        return "its time is no number"
    if not isinstance(evidence.get("clock"), str):
        return "it names no clock"
    if event.kind == MAINTAINED and evidence.get("kind") not in DONE:
        return f"it says neither of {', '.join(DONE)}"
    return ""


BETWEEN = 0.5
"""A mark set after run n stands at n + ½."""


@dataclass(frozen=True)
class Moment:
    """One fit: when it was, what it found, and how far the outputs had been off before.

    >>> Moment(1.0, {"Fc": (12.0, 0.1)}, {}).found["Fc"][0]
    12.0
    """

    at: float
    """On the clock."""
    found: Mapping[str, tuple[float, float]]
    """Parameter → value and standard deviation (NaN: not known); only what could be told."""
    deviation: Mapping[str, float]
    """Output → rms(residual) / rms(measured) before the fit."""
    since_start: float = 0.0
    """Time in the run [s]."""
    left: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """What it said that does not count."""
    why: str = ""
    """Why that does not count."""
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Parameter → what would look the same as what it found."""


@dataclass(frozen=True)
class History:
    """Every fit that a store has kept, on one clock.

    >>> History((), "run", ()).now
    0.0
    """

    moments: tuple[Moment, ...]
    clock: str
    events: tuple[Event, ...]
    """Maintenance and decisions that count, in order."""
    labels: tuple[Label, ...] = ()
    """All that was ever said or done."""
    stamp: int = 0
    """Of the newest fit [ns]."""
    calendar: Calendar | None = None
    """Where the clock counts from 1970."""

    @property
    def names(self) -> tuple[str, ...]:
        """Every parameter that was ever tuned."""
        return tuple(dict.fromkeys(name for moment in self.moments for name in moment.found))

    @property
    def now(self) -> float:
        """The newest moment."""
        return self.moments[-1].at if self.moments else 0.0

    @property
    def after(self) -> float:
        """Where a mark stands that is set now: after the newest moment, before the next one."""
        return self.now + self.between

    @property
    def counts(self) -> bool:
        """Does the clock count tasks, and not time?"""
        return self.clock not in UNITS

    @property
    def between(self) -> float:
        """From a value to a mark that is set after it."""
        return BETWEEN if self.counts else 1e-3

    @property
    def notes(self) -> tuple[str, ...]:
        """On labels that do not count."""
        return notes(self.labels, self.clock)

    def series(self, names: Sequence[str]) -> tuple[Vector, dict[str, Vector], dict[str, Vector]]:
        """Times at which all ``names`` are known, their newest values and standard deviations."""
        at, values, sigmas = [], [], []
        newest: dict[str, tuple[float, float]] = {}
        for moment in self.moments:
            newest |= {n: moment.found[n] for n in names if n in moment.found}
            if len(newest) == len(names) and any(n in moment.found for n in names):
                at.append(moment.at)
                values.append([newest[n][0] for n in names])
                sigmas.append([newest[n][1] for n in names])
        v = np.array(values, dtype=np.float64).reshape(len(at), len(names))
        s = np.array(sigmas, dtype=np.float64).reshape(len(at), len(names))
        return (
            np.array(at, dtype=np.float64), {n: v[:, k] for k, n in enumerate(names)},
            {n: s[:, k] for k, n in enumerate(names)},
        )  # fmt: skip

    def beside(self, name: str, at: Vector) -> Vector:
        """The newest value of another parameter at each of some moments; NaN before its first.

        Raises:
            ConfigError: it was never tuned.
        """
        times, values, _ = self.series((name,))
        if not len(times):
            raise ConfigError(
                f"covariate {name!r}: expected a tuned parameter, or a column of a history file"
            )
        place = np.searchsorted(times, at, side="right") - 1
        return np.where(place >= 0, values[name][np.maximum(place, 0)], np.nan)

    def newest(self, names: Sequence[str]) -> tuple[Moment | None, Moment | None]:
        """The newest moment that tells of any of ``names``; and the newest of which that does not
        count."""
        found = [m for m in self.moments if any(n in m.found for n in names)]
        left = [m for m in self.moments if any(n in m.left for n in names)]
        return found[-1] if found else None, left[-1] if left else None

    def in_doubt(self, names: Sequence[str]) -> tuple[str, ...]:
        """What would look the same as the newest values of ``names``."""
        newest = self.newest(names)[0]
        each = () if newest is None else (newest.alike.get(name, ()) for name in names)
        return tuple(dict.fromkeys(said for some in each for said in some))

    def since_start(self, at: Vector) -> Vector:
        """Time in the run at each of some moments [s]."""
        known = {moment.at: moment.since_start for moment in self.moments}
        return np.array([known[x] for x in at.tolist()], dtype=np.float64)


def history(store: Store, clock: str, parameters: Parameters | None = None) -> History:
    """What the store has kept, on ``clock`` (run, cycle, s, h or d); values in SI.

    ``parameters``: of the model, for the units of those that it does not keep in SI.
    """
    told = [one for one in believed(store) if one.estimates]
    units = {item.name: conversion(item.unit) for item in parameters or ()}
    first = [one.estimates[0] for one in told]
    moments = tuple(
        _moment(at, one, units) for at, one in zip(_clock(first, clock), told, strict=True)
    )
    said = labels([e for e in store.read("event") if isinstance(e, Event)], clock)
    stamp = first[-1].time if first else 0
    calendar = None
    if clock in UNITS and FIRST < stamp * 1e-9 < LAST and _stamps_rise(first):
        calendar = Calendar(clock, zoned=True)
    return History(moments, clock, standing(said), said, stamp, calendar)


def dated(store: Store) -> bool:
    """Do the stamps of the recordings rise from run to run, so that they tell the date?"""
    return _stamps_rise([one.estimates[0] for one in believed(store) if one.estimates])


def _moment(at: float, one: Told, units: Mapping[str, tuple[float, float]]) -> Moment:
    found, first = _found(one.estimates, units), one.estimates[0]
    shares = {name: item.get("deviation_before") for name, item in one.outputs.items()}
    # what a sensor was off by, no output of the machine was
    off = {n: float(v) for n, v in shares.items() if v is not None and not one.by}
    left = found if one.against else {}
    alike = {name: one.alike for name in found if one.alike and name not in one.beyond}
    return Moment(
        at, {} if one.against else found, off, first.elapsed * 1e-9, left, one.against, alike
    )


def _found(
    group: Sequence[Estimate], units: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    found = {}
    for one in group:
        if one.verdict == "not":
            continue  # its value is what was assumed before
        half = (one.high - one.low) / (2 * 1.96)
        factor, zero = units.get(one.name, (1.0, 0.0))
        sigma = half * factor if np.isfinite(half) and half > 0 else np.nan
        found[one.name] = (one.value * factor + zero, sigma)
    return found


def _clock(fits: Sequence[Estimate], clock: str) -> list[float]:
    """When each fit was; never falls."""
    at: list[float] = []
    stamped = clock in UNITS and _stamps_rise(fits)
    begun, last = 0.0, 0.0
    before: Estimate | None = None
    for one in fits:
        if before is not None and (one.elapsed, one.row) <= (before.elapsed, before.row):
            begun = last  # a new run counts from zero
        if clock not in UNITS:
            now = max(begun, float(one.tasks_before)) + one.task + 1.0
        elif stamped:
            now = one.time * 1e-9 / UNITS[clock]
        else:
            passed = one.elapsed_before * 1e-9 / UNITS[clock]
            now = max(begun, passed) + one.elapsed * 1e-9 / UNITS[clock]
        last = max(now, last)
        at.append(last)
        before = one
    return at


def _stamps_rise(fits: Sequence[Estimate]) -> bool:
    """Do stamps rise at least as fast as the time in tasks? Else they begin anew with each."""
    for a, b in itertools.pairwise(fits):
        needed = max(b.elapsed_before + b.elapsed - a.elapsed_before - a.elapsed, 0)
        if b.time - a.time < 0.99 * needed or b.time < a.time:
            return False
    return bool(fits) and all(one.time > 0 for one in fits)
