"""Confusions that drift: labels as they come against the table that was known.

The newest labels are compared with the known ones over windows of doubling length, each every half
of its length: short ones tell a large change soon, long ones a small one. Each comparison is the
exact or permutation test of `evertwin.features.images.confusions`, over all cells at once. Of
windows of ``w`` labels there are ``2 / w`` a label; each is tested at the level ``w / (2 · per ·
windows)``, so that of labels that do not drift at most one in ``per`` raises an event on average,
however long they go on and however the looks depend on each other (expectations add up). Lengths
whose level lies below what exchanges can tell are left out.

A cell is told once, and again only after it was back: labels from behind that moment, over twice
the window, whose 95 % interval lies nearer to the known rate than to that of the drift.

>>> known = Labelled.of(["a", "b"] * 300, ["a", "b"] * 300, [True] * 600)
>>> stage = ConfusionDrift("labels", known)
>>> said = np.tile([[0, 0, 0.9], [1, 0, 0.6]], (200, 1))
>>> state, out = stage.step(stage.init(), Chunk("labels", np.arange(400), said))
>>> [(one.kind, one.evidence["cells"][0]["label"]) for one in out.records]
[('confusions_drift', 'a')]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.features.images.confusions import EXCHANGES, Cell, Rate, confusions
from evertwin.features.images.labelled import Labelled
from evertwin.fold import Chunk, Event, Out
from evertwin.types import Bool, Float64, Int64, Json

WINDOWS = tuple(100 * 2**k for k in range(8))
"""Labels that are compared at once."""
FAR = 2.5
"""Standard errors that no rate is off by where no test at these levels could tell a difference."""
TRUTH, LABEL, PROBABILITY, GROUP = range(4)
DRIFTED = ("confusions_drift", "confusions_back", "confusions_unknown")
"""Kinds of its events."""


class DriftState(NamedTuple):
    """State of `ConfusionDrift`.

    >>> ConfusionDrift("labels", Labelled.of(["a"], ["a"], [True])).init().rows.shape
    (12800, 4)
    """

    rows: Float64[np.ndarray, "window 4"]
    """The newest labels, in a ring: truth, label, probability, group."""
    came: int
    """Labels so far."""
    told: Int64[np.ndarray, "c c"]
    """By how long a window each cell was told; 0: it was not. On the diagonal: a truth that is not
    known at all."""
    at: Int64[np.ndarray, "c c"]
    """Labels by then."""
    share: Float64[np.ndarray, "c c"]
    """The end of its interval then that is nearer to what was known."""


@dataclass(frozen=True)
class ConfusionDrift:
    """The stage: implements `evertwin.fold.Online` over chunks of labels, (n, 3) or (n, 4): truth
    and label by their number in the known classes, probability, group. See the module."""

    source: str
    """Name of the source of labels."""
    known: Labelled
    """What was known; its side is of no account. With groups labels have them too."""
    per: float = 2e5
    """Labels that do not drift of which at most one raises an event, on average.

    Raises:
        UsageError: so many that no window can tell.
    """

    def __post_init__(self) -> None:
        if not self._levels:
            most = WINDOWS[-1] * (EXCHANGES + 1) / 2
            raise UsageError(
                f"labels per false event: expected at most {most:g}, got {self.per:g}: so rare "
                "ones cannot be told by exchanging labels"
            )

    @cached_property
    def _levels(self) -> dict[int, float]:
        """The level of each window."""
        for first in range(len(WINDOWS)):
            used = WINDOWS[first:]
            levels = {w: w / (2 * self.per * len(used)) for w in used}
            if levels[used[0]] >= 1 / (EXCHANGES + 1):
                return levels
        return {}

    def init(self) -> DriftState:
        """No label came yet."""
        c = len(self.known.classes)
        none = np.zeros((c, c), np.int64)
        rows = np.full((WINDOWS[-1], 4), np.nan)
        return DriftState(rows, 0, none, none.copy(), np.zeros((c, c)))

    def step(self, state: DriftState, block: Chunk) -> tuple[DriftState, Out]:
        """More labels.

        Raises:
            DataError: they have another number of values, or a class that is not known.
        """
        self.check(block)
        events = list[Event]()
        for t, v in zip(block.t.tolist(), block.v, strict=True):
            if not np.isfinite(v[:2]).all():
                continue  # nothing was said
            place = state.came % len(state.rows)
            state.rows[place, : len(v)] = v
            state = state._replace(came=state.came + 1)
            for window, level in self._levels.items():
                if state.came >= window and state.came % (window // 2) == 0:
                    events += self._look(state, t, window, level)
        return state, Out(None, tuple(events))

    def check(self, chunk: Chunk) -> None:
        """Has a chunk the shape of labels?

        Raises:
            DataError: it has another one, or a class that is not known.
        """
        width = 3 + (self.known.group is not None)
        if chunk.v.shape != (len(chunk.t), width):
            raise DataError(
                f"source {chunk.source!r}: expected {width} values (truth, label, probability"
                f"{', group' * (width > 3)}), got {chunk.v.shape[1:]}"
            )
        codes = chunk.v[:, :2]
        codes = codes[np.isfinite(codes)]
        if ((codes < 0) | (codes >= len(self.known.classes)) | (codes % 1 != 0)).any():
            raise DataError(
                f"source {chunk.source!r}: expected classes by number, 0 to "
                f"{len(self.known.classes) - 1} ({', '.join(self.known.classes)}), got {codes}"
            )

    def _look(self, state: DriftState, t: int, window: int, level: float) -> list[Event]:
        """Compares the newest labels with those known; marks in the state what is told."""
        last = np.arange(state.came - window, state.came) % len(state.rows)
        waits = _may_return(state, window)
        if not waits.any() and not self._suspects(state.rows[last], state.told > 0):
            return []
        found = confusions(self._both(state.rows[last]), level)
        index = {name: k for k, name in enumerate(self.known.classes)}
        drifted, back, unknown = list[Cell](), list[Cell](), list[str]()
        for cell in found.cells:
            at = index[cell.truth], index[cell.label]
            if cell.differs and not state.told[at]:
                drifted.append(cell)
                state.told[at], state.at[at] = window, state.came
                more = cell.real.share > cell.simulated.share
                state.share[at] = cell.real.low if more else cell.real.high
            elif waits[at] and _returned(state.share[at], cell.simulated.share, cell.real):
                back.append(cell)
                state.told[at] = 0
        for name in found.alone:
            at = index[name], index[name]
            if not state.told[at] and (state.rows[last, TRUTH] == index[name]).any():
                unknown.append(name)
                state.told[at] = window
        events = [Event(0, t, "confusions_unknown", self.source,
                        f"{name}: no known label has this truth: what it is taken for cannot be "
                        "compared", {"truth": name}) for name in unknown]  # fmt: skip
        if drifted:
            events.append(self._event(state, t, "confusions_drift", drifted, (window, level)))
        if back:
            events.append(self._event(state, t, "confusions_back", back, (window, level)))
        return events

    @cached_property
    def _table(self) -> Int64[np.ndarray, "c c"]:
        """Counts of truth × label that are known."""
        return _counted(self.known.truth, self.known.label, len(self.known.classes))

    def _suspects(self, rows: Float64[np.ndarray, "w 4"], told: Bool[np.ndarray, "c c"]) -> bool:
        """Is a rate so far off that a test is worth its time, or a truth not known at all? Not of
        what was told."""
        codes = rows[:, :PROBABILITY].astype(np.int64)
        known, now = self._table, _counted(codes[:, TRUTH], codes[:, LABEL], len(self._table))
        of, n = known.sum(axis=1, keepdims=True), now.sum(axis=1, keepdims=True)
        if ((of == 0) & (n > 0) & ~np.diag(told)[:, None]).any():
            return True
        asked = (of > 0) & (n > 0) & ~told & ~np.eye(len(told), dtype=np.bool_)
        of, n = np.maximum(of, 1), np.maximum(n, 1)
        share = np.minimum((known + now) / (of + n), 1.0)
        error = np.sqrt(share * (1 - share) * (1 / of + 1 / n))
        return bool((asked & (np.abs(now / n - known / of) > FAR * error)).any())

    def _both(self, rows: Float64[np.ndarray, "w 4"]) -> Labelled:
        """The known labels as simulated, the newest as real."""
        known, codes = self.known, rows[:, :GROUP].astype(np.float64)
        first = np.arange(len(known.truth) + len(rows)) < len(known.truth)
        group = None
        if known.group is not None:
            whole = np.concatenate([known.group, rows[:, GROUP]])
            pairs = np.column_stack([first, whole])
            group = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
        return Labelled(
            known.classes, np.concatenate([known.truth, codes[:, TRUTH].astype(np.int64)]),
            np.concatenate([known.label, codes[:, LABEL].astype(np.int64)]), first,
            np.concatenate([known.probability, codes[:, PROBABILITY]]), group,
        )  # fmt: skip

    def _event(
        self, state: DriftState, t: int, kind: str, cells: list[Cell], rule: tuple[int, float]
    ) -> Event:
        window, level = rule
        drifted = kind == "confusions_drift"
        said = "; ".join(_said(cell) for cell in cells)
        reason = f"of the last {window} labels {said}" + (
            f": other than known (at most one such event in {self.per:g} labels without a drift)"
            if drifted else ": again as known"
        )  # fmt: skip
        told: list[Json] = [
            {"truth": c.truth, "label": c.label, "known": c.simulated._asdict(),
             "now": c.real._asdict(), "p": c.p}
            for c in cells
        ]  # fmt: skip
        evidence: dict[str, Json] = {
            "cells": told, "window": window, "labels": state.came, "level": level,
        }  # fmt: skip
        return Event(0, t, kind, self.source, reason, evidence)


def _counted(
    truth: Int64[np.ndarray, " n"], label: Int64[np.ndarray, " n"], c: int
) -> Int64[np.ndarray, "c c"]:
    return np.bincount(c * truth + label, minlength=c * c).reshape(c, c).astype(np.int64)


def _may_return(state: DriftState, window: int) -> Bool[np.ndarray, "c c"]:
    """Cells that were told by half the window at most, before it."""
    long = window >= np.minimum(2 * state.told, WINDOWS[-1])
    later = state.came - window >= state.at
    off = ~np.eye(len(state.told), dtype=np.bool_)
    return np.asarray((state.told > 0) & long & later & off)


def _returned(drifted: float, known: float, now: Rate) -> bool:
    """Is a rate nearer to what was known than to the drift, with its whole interval?"""
    middle = 0.5 * (known + drifted)
    return bool(now.high < middle if drifted > known else now.low > middle)


def _said(cell: Cell) -> str:
    now, known = cell.real, cell.simulated
    return (
        f"{cell.truth} is taken for {cell.label} {now.hits} times of {now.of} "
        f"({100 * now.share:.1f} %, 95 %: {100 * now.low:.1f} … {100 * now.high:.1f}), known are "
        f"{100 * known.share:.1f} %"
    )
