"""Pushed samples in the store: arrays beside the rows, and how long samples are kept."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from evertwin.config import TwinSpec
from evertwin.errors import DataError
from evertwin.fold import Chunk
from evertwin.store import Batch, Store
from evertwin.sync.horizon.horizon import nanoseconds

SECONDS = 1.0
"""Time from one look at what may go to the next."""


class Numbered(NamedTuple):
    """Samples with their number in the store.

    >>> Numbered._fields
    ('number', 'chunk')
    """

    number: int
    """0: the store has none of them."""
    chunk: Chunk


@dataclass
class Samples:
    """What goes into the store of each source.

    >>> from evertwin.config.spec import ArraySpec, ModelSpec
    >>> from evertwin.store import SqliteStore
    >>> import numpy as np
    >>> spec = TwinSpec("cart", ModelSpec("robot1d"), array=(ArraySpec("lidar", (3,), keep=1.0),))
    >>> samples = Samples(SqliteStore(":memory:"), spec)
    >>> for second in range(4):
    ...     scan = Chunk("lidar", np.array([second * 10**9]), np.ones((1, 3)))
    ...     assert samples.is_array(scan) and samples.keep(scan).number == second + 1
    >>> samples.forget(now=1e9)
    >>> [int(chunk.t[0]) for chunk in samples.store.samples("lidar", 0, 10**12)]
    [2000000000, 3000000000]
    """

    store: Store
    spec: TwinSpec
    _newest: dict[str, int] = field(default_factory=dict, init=False)
    """Stamp of the newest sample of each source that is not kept for good."""
    _looked: float = field(default=-SECONDS, init=False)
    _shapes: Mapping[str, tuple[int, ...]] = field(init=False)
    _kept: Mapping[str, int] = field(init=False)
    """How long [ns]."""

    _count: int = field(init=False)
    """Number of the newest ones."""

    def __post_init__(self) -> None:
        self._count = self.store.chunks
        self._shapes = {one.name: one.shape for one in self.spec.array}
        kept = {one.name: one.keep for one in self.spec.source}
        kept |= {one.name: one.keep for one in self.spec.array}
        self._kept = {name: nanoseconds(keep) for name, keep in kept.items() if keep is not None}

    def is_array(self, chunk: Chunk) -> bool:
        """Is a chunk of a source of arrays, which no row is made of?

        Raises:
            DataError: its arrays have another shape than the twin file says, or none at all.
        """
        shape = self._shapes.get(chunk.source)
        if shape is not None and (len(chunk.t) == 0 or chunk.v.shape != (len(chunk.t), *shape)):
            raise DataError(
                f"source {chunk.source!r}: expected {len(chunk.t)} arrays of shape {shape}, got "
                f"values of shape {chunk.v.shape}"
            )
        return shape is not None

    def keep(self, chunk: Chunk) -> Numbered:
        """Stores samples, and lets go of what need not be kept any longer."""
        self.store.commit(Batch(chunks=(chunk,)), wait=False)
        self._count += 1
        if chunk.source in self._kept:
            newest = self._newest.get(chunk.source, int(chunk.t[0]))
            self._newest[chunk.source] = max(newest, int(chunk.t.max()))
            self.forget(time.monotonic())
        return Numbered(self._count, chunk)

    def forget(self, now: float) -> None:
        """Lets go of what need not be kept any longer; looks once a second (of ``now`` [s])."""
        if now < self._looked + SECONDS:
            return
        self._looked = now
        before = {name: newest - self._kept[name] for name, newest in self._newest.items()}
        self.store.commit(Batch(forget=before), wait=False)
