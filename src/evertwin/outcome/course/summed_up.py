"""Events that say the same of one channel again and again, as one line: how often, from when on,
and until when. What decides is never summed up.

>>> spikes = [Event(k, k, "measurement_error", "x", "", {"cause": "vote"}) for k in (3, 5, 9)]
>>> [(one.first.row, one.times, one.last.row) for one in summed_up(spikes)]
[(3, 3, 9)]
>>> len(summed_up(spikes[:2]))
2
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from evertwin.fold import Event

REPEATED = frozenset({"measurement_error", "measurement_restored", "overruled"})
"""Kinds of event that come as often as a sensor's samples do."""
LEAST = 3
"""Events that make one line."""


class Several(NamedTuple):
    """One event, or several that say the same.

    >>> event = Event(3, 3, "tuned", "", "tuned gain", {})
    >>> Several(event, event, 1).times
    1
    """

    first: Event
    last: Event
    times: int


def summed_up(events: Sequence[Event]) -> list[Several]:
    """The events in order, those that repeat one another at the place of their first."""
    groups: dict[object, list[Event]] = {}
    for number, event in enumerate(events):
        repeats = event.kind in REPEATED
        key = (event.kind, event.signal, event.evidence.get("cause")) if repeats else number
        groups.setdefault(key, []).append(event)
    found = [
        several
        for some in groups.values()
        for several in (
            [Several(some[0], some[-1], len(some))]
            if len(some) >= LEAST
            else [Several(event, event, 1) for event in some]
        )
    ]
    places = {id(event): number for number, event in enumerate(events)}
    return sorted(found, key=lambda one: places[id(one.first)])
