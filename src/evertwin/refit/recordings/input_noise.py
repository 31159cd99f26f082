"""How inputs scatter that are derived from what was recorded, drawn anew.

Noise is added to the recorded columns, as large as their own, and these are read once more: what
the inputs change by has passed the filters and derivatives that they passed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.fold import Block, Chunk
from evertwin.gauges.changes.noise import rounding
from evertwin.models import Model
from evertwin.rows.channels import measured_as, recorded_as
from evertwin.rows.feed import Data, Feed
from evertwin.setup.setup import Setup
from evertwin.tuning.form.noisy_inputs import white
from evertwin.types import Inputs

DRAWS = 3
"""Times that noise is drawn."""


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


def drawn(
    setup: Setup, model: Model, data: Data, windows: Sequence[Block]
) -> tuple[Inputs, ...]:
    """What the inputs of ``windows`` scatter by, (n, nu) each; none where none is derived, or no
    noise is told.

    Args:
        data: that the windows were read of.
    """
    spec = setup.spec
    rates = {one.name for one in spec.derive if one.op in ("derivative", "slope")}
    roots = {measured_as(spec, n) for n in model.inputs.names if recorded_as(spec, n) in rates}
    if not roots or len(model.states) or not _read(data):
        return ()
    feed: Any = Feed(spec, model)
    chunks = tuple(feed.chunks(data))
    level = {
        (brings.name, k): size
        for brings in feed.brings(data)
        for k, name in enumerate(brings.channels)
        if name in roots and (size := _level(chunks, brings.name, k)) > 0.0
    }
    if not level:
        return ()
    plain = _inputs(_Noisy(spec, model, feed.tallies, given=chunks), data, windows)
    found = _Noisy(spec, model, feed.tallies, given=chunks, level=level)
    draws = [_inputs(found, data, windows) for _ in range(DRAWS)]
    if plain is None or any(one is None for one in draws):
        return ()
    return tuple(np.nan_to_num(one - plain) for one in draws if one is not None)


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
