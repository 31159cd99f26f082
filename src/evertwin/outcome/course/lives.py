"""Which versions were live in a run, one after the other: what has changed since it began."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from evertwin.fold import Event
from evertwin.setup.setup import Setup
from evertwin.trial.odds import ODDS

SWITCHES = ("promoted", "rolled_back")
"""Kinds of event after which another version is live."""
TURNS = 2
"""Versions in turn that did not last, from so many of which on it is said."""
BRIEF = 4
"""A version that was live for so many times its trial, or a deviation's window, did not last."""
MADE = re.compile(f"(?:{ODDS}|, e-value )[^;]*; (.*)")
"""What a version was made of, in the reason of its promotion; logs of before say e-value."""


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
        if event.kind not in SWITCHES or "version" not in known:
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

    >>> went = Event(9, 0, "promoted", "", "2 replaces 1, odds of 9 to 1; c 1 → 2",
    ...              {"version": 2, "replaced": 1})
    >>> back = Event(19, 0, "rolled_back", "", "", {"version": 1, "since": 12})
    >>> print(went_back([went, back], 1)[0].replace("; ", "\\n"))
    Version 2 (c 1 → 2) was live from row 9 to 19
    from row 12 on the machine is again as at version 1, as after a repair.
    """
    back = returned(events)
    if back is None or back.evidence["version"] != live:
        return ()
    away = list[Event]()
    for event in reversed(events[: events.index(back)]):
        if event.kind == "promoted" and "version" in event.evidence:
            away.append(event)
        if event.kind in SWITCHES and event.evidence.get("replaced") == live:
            break
    if not away:
        return ()
    found = MADE.search(away[0].reason)
    made = found[1] if found else ""
    numbers = [str(event.evidence["version"]) for event in reversed(away)]
    which = f"Version{'s' * (len(away) > 1)} {', '.join(numbers)}{f' ({made})' if made else ''}"
    was = "were" if len(away) > 1 else "was"
    said = f"{which} {was} live from row {away[-1].row} to {back.row}; "
    told: Any = [
        e.evidence["row"] for e in events if e.kind == "changed" and away[0].row < e.row < back.row
    ]
    since = back.evidence.get("since", told[-1] if told and back.kind == "promoted" else None)
    outdone = {"left", "segments"} <= back.evidence.keys()
    if back.kind == "rolled_back" and (since is None or outdone):
        neither = ", though neither is within what is asked" if outdone else ""
        return (f"{said}it did worse than version {live}, which is live again{neither}.",)
    on = f"from row {since} on " if since is not None else ""
    return (f"{said}{on}the machine is again as at version {live}, as after a repair.",)


def restless(setup: Setup, events: Sequence[Event]) -> tuple[str, ...]:
    """What is said where versions came one after the other and none lasted; else nothing."""
    tried = setup.trial.least * setup.trial.horizon * (setup.known_rate or 0.0)
    came = in_turn(events, round(BRIEF * max(setup.enough, tried)))
    if len(came) <= TURNS:
        return ()
    rows = [after.row - before.row for before, after in pairwise(came)]
    longest = f"{max(rows) / setup.known_rate:.3g} s" if setup.known_rate else f"{max(rows)} rows"
    return (
        f"{len(rows)} versions in turn were live for {longest} or less, since the machine went on "
        "changing: something may drive it that the model has no input for, such as a load or a "
        "temperature.",
    )


def in_turn(events: Sequence[Event], brief: int) -> list[Event]:
    """The newest promotions that came one after the other, each since the machine had changed anew
    and within ``brief`` rows of the one before.

    >>> told = [Event(row, 0, kind, "", "", {}) for row in (0, 500, 600, 700)
    ...         for kind in ("changed", "promoted")]
    >>> [event.row for event in in_turn(told, 200)], len(in_turn(told, 50))
    ([500, 600, 700], 1)
    """
    found, change = list[Event](), 0
    for event in events:
        change = event.row if event.kind == "changed" else change
        if event.kind == "promoted":
            goes_on = found and found[-1].row < change and event.row - found[-1].row <= brief
            found = [*found, event] if goes_on else [event]
        elif event.kind in ("rolled_back", "alternates"):
            found = []
    return found


def returned(events: Sequence[Event]) -> Event | None:
    """The last switch, if it is to a version that was live before."""
    switches = [e for e in events if e.kind in SWITCHES and "version" in e.evidence]
    if not switches:
        return None
    last, keys = switches[-1], ("version", "replaced")
    before = {e.evidence[key] for e in switches[:-1] for key in keys if key in e.evidence}
    return last if last.kind == "rolled_back" or last.evidence["version"] in before else None
