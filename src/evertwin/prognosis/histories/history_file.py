"""A history file as the series of an indicator: what people write by hand or export elsewhere.

What can be read in one way only is read, with a note where that may surprise: rows that are out of
order, a row that stands there twice, rows without a count. What can be read in two ways is refused
with its row: two values for one moment, a standard deviation that is none, a unit of another kind.

>>> from evertwin.sources.texts.small_table import parse
>>> table = parse(["run,wear,maintenance", "2,1.2,", "1,1.1,", "3,0.1,pump: replaced"], "h.csv")
>>> known = of_table(IndicatorSpec("wear", component="pump", limit=3.0), table, "run")
>>> known.value.tolist(), known.maintenance[0].at, known.notes
([1.1, 1.2, 0.1], 3.0, ('h.csv: rows were sorted by run: row 3 is earlier than row 2',))

A cell of maintenance says whom it was done to and what it was: ``gearbox: replaced``; several are
parted by ``;``. Without a name it holds for the component that it mentions, and for all if it
mentions none. Only what begins a new life (replaced, new) or shifts the level (adjusted) may stand
there, so that no word is taken for what it is not.

>>> from evertwin.sources.texts.small_table import parse
>>> table = parse(["run,maintenance", "1,", "2,pump: seal replaced"], "h.csv")
>>> maintenance_of(table, "pump", table.column("run"), {"pump", "motor"})[0]
(Maintenance(at=2.0, kind='replaced', note='seal replaced'),)
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Sequence
from typing import Literal, NamedTuple

import numpy as np

from evertwin.config.prognosis import IndicatorSpec
from evertwin.errors import DataError, UsageError
from evertwin.fold import Event
from evertwin.prognosis.histories import headings
from evertwin.prognosis.histories.contradictions import (
    check_times,
    check_values,
    doubled,
    is_serial,
    refuse_number,
)
from evertwin.prognosis.histories.observed_series import Observed, component_of, marks_of, warm_of
from evertwin.prognosis.laws import Maintenance
from evertwin.prognosis.laws.series.calendar import FIRST, LAST, UNITS, Calendar
from evertwin.signals.channels import position
from evertwin.signals.units import compatible, conversion, from_si
from evertwin.sources.texts.small_table import ABSENT, Table
from evertwin.types import Vector

Kind = Literal["replaced", "adjusted", "failed"]
WORDS: dict[str, Kind] = {
    "replaced": "replaced", "new": "replaced", "adjusted": "adjusted", "failed": "failed"
}  # fmt: skip
NEGATIONS = {"not", "no", "never"}
_WORD = re.compile(r"[^\W\d_]+")


class Said(NamedTuple):
    """One thing that a cell says.

    >>> Said(2, 1.0, "pump", "replaced").whom
    'pump'
    """

    line: int
    at: float
    whom: str
    """Empty: it does not say."""
    text: str


def maintenance_of(
    table: Table, component: str, at: Vector, components: Collection[str], *, alone: bool = False
) -> tuple[tuple[Maintenance, ...], tuple[str, ...]]:
    """Marks of a component; of a series ``alone`` under any name that no column has; and notes.

    Raises:
        DataError: a word that means neither, or a name that is nearly a known one.
    """
    marks, notes = [], []
    for said in _said(table, at):
        where = f"{table.name}:{said.line}: maintenance"
        named = [said.whom] if said.whom else _mentioned(said.text, components)
        others = [name for name in named if name not in components]
        notes += [_of_another(name, components, where) for name in ([] if alone else others)]
        if (alone or not others) and (len(others) == len(named) or component in named):
            marks.append(Maintenance(said.at, _kind(said.text, where), said.text))
    return tuple(marks), tuple(notes)


def _said(table: Table, at: Vector) -> list[Said]:
    if "maintenance" in table.numbers and np.isfinite(table.numbers["maintenance"]).any():
        k = int(np.argmax(np.isfinite(table.numbers["maintenance"])))
        raise DataError(
            f"{table.name}:{table.lines[k]}: maintenance: expected what was done, as in 'gearbox: "
            "replaced', got numbers or dates alone"
        )
    found = []
    cells = table.text.get("maintenance", ())
    for line, moment, cell in zip(table.lines, at.tolist(), cells, strict=False):
        for text in cell.split(";"):
            whom, _, said = text.rpartition(":")
            if said.strip().lower() not in ABSENT:
                found.append(Said(line, moment, whom.strip(), said.strip()))
    return found


def _mentioned(text: str, components: Collection[str]) -> list[str]:
    return [name for name in components if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text)]


def _of_another(name: str, components: Collection[str], where: str) -> str:
    """A note that a mark is left out.

    Raises:
        DataError: the name is nearly a known one, by more than its number.
    """
    near = difflib.get_close_matches(name, components, n=1)
    if near and _unnumbered(near[0]) != _unnumbered(name):
        raise DataError(f"{where}: no component {name!r}, did you mean {near[0]!r}?")
    return f"{where} of {name!r} was left out: indicators tell of {', '.join(sorted(components))}"


def _unnumbered(name: str) -> str:
    return re.sub(r"\d+", "", name)


def _kind(text: str, where: str) -> Kind:
    words = _WORD.findall(text.lower())
    kinds = {WORDS[word] for word in words if word in WORDS}
    if len(kinds) == 1 and not NEGATIONS & set(words):
        return kinds.pop()
    near = [m for word in words for m in difflib.get_close_matches(word, WORDS, n=1, cutoff=0.75)]
    meant = f", did you mean {near[0]!r}" if near and not kinds else ""
    raise DataError(
        f"{where}: expected 'replaced' (a new life begins), 'adjusted' (the level shifts, wear "
        f"goes on) or 'failed' (life ended here), got {text!r}{meant}? What "
        "does neither belongs into another column"
    )


TIMES = ("t", "time", "time_s", "date", "datetime", "timestamp")
"""Columns of time, in order."""
DATES = ("date", "datetime")
"""Columns of which a plain number tells nothing."""


class Counted(NamedTuple):
    """When each row was, on the clock of the prognosis.

    >>> Counted(np.array([1.0, 2.0]), "run").notes
    ()
    """

    at: Vector
    by: str
    """The column; empty: rows were counted."""
    notes: tuple[str, ...] = ()
    calendar: Calendar | None = None
    """Where times are counted from 1970."""


def of_table(
    rule: IndicatorSpec, table: Table, clock: str, events: Sequence[Event] = (),
    components: Sequence[str] = (),
) -> Observed:  # fmt: skip
    """The series in a history file.

    Args:
        rule: which indicator.
        table: the file.
        clock: what life is counted in.
        events: maintenance that the store has kept.
        components: all that the twin tells of, for names in the column ``maintenance``.

    Raises:
        DataError: a column is missing, or a row can be read in two ways; with its line.
    """
    name, value, unit = _value(rule, table)
    counted = _counted(table, clock)
    sigma = _sigma(table, name, rule)
    whose = component_of(rule)
    names = {whose, *(components or table.numbers)}
    marks, told = maintenance_of(table, whose, counted.at, names, alone=not components)
    order = np.argsort(counted.at, kind="stable")
    notes = (*counted.notes, *told, *_unsorted(table, counted))
    if counted.by:
        check_times(table, counted.by, counted.at, counted.calendar)
    new = [m.at for m in marks if m.kind == "replaced"]
    check_values(table, name, value, np.searchsorted(np.sort(new), counted.at, side="right"))
    keep, twice = _once(table, name, counted, order, value)
    usage = None if rule.usage is None else _usage(table, rule.usage, keep)
    warm = {} if rule.warm_up is None else warm_of(rule, table.column("since_start")[keep])
    marks += marks_of(whose, events, clock)
    return Observed(
        counted.at[keep], value[keep], sigma[keep],
        {c: table.column(c)[keep] for c in rule.covariates},
        {c: table.column(c)[keep] for c in rule.factors} | warm,
        usage, tuple(sorted(marks, key=lambda m: m.at)), (*notes, *twice), unit, counted.calendar,
        tuple(np.array(table.lines)[keep].tolist()), counted.by,
    )  # fmt: skip


def _value(rule: IndicatorSpec, table: Table) -> tuple[str, Vector, str]:
    """The indicator's column, its values, and their unit as far as the file says it."""
    wanted = [n for n in (rule.column, rule.name, rule.parameter) if n]
    there = (*table.names, *table.text)
    name = next((n for n in wanted if n in there), None)
    if name is None:
        try:
            position(there, wanted[0], "column")
        except UsageError as error:
            raise DataError(
                f"{table.name}: indicator {rule.name}: {error}: name it so in this file; "
                "a twin file names the column with column = …"
            ) from error
    name = str(name)
    value = table.column(name)
    unit = table.units.get(name, "")
    if not unit or not rule.unit:
        return name, value, unit
    if not compatible(unit, rule.unit):
        raise DataError(
            f"{table.name}: {name}: expected a unit like {rule.unit}, got one like {unit}: correct "
            "the heading, or unit in the twin file"
        )
    return name, np.asarray(from_si(value, rule.unit), dtype=np.float64), rule.unit


