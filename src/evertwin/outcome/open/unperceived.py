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

from evertwin.features.perception import CAUSES, FROZEN
from evertwin.fold import Event


def unperceived(events: Iterable[Event]) -> list[str]:
    """Why scans tell no pose, a sentence for each kind; a frozen lidar until they do again."""
    found = dict[str, str]()
    for event in events:
        if event.kind == "pose_found":
            found.pop(FROZEN, None)
        elif event.kind in CAUSES:
            found[event.kind] = f"{event.reason[0].upper()}{event.reason[1:]}."
    return [*found.values()]
