"""Faults of sensors that were told of and are not over: what a result has to say first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from evertwin.fold import Event


def open_faults(events: Sequence[Event]) -> Mapping[str, str]:
    """Signals whose measurement is in error at the end, each with a sentence about it.

    >>> frozen = {"cause": "frozen", "onset": 3, "end": 9}
    >>> open_faults([Event(9, 0, "measurement_error", "tau", "frozen", frozen)])
    {'tau': 'tau has been in error since row 3: frozen.'}
    >>> open_faults([Event(12, 0, "measurement_error", "tau", "frozen", frozen)])
    {}
    """
    newest = {
        e.signal: e for e in events if e.kind in ("measurement_error", "measurement_restored")
    }
    found = {}
    for signal, event in newest.items():
        # one that lasts is told of at its newest row, one that is over at a later one
        lasts = event.evidence.get("open", event.evidence.get("end") == event.row)
        if event.kind == "measurement_error" and lasts and event.evidence.get("cause") != "vote":
            first = event.evidence.get("first", event.evidence.get("onset"))
            known = " Its first rows are in the figures." if "known" in event.evidence else ""
            found[signal] = f"{signal} has been in error since row {first}: {event.reason}.{known}"
    return found
