"""What twins are compared by: position updates, deviation, time to detect and to re-tune, rates.

A view on what a run gave and its log says; nothing is simulated again.

* Position updates by the first and the last version over the same unseen rows, as P1 counts them,
  per metre of the measured way and per task. The way is walked with a ruler as long as the
  tolerance, so that noise of a machine that stands is no way.
* Deviation per output, as P2 holds it to 5 % of the rms, over all rows and over moving ones.
* Times in seconds of data, breaks between tasks left out: from a change, or from the first sign of
  one, to new parameters and to the version that is live.
* Rates per month of data, over all runs in the log.
* Coverage: how many measured rows lie inside the 95 % band that was foretold of them. Where the
  arbiter blends samples the band is the spread of the residual from one sample to the next, however
  far off predictions over the horizon are; else it is what the arbiter still believes of a sample,
  which is wider. It is said how far ahead.

What the data do not tell stands in ``notes``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Event, plain
from evertwin.fold.marks import Mark
from evertwin.ledger.ledger import Ledger
from evertwin.outcome.intervals import Coverage, Interval, Rate
from evertwin.outcome.result import OutputFigures, RunResult
from evertwin.setup.setup import Setup
from evertwin.signals.spoken import suited
from evertwin.types import Float64, Json, Vector

SIGNS = ("suspected", "drift", "changed")
TUNED = ("tuned", "corrected")
FALSE = ("rejected", "rolled_back")
COUNTED = (*TUNED, "promoted", *FALSE)


@dataclass(frozen=True)
class Updates:
    """Position updates (by the first version, by the last) over the same rows.

    >>> Updates(100, 2.0, 0.5, (35, 4), (17.5, 2.0), (70.0, 8.0)).way
    2.0
    """

    rows: int
    way: float | None
    """Measured way [m]; None: no position in metres is held to a tolerance."""
    tasks: float
    """Tasks; a part of one counts as its share of rows."""
    count: tuple[int, int]
    per_metre: Interval | None
    per_task: Interval | None


@dataclass(frozen=True)
class Change:
    """A deviation, from its first sign until a new version is live. Times are in s of data.

    >>> Change(310, 31.0).live is None
    True
    """

    row: int
    """Row of the first sign."""
    at: float
    """When that was, from the start of the run."""
    detected: float | None = None
    """From the known change to the sign; None: no change was known."""
    tuned: float | None = None
    """From the change, or the sign where none was known, to new parameters or terms."""
    live: float | None = None
    """From there to the new version being live; None: it is not yet."""
    rejected: int = 0
    """Candidates that were turned down on the way."""

    def __str__(self) -> str:
        """One line."""
        times = {"detected": self.detected, "tuned": self.tuned, "live": self.live}
        told = [f"{word} after {s:.4g} s" for word, s in times.items() if s is not None]
        said = ", ".join(told) or "neither tuned nor live"
        return f"sign at {self.at:.4g} s, row {self.row}: {said}; {self.rejected} rejected"


@dataclass(frozen=True)
class Kpi:
    """The figures. Their text is ``str``, their plain content `to_dict`.

    >>> Kpi("cart", 0, 10.0, 10.0, None, {}, (), {}, {}).to_dict()["schema"]
    'evertwin.kpi/1'
    """

    name: str
    version: int
    """That is live at the end."""
    seconds: float
    """Data of this run [s]."""
    seconds_logged: float
    """Data of all runs that the log tells of [s]: the rates are over these."""
    updates: Updates | None
    outputs: Mapping[str, OutputFigures]
    changes: tuple[Change, ...]
    rates: Mapping[str, Rate]
    """Of each of `COUNTED`; ``false_retunes``: of what was rejected or rolled back."""
    coverage: Mapping[str, Coverage]
    notes: tuple[str, ...] = ()
    """What cannot be told."""

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.kpi/1"``."""
        return plain({"schema": "evertwin.kpi/1", **vars(self)})  # type: ignore[return-value]

    def __str__(self) -> str:
        """All figures as text."""
        text = [f"{self.name}: version {self.version} is live after {self.seconds:.4g} s of data"]
        if (one := self.updates) is not None:
            told = {"": one.count, " per metre": one.per_metre, " per task": one.per_task}
            said = [f"{pair[0]:.3g} -> {pair[1]:.3g}{per}" for per, pair in told.items() if pair]
            text.append(f"position updates {', '.join(said)}")
        for name, f in self.outputs.items():
            whole = _percent(f.relative_rms_before, f.relative_rms_after)
            moving = _percent(f.relative_rms_moving_before, f.relative_rms_moving_after)
            size = "range" if f.unit == "K" else "rms"
            unit, factor = suited(max(f.rms_before, f.rms_after), f.unit, f.recorded)
            rms = f"{f.rms_before * factor:.3g} -> {f.rms_after * factor:.3g} {unit}"
            text.append(f"{name:<13} off by {rms}: {whole} of its {size}, moving {moving}")
        text += [f"{name:<13} inside the 95 % band{_ahead(c)}: {c}"
                 for name, c in self.coverage.items()]  # fmt: skip
        text += [str(change) for change in self.changes]
        text += [f"{kind.replace('_', ' '):<13} {rate}" for kind, rate in self.rates.items()]
        return "\n  ".join([*text, *self.notes])


