"""Who looks at a run while it goes on, and tells afterwards what it found."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from evertwin.fold import Answer, Block, Event, Record
from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.follow import Followed
from evertwin.loop.decisions.in_stream import as_is
from evertwin.loop.driver import Driver
from evertwin.models import Parameters
from evertwin.models.form import Version
from evertwin.outcome.asked_of import limits
from evertwin.outcome.course.jumps import usual_most
from evertwin.outcome.course.lives import lives
from evertwin.outcome.course.spells import spell
from evertwin.outcome.headline import also_pinned, failed_first, headline, unless_at_rest, wrong
from evertwin.outcome.open.on_trial import open_trial
from evertwin.outcome.open.unjudged import at_rest, unjudged
from evertwin.outcome.result import OutputFigures, RunResult
from evertwin.outcome.trace import Tail, Trace
from evertwin.setup.deviation import deviation, judged_deviation
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TwinState
from evertwin.signals import wrap
from evertwin.tuning.iteration import Round

Progress: TypeAlias = Callable[[int, float], None]
"""``progress(rows so far, seconds of data so far)``."""
OFTEN = 0.2
"""Seconds between two reports of progress."""
PIECES, ROWS = 16, 8192
"""Pieces, and rows in them, that are put into the trace at once."""
NEWEST = 4096
"""Newest rows that are kept one by one, however long the run is."""
COLUMNS = (
    "t", "task", "input", "measured", "predicted", "sigma", "update", "first", "first_update",
    "off", "off_first", "mark",
)  # fmt: skip


class Observer:
    """Collects rows, events and the newest knowledge of parameters.

    >>> Observer.__name__
    'Observer'
    """

    def __init__(self, setup: Setup, progress: Progress | None = None) -> None:
        self.setup = setup
        self._angles = setup.model.outputs.angles
        self._trace = Trace()
        self._pieces: list[tuple[int, Block, Followed]] = []
        self._waiting = 0
        self._newest = Tail(NEWEST)
        self.events: list[Event] = []
        self.knowledge: dict[tuple[str, float], dict[str, Any]] = {}
        self.rounds: list[dict[str, Any]] = []
        self._progress = progress
        self._told = 0.0
        self._seconds = 0.0

    def restore(self, records: Iterable[Record], shown: Mapping[str, np.ndarray]) -> None:
        """What was known at a checkpoint."""
        for record in records:
            self.record(record)
        if set(COLUMNS) <= shown.keys():  # else they are of a release that showed less
            self.trace.add(shown)

    def watch(self, state: TwinState, piece: Block, out: Followed) -> None:
        """One piece between beats."""
        self._pieces.append((state.live.version, piece, out))
        self._waiting += len(piece.t)
        if len(self._pieces) >= PIECES or self._waiting >= ROWS:
            self._collect()
        if self._progress is not None:
            self._seconds += float(piece.dt.sum())
            if time.monotonic() - self._told >= OFTEN:
                self._told = time.monotonic()
                self._progress(state.row, self._seconds)

    @property
    def trace(self) -> Trace:
        """All rows so far."""
        self._collect()
        return self._trace

    def newest(self, rows: int) -> dict[str, np.ndarray]:
        """The newest rows; those long past as the trace has them."""
        self._collect()
        kept = self._newest.columns()
        if not kept or len(kept["row"]) < rows:
            parts = [part for part in self._parts() if part]
            names = parts[-1] if parts else {}
            kept = {name: np.concatenate([part[name] for part in parts]) for name in names}
        return {
            name: column[len(column) - min(rows, len(column)) :] for name, column in kept.items()
        }

    def between(self, first: int, last: int) -> dict[str, np.ndarray]:
        """Rows stamped in [first, last] [ns]; those long past as the trace has them."""
        parts = [
            {name: column[chosen] for name, column in part.items()}
            for part in self._parts()
            if "t" in part and (chosen := (part["t"] >= first) & (part["t"] <= last)).any()
        ]
        names = parts[-1] if parts else {}
        return {name: np.concatenate([part[name] for part in parts]) for name in names}

    def _parts(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """The trace up to the newest rows, and these."""
        trace, newest = self.trace.columns(), self._newest.columns()
        if trace and newest:
            before = int(np.searchsorted(trace["row"], newest["row"][0]))
            trace = {name: column[:before] for name, column in trace.items()}
        return trace, newest

    def _collect(self) -> None:
        """Small pieces are put into the trace together."""
        pieces, self._pieces, self._waiting = self._pieces, [], 0
        if not pieces:
            return
        row, sizes = pieces[0][1].row, [len(piece.t) for _, piece, _ in pieces]
        columns = {
            "row": np.arange(row, row + sum(sizes)),
            "version": np.repeat([version for version, _, _ in pieces], sizes),
        }
        parts = zip(*(_columns(piece, out) for _, piece, out in pieces), strict=True)
        for name, column in zip(COLUMNS, parts, strict=True):
            columns[name] = column[0] if len(column) == 1 else np.concatenate(column)
        columns["mark"] = columns["mark"][:, -len(self._angles) :]
        self._newest.add(columns)
        at = self._trace.places(row)
        kept = {name: column[at] for name, column in columns.items()}
        kept["residual"] = wrap(kept["measured"] - kept["predicted"], self._angles)
        self._trace.add(kept)

    def record(self, record: Record) -> None:
        """A record as it is logged."""
        if isinstance(record, Event):
            self.events.append(record)
        if isinstance(record, Answer):
            content: Any = record.content
            fit: Mapping[str, Any] = content.get("fit") or {}
            for name, item in fit.get("parameters", {}).items():
                known = {k: item[k] for k in ("interval95", "verdict", "value")}
                self.knowledge[name, item["value"]] = known
            for item in content.get("rounds") or ():
                kept = Round(*item)._asdict()
                values = dict(zip(content["names"], kept["values"], strict=True))
                self.rounds.append({"version": record.version, **kept, "values": values})

    def figures(self, state: TwinState) -> dict[str, OutputFigures]:
        """Deviations of the first and the last champion, and the most of the rows so far."""
        found = figures(self.setup, state)
        most = usual_most(self.trace.columns(), self.events, self.setup.horizon)
        if most is None:
            return found
        trace, limit = self.trace.columns(), self.setup.requirement
        kept = trace["row"] >= state.scores.rows
        row, moving = trace["row"][kept], self.setup.moving(trace["input"][kept])
        told = {}
        for k, (name, one) in enumerate(found.items()):
            off = np.where(moving[:, k], trace["off"][kept, k], np.nan)
            asked = limit * one.size if self.setup.relative else limit
            passed = spell(row, off, asked) if one.judged > limit else None
            told[name] = replace(one, most=float(most[k]), spell=passed)
        return told

    def _known(self, parameters: Parameters) -> dict[str, dict[str, Any]]:
        """What the fits that the champion's values come from said of them."""
        found = {item.name: self.knowledge.get((item.name, item.value)) for item in parameters}
        return {name: known for name, known in found.items() if known is not None}

    def result(self, driver: Driver, state: TwinState, seconds: float) -> RunResult:
        """The outcome."""
        champion = driver.versions[state.live.version]
        model = driver.versions.model(state.live.version)
        now = as_is(driver.versions, state)
        parameters: Parameters = model.parameters.with_values(now.p)
        outputs = self.figures(state)
        trial, trace = open_trial(driver.setup, driver.versions, state), self.trace.columns()
        measured, told = 0, succeeded(driver.versions, champion, self.events)
        if trace:
            trace["moving"] = self.setup.moving(trace["input"])
            measured = int(np.isfinite(trace["measured"]).any(axis=1).sum())
        failed = state.live.track.failed(self.events)
        said = headline(driver.setup, outputs, told, self.events, trial, measured)
        still = at_rest(trace)
        said = unless_at_rest(said, still=still)
        said = failed_first(" ".join(filter(None, (unjudged(driver.setup, trace), said))), failed)
        pinned = state.agenda.pinned
        return RunResult(
            name=self.setup.spec.name, samples=state.row, seconds=seconds,
            outputs=outputs, position_updates=updates(state),
            unseen_since=state.scores.rows, events=tuple(self.events), champion=champion,
            parameters=parameters, knowledge=self._known(parameters),
            versions=tuple(driver.versions),
            model=model,
            models={v.form: driver.versions.model(v.number) for v in driver.versions},
            trace=trace, rounds=tuple(self.rounds),
            trial=trial,
            headline=also_pinned(said, champion.number, pinned=pinned), pinned=pinned,
            faults=wrong(driver.setup, outputs, self.events),
            missed=missed(outputs, driver.setup.requirement), asked=limits(driver.setup, outputs),
            judged=judged(outputs, self.events, still=still),
            relative=self.setup.relative or not self.setup.decides, failed=failed,
        )  # fmt: skip


