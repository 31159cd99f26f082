"""Samples by name as chunks of the one source of a running twin.

Which source reads a row of numbers, in which units and on which clock, its names tell: it is found
with the first row that has them, as of a table, and kept for those after it. What a value alone can
tell (a stamp that is a whole number, a text, a date, None) is read as a table each time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from evertwin.config import TwinSpec
from evertwin.errors import DataError
from evertwin.fold import Chunk
from evertwin.models import Model
from evertwin.rows.given import Given, tabled
from evertwin.sources.clocks.exported import computed
from evertwin.sources.clocks.stamps import NO_STAMP, is_decimal, to_ns
from evertwin.sources.clocks.tally import order_of_rows
from evertwin.sources.columns.cells import InSi
from evertwin.sources.recorded import Recorded
from evertwin.sync import Feed

PLAIN = frozenset((float, np.float64, int))
"""Types of numbers that are read alike where they are no stamps."""
EXACT = 2.0**53
"""Whole numbers below it are floats too."""


@dataclass
class ByName:
    """Reads what is pushed for ``feed``, a table or one row as numbers by name.

    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.machines.mobile import Robot1D
    >>> read = ByName(TwinSpec("cart", ModelSpec("robot1d")), Robot1D(), Feed("log", ("v", "x")))
    >>> [read({"t": t, "x": 0.1, "v": 2.0}).v.tolist() for t in (0.0, 1.0)]
    [[[2.0, 0.1]], [[2.0, 0.1]]]
    """

    spec: TwinSpec
    model: Model
    feed: Feed
    _known: _Row | None = field(default=None, init=False)
    """How rows with the names of the last one are read."""

    def __call__(self, data: Any) -> Chunk:
        """The samples.

        Raises:
            DataError: a column lacks, a row has no stamp, or the rows are not in order.
            UsageError: it is no table.
        """
        plain = type(data) is dict and PLAIN.issuperset(map(type, data.values()))
        if plain and self._known is not None and (found := self._known.read(data)) is not None:
            return found
        held = tabled(self.spec, self.model, data)
        channels = list(held.source.channels)
        lacking = [name for name in self.feed.channels if name not in channels]
        if lacking:
            there = ", ".join(c.name for c in held.recordings[0].tables[0].columns)
            raise DataError(f"columns: expected {', '.join(lacking)} too, got {there}")
        source = Recorded.of(held.source, held.recordings)
        read = source.samples()
        if unsorted := order_of_rows(read.t):
            raise DataError(f"samples: {unsorted}")
        order = [channels.index(name) for name in self.feed.channels]
        if plain:
            self._known = _Row.of(data, self.feed, held, source)
        return Chunk(self.feed.name, read.t, np.ascontiguousarray(read.v[:, order]))


class _Row(NamedTuple):
    """How one row of numbers is read."""

    name: str
    names: tuple[str, ...]
    pick: Callable[[Mapping[str, float]], tuple[float, ...]]
    """Its stamp, then its cells in the order of the feed's channels."""
    unit: str
    offset: int
    in_si: InSi

    @classmethod
    def of(cls, row: Mapping[str, float], feed: Feed, held: Given, source: Recorded) -> _Row | None:
        """None: another row with these names may be read otherwise."""
        clock, cells = source.clock, {cell.channel: cell for cell in source.cells}
        asked = [clock.column, *(cells[name].column for name in feed.channels)]
        named = [column for column in asked if isinstance(column, str) and column in row]
        texts = all(isinstance(name, str) for name in row)
        told = held.source.task is None and not held.source.where and is_decimal(clock.unit)
        if not (told and texts and len(named) == len(asked)) or computed(list(row)):
            return None
        if isinstance(row[named[0]], int):  # its unit is guessed anew each time
            return None
        in_si = InSi.of([cells[name] for name in feed.channels])
        return cls(feed.name, tuple(row), itemgetter(*named), clock.unit, clock.offset, in_si)

    def read(self, row: Mapping[str, float]) -> Chunk | None:
        """One sample; None: it has other names, or its numbers are not read as those before."""
        if tuple(row) != self.names:
            return None
        stamp, *cells = self.pick(row)
        if isinstance(stamp, int) or not all(-EXACT < cell < EXACT for cell in cells):
            return None  # no number, too
        t, raw = to_ns(np.array([stamp]), self.unit), np.array([cells], dtype=np.float64)
        if t[0] == NO_STAMP:
            return None
        return Chunk(self.name, t + self.offset, self.in_si(raw)[0])