def _ahead(coverage: Coverage) -> str:
    """How far ahead a band was foretold, where that is one time."""
    return f" {coverage.ahead:.3g} s ahead" if coverage.ahead else ""


def _percent(before: float, after: float) -> str:
    return f"{100 * before:.2f} -> {100 * after:.2f} %"


def kpi_of(setup: Setup, ledger: Ledger, result: RunResult, changed: float | None) -> Kpi:
    """The figures of a run; ``changed``: when the machine is known to have changed [s of data].

    Raises:
        UsageError: the run has no rows, or the change lies outside it.
    """
    if not result.samples:
        raise UsageError("kpi: the run has no rows: give recordings")
    trace, names = result.trace, result.model.outputs.names
    clock = _clock(trace)
    whole = float(clock[-1])
    if changed is not None and not 0 <= changed <= whole:
        raise UsageError(f"kpi: changed: expected within 0 … {whole:.6g} s, got {changed:.6g}")
    records = (ledger.store.record(e) for e in ledger.store.entries(kinds=("event",)) if e.run)
    kinds = [record.kind for record in records if isinstance(record, Event)]
    logged = sum(run.ended["elapsed"] for run in ledger.runs if run.ended is not None) * 1e-9
    counts = {kind: kinds.count(kind) for kind in COUNTED}
    counts["false_retunes"] = sum(counts[kind] for kind in FALSE)
    known = np.where(trace["mark"] == Mark.ERROR, np.nan, trace["residual"])
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(np.isfinite(trace["sigma"]), known / trace["sigma"], np.nan)
    covered = [
        replace(Coverage.of(np.ascontiguousarray(column)), ahead=_lead(setup, result, k, clock))
        for k, column in enumerate(z.T)
    ]
    found = Kpi(
        result.name, result.champion.number, whole, logged, _updates(setup, result),
        {name: one for name, one in result.outputs.items() if one.rows},
        _changes(result.events, (trace["row"], clock), changed),
        {kind: Rate.of(count, logged) for kind, count in counts.items()},
        {name: one for name, one in zip(names, covered, strict=True) if one.rows},
    )  # fmt: skip
    return replace(found, notes=_notes(setup, found, result, changed))


def _lead(setup: Setup, result: RunResult, k: int, clock: Vector) -> float | None:
    """From one sample of an output to the next [s], where its band is foretold so far ahead."""
    trace, channel = result.trace, result.model.outputs.channels[k]
    measured = np.isfinite(trace["measured"][:, k])
    use = setup.track(result.model).arbiter.rule_of(channel.group).use
    if setup.static or use != "blend" or np.count_nonzero(measured) < 2:
        return None
    kept = int(np.diff(trace["row"]).min())  # of a long run every so many rows are
    return float(np.median(np.diff(clock[measured]))) / kept


def _clock(trace: Mapping[str, np.ndarray]) -> Float64[np.ndarray, " n"]:
    """Seconds of data at each row of the trace, without the breaks between tasks."""
    same = np.diff(trace["task"], prepend=trace["task"][:1]) == 0
    return np.asarray(np.cumsum(np.diff(trace["t"], prepend=trace["t"][:1]) * same) * 1e-9)