def _counted(table: Table, clock: str) -> Counted:
    """The column that life is counted by; time in its unit."""
    there = (*table.names, *table.text)
    if clock not in UNITS:
        said = (clock, "run", "cycle")
        by = headings.found_in(said, there) or headings.counting(said, table)
        by = by or headings.numbering(table)
        if by is None:
            return _by_row(table, clock)
        return Counted(np.asarray(from_si(_whole(table, by), table.written.get(by, "1"))), by)
    by = counted_by(table, clock)
    if by is None:
        raise DataError(
            f"{table.name}: expected a column {clock!r}, or one of {', '.join(TIMES)}, to count "
            f"life by; got {', '.join(there)}: add one, or count runs with [prognosis] clock"
        )
    plain = clock in (by, headings.clock_of(by)) and by not in (*table.dates, *table.units)
    at, notes = (_whole(table, by), ()) if plain else in_seconds(table, by)
    stamps = clock == "s" or not plain
    dated = by in table.dates or (stamps and bool(np.all((at > FIRST) & (at < LAST))))
    calendar = Calendar(clock, by not in table.dates or by in table.zoned) if dated else None
    return Counted(at if plain else at / UNITS[clock], by, notes, calendar)


def counted_by(table: Table, clock: str = "s") -> str | None:
    """The column that tells the time: by its name, or as the only one of dates."""
    there = (n for n in (*table.names, *table.text) if headings.is_timely(table, n))
    by = headings.found_in((clock, *TIMES), there)
    by = next(iter(table.dates)) if by is None and len(table.dates) == 1 else by
    return by or headings.counting((clock,), table) or headings.spanning(table)