def _columns(piece: Block, out: Followed) -> tuple[np.ndarray, ...]:
    before = out.rows if out.first is None else out.first
    return (
        piece.t, piece.task, piece.u, piece.y, out.rows.y, out.rows.sigma, out.rows.update,
        before.y, before.update, *out.off, out.judged.mark,
    )  # fmt: skip


def succeeded(
    versions: Versions, champion: Version, events: Sequence[Event]
) -> tuple[Version, ...]:
    """The live version, and those that were live before it since the run began, the newest first;
    of one that went live before, its parent."""
    chain = lives(events)
    if len(chain) > 1 and chain[-1] == champion.number:
        return (champion, *(versions[number] for number in reversed(chain[:-1])))
    before: Any = champion.parent
    for event in events:
        if event.kind == "promoted" and event.evidence.get("version") == champion.number:
            before = event.evidence.get("replaced", before)
    return (champion,) if before is None else (champion, versions[before])


def judged(
    outputs: Mapping[str, OutputFigures], events: Sequence[Event], *, still: bool
) -> bool:  # fmt: skip
    """Was an output that moved held against what is asked, or did a version go live, since which
    there may be no row yet?"""
    held = any(not math.isnan(f.judged) for f in outputs.values()) and not still
    return held or any(event.kind == "promoted" for event in events)


