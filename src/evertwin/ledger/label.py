"""What a person says to an event of the log, and what of it acts on the twin.

``acknowledged``, ``shelved`` and ``true`` are kept and shown. The others are inputs of the fold
(`evertwin.loop.decisions.heeding`): a ``false alarm`` counts in the rate that its detector is held
to, and is no evidence again; a named ``cause`` is tried first at the next tuning; ``faulty`` rows
leave the window of every fit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from evertwin.errors import UsageError
from evertwin.fold import Event

Verdict: TypeAlias = Literal["acknowledged", "shelved", "false alarm", "true", "cause", "faulty"]
ACTS = ("false alarm", "cause", "faulty")
"""What the fold heeds."""
BEGINS, ENDS = ("first", "onset", "row"), ("last", "end")
"""Where the evidence of an event has the rows that it is about."""


@dataclass(frozen=True)
class Label:
    """What is said. ``rows``: first and last one, in the numbers of the event's run.

    Raises:
        UsageError: no reason, a cause without a name, a name without a cause, rows that end before
            they begin.

    >>> Label(7, "cause", "a new bearing", cause="friction").cause
    'friction'
    >>> Label(7, "faulty", "sensor unplugged", rows=(40, 90)).rows
    (40, 90)
    """

    event: int
    """Number of the event in the log."""
    verdict: Verdict
    reason: str
    person: str = ""
    cause: str = ""
    """Which of ``[tuning] causes`` it is."""
    rows: tuple[int, int] | None = None
    """None: those that the event is about."""

    def __post_init__(self) -> None:
        if not self.reason.strip():
            raise UsageError("label: expected a reason: it is kept with what is said")
        if bool(self.cause) != (self.verdict == "cause"):
            raise UsageError("label: the verdict cause, and it alone, names a cause")
        if self.rows is not None and (self.verdict != "faulty" or self.rows[0] > self.rows[1]):
            raise UsageError("label: rows: expected the first and the last one, of faulty rows")

    def evidence(self, about: Event, rows_since: int) -> Mapping[str, Any]:
        """What the log keeps beside the sentence.

        Args:
            about: the event.
            rows_since: rows from the beginning of its run to that of the run that heeds it.

        Raises:
            UsageError: the rows are not told, and the event is about none.
        """
        told: dict[str, Any] = {"event": self.event, "kind": about.kind, "verdict": self.verdict}
        if self.person:
            told["person"] = self.person
        if self.verdict == "cause":
            return told | {"cause": self.cause}
        if self.verdict not in ACTS:
            return told
        rows = self.rows or rows_of(about)
        if self.verdict == "faulty" and rows is None:
            raise UsageError(f"label: event {self.event} is about no rows: name the first and last")
        if rows is not None:
            told["rows"] = (rows[0] - rows_since, rows[1] - rows_since)
        if "detector" in about.evidence:
            told["alarm"] = about.evidence
        return told | {"signal": about.signal}


def rows_of(event: Event) -> tuple[int, int] | None:
    """The first and the last row that an event is about; None: it says none.

    >>> rows_of(Event(90, 0, "suspected", "x", "off by 9 %", {"first": 40}))
    (40, 89)
    >>> rows_of(Event(90, 0, "measurement_error", "x", "frozen", {"onset": 40, "end": 60}))
    (40, 60)
    """
    if event.kind == "alarm":  # of a life
        return None
    begins: Any = next((event.evidence[key] for key in BEGINS if key in event.evidence), None)
    ends: Any = next((event.evidence[key] for key in ENDS if key in event.evidence), event.row - 1)
    return None if begins is None or ends is None or ends < begins else (begins, ends)


def acts(event: Event) -> bool:
    """Is it a label that a run heeds?

    >>> acts(Event(90, 0, "labelled", "", "x: true: seen", {"verdict": "true"}))
    False
    """
    return event.kind == "labelled" and event.evidence["verdict"] in ACTS
