"""Which source reads a table that a program holds, and how.

A table whose columns are those of a source of the twin file is read as its file would be: units,
scales, sentinels, stamps. Any other holds the model's channels by name, each in the unit that the
model states for it, else in SI, with ``t`` in seconds. Of a mapping of columns it is the other way
round: channels by name come first.

>>> from evertwin.config.spec import ModelSpec
>>> from evertwin.machines.mobile import Robot1D
>>> spec = TwinSpec("cart", ModelSpec("robot1d"))
>>> read = given(spec, Robot1D(), {"t": [0, 1], "v": [0, 0], "x": [0, 0], "who": ["me", "me"]})
>>> [(one.source.name, list(one.source.channels)) for one in read]
[('columns', ['v', 'x'])]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from evertwin.config import TwinSpec
from evertwin.errors import DataError, UsageError
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.rows.alignment import recorded_for
from evertwin.rows.channels import recorded_as
from evertwin.signals.units import conversion_of
from evertwin.sources.clocks.dates import ORDERS
from evertwin.sources.clocks.stamps import UNITS
from evertwin.sources.clocks.time_unit import EPOCH, guess
from evertwin.sources.columns.table import Column, Recording, Table
from evertwin.sources.numeric.in_memory import InMemory, in_memory
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec

COLUMNS = "columns"
"""Name of the source of columns that were given by name."""
TIME = "t"
"""Their time [s]."""
SECONDS = TimeSpec(TIME)


class Given(NamedTuple):
    """Recordings that a program holds, and the source that reads them.

    >>> Given(SourceSpec("columns", {}), (), ()).notes
    ()
    """

    source: SourceSpec
    recordings: tuple[Recording, ...]
    notes: tuple[str, ...]
    """How their stamps and values are read, where that was not told."""


def given(spec: TwinSpec, model: Model, data: Any) -> tuple[Given, ...] | None:
    """Tables as sources; None: these are none.

    Raises:
        DataError: a column of time lacks, or two columns have one name.
        UsageError: some of several are no tables.
    """
    tables = _tables(data)
    if tables is None:
        return None
    needed = recorded_for(spec, model)
    by_name = all(
        {*needed} <= _names(one) and (TIME in _names(one) or one.clock or spec.clock.rate)
        for one in tables
    )
    files = [_read_by(spec, one) for one in tables]
    if all(files) and not (by_name and any(one.mapping for one in tables)):
        of = {
            k: [i for i, found in enumerate(files) if k in found] for k in range(len(spec.source))
        }
        return tuple(
            _as_file(spec, model, spec.source[k], [tables[i] for i in those])
            for k, those in of.items()
            if those
        )
    return (_as_channels(spec, model, tables, needed),)


def _tables(data: Any) -> list[InMemory] | None:
    found = in_memory(data)
    if found is not None:
        return [found]
    if not isinstance(data, list | tuple) or not data:
        return None
    if isinstance(data[0], str | Path | Block):
        return None
    tables = [in_memory(one, k + 1) for k, one in enumerate(data)]
    for one, table in zip(data, tables, strict=True):
        if table is None:
            raise UsageError(unknown(one))
    return [one for one in tables if one is not None]


def unknown(data: object) -> str:
    """What can be given in place of something that holds no rows."""
    kind = type(data).__name__
    return (
        f"data: expected files, a table with columns by name (DataFrame, {{name: values}}), or a "
        f"list of these, got {kind}: "
        + ("give its path" if hasattr(data, "read") else "name its columns, with the time as 't'")
    )


def tabled(spec: TwinSpec, model: Model, data: Any) -> Given:
    """The first source that reads a table.

    Raises:
        UsageError: it is no table.
    """
    held = None if isinstance(data, list | tuple) else given(spec, model, data)
    if held is None:
        raise UsageError(
            "samples: expected a Chunk, or columns by name (a DataFrame, {'t': …, name: …}), got "
            f"{type(data).__name__}"
        )
    return held[0]


def _table(one: InMemory) -> Table:
    return one.recording.tables[0]


def _names(one: InMemory) -> set[str]:
    return {column.name for column in _table(one).columns}


def _called(one: InMemory, name: str | int) -> Column | None:
    return next((c for c in _table(one).columns if c.called(str(name))), None)


def _read_by(spec: TwinSpec, one: InMemory) -> tuple[int, ...]:
    """The sources whose columns a table has; of alike ones the first."""
    found, taken = [], list[object]()
    for k, source in enumerate(spec.source):
        columns = {c.column for c in source.channels.values()} | set(source.where)
        columns |= set() if source.task is None else {source.task}
        alike = (columns, source.where)
        if columns and alike not in taken and all(_called(one, name) for name in columns):
            taken.append(alike)
            found.append(k)
    return tuple(found)


def _as_file(
    spec: TwinSpec, model: Model, source: SourceSpec, tables: Sequence[InMemory]
) -> Given:  # fmt: skip
    time, notes = _time_of(spec, tables, source.time)
    channels = {recorded_as(spec, c.name): c for c in (*model.inputs, *model.outputs)}
    other = [
        f"{name} in {told.unit}" + f" times {told.scale:g}" * (told.scale != 1.0)
        for name, told in source.channels.items()
        if name == told.column and name in channels and not tables[0].mapping
        and _size(told) != conversion_of(channels[name].stated or channels[name].unit)
    ]  # fmt: skip
    read = f"read as the twin file says of source {source.name}: {', '.join(other)}"
    recordings = tuple(one.recording for one in tables)
    return Given(replace(source, time=time), recordings, (*notes, *([read] if other else [])))


def _size(told: ChannelSpec) -> tuple[float, float]:
    factor, zero = conversion_of(told.unit)
    return told.scale * factor, told.offset * factor + zero


def _as_channels(
    spec: TwinSpec, model: Model, tables: Sequence[InMemory], needed: Sequence[str]
) -> Given:
    units = {recorded_as(spec, one.name): one.stated for one in (*model.inputs, *model.outputs)}
    recorded = dict.fromkeys((*needed, *(name for one in spec.source for name in one.channels)))
    there = [name for name in recorded if all(name in _names(one) for one in tables)]
    lacks = not {*needed} <= {*there}  # then all that there is is told with what lacks
    time, notes = _time_of(spec, tables, SECONDS)
    every = [c.name for c in _table(tables[0]).columns if c.kind == "number" and c.name != TIME]
    names = dict.fromkeys([*there, *every]) if lacks else dict.fromkeys(there)
    read = _columns(tuple((name, units.get(name) or "1") for name in names), time)
    return Given(read, tuple(one.recording for one in tables), notes)


@lru_cache(maxsize=64)
def _columns(channels: tuple[tuple[str, str], ...], time: TimeSpec) -> SourceSpec:
    """The source of columns by name, each in its unit."""
    return SourceSpec(COLUMNS, {n: ChannelSpec(n, unit) for n, unit in channels}, time=time)


def _time_of(
    spec: TwinSpec, tables: Sequence[InMemory], told: TimeSpec
) -> tuple[TimeSpec, tuple[str, ...]]:
    """Where the stamps of tables come from, and what is to be said of it."""
    if told.rate is not None:
        return told, ()
    found = [_column_of_time(spec, one, told) for one in tables]
    if len(set(found)) > 1:
        said = ", ".join(f"{time.column or time.rate} in {time.unit}" for time, _ in found)
        raise DataError(f"the time of the recordings is not one: {said}: write them alike")
    time, note = found[0]
    return time, (note,) * bool(note)


def _column_of_time(spec: TwinSpec, one: InMemory, told: TimeSpec) -> tuple[TimeSpec, str]:
    column = _called(one, str(told.column))
    if column is None and one.clock is not None:
        column = _called(one, one.clock)
        told = TimeSpec(one.clock)
    if column is None:
        if (rate := spec.clock.rate) is not None:
            return TimeSpec(rate=rate), f"no column of time: rows at {rate:g} Hz, the [clock] rate"
        there = ", ".join(c.name for c in _table(one).columns[:12])
        raise DataError(
            f"{_table(one).path.name}: no time: expected a column {str(told.column)!r}"
            f"{' with seconds' * (told.column == TIME)}, or of a DataFrame an index of dates (one "
            f"that numbers its rows is no time), got {there}: name one so, or give [clock] rate"
        )
    rows = next(iter(_table(one).rows([], column.name, strict=False)), None)
    if rows is None or told.unit not in UNITS or rows.time.dtype.kind == "f":
        return told, ""
    looks = guess(column.name, rows.time[:1000], column.unit)
    if looks.unit in ORDERS:
        return replace(told, unit="auto"), ""
    since = looks.reason == EPOCH and looks.unit != told.unit and rows.time.dtype.kind in "iu"
    if not since:
        return told, ""
    return (
        TimeSpec(told.column, looks.unit),  # type: ignore[arg-type]
        f"{column.name} read in {looks.unit} ({looks.reason})",
    )
