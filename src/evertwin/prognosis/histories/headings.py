"""Headings that say what a history counts by, as people write them.

>>> clock_of("cycle_number"), clock_of("time_cycles"), clock_of("runtime_h"), clock_of("h_room")
('cycle', 'cycle', 'h', '')
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from evertwin.sources.columns.names import split_unit
from evertwin.sources.texts.small_table import Table

COUNTS = ("index", "row", "n", "number")
"""Columns that count rows."""
_WORDS = {
    "run": {"run", "runs"},
    "cycle": {"cycle", "cycles", "cyc", "zyklus", "zyklen", "ciclo", "ciclos", "cicli"},
    "h": {"h", "hour", "hours", "hr", "hrs", "stunden", "betriebsstunden", "heures", "horas"},
    "d": {"d", "day", "days", "tag", "tage", "jours", "dias", "giorni"},
}
_BESIDE = {"number", "no", "nr", "num", "index", "idx", "id", "count", "counter", "total",
           "operating", "operation", "elapsed", "time", "runtime", "t", "age", "usage", "used",
           "service", "engine"}  # fmt: skip
"""Words that such a heading has beside what it counts."""


_SPANS = {
    60.0: {"min", "mins", "minute", "minutes", "minuten", "minuti", "minutos"},
    604_800.0: {"week", "weeks", "wk", "woche", "wochen", "semaine", "semaines", "semanas"},
}
"""Seconds of one → the words that count it."""
_WAYS = {"km", "kilometer", "kilometers", "kilometres", "miles", "mileage", "odometer",
         "laufleistung", "strokes", "stroke", "parts", "part", "pieces", "piece", "shots", "shot",
         "flights", "flight", "landings", "landing", "starts", "passes", "pass"}  # fmt: skip
"""What else a life is counted in."""
_LABELS = {"unit", "id", "case", "machine", "engine", "serial", "asset", "device", "sn", "no", "nr"}

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


def plainly(heading: str) -> str:
    """In small letters, but for a letter alone: T is no t."""
    return heading.lower() if len(heading) > 1 else heading


def found_in(words: Iterable[str], there: Iterable[str]) -> str | None:
    """The first of ``words`` that is there; with capitals too, but T is no t."""
    columns = tuple(there)
    return next((n for word in words for n in columns if word in (n, plainly(n))), None)


def is_timely(table: Table, name: str) -> bool:
    """May a column be a time, by its unit? ``t [degC]`` is none."""
    return table.units.get(name, "s") == "s"


def seconds_of(heading: str) -> float:
    """How many seconds one of what a heading counts has, where it is no unit of a clock; else 1.

    >>> seconds_of("minutes"), seconds_of("week"), seconds_of("speed")
    (60.0, 604800.0, 1.0)
    """
    rest = [word for word in _words(heading) if word not in _BESIDE]
    return next((s for s, own in _SPANS.items() if len(rest) == 1 and rest[0] in own), 1.0)


def spanning(table: Table) -> str | None:
    """The first column that counts minutes or weeks."""
    named = (n for n in table.names if n not in table.units)
    return next((n for n in named if seconds_of(n) != 1.0), None)


def mileage_of(table: Table) -> str | None:
    """A column that counts a way, or strokes, and never falls."""
    for name in table.names:
        rest = [word for word in _words(name) if word not in _BESIDE]
        at = table.column(name) if rest and _WAYS.issuperset(rest) else np.zeros(0)
        if len(at) > 1 and np.isfinite(at).all() and (np.diff(at) >= 0.0).all() and at[-1] > at[0]:
            return name
    return None


def rising(table: Table, column: str = "") -> str | None:
    """The first column beside the values that rises with every row, in a table without dates.

    >>> rising(Table("a.csv", {"cut": np.array([5.0, 10.0]), "wear": np.array([1.0, 2.0])}), "wear")
    'cut'
    """
    for name in () if table.dates else table.names:
        steps = np.diff(table.column(name))
        if name != column and name.lower() not in COUNTS and len(steps) and (steps > 0.0).all():
            return name
    return None


def is_label(table: Table, name: str) -> bool:
    """Does a column tell which machine, or nothing: one number all through?"""
    value = table.column(name)
    value = value[np.isfinite(value)]
    if len(value) < 2 or np.ptp(value) == 0.0:
        return len(value) > 1
    few = 2 * len(np.unique(value)) <= len(value) and bool(np.all(value == np.floor(value)))
    return few and not _LABELS.isdisjoint(_words(name))


def named(table: Table, said: str) -> str:
    """A column by its heading, with its unit or without; as it is said where none is called so."""
    there = (*table.names, *table.text)
    if said in there:
        return said
    own = [n for n in there if said in (f"{n} [{table.written.get(n, '')}]", split_unit(n)[0])]
    own = own or [n for n in there if split_unit(said)[0] == n]
    return own[0] if len(own) == 1 else said


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
