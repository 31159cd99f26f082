"""A recorded drive, of which several readings are held until the scans that follow decide.

Where two places fit a scan nearly alike (along a corridor, say) a stream must take one at once. A
recording need not: each is followed on, with its own map, and judged by all scans since. Readings
that are `HOPELESS` end; so do those whose last steps are another's.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from evertwin.features.scans.came import Came
from evertwin.features.scans.local_map import Known, known
from evertwin.features.scans.poses import Row
from evertwin.features.scans.scan_fit import ranked
from evertwin.features.scans.scan_matcher import Following, ScanMatcher
from evertwin.fold import Block
from evertwin.signals.planar import between
from evertwin.types import Vector

MOST = 4
"""Readings that are held."""
HOPELESS = 8.0
"""Logarithm of how much less likely than the best one a reading is that ends."""
SAME, LAST = 0.1, 6
"""Two readings are one where their last so many steps differ by less [m, rad]."""


class Past(NamedTuple):
    """What a reading told of a scan, and of those before: readings share what they have in common.

    >>> Past(Row(), True, None).keyframe
    True
    """

    row: Row
    keyframe: bool
    before: Past | None


class Reading(NamedTuple):
    """What may have happened so far.

    >>> Reading._fields
    ('state', 'view', 'worth', 'past')
    """

    state: Following
    view: Known | None
    worth: float
    """Logarithm of how likely it is, up to a constant."""
    past: Past | None
    """What it told so far."""


def read_on(matcher: ScanMatcher, block: Block) -> tuple[list[tuple[int, Row, bool]], Vector]:
    """Stamps, rows and keyframes of the likeliest reading, and the time for each scan [s]."""
    held, took = [Reading(matcher.init(), None, 0.0, None)], np.zeros(len(block.t))
    for i in range(len(block.t)):
        began = time.perf_counter()
        came = Came.of(block, i)
        grown = [new for one in held for new in _onward(matcher, one, came)]
        held = _kept(grown)
        took[i] = time.perf_counter() - began
    rows, last = [], held[0].past
    for t in block.t[::-1]:
        assert last is not None
        row, keyframe, last = last
        rows.append((int(t), row, keyframe))
    return rows[::-1], took


def _onward(matcher: ScanMatcher, one: Reading, came: Came) -> Iterator[Reading]:
    """A reading with one scan more: one for each place that the scan may have been taken from."""
    before = one.state.map.joined, one.state.segment
    for state, row, worth in matcher.read(one.state, one.view, came, ranked):
        new = (state.map.joined, state.segment) != before
        view = known(state.map) if new else one.view
        yield Reading(state, view, one.worth + worth, Past(row, new, one.past))


def _kept(readings: list[Reading]) -> list[Reading]:
    """The likeliest, none of them twice."""
    kept: list[Reading] = []
    for one in sorted(readings, key=lambda one: -one.worth):
        if kept and (len(kept) == MOST or one.worth < kept[0].worth - HOPELESS):
            break
        if not any(_same(one, other) for other in kept):
            kept.append(one)
    return kept


def _same(one: Reading, other: Reading) -> bool:
    """Have two readings taken the same steps of late?"""
    a, b = one.past, other.past
    poses = []
    for _ in range(LAST + 1):
        if a is None or b is None:
            break
        poses.append((a.row.pose, b.row.pose))
        a, b = a.before, b.before
    mine, theirs = np.array(poses).transpose(1, 0, 2)
    off = between(mine[1:], mine[:-1]) - between(theirs[1:], theirs[:-1])
    return bool(np.all(np.abs(off) < SAME)) and one.state.segment == other.state.segment
