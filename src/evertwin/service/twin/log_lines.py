"""What a twin says of itself, as lines of the service's log.

A line names the signal that it is about, and what is said over and over in the same words (a value
that drops out now and then) is said once and then counted: the log is read by people.

>>> said = Sayings("oven")
>>> drops = {"kind": "unknown", "signal": "room", "reason": "room has no value here"}
>>> for now in (0.0, 5.0, 9.0, 700.0):
...     said.line(drops, now)
'unknown: room has no value here'
'unknown: room has no value here (3 times since the line before)'
>>> said.line({"kind": "not_identifiable", "signal": "mass", "reason": "± 80 % of its size"}, 1.0)
'not_identifiable: mass: ± 80 % of its size'
"""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Mapping
from typing import Any

LOG = logging.getLogger("evertwin.service")
QUIET = 600.0
"""Seconds in which the same is not said again."""
MOST = 200
"""Different things of which it is known when they were said."""


class Sayings:
    """Of one twin. See the module for an example."""

    def __init__(self, twin: str) -> None:
        self.twin = twin
        self._said: dict[tuple[str, str, str], tuple[float, int]] = {}

    def log(self, event: Mapping[str, Any]) -> None:
        """Writes the line, if there is one."""
        if line := self.line(event, time.monotonic()):
            about = {"twin": self.twin, "event": event["kind"], "row": event["row"]}
            LOG.info("%s: %s", self.twin, line, extra=about)

    def line(self, event: Mapping[str, Any], now: float) -> str | None:
        """The line; None: it stands there already.

        Args:
            event: as it was told.
            now: of a clock in seconds.
        """
        kind, signal, reason = (str(event[key]) for key in ("kind", "signal", "reason"))
        when, times = self._said.pop((kind, signal, reason), (-QUIET, 0))
        if now < when + QUIET:
            self._said[kind, signal, reason] = when, times + 1
            return None
        self._said[kind, signal, reason] = now, 0
        if len(self._said) > MOST:
            del self._said[next(iter(self._said))]
        named = not signal or re.search(rf"(?<!\w){re.escape(signal)}(?!\w)", reason)
        again = f" ({times + 1} times since the line before)" if times else ""
        return f"{kind}: {'' if named else f'{signal}: '}{reason}{again}"
