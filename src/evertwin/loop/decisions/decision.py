"""What a beat has decided so far."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evertwin.fold import Event, Request
from evertwin.setup.twin_state import TwinState

FIGURE = re.compile(r"[-+]?\d[\d.e+-]*")
UNDETERMINED = "not_identifiable"
"""Kind of the event of a number that the rows do not determine."""


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

    def fresh(self, content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
        """The events of an answer, less those that were said before and are as they were: that the
        rows do not determine a number is said again only after other rows did."""
        told = set(filter(None, self.state.agenda.undetermined.split("\n")))
        fitted = (content.get("fit") or {}).get("parameters", {})
        known = told - {name for name, one in fitted.items() if one["verdict"] != "not"}
        lacks = [one for one in content.get("events", ()) if one["kind"] == UNDETERMINED]
        self.remember(undetermined="\n".join(sorted(known | {one["signal"] for one in lacks})))
        return [
            one for one in content.get("events", ())
            if (one["kind"] != UNDETERMINED or one["signal"] not in told)
            and (one["kind"] != "abnormal" or self._is_new(one))
        ]  # fmt: skip

    def _is_new(self, one: Mapping[str, Any]) -> bool:
        """Is it another thing, but for its figures, than what was said last of this version?"""
        said = f"{self.state.live.version} {one['signal']} {FIGURE.sub('', one['reason'])}"
        known = self.state.agenda.abnormal
        self.remember(abnormal=said)
        return said != known

    def remember(self, **changes: Any) -> None:
        """Changes what is remembered between beats."""
        self.state = self.state._replace(agenda=self.state.agenda._replace(**changes))
