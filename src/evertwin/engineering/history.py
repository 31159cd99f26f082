"""Proneness to failure from a maintenance history: how often, and how long the machine stood.

A history is a CSV with one line for each failure:

    date,component,downtime [h]
    2024-03-05,gearbox 3,6.5

The grade counts in factors of four, so that it says the same as the words of `evertwin.engineering.
parts`: a failure every four years is 3, every year 4, four times a year 5. Standing still counts
alike, with a shift of eight hours a year for 4. The larger of both is taken.

>>> history = History({"seal": (2, 8.0 * 3600.0)}, 4 * YEAR)
>>> history.grade("seal"), history.grade("pump")
(3.5, 1.0)
>>> history.reason("seal")
'2 failures in 4 years, 8 h of downtime'
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.small_table import read_table
from evertwin.types import Vector

YEAR = 365.25 * 86400.0
"""[s]"""
SHIFT = 8.0 * 3600.0
"""Downtime a year that counts as one failure a year [s]."""
FACTOR = 4.0


@dataclass(frozen=True)
class History:
    """Failures of a machine's components. See the module for an example."""

    found: Mapping[str, tuple[int, float]]
    """Component → failures and downtime [s]."""
    span: float
    """Time that it covers [s]."""

    def grade(self, component: str) -> float:
        """Proneness to failure, 1 to 5."""
        failures, downtime = self.found.get(component, (0, 0.0))
        if not failures:
            return 1.0
        yearly = max(failures, downtime / SHIFT) * YEAR / self.span
        return min(max(4.0 + math.log(yearly, FACTOR), 1.0), 5.0)

    def reason(self, component: str) -> str:
        """What the grade rests on."""
        failures, downtime = self.found.get(component, (0, 0.0))
        years = f"{self.span / YEAR:.3g} years"
        if not failures:
            return f"no failure in {years}"
        times = "1 failure" if failures == 1 else f"{failures} failures"
        return f"{times} in {years}, {downtime / 3600.0:.3g} h of downtime"


def read_history(path: Path, span: float | None = None) -> History:
    """The history in a CSV file.

    Args:
        span: time that it covers [s]; None: from the first entry to the last.

    Raises:
        DataError: it cannot be read, a column is missing, or a line is not as it should be.
    """
    table = read_table(path)
    there = (*table.names, *table.text)
    for name in ("component", "downtime", *(("date",) if span is None else ())):
        if name not in there:
            raise DataError(
                f"{path}:1: expected the columns date, component, downtime [h], got "
                f"{', '.join(there)}"
            )
    downtime = table.column("downtime") * (1.0 if "downtime" in table.units else 3600.0)
    found: dict[str, tuple[int, float]] = {}
    for line, name, seconds in zip(table.lines, table.text.get("component", ()), downtime.tolist()):
        if not seconds >= 0.0:
            raise DataError(
                f"{path}:{line}: downtime: expected 0 or more, got {seconds / 3600:g} h"
            )
        count, so_far = found.get(name, (0, 0.0))
        found[name] = count + 1, so_far + seconds
    return History(found, _span(path, table.column("date")) if span is None else span)


def _span(path: Path, days: Vector) -> float:
    covered = float(np.nanmax(days) - np.nanmin(days))
    if not covered >= 30 * 86400.0:
        raise DataError(
            f"{path}: covers {covered / 86400.0:.0f} days: say how long it covers, "
            "history_span = '5 year'"
        )
    return covered