def in_seconds(table: Table, by: str) -> tuple[Vector, tuple[str, ...]]:
    """A column of times [s]; stamps since 1970 are read in the finer units of computers too.

    Raises:
        DataError: a row has no time.
    """
    at, where = _whole(table, by), f"{table.name}: {by}"
    if by in table.units or by in table.dates:
        return at, ()
    at = at * headings.seconds_of(by)
    for unit, size in (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)):
        if len(at) and np.all((at > FIRST * size) & (at < LAST * size)):
            return at / size, (f"{where} was read as {unit} since 1970",)
    return at, ()


def _by_row(table: Table, clock: str) -> Counted:
    """One row after the other, or date after date."""
    dates = (
        next(iter(table.dates)) if len(table.dates) == 1 else headings.found_in(TIMES, table.dates)
    )
    said = f"{table.name}: no column {clock!r}: its {table.rows} rows were counted"
    if dates is None:
        for name in table.names:
            if is_serial(table, name):
                refuse_number(table, name)
        return Counted(np.arange(1.0, table.rows + 1.0), "", (said,))
    at = _whole(table, dates)
    rank = np.empty(table.rows)
    rank[np.argsort(at, kind="stable")] = np.arange(1.0, table.rows + 1.0)
    said = f"{said} in the order of {dates}; [prognosis] clock = 'd' would count days"
    return Counted(rank, "", (said,))


