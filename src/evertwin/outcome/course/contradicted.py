"""Where measurements and the model contradicted each other, and what became of it: sensors that
were in error for a while, steps that were believed, and how often single samples were."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from evertwin.fold import Event

FEW = 3
"""Signals that are named one by one."""
SELDOM = 0.003
"""Share of the rows below which single contradictions are a rough model's."""


class Over(NamedTuple):
    """A fault of a sensor that is over.

    >>> Over(3, 9, "frozen").last
    9
    """

    first: int
    last: int
    reason: str


def contradicted(events: Sequence[Event], told: Mapping[str, str], rows: int) -> list[str]:
    """Sentences about it.

    Args:
        events: of a run.
        told: signals of which all was said.
        rows: so many there were.

    >>> known = {"cause": "frozen", "onset": 3, "end": 9}
    >>> error = Event(5, 0, "measurement_error", "tau", "frozen", known)
    >>> restored = Event(10, 0, "measurement_restored", "tau", "no longer frozen", known)
    >>> contradicted([error, restored], {}, 99)
    ['tau was in error from row 3 to 9: frozen; nothing was learned from it.']
    """
    over = {signal: some for signal, some in _over(events).items() if signal not in told}
    said = [_sentence(signal, some) for signal, some in over.items()]
    doubts = _doubts(events, {*told, *over}, rows)
    if doubts:
        most = [f"{signal} ({count}×)" for signal, count in doubts.most_common(FEW)]
        rest = [f"{len(doubts) - FEW} more"] if len(doubts) > FEW else []
        said.append(
            f"Measurement and model contradicted each other at {', '.join(most + rest)}: the "
            "events say which was believed."
        )
    return said


def _over(events: Sequence[Event]) -> dict[str, list[Over]]:
    """Faults that were told of and are over, by signal."""
    begun, found = dict[tuple[str, object], Event](), dict[str, list[Over]]()
    for event in events:
        known, key = event.evidence, (event.signal, event.evidence.get("cause"))
        if event.kind == "measurement_error" and key[1] != "vote":
            begun[key] = event
        elif event.kind == "measurement_restored" and key in begun:
            error, first, last = begun.pop(key), known.get("onset"), known.get("end")
            if isinstance(first, int) and isinstance(last, int):
                one = Over(first, last, error.reason)
                found.setdefault(event.signal, []).append(one)
    return found


def _sentence(signal: str, some: Sequence[Over]) -> str:
    first, last, reason = max(some, key=lambda one: one.last - one.first)
    times = f" {len(some)} times, longest" if len(some) > 1 else ""
    return (
        f"{signal} was in error{times} from row {first} to {last}: {reason}; nothing was learned "
        "from it."
    )


def _doubts(events: Sequence[Event], told: set[str], rows: int) -> Counter[str]:
    """How often a signal and the model contradicted each other: single samples that no other agreed
    with, and values that were believed, only where they are more than a rough model's."""
    alike = Counter[str](), Counter[str]()
    for event in events:
        if event.kind in ("measurement_error", "overruled") and event.signal not in told:
            rough = event.kind == "overruled" or event.evidence.get("cause") == "vote"
            alike[rough][event.signal] += 1
    seldom = {signal for signal, count in alike[True].items() if count < SELDOM * rows}
    return alike[False] + Counter({s: n for s, n in alike[True].items() if s not in seldom})
