"""What keeps a twin that perceives from a pose, as far as its events say: part of its result.

>>> events = [Event(4, 0, "scans_frozen", "scan", "scan: the same ranges came again"),
...           Event(4, 0, "pose_lost", "scan", "3 scans in a row tell no pose")]
>>> unperceived(events)
['Scan: the same ranges came again.']
>>> unperceived([*events, Event(9, 0, "pose_found", "scan", "")])
[]
"""

from __future__ import annotations

from collections.abc import Iterable

from evertwin.fold import Event

LASTS, PASSES = "unit_doubted", "scans_frozen"
"""Kinds of event that say why there is no pose: whatever scans tell, and until they tell one."""


def unperceived(events: Iterable[Event]) -> list[str]:
    """Why scans tell no pose, a sentence for each kind."""
    found = dict[str, str]()
    for event in events:
        if event.kind == "pose_found":
            found.pop(PASSES, None)
        elif event.kind in (LASTS, PASSES):
            found[event.kind] = f"{event.reason[0].upper()}{event.reason[1:]}."
    return [*found.values()]
