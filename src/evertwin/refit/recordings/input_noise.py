"""What inputs may have been that are derived from what was recorded: how they scatter.

Noise is added to the recorded columns, as large as their own, and these are read once more: what
the inputs change by has passed the filters and derivatives that they passed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.config import TwinSpec
from evertwin.fold import Block, Chunk
from evertwin.gauges.changes.noise import rounding
from evertwin.models import Model
from evertwin.rows.channels import measured_as, recorded_as
from evertwin.rows.feed import Data, Feed
from evertwin.setup.setup import Setup
from evertwin.tuning.form.blurred import Drawn
from evertwin.tuning.form.noisy_inputs import white
from evertwin.types import Inputs

DRAWS = 3
"""Times that noise is drawn."""
RATES = ("derivative", "slope")
"""Operations that make noise of a place large."""


@dataclass
class _Noisy(Feed):
    """The rows of recordings with noise added to some columns."""

    given: Sequence[Chunk] = ()
    level: dict[tuple[str, int], float] = field(default_factory=dict)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def chunks(self, data: Data = None) -> Iterator[Chunk]:
        for one in self.given:
            v = one.v.copy()
            for (source, column), size in self.level.items():
                if source == one.source:
                    v[:, column] += size * self.rng.standard_normal(len(v))
            yield one._replace(v=v)


def drawn(setup: Setup, model: Model, data: Data, windows: Sequence[Block]) -> Drawn | None:
    """What the inputs of ``windows`` may have been; None where none is derived.

    Args:
        data: that the windows were read of.
    """
    spec = setup.spec
    times = [differentiated(spec, name) for name in model.inputs.names]
    rates = {one.name for one in spec.derive if one.op in RATES}
    roots = {measured_as(spec, n) for n in model.inputs.names if recorded_as(spec, n) in rates}
    if not roots or len(model.states) or not _read(data):
        return None
    feed: Any = Feed(spec, model)
    chunks = tuple(feed.chunks(data))
    level = {
        (brings.name, k): size
        for brings in feed.brings(data)
        for k, name in enumerate(brings.channels)
        if name in roots and (size := _level(chunks, brings.name, k)) > 0.0
    }
    plain = np.concatenate([window.u for window in windows])
    found = _Noisy(spec, model, feed.tallies, given=chunks, level=level)
    draws = [_inputs(found, data, windows) for _ in range(DRAWS if level else 0)]
    known = [np.nan_to_num(one - plain) for one in draws if one is not None]
    parts = np.cumsum([len(window.t) for window in windows])[:-1]
    better, *noise = (
        np.concatenate([sharpened(part, times) for part in np.split(u, parts)])
        for u in (plain, *known)
    )
    return Drawn(better, noise)


def differentiated(spec: TwinSpec, name: str) -> int:
    """How often a channel of the model is derived from row to row."""
    made, found, times = {one.name: one for one in spec.derive}, recorded_as(spec, name), 0
    while (one := made.pop(found, None)) and len(one.source) == 1:
        times, found = times + (one.op == "derivative"), one.source[0]
    return times


def sharpened(u: Inputs, times: Sequence[int]) -> Inputs:
    """Inputs with what differences over two rows make too small of a fast motion, put back: over
    four rows it is four times as much (L. F. Richardson 1911).

    Args:
        times: that each is derived so, (nu,).

    >>> t = np.arange(400) * 0.1
    >>> u = np.gradient(np.sin(3 * t), t)[:, None]
    >>> [round(float(np.abs(one[5:-5]).max()), 2) for one in (u, sharpened(u, [1]))]
    [2.96, 3.0]
    """
    out = u.copy()
    bend = (u[2:] - 2.0 * u[1:-1] + u[:-2]) / 2.0
    out[1:-1] -= np.array(times) / 3.0 * np.nan_to_num(bend)
    return out


def _read(data: Data) -> bool:
    """Is it read from columns, not given as rows?"""
    listed = data if isinstance(data, list | tuple) else [data]
    return not any(isinstance(one, Block) for one in listed) and not isinstance(data, Iterator)


def _level(chunks: Sequence[Chunk], source: str, column: int) -> float:
    """Standard deviation of a recorded column's noise, by its own bends or what it is rounded to;
    the mean square of its tasks."""
    tasks = dict[int, list[np.ndarray]]()
    for one in chunks:
        if one.source == source:
            tasks.setdefault(one.task, []).append(one.v[:, column])
    found, steps = list[tuple[int, float]](), list[np.ndarray]()
    for parts in tasks.values():
        v = np.concatenate(parts)
        found.append((len(v), float(white(v[:, None], np.ones(len(v), dtype=np.bool_))[0])))
        steps.append(np.diff(v[np.isfinite(v)]))
    rows = sum(n for n, _ in found)
    square = sum(n * size**2 for n, size in found) / max(rows, 1)
    return max(float(np.sqrt(square)), rounding(steps))


def _inputs(feed: Feed, data: Data, windows: Sequence[Block]) -> Inputs | None:
    """The inputs of the same rows, read by another feed; None: they are others."""
    blocks = tuple(feed.blocks(data))
    t, u = (np.concatenate([getattr(one, name) for one in blocks]) for name in ("t", "u"))
    first = blocks[0].row
    found = list[Inputs]()
    for one in windows:
        at = slice(one.row - first, one.row - first + len(one.t))
        if not np.array_equal(t[at], one.t):
            return None
        found.append(u[at])
    return np.concatenate(found)