def missed(outputs: Mapping[str, OutputFigures], limit: float) -> tuple[str, ...]:
    """Outputs that are off by more than is asked; none where all that are fit again."""
    off = {name: f for name, f in outputs.items() if f.judged > limit}
    return () if all(f.spell for f in off.values()) else tuple(off)


def figures(setup: Setup, state: TwinState) -> dict[str, OutputFigures]:
    """Deviations of the first and the last champion over the rows since the last switch."""
    scores, alone = state.scores, state.first.version < 0
    first, first_moving = (
        (scores.live, scores.live_moving) if alone else (scores.first, scores.first_moving)
    )
    pairs, moving = (
        [[deviation(sums, relative, scores.usual) for sums in both] for relative in (False, True)]
        for both in ((first, scores.live), (first_moving, scores.live_moving))
    )
    judged = judged_deviation(scores.live_moving, setup.relative, scores.usual)
    judged = np.where(setup.watched & setup.decides, judged, np.nan)
    held = state.agenda.held and not (state.agenda.told or setup.detect.lasts(state.detect))
    return {
        channel.name: OutputFigures(
            channel.unit, float(pairs[0][0][k]), float(pairs[0][1][k]), float(pairs[1][0][k]),
            float(pairs[1][1][k]), float(moving[1][0][k]), float(moving[1][1][k]),
            int(scores.live.samples[k]), int(scores.live_moving.samples[k]), float(judged[k]),
            float(moving[0][0][k]), float(moving[0][1][k]), setup.recorded[k], held=held,
        )
        for k, channel in enumerate(setup.model.outputs)
    }  # fmt: skip


def updates(state: TwinState) -> tuple[int, int]:
    """Tolerance updates (first, last champion) over the same rows."""
    live = int(state.live.track.updates.sum()) - int(state.scores.updates[0])
    if state.first.version < 0:
        return live, live
    return int(state.first.track.updates.sum()) - int(state.scores.updates[1]), live
