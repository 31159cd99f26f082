"""Headings that say what a history counts by, as people write them.

>>> clock_of("cycle_number"), clock_of("CycleIndex"), clock_of("operating hours")
('cycle', 'cycle', 'h')
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from evertwin.sources.small_table import Table

COUNTS = ("index", "row", "n", "number")
"""Columns that count rows."""
_WORDS = {
    "run": {"run", "runs"},
    "cycle": {"cycle", "cycles", "cyc", "zyklus", "zyklen", "ciclo", "ciclos", "cicli"},
    "h": {"h", "hour", "hours", "hr", "hrs", "stunden", "betriebsstunden", "heures", "horas"},
    "d": {"d", "day", "days", "tag", "tage", "jours", "dias", "giorni"},
}
_BESIDE = {"number", "no", "nr", "num", "index", "idx", "id", "count", "counter", "total",
           "operating", "operation", "elapsed"}  # fmt: skip
"""Words that such a heading has beside what it counts."""


_DATED = {"date", "datetime", "datum", "fecha", "dato", "pvm"}


def dated(heading: str) -> bool:
    """Does a heading say that its column holds dates?

    >>> dated("Datum"), dated("updates")
    (True, False)
    """
    return not _DATED.isdisjoint(_words(heading))


def clock_of(heading: str) -> str:
    """What a heading counts: run, cycle, h or d; empty where it says none of them."""
    rest = [word for word in _words(heading) if word not in _BESIDE]
    return next((clock for clock, own in _WORDS.items() if len(rest) == 1 and rest[0] in own), "")


def counting(clocks: Iterable[str], table: Table) -> str | None:
    """The first column that counts one of the clocks."""
    fits = {"run": "1", "cycle": "1", "h": "s", "d": "s"}
    return next(
        (n for clock in clocks for n in table.names
         if clock_of(n) == clock and table.units.get(n, fits[clock]) == fits[clock]), None,
    )  # fmt: skip


def numbering(table: Table) -> str | None:
    """A column that numbers rows some of which are not there, in a table without dates."""
    for name in table.names:
        steps = np.diff(table.column(name)) if name.lower() in COUNTS else np.zeros(0)
        if not table.dates and np.all(steps > 0.0) and np.any(steps != 1.0):
            return name
    return None


def _words(heading: str) -> list[str]:
    return re.findall(r"[a-z]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", heading).lower())
