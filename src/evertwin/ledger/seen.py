"""Recordings that a store has seen: which of the rows given are those of a run that it knows.

* Rows of a run that was cut off: the run goes on where it stopped.
* Rows of runs that ended are passed over, one run after the other; what follows is the next run.
* Where nothing follows, the last of these runs is shown again, and nothing is added to the log;
  but where somebody has promoted, rolled back or pinned a version since, all rows are run anew.

Rows are recognised by their hash (`Fingerprint`): names, sizes and dates of files do not count, nor
what was named before them: a run has the stamps that its first recording has alone. A run counts
under the settings that it had; with others its rows are new. A run that was cut off is given up
when another one begins: its rows are then run from their first on.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block, take
from evertwin.ledger.begun import Begun
from evertwin.ledger.fingerprint import Fingerprint
from evertwin.ledger.ledger import Ledger

NOTHING: Mapping[int, int] = {}


class Place(NamedTuple):
    """Where a run begins in the data.

    >>> Place(None, 0).run is None
    True
    """

    run: Begun | None
    """The run that is repeated; None: a new one."""
    offset: int
    """Rows that belong to runs before."""
    moved: int = 0
    """How far the recordings before have moved the stamps of its first row [ns]."""


class _Known(NamedTuple):
    """A run by its rows."""

    run: Begun
    rows: int
    digest: str | None
    """None: lost."""


@dataclass
class _Trail:
    """Rows from an offset on, compared with the runs that may begin there."""

    offset: int
    left: list[_Known]
    """By rows; those that are still possible."""
    tasks: Mapping[int, int]
    """As `find` has it."""
    hash: Fingerprint = field(default_factory=Fingerprint)
    moved: int = 0
    """As `Place` has it."""

    def add(self, block: Block) -> Iterator[_Known]:
        """Further rows; runs whose rows end among them."""
        if self.hash.rows == 0:
            self.moved = self.tasks.get(int(block.task[0]), 0)
        block = block._replace(t=block.t - self.moved)
        if self.hash.rows == 0:
            self.hash.add(take(block, 0, 1))
            self.left = [one for one in self.left if one.run.evidence["first"] == self.hash.digest]
        begin = block.row - self.offset
        while self.left and self.left[0].rows <= begin + len(block.t):
            one = self.left.pop(0)
            self.hash.add(take(block, self.hash.rows - begin, one.rows - begin))
            if one.digest in (None, self.hash.digest):
                yield one
        if self.left:
            self.hash.add(take(block, self.hash.rows - begin, len(block.t)))


def find(
    ledger: Ledger, blocks: Iterable[Block], settings: str, moved: Mapping[int, int] = NOTHING
) -> Place:
    """Where in the data the next run begins, or which run is repeated.

    Args:
        ledger: its runs are looked for.
        blocks: the rows from the first on; no more are read than are needed.
        settings: hash of the settings that are in force.
        moved: tasks of the rows so far whose stamps were moved by those before, how far [ns].
    """
    known = [one for one in _runs(ledger) if one.run.evidence["settings"] == settings]
    if not known:
        return Place(None, 0)
    trails, ended = [_Trail(0, list(known), moved)], dict[int, Place]()
    opened = {0: trails[0]}
    rows, furthest = 0, 0
    for block in blocks:
        rows = block.row + len(block.t)
        fresh = list(trails)
        while fresh:
            trail = fresh.pop()
            part = take(block, max(trail.offset - block.row, 0), len(block.t))
            for one in trail.add(part) if len(part.t) else ():
                place, end = Place(one.run, trail.offset, trail.moved), trail.offset + one.rows
                if not one.run.over:
                    return place
                if end not in opened:
                    opened[end] = _Trail(end, list(known), moved)
                    fresh.append(opened[end])
                    trails.append(opened[end])
                ended[end], furthest = place, max(end, furthest)  # of equal runs the newest
        trails = [trail for trail in trails if trail.left]
        if not trails:
            break
    if not furthest or rows > furthest:
        return Place(None, furthest, opened[furthest].moved)
    run = ended[furthest].run
    assert run is not None
    return Place(None, 0) if ledger.spoken > run.last else ended[furthest]


def _runs(ledger: Ledger) -> list[_Known]:
    """The runs whose rows are known, by rows."""
    found, seen = [], ledger.store.progress()
    for run in ledger.runs:
        if run.ended is not None and not run.ended["given_up"]:
            found.append(_Known(run, run.ended["rows"], run.ended["digest"]))
        elif not run.over:
            mine = seen is not None and seen.run == run.number
            far = seen is not None and mine and seen.rows > 0
            rows, digest = (seen.rows, seen.digest) if seen is not None and far else (1, None)
            found.append(_Known(run, rows, digest))
    return sorted(found, key=lambda one: one.rows)


def later(blocks: Iterable[Block], place: Place) -> Iterator[Block]:
    """The rows from a place on, numbered from zero, their tasks too, and stamped as if they had
    been named alone."""
    first, offset = None, place.offset
    for block in blocks:
        part = take(block, max(offset - block.row, 0), len(block.t))
        if len(part.t) == 0:
            continue
        if first is None:
            first = int(part.task[0])
            opens = np.arange(len(part.t)) == 0
            dt = np.where(opens, 0.0, part.dt)
            part = part._replace(gap=part.gap | opens, dt=dt) if offset else part
        t, task = part.t - place.moved, part.task - first
        yield part._replace(row=part.row - offset, t=t, task=task)


def rest(blocks: Iterable[Block], row: int) -> Iterator[Block]:
    """The rows from number ``row`` on."""
    for block in blocks:
        part = take(block, max(row - block.row, 0), len(block.t))
        if len(part.t):
            yield part
