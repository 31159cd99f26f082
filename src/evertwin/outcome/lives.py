"""Which versions were live in a run, one after the other: what has changed since it began."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from evertwin.fold import Event


def lives(events: Sequence[Event]) -> list[int]:
    """Numbers of the versions that were live, without those that were taken back.

    >>> switched = [("promoted", 2, 1), ("promoted", 3, 2), ("rolled_back", 1, 3)]
    >>> [lives([Event(0, 0, kind, "", "", {"version": new, "replaced": old})
    ...         for kind, new, old in switched[:count]]) for count in (2, 3)]
    [[1, 2, 3], [1]]
    """
    found = list[int]()
    for event in events:
        known: Any = event.evidence
        if event.kind not in ("promoted", "rolled_back") or "version" not in known:
            continue
        number = known["version"]
        if not found and known.get("replaced") is not None:
            found.append(known["replaced"])
        found = found[: found.index(number)] if number in found else found
        found.append(number)
    return found


def went_back(events: Sequence[Event], live: int) -> tuple[str, ...]:
    """Of an earlier version that went live again last: what was live before it, and from when to
    when; nothing: none did, or another one is ``live`` now.

    >>> went = Event(9, 0, "promoted", "", "2 replaces 1, e-value 9; c 1 → 2", {"version": 2})
    >>> back = Event(19, 0, "rolled_back", "", "", {"version": 1, "since": 12})
    >>> print(went_back([went, back], 1)[0].replace("; ", "\\n"))
    Version 2 (c 1 → 2) was live from row 9 to 19
    from row 12 on the machine is again as at version 1, as after a repair.
    """
    switches = [e for e in events if e.kind in ("promoted", "rolled_back")]
    if not switches or switches[-1].kind != "rolled_back":
        return ()
    back: Any = switches[-1].evidence
    if back["version"] != live:
        return ()
    went = [e for e in switches if e.kind == "promoted" and e.evidence.get("version") is not None]
    if not went:
        return ()
    number, made = went[-1].evidence["version"], went[-1].reason.partition(", e-value")[2]
    made = made.partition("; ")[2]
    which = f"Version {number}{f' ({made})' if made else ''}"
    said = f"{which} was live from row {went[-1].row} to {switches[-1].row}; "
    if "since" not in back:
        return (f"{said}it did worse than version {back['version']}, which is live again.",)
    said += f"from row {back['since']} on the machine is again as at version {back['version']}"
    return (f"{said}, as after a repair.",)
