"""Faults of sensors that were told of and are not over: what a result has to say first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from evertwin.fold import Event

KINDS = ("measurement_error", "measurement_restored")
SHORT = 0.1
"""Rows for which a fault seemed over, by those of all of it, where it has only gone on."""


def open_faults(events: Sequence[Event]) -> Mapping[str, str]:
    """Signals whose measurement is in error at the end, each with a sentence about it.

    >>> frozen = {"cause": "frozen", "onset": 3, "end": 9}
    >>> open_faults([Event(9, 0, "measurement_error", "tau", "frozen", frozen)])
    {'tau': 'tau has been in error since row 3: frozen.'}
    >>> open_faults([Event(12, 0, "measurement_error", "tau", "frozen", frozen)])
    {}
    """
    found = dict[str, str]()
    told_of = [(e.signal, _compared(e)) for e in events if e.kind in KINDS]
    for signal, compared in sorted(dict.fromkeys(told_of), key=lambda one: not one[1]):
        own = [
            e for e in events
            if e.signal == signal and e.kind in KINDS and _compared(e) == compared
        ]  # fmt: skip
        event, told = own[-1], own[-1].evidence
        if event.kind != "measurement_error" or signal in found:
            continue
        if lasts(told, event.row):
            known = " Its first rows are in the figures." if "known" in told else ""
            since = f"since row {_first(own)}"
            found[signal] = f"{signal} has been in error {since}: {event.reason}.{known}"
    return found


def lasts(told: Mapping[str, Any], row: int) -> bool:
    """Is the error of a measurement going on, as far as its event knows? One that lasts is told of
    at its newest row, one that is over at a later one.

    >>> lasts({"cause": "frozen", "end": 9}, 9), lasts({"cause": "frozen", "end": 9}, 12)
    (True, False)
    """
    return bool(told.get("open", told.get("end") == row)) and told.get("cause") != "vote"


def _compared(event: Event) -> bool:
    """Is it of what two signals say of each other? What one says by itself does not end that."""
    return event.evidence.get("cause") == "kinematics"


def _first(own: Sequence[Event]) -> Any:
    """First row of the newest fault: what was over for a moment only has gone on."""
    found: Any = own[-1].evidence
    first = found.get("first", found.get("onset"))
    for back, before in zip(reversed(own[:-1]), reversed(own[:-2]), strict=False):
        error: Any = before.evidence
        pair = back.kind == "measurement_restored" and before.kind == "measurement_error"
        if not pair:
            continue
        began = error.get("first", error.get("onset"))
        gap, whole = first - back.row, own[-1].row - began
        if error.get("cause") != found.get("cause") or gap > SHORT * whole:
            break
        first = began
    return first
