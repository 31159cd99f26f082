"""What the doctor looks at: a version of a twin, its rows as read, and its rows as judged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.errors import ModelError
from evertwin.fold import Block, Chunk, Event, take
from evertwin.fold.block import first
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.contract import KernelModel
from evertwin.models.form import Version
from evertwin.models.functions.failures import Failed
from evertwin.models.functions.function import FunctionModel, kernel_of
from evertwin.models.functions.translated import Translated
from evertwin.rows.feed import Data, Feed
from evertwin.setup.setup import Setup
from evertwin.sources.clocks.tally import Tally

MOST = 20_000
"""Rows that are tuned and compared on."""
SPREAD, PIECES = 2_000, 8
"""Rows of a static map, which remembers nothing, and the stretches they are taken from: its numbers
are tuned to them again and again."""
FEW, FOLLOWED = 1_000, 10_000
"""The same, and rows that are judged, where each row is a call of a model that is not compiled."""

ASTRAY = 0.3
"""Part of an output's size by which a model is off that says nothing of its sensor."""


class Samples(NamedTuple):
    """What one source recorded in one task.

    >>> Samples("log", "a.csv", ("x",), 0.01, np.zeros((2, 1))).file
    'a.csv'
    """

    source: str
    file: str
    """Its file, or the number of its recording."""
    names: tuple[str, ...]
    step: float
    """Typical interval between its samples [s]."""
    v: np.ndarray


@dataclass
class _Heard(Feed):
    """A feed that keeps the samples that went through it."""

    heard: list[Chunk] = field(default_factory=list)

    def chunks(self, data: Data = None) -> Iterator[Chunk]:
        """The samples of all sources, merged by stamp."""
        for chunk in super().chunks(data):
            self.heard.append(chunk)
            yield chunk

    def samples(self, data: Data) -> Iterator[Samples]:
        """What was heard, by source and task."""
        parts: dict[tuple[str, int], list[Chunk]] = {}
        for chunk in self.heard:
            parts.setdefault((chunk.source, chunk.task), []).append(chunk)
        names = {one.name: one.channels for one in self.brings(data)} if parts else {}
        for source, task in parts:
            if source not in names:  # scans: their poses are judged as rows
                continue
            files, count = self.files.get(source, []), sum(name == source for name, _ in parts)
            file = files[task].name if len(files) == count else f"recording {task}"
            listed = parts[source, task]
            steps = np.diff(np.concatenate([one.t for one in listed]))
            step = 1e-9 * float(np.median(steps)) if len(steps) else 1.0
            whole = np.concatenate([one.v for one in listed])[:, : len(names[source])]
            yield Samples(source, file, names[source], step, whole)