def _changes(
    events: Sequence[Event], clock: tuple[np.ndarray, np.ndarray], changed: float | None
) -> tuple[Change, ...]:
    """From each first sign to the next promotion; a known change begins a new one."""
    found: list[Change] = []
    going, since, waited = False, 0.0, math.inf if changed is None else changed
    for event in events:
        at = float(np.interp(event.row - 1, *clock))
        told = at >= waited
        if event.kind in SIGNS and (told or not going):
            going, since, waited = True, waited if told else at, math.inf if told else waited
            found.append(Change(event.row, at, at - since if told else None))
        if not going:
            continue
        if event.kind in TUNED and found[-1].tuned is None:
            found[-1] = replace(found[-1], tuned=at - since)
        elif event.kind == "rejected":
            found[-1] = replace(found[-1], rejected=found[-1].rejected + 1)
        elif event.kind == "promoted":
            found[-1], going = replace(found[-1], live=at - since), False
    return tuple(found)


def _updates(setup: Setup, result: RunResult) -> Updates | None:
    """Position updates per way and task, over the rows that they are counted on."""
    outputs, trace = result.model.outputs, result.trace
    arbiter = setup.track(result.model).arbiter
    held = [(k, c) for k, c in enumerate(outputs) if arbiter.rule_of(c.group).use == "tolerance"]
    if not held:
        return None
    rows, task = trace["row"] >= result.unseen_since, trace["task"]
    tasks = sum(float(rows[task == one].mean()) for one in np.unique(task))
    metres, way = [(k, c.group) for k, c in held if c.unit == "m"], None
    if metres:
        here = [k for k, group in metres if group == metres[0][1]]
        places = np.where(trace["mark"] == Mark.ERROR, np.nan, trace["measured"])[rows][:, here]
        way = _way(places, task[rows], arbiter.rule_of(metres[0][1]).tolerance)
    before, after = count = result.position_updates
    per = [(before / size, after / size) if size else None for size in (way, tasks)]
    return Updates(result.samples - result.unseen_since, way, tasks, count, *per)


def _way(places: Float64[np.ndarray, "n k"], task: np.ndarray, ruler: float) -> float:
    """Length of a measured way, walked with a ruler; no step joins two tasks.

    >>> line = np.array([[0.0], [0.4], [1.2], [1.1], [2.4]])
    >>> round(_way(line, np.array([0, 0, 0, 0, 0]), 1.0), 9)
    2.4
    """
    last: list[float] | None = None
    way, of = 0.0, -1
    for place, one in zip(places.tolist(), task.tolist(), strict=True):
        if any(map(math.isnan, place)):
            continue
        if last is None or one != of:
            last, of = place, one
        elif (step := math.dist(last, place)) >= ruler:
            way, last = way + step, place
    return way


def _notes(setup: Setup, found: Kpi, result: RunResult, changed: float | None) -> tuple[str, ...]:
    """What the figures do not say."""
    rows, updates = result.trace["row"], found.updates
    seen = any(one.detected is not None for one in found.changes)
    near = [c.ahead for c in found.coverage.values() if c.ahead is not None]
    reach = setup.horizon
    far = bool(near) and max(near) < reach < math.inf
    lacks = [name for name in result.model.outputs.names if name not in found.coverage]
    said = {
        "no change was planted or known: time to detect is not told, and times count from the first"
        " sign": changed is None,
        f"the change at {changed or 0:g} s was not detected": changed is not None and not seen,
        "nothing was suspected: time to re-tune is not told": not found.changes,
        "no group of outputs is held to a tolerance: there are no position updates": not updates,
        "no way in metres was measured": updates is not None and not updates.way,
        "before and after are one version: none was promoted": not result.of_kind("promoted"),
        str(result.trial): result.trial is not None,
        f"way and coverage are of {len(rows)} of the rows": len(rows) < result.samples,
        f"coverage is of bands one sample ahead; {reach:.3g} s ahead the twin is off as told": far,
        "a band is as wide as what its output was off by just before: rows inside tell that this"
        " goes on, not that the twin is right": bool(found.coverage),
        f"coverage of {', '.join(lacks)}: no row has a measurement and a band": bool(lacks),
    }
    return tuple(text for text, holds in said.items() if holds)
