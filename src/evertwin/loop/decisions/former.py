"""Versions that were live before: the machine may be again as it was at one of them.

A machine that goes to and fro between two of them (a floor, a tool, a valve) is followed by going
back to the one that is known, after a short test; nothing is learned anew.

>>> lives = none()
>>> for number, row in ((1, 0), (2, 300), (1, 500), (2, 700)):
...     lives = with_live(lives, number, row)
>>> known_again(lives, 1), known_again(lives, 3)
(True, False)
>>> alternates(lives)
Alternates(first=1, second=2, since=0, changes=3)
>>> alternates(without_newest(lives)) is None
True
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.ledger.versions import FORMER, Versions
from evertwin.loop.decisions.decision import Decision
from evertwin.models.form import Version
from evertwin.setup.twin_state import TwinState
from evertwin.types import Int64

NOBODY = -1
"""Stands where no version was live yet."""
KNOWN = 0.5
"""Gain that a version which the machine was like time and again has to show in its short test."""
TURNS = 3
"""Changes between the same two versions from which on the machine alternates."""
Lives = Int64[np.ndarray, "k two"]


class Alternates(NamedTuple):
    """Two versions that the machine is like by turns.

    >>> Alternates(1, 2, 0, 3).changes
    3
    """

    first: int
    second: int
    """The one that is live."""
    since: int
    """Row since which it does."""
    changes: int


def none() -> Lives:
    """No version was live yet."""
    return np.full((FORMER, 2), NOBODY, dtype=np.int64)


def with_live(lives: Lives, number: int, row: int) -> Lives:
    """A version more, which is live from ``row`` on; the oldest one goes."""
    return np.concatenate([lives[1:], [[number, row]]])


def began(lives: Lives, number: int, row: int, *, reached: bool) -> Lives:
    """The lives with ``number``, live from ``row`` on. Those before it go for good where none has
    ``reached`` what is asked: no machine was ever like them.

    >>> began(with_live(none(), 0, 0), 1, 700, reached=False)[-2:, 0].tolist()
    [-1, 1]
    """
    return with_live(lives if reached else none(), number, row)


def without_newest(lives: Lives) -> Lives:
    """The newest one is taken back: it was never what the machine is."""
    return np.concatenate([[[NOBODY, 0]], lives[:-1]])


def former(versions: Versions, state: TwinState, live: int) -> tuple[Version, ...]:
    """Those that may come back: that were live in these rows, the newest first, then what the
    ``live`` one was made from; not the description that it all began with, which was never tried
    on these rows and need not ever have been the machine."""
    learned = (one.number for one in versions.before(live) if one.parent is not None)
    numbers = [*state.lives[::-1, 0].tolist(), *learned]
    known = [number for number in dict.fromkeys(numbers) if number not in (NOBODY, live)]
    return tuple(versions[number] for number in known[:FORMER])


def known_again(lives: Lives, number: int) -> bool:
    """Was the machine like this version, then like another, and like this one again before?"""
    return int((lives[:, 0] == number).sum()) >= 2


def alternates(lives: Lives) -> Alternates | None:
    """The two versions between which the newest changes went; None: they went elsewhere."""
    number = lives[:, 0]
    if NOBODY in number[-4:] or number[-1] == number[-2]:
        return None
    others = np.flatnonzero(number != np.where(np.arange(FORMER) % 2, number[-1], number[-2]))
    changes = FORMER - 1 - (int(others[-1]) + 1 if len(others) else 0)
    if changes < TURNS:
        return None
    since = int(lives[FORMER - 1 - changes, 1])
    return Alternates(int(number[-2]), int(number[-1]), since, changes)


def tell_alternates(decision: Decision) -> None:
    """Another version is live; is it one of two by turns? Told once."""
    found = alternates(decision.state.lives)
    if found is not None and found.changes == TURNS:
        reason = (
            f"the machine alternates: since row {found.since} it is by turns as at versions "
            f"{found.first} and {found.second}; the twin goes back to each and learns nothing anew"
        )
        decision.say("alternates", "", reason, found._asdict())
