"""Whose log a store holds."""

from __future__ import annotations

from evertwin.errors import StoreError
from evertwin.fold import Event


def check_owner(event: Event, name: str) -> None:
    """Refuses the log of another twin: its history would be taken for this one's.

    >>> check_owner(Event(0, 0, "configured", "", "", {"twin": "arm"}), "arm")

    Raises:
        StoreError: the event says that it is one.
    """
    other = event.evidence.get("twin", name) if event.kind == "configured" else name
    if other != name:
        raise StoreError(
            f"the store is that of the twin {other!r}, and this is {name!r}: give it a "
            "[store] path of its own (a twin keeps its store only under its name)"
        )
