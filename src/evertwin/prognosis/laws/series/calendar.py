"""Dates of a clock that counts from 1970: nobody reads 494,000 hours.

>>> days = Calendar("d", zoned=False)
>>> days.said(20_545.25), days.iso(20_545.25), days.iso(float("inf"))
('2026-04-02', '2026-04-02T06:00:00', None)
"""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

UNITS = {"s": 1.0, "h": 3600.0, "d": 86400.0}
"""Clocks of time, in seconds."""
SAID = {"s": "%Y-%m-%d %H:%M:%S", "h": "%Y-%m-%d %H:%M", "d": "%Y-%m-%d"}
FIRST, LAST = 946_684_800.0, 7_258_118_400.0
"""Seconds since 1970 that are taken for a date: the years 2000 to 2200."""
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Calendar(NamedTuple):
    """What a moment on the clock is called. See the module for an example."""

    clock: str
    """Its unit: s, h or d."""
    zoned: bool
    """Moments are told in the zone of this computer; else as they were written, without a zone."""

    def moment(self, at: float) -> datetime | None:
        """The date, with its zone where that is known; None: never, or beyond the year 9999."""
        if not math.isfinite(at):
            return None
        try:
            found = _EPOCH + timedelta(seconds=round(at * UNITS[self.clock], 3))
            return found.astimezone() if self.zoned else found.replace(tzinfo=None)
        except (OverflowError, ValueError):
            return None

    def iso(self, at: float) -> str | None:
        """The date for a document, to the second."""
        found = self.moment(at)
        return None if found is None else found.isoformat(timespec="seconds")

    def said(self, at: float, *, zone: bool = True) -> str:
        """The date for a person, as fine as the clock, with its zone unless that stands nearby."""
        found = self.moment(at)
        if found is None:
            return "without end"
        named = f" {found.tzname()}" if zone and self.zoned and self.clock != "d" else ""
        return found.strftime(SAID[self.clock]) + named

    def at(self, date: str) -> float:
        """The moment on the clock that a date says, in the zone of this computer if it names none.

        >>> Calendar("d", zoned=False).at("1970-01-02T12:00")
        1.5

        Raises:
            ValueError: it is no date as in 2027-03-01.
        """
        found = datetime.fromisoformat(date)
        if self.zoned:
            seconds = found.timestamp()
        else:
            seconds = (found.replace(tzinfo=None) - _EPOCH.replace(tzinfo=None)).total_seconds()
        return seconds / UNITS[self.clock]

    def gone(self, at: float) -> bool:
        """Does a moment lie before today, by this computer? On a clock of days today itself is not.

        >>> Calendar("d", zoned=False).gone(0.0)
        True
        """
        today = self.today()
        return at < (math.floor(today) if self.clock == "d" else today)

    def today(self) -> float:
        """Now on the clock: by this computer."""
        now = time.time()
        if not self.zoned:
            now = datetime.fromtimestamp(now).replace(tzinfo=UTC).timestamp()
        return now / UNITS[self.clock]
