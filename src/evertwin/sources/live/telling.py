"""What a live source counts and says: one line in the log when it goes down, one when it is up.

>>> told = Telling("controller")
>>> told.up(); told.reject("a wrong count"); told.lose("gap in the sequence", 3)
>>> told.health.state, told.health.rejected, told.health.losses
('up', {'a wrong count': 1}, 3)
"""

from __future__ import annotations

import logging
import time
from collections import Counter

from evertwin.sources.live.contract import Health, State

LOG = logging.getLogger("evertwin.live")
KINDS = 64
"""Reasons of one count that are kept apart; a hostile peer cannot make more."""


class Telling:
    """The counts of one source. See the module for an example."""

    def __init__(self, name: str, twin: str = "") -> None:
        self.name, self.twin = name, twin
        self.state: State = "connecting"
        self.since = time.time()
        self.newest: int | None = None
        self.received = 0
        self.repeated = self.refused = 0
        self.reason = ""
        self.hint = ""
        """What in the map looks wrong, and what would be right."""
        self._line = ""
        """Why the line was down last."""
        self._rejected: Counter[str] = Counter()
        self._lost: Counter[str] = Counter()
        self._noted: Counter[str] = Counter()
        self._ups = 0

    @property
    def health(self) -> Health:
        """As it is now."""
        return Health(
            self.state, self.since, self.newest, self.received, dict(self._rejected),
            self.repeated, dict(self._lost), dict(self._noted), max(self._ups - 1, 0), self.reason,
            self.state == "up" and self.reason == self._line, self.hint,
        )  # fmt: skip

    def give(self, stamp: int, count: int = 1) -> None:
        """Samples go out."""
        self.received += count
        self.newest = stamp if self.newest is None else max(self.newest, stamp)

    def reject(self, reason: str, count: int = 1) -> None:
        """Samples are kept out."""
        _add(self._rejected, reason, count)
        self.reason = reason
        self.refused += count

    def lose(self, cause: str, count: int = 1) -> None:
        """Samples never came."""
        _add(self._lost, cause, count)
        if self.state == "up":
            self.reason = f"{count} lost: {cause}"

    def found(self, cause: str, count: int = 1) -> None:
        """What was counted as lost came late, or never was."""
        self._lost -= Counter({cause: count})

    def note(self, what: str, count: int = 1) -> None:
        """Something remarkable in samples that are used."""
        _add(self._noted, what, count)

    def up(self) -> None:
        """The machine answers."""
        if self.state == "up":
            return
        self._ups += 1
        self._say(logging.INFO, f"up after {self._down():.1f} s" if self._ups > 1 else "up")
        self._turn("up")

    def down(self, reason: str) -> None:
        """It does not, for this reason; said once until it is up again."""
        self.reason = self._line = reason
        if self.state != "down":
            self._say(logging.WARNING, f"down: {reason}")
            self._turn("down")

    def end(self) -> None:
        """There will be no more."""
        if self.state != "ended":
            self._turn("ended")

    def _say(self, level: int, what: str) -> None:
        of = f"{self.twin}: " if self.twin else ""
        LOG.log(level, "%s%s: %s", of, self.name, what, extra={"twin": self.twin})

    def _down(self) -> float:
        return time.time() - self.since

    def _turn(self, state: State) -> None:
        self.state, self.since = state, time.time()


def _add(counts: Counter[str], what: str, count: int) -> None:
    counts[what if what in counts or len(counts) < KINDS else "others"] += count
