"""A run that is over, and went on from what is kept no longer: its rows once more.

They are followed by the versions that its log says were live at them. Nothing is judged or learned
anew, and nothing is logged.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

from evertwin.fold import Answer, Event
from evertwin.ledger.begun import Begun
from evertwin.outcome.course.lives import SWITCHES
from evertwin.store import Store


class Retold:
    """The switches of such a run, as if each were an order.

    >>> went = Event(20, 0, "promoted", "", "", {"version": 1})
    >>> retold = Retold([went])
    >>> retold.next_order(), retold.heed(19), retold.heed(20) == (went,), retold.next_order()
    (20, (), True, inf)
    """

    def __init__(self, switches: Iterable[Event]) -> None:
        self._left = deque(switches)

    @classmethod
    def of(cls, store: Store, run: Begun) -> Retold:
        """The switches that a log has of a run, its own and an operator's."""
        found = list[Event]()
        for entry in store.entries(run.position, ("event",)):
            if entry.run in (0, run.number) and entry.number <= run.last:
                record = store.record(entry)
                if isinstance(record, Event) and record.kind in SWITCHES:
                    found.append(record)
        return cls(found)

    def answer(self, number: int) -> tuple[int, Answer] | None:
        """None: nothing is asked."""
        return None

    def knows_more(self) -> bool:
        """No answer is waited for."""
        return False

    def next_order(self) -> float:
        """Row from which on the next version is live; infinite: there is none."""
        return self._left[0].row if self._left else math.inf

    def heed(self, row: int) -> tuple[Event, ...]:
        """The switches up to a beat at ``row``."""
        found = list[Event]()
        while self._left and self._left[0].row <= row:
            found.append(self._left.popleft())
        return tuple(found)
