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

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from evertwin.errors import DataError, UsageError
from evertwin.settings.quantity import number

YEAR = 365.25 * 86400.0
"""[s]"""
SHIFT = 8.0 * 3600.0
"""Downtime a year that counts as one failure a year [s]."""
FACTOR = 4.0
_COLUMN = re.compile(r"\s*(\w+)\s*(?:\[\s*(.*?)\s*\])?\s*$")


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
    try:
        lines = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: expected UTF-8 text, byte {error.start} is not") from error
    head = [_COLUMN.match(cell) for cell in lines[0]] if lines else []
    at = {found[1]: (j, found[2] or "") for j, found in enumerate(head) if found}
    for name in ("component", "downtime", *(("date",) if span is None else ())):
        if name not in at:
            raise DataError(
                f"{path}:1: expected the columns date, component, downtime [h], got "
                f"{', '.join(lines[0]) if lines else 'nothing'}"
            )
    days: list[date] = []
    found: dict[str, tuple[int, float]] = {}
    for row, cells in enumerate(lines[1:], start=2):
        if not cells:
            continue
        try:
            name, downtime, day = _entry(cells, at)
        except (IndexError, ValueError, UsageError) as error:
            raise DataError(
                f"{path}:{row}: expected a date such as 2024-03-05, a component and a downtime, "
                f"got {','.join(cells)!r}"
            ) from error
        count, so_far = found.get(name, (0, 0.0))
        found[name] = count + 1, so_far + downtime
        days += [] if day is None else [day]
    return History(found, _span(path, days) if span is None else span)


def _entry(cells: list[str], at: Mapping[str, tuple[int, str]]) -> tuple[str, float, date | None]:
    column, unit = at["downtime"]
    downtime = number(f"{float(cells[column])} {unit or 'h'}", "s")
    if not downtime >= 0.0:
        raise ValueError("downtime")
    day = date.fromisoformat(cells[at["date"][0]].strip()) if "date" in at else None
    return cells[at["component"][0]].strip(), downtime, day


def _span(path: Path, days: list[date]) -> float:
    covered = (max(days) - min(days)).days if days else 0
    if covered < 30:
        raise DataError(
            f"{path}: covers {covered} days: say how long it covers, history_span = '5 year'"
        )
    return covered * 86400.0
