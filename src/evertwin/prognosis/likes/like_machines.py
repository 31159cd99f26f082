"""Like machines: what their histories and the stores of their twins tell of a life.

A history is a CSV, a store the file of another twin (``arm2.db``), read as it is while that twin
may be at work. Each life in them is labelled: it passed the limit, failed before, was replaced in
time, or still runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from glob import glob
from pathlib import Path

from evertwin.config.prognosis import IndicatorSpec
from evertwin.errors import DataError, UsageError
from evertwin.models import Parameters
from evertwin.prognosis.histories.contradictions import check_units
from evertwin.prognosis.histories.headings import counting
from evertwin.prognosis.histories.health import indicator_of, series_of
from evertwin.prognosis.histories.history_file import counted_by
from evertwin.prognosis.histories.parameter_history import History, history
from evertwin.prognosis.histories.value_columns import value_columns
from evertwin.prognosis.laws import Fleet, Indicator, Limit, Maintenance, learn
from evertwin.prognosis.laws.predict import has_ended
from evertwin.sources.texts.small_table import Table, read_table
from evertwin.store import SqliteStore

ENOUGH = 4
"""Earlier lives that ended from which they tell more than the series itself."""
FLEETS = 8
"""Fleets that a process remembers."""
_LEARNED: dict[str, Fleet] = {}
_STORE = b"SQLite format 3\0"


@dataclass(frozen=True)
class Likes:
    """Which machines are alike, and how their wear is told.

    >>> Likes(IndicatorSpec("wear", limit=2.0), Limit(2.0), "run").files
    ()
    """

    rule: IndicatorSpec
    limit: Limit
    clock: str
    files: tuple[Path, ...] = ()
    """Histories and stores."""
    failed: tuple[Path, ...] = ()
    """Of machines that failed with the last row, wherever the limit lies."""
    parts: tuple[str, ...] = ()
    """Components of the twin."""
    parameters: Parameters | None = None
    own: Indicator | None = None
    """The machine that is asked for, where its values state no unit."""
    past: tuple[Indicator, ...] = ()
    """Earlier lives of the machine that is asked for."""


def files_of(patterns: Sequence[str], folder: Path, own: Sequence[Path] = ()) -> tuple[Path, ...]:
    """The files that patterns name, as in ``others/*.csv``, each once, without the ones asked for.

    Raises:
        UsageError: a pattern that names none.
    """
    found: dict[Path, None] = {}
    kept = {one.resolve() for one in own}
    for pattern in patterns:
        plain = (folder / pattern).is_file()
        names = [pattern] if plain else sorted(glob(pattern, root_dir=folder))
        there = [folder / name for name in names]
        if not there:
            raise UsageError(
                f"fleet: {pattern}: expected histories (CSV) or stores, no file is called so"
            )
        found |= dict.fromkeys(one for one in there if one.resolve() not in kept)
    return tuple(found)


def past_of(own: Indicator) -> tuple[Indicator, ...]:
    """Lives before the current one, each by its number."""
    return tuple(one.with_(name=f"life {k}") for k, one in enumerate(own.lives()[:-1], 1))


def fleet_of(asked: Likes) -> Fleet | None:
    """What like machines and earlier lives tell, learned once; None without any.

    Earlier lives alone tell from `ENOUGH` that ended on: fewer say less than the series itself.

    Raises:
        UsageError: fewer than two of their lives ended.
        DataError: one of them cannot be read; with its row.
    """
    files = (*asked.files, *(one for one in asked.failed if one not in asked.files))
    past = asked.past
    if not files and sum(map(has_ended, past)) < ENOUGH:
        return None
    before = [(one.at.tobytes(), one.value.tobytes(), one.maintenance) for one in past]
    written = [(str(file), file.stat().st_mtime_ns) for file in files]
    key = repr(
        (asked.rule, asked.limit, asked.clock, asked.failed, written, asked.own is None, before)
    )
    if key not in _LEARNED:
        named = [_named(asked, file) for file in files]
        lived, taken = [one for one, _ in named], [column for _, column in named]
        if asked.own is not None:
            check_units(lived, asked.own)
        while len(_LEARNED) >= FLEETS:
            _LEARNED.pop(next(iter(_LEARNED)))
        notes = (
            f"{asked.rule.name}: its like machines tell {column}, their only column: the same?"
            for column in dict.fromkeys(filter(None, taken))
        )
        _LEARNED[key] = replace(learn(lived, past), notes=tuple(notes))
    return _LEARNED[key]


def _named(asked: Likes, file: Path) -> tuple[Indicator, str]:
    """A machine's indicator, by the name of its file, and its column where that is called else."""
    with file.open("rb") as begin:
        stored = begin.read(len(_STORE)) == _STORE
    if stored:
        with closing(SqliteStore(file, read_only=True)) as store:
            kept, table = history(store, asked.clock, asked.parameters), None
    else:
        kept, table = History((), asked.clock, ()), read_table(file)
    rule = asked.rule if table is None else _rule(asked.rule, table)
    taken = "" if rule is asked.rule else str(rule.column)
    if table is not None and asked.own is not None:  # numbers as they are written, as its own are
        written = (table.written.get(x, "") for x in (rule.column, rule.name, rule.parameter) if x)
        rule = replace(rule, unit=next(filter(None, written), ""))
    known = series_of(rule, kept, table, file.parent, asked.parts)
    if table is not None and not known.by:
        _check_clock(table, asked.clock)
    found = indicator_of(rule, known, asked.limit, asked.clock, asked.parameters)
    marks = found.maintenance
    if file in asked.failed and len(found.at) and found.failed is None:
        marks = (*marks, Maintenance(float(found.at[-1]), "failed", "by its file"))
    return found.with_(name=file.name, maintenance=marks), taken


def _rule(rule: IndicatorSpec, table: Table) -> IndicatorSpec:
    """With the only column of values that a file has, where none is called as it should be.

    Raises:
        DataError: it has several.
    """
    there = value_columns(table)
    wanted = [name for name in (rule.column, rule.name, rule.parameter) if name]
    if not there or not {*wanted}.isdisjoint((*table.names, *table.text)):
        return rule
    if len(there) > 1:
        raise DataError(
            f"{table.name}: expected a column {wanted[0]!r}, as the machine asked for has, got "
            f"{', '.join(there)}: rename the one that tells the same there"
        )
    return replace(rule, column=there[0])


def _check_clock(table: Table, clock: str) -> None:
    """Refuses to count the rows of a machine that counts its life by something else.

    Raises:
        DataError: its own column of times.
    """
    by = counted_by(table) or counting(("h", "d"), table)
    if by is not None:
        raise DataError(
            f"{table.name}: expected a column {clock!r}, to count its life as that of the machine "
            f"asked for, got {by}: add one, or leave the file out"
        )