@dataclass(frozen=True)
class View:
    """A version and its rows; built by `view`.

    >>> View.__name__
    'View'
    """

    setup: Setup
    versions: Versions
    version: Version
    windows: tuple[Block, ...]
    """Rows as they were read, one block a task."""
    judged: tuple[Block, ...]
    """The same with the arbiter's marks; of a slow model the first."""
    events: tuple[Event, ...]
    """What the arbiter found."""
    tallies: tuple[Tally, ...]
    """What the sources found."""
    failed: Failed | None
    """Rows that the model could not compute, its step having raised something."""
    recorded: tuple[Samples, ...]
    """Samples as they were recorded, by source and task; none where rows were given as such."""

    @cached_property
    def model(self) -> Model:
        """The model of the version."""
        return self.versions.model(self.version.number)

    @cached_property
    def rows(self) -> int:
        """Rows in all."""
        return sum(len(window.t) for window in self.windows)

    @cached_property
    def step(self) -> float:
        """Typical interval between rows [s]."""
        steps = np.concatenate([window.dt[1:] for window in self.windows])
        return float(np.median(steps)) if len(steps) else 1.0

    @cached_property
    def seconds(self) -> float:
        """Duration of all tasks together [s]."""
        return float(sum(window.dt[1:].sum() for window in self.windows))

    @cached_property
    def horizon(self) -> float:
        """Length over which changes are compared [s]: the twin's, or a twentieth of the data."""
        given = self.setup.horizon
        return given if np.isfinite(given) else max(self.seconds / 20, 2 * self.step)

    @cached_property
    def slow(self) -> bool:
        """Is a row of the model a call of Python, or of another process?"""
        return _slow(self.setup.model)

    @cached_property
    def most(self) -> int:
        """Rows that are simulated again and again."""
        return FEW if self.slow else MOST

    def some(self, windows: tuple[Block, ...]) -> tuple[Block, ...]:
        """The first whole windows, `MOST` rows about; of a slow model their first `FEW` rows."""
        kept = first(windows, self.most)
        if not self.slow or len(kept) > 1:
            return kept
        return (take(kept[0], 0, min(len(kept[0].t), self.most)),)

    def spread(self, windows: tuple[Block, ...]) -> tuple[Block, ...]:
        """Rows that numbers are tuned to: of a static map stretches from all over the windows."""
        if self.slow or not self.setup.static or sum(len(one.t) for one in windows) <= SPREAD:
            return self.some(windows)
        found, at, edges = list[Block](), 0, np.linspace(0, self.rows - SPREAD, PIECES).astype(int)
        for window in windows:
            for edge in edges.tolist():
                a, b = max(edge - at, 0), min(edge - at + SPREAD // PIECES, len(window.t))
                found += [take(window, a, b)] if b - a > 1 else []
            at += len(window.t)
        return tuple(found)

    @cached_property
    def astray(self) -> frozenset[str]:
        """Outputs of a static map that the version is off by more than `ASTRAY` of their size, in
        the middle of their rows: it says nothing of their sensors."""
        model, p = self.model, self.version.p
        y = np.concatenate([window.y for window in self.simulated])
        off = y - np.concatenate(
            [model.simulate(model.initial(p), w.u, w.dt, p)[1] for w in self.simulated]
        )
        with np.errstate(invalid="ignore"):
            far = np.nanmedian(np.abs(off), axis=0) > ASTRAY * np.nanmedian(np.abs(y), axis=0)
        return frozenset(n for n, on in zip(self.model.outputs.names, far, strict=True) if on)

    @property
    def simulated(self) -> tuple[Block, ...]:
        """The judged rows that are simulated once or twice: all; of a slow model some."""
        return self.some(self.judged) if self.slow else self.judged


def view(setup: Setup, versions: Versions, number: int, data: Data) -> View:
    """Reads and judges all rows.

    Raises:
        DataError: a recording cannot be read, or nothing is left of it.
        ModelError: the model's step raised something at every row.
    """
    feed = _Heard(setup.spec, setup.model)
    windows = tuple(feed.blocks(data))
    version = versions[number]
    track = setup.track(versions.model(number))
    state = track.renew(track.init(), version.p)
    judged, events = [], []
    for window in _begin(windows) if _slow(setup.model) else windows:
        state, out = track.step(state, window)
        judged.append(out.rows.judged(window))
        events += [record for record in out.records if isinstance(record, Event)]
    failed = state.failed(events)
    if failed and failed.all:
        raise ModelError(str(failed))
    seen = windows, tuple(judged), tuple(events), feed.left_out, failed, tuple(feed.samples(data))
    return View(setup, versions, version, *seen)


def _slow(base: Model) -> bool:
    plain = isinstance(base, FunctionModel) and not isinstance(base, Translated)
    plain = plain or not isinstance(base, KernelModel)
    return plain or kernel_of(base).remote is not None


def _begin(windows: Sequence[Block]) -> Iterator[Block]:
    """The first `FOLLOWED` rows."""
    left = FOLLOWED
    for window in windows:
        if left > 0:
            yield take(window, 0, min(left, len(window.t)))
        left -= len(window.t)
