"""Columns of a table that may hold values of wear: neither a clock, nor a date, nor a label.

>>> value_columns(Table("a.csv", {"run": np.arange(3.0), "wear": np.array([1.0, 1.2, 1.1])}))
('wear',)
"""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.histories.contradictions import is_serial
from evertwin.prognosis.histories.headings import (
    COUNTS,
    clock_of,
    is_label,
    is_timely,
    mileage_of,
    plainly,
    spanning,
)
from evertwin.prognosis.histories.history_file import TIMES
from evertwin.sources.texts.small_table import Table
from evertwin.types import Vector

CLOCKS = ("run", "cycle", "s", "h", "d")
"""What a life is counted in, by its heading."""


def value_columns(table: Table) -> tuple[str, ...]:
    """Columns that may be values."""
    clocks = {*CLOCKS, *TIMES, "maintenance"}
    there = [
        n for n in table.names
        if not (plainly(n) in clocks and is_timely(table, n)) and n.lower() not in COUNTS
        and not clock_of(n)
        and not n.endswith("sigma") and n not in table.dates and not is_serial(table, n)
        and n not in (spanning(table), mileage_of(table))
    ]  # fmt: skip
    told = [n for n in there if np.isfinite(table.column(n)).any()]
    told = [n for n in told if not is_label(table, n)] or told
    return tuple(n for n in told if not _counts(table.column(n))) or tuple(told or there)


def _counts(value: Vector) -> bool:
    """Whether a column only counts its rows."""
    return len(value) > 1 and bool(np.all(np.diff(value) == 1.0))
