"""What a beat has decided so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evertwin.fold import Event, Request
from evertwin.setup.twin_state import TwinState


@dataclass
class Decision:
    """A state on its way through a beat, with what is said on the way.

    >>> Decision.__name__
    'Decision'
    """

    state: TwinState
    events: list[Event]
    requests: list[Request]

    def say(self, kind: str, signal: str, reason: str, evidence: Mapping[str, Any]) -> None:
        """Adds an event."""
        self.events.append(
            Event(self.state.row, self.state.time, kind, signal, reason, dict(evidence))
        )

    def remember(self, **changes: Any) -> None:
        """Changes what is remembered between beats."""
        self.state = self.state._replace(agenda=self.state.agenda._replace(**changes))
