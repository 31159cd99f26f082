"""Can this process go on from the state that a store has? Asked before anything is written.

A twin that is opened writes: its model as configured, the run that it gives up. Where several
machines share a store (`evertwin.fleet`) that would leave traces of one that cannot go on.
"""

from __future__ import annotations

from typing import NamedTuple

from evertwin.errors import StoreError
from evertwin.ledger.begun import Begun
from evertwin.ledger.ledger import Ledger
from evertwin.loop.driver import Driver
from evertwin.loop.run import settings_hash
from evertwin.rows.alignment import Alignment, AlignmentState
from evertwin.rows.feed import Feed
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import Saved


class Rate(NamedTuple):
    """Rows per second, which says what shape a state has; NaN where there is but one row.

    >>> Rate(10.0).rate
    10.0
    """

    rate: float


class FeedState(NamedTuple):
    """What a checkpoint of pushed samples holds beside the state of the twin.

    >>> FeedState._fields
    ('rate', 'task', 'aligned')
    """

    rate: float
    task: int
    """Number of the first task."""
    aligned: AlignmentState


def other_settings(setup: Setup, ledger: Ledger) -> str:
    """Why a new run would begin in place of the one that was cut off; empty: it goes on."""
    left, feeds = _left(ledger), Feed(setup.spec, setup.model).live(())
    if left is None or left.evidence["settings"] == settings_hash(setup.spec, feeds):
        return ""
    return f"run {left.number} was begun with other settings of the twin file, or another version"


def unloadable(setup: Setup, ledger: Ledger) -> str:
    """Why the state of the run that was cut off cannot be loaded; empty: it can, or need not."""
    left = _left(ledger)
    if left is None or other_settings(setup, ledger):
        return ""
    aligned = Alignment.of(setup.spec, setup.model, Feed(setup.spec, setup.model).live(())).init()
    try:
        found = ledger.store.restore(Saved((), Rate(0.0)), left.number)
        if found is None:  # it is folded from its first sample
            return ""
        rate = found.state.feed.rate
        shape = setup.at(rate if rate == rate else None)
        champion, pinned = int(left.evidence["champion"]), bool(left.evidence["pinned"])
        driver = Driver(shape, ledger.versions, _unsaid, champion=champion, pinned=pinned)
        driver.restored(ledger.store, left.number, FeedState(0.0, 0, aligned))
    except StoreError as error:
        return str(error)
    return ""


def _left(ledger: Ledger) -> Begun | None:
    """The run of pushed samples that was cut off."""
    left = ledger.unfinished
    return left if left is not None and "sources" in left.evidence else None


def _unsaid(row: int, records: object) -> None:
    """Nothing is folded."""