def _whole(table: Table, name: str) -> Vector:
    """A clock: every row has it."""
    at = table.column(name)
    if (name in DATES and name not in table.dates) or is_serial(table, name):
        refuse_number(table, name)
    if not np.isfinite(at).all():
        line = table.lines[int(np.argmin(np.isfinite(at)))]
        raise DataError(
            f"{table.name}:{line}: {name}: expected when the row was, got an empty cell: fill it "
            "in, or delete the row"
        )
    return at


def _sigma(table: Table, name: str, rule: IndicatorSpec) -> Vector:
    """Standard deviations in the unit of the values; NaN where none is known."""
    there = (*table.names, *table.text)
    column = next((c for c in (f"{name}.sigma", "sigma") if c in there), None)
    if column is None:
        return np.full(table.rows, np.nan)
    sigma = table.column(column)
    if (sigma <= 0.0).any():
        k = int(np.argmax(sigma <= 0.0))
        raise DataError(
            f"{table.name}:{table.lines[k]}: {column}: expected a standard deviation above 0, got "
            f"{sigma[k]:g}: leave the cell empty where it is not known"
        )
    if (name in table.units) != (column in table.units):
        raise DataError(
            f"{table.name}: expected a unit in both headings, {name} and {column}, or in none"
        )
    return sigma / conversion(rule.unit)[0] if rule.unit and column in table.units else sigma


def _unsorted(table: Table, counted: Counted) -> tuple[str, ...]:
    """A note where rows are out of order."""
    falls = np.flatnonzero(np.diff(counted.at) < 0.0)
    if not counted.by or not len(falls):
        return ()
    first, more = int(falls[0]), len(falls) - 1
    said = f"row {table.lines[first + 1]} is earlier than row {table.lines[first]}"
    also = f", and {more} more" if more else ""
    return (f"{table.name}: rows were sorted by {counted.by}: {said}{also}",)


def _once(
    table: Table, name: str, counted: Counted, order: np.ndarray, value: Vector
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Rows in order, one value for each moment; a row that says the same again is left out.

    Raises:
        DataError: two values for one moment.
    """
    valued = order[np.isfinite(value[order])]
    same = np.flatnonzero(np.diff(counted.at[valued]) == 0.0)
    first, second = valued[same], valued[same + 1]
    differ = np.flatnonzero(value[first] != value[second])
    if len(differ):
        i, j = int(first[differ[0]]), int(second[differ[0]])
        more = f", and {len(differ) - 1} more such rows" if len(differ) > 1 else ""
        unit = UNITS[counted.calendar.clock] if counted.calendar else 1.0
        rows = first[differ], second[differ]
        what = doubled(table, name, counted.by, unit * counted.at, rows)
        raise DataError(
            f"{table.name}:{table.lines[j]}: expected one {name} for each {counted.by}, got "
            f"{value[j]:g}, and {value[i]:g} for the same one in row {table.lines[i]}{more}: "
            f"{what}"
        )
    again = ", ".join(str(table.lines[k]) for k in second[:5].tolist())
    more = f" and {len(second) - 5} more" if len(second) > 5 else ""
    note = f"{table.name}: rows that stand there twice were left out: {again}{more}"
    return order[~np.isin(order, second)], ((note,) if len(second) else ())


def _usage(table: Table, name: str, keep: np.ndarray) -> Vector:
    """Work done so far; never falls.

    Raises:
        DataError: it does, or a cell is empty.
    """
    usage: Vector = table.column(name)[keep]
    wrong = ~np.isfinite(usage) | (np.diff(usage, prepend=usage[:1]) < 0.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise DataError(
            f"{table.name}:{table.lines[keep[k]]}: {name}: expected the work done so far, which "
            f"never falls, got {usage[k]:g}"
            + (f" after {usage[k - 1]:g}" if k else "") + ": correct the counter, or begin with "
            "the row of the replacement"
        )  # fmt: skip
    return usage
