"""Sentences about a recording that a person should read before a twin runs on it.

Each says what was found and where; they are worked out from the figures of an `Info` alone.
"""

from __future__ import annotations

from collections.abc import Iterator

from evertwin.sources.description import ColumnInfo, TableInfo, TimeInfo
from evertwin.sources.names import unit_problem

_HELD = 20
"""A stretch of equal values is named when it is so many times the usual one."""


def table_findings(table: TableInfo) -> list[str]:
    """What is wrong with the rows and the clock of a table."""
    where = f"{table.name}: " if table.name else ""
    out = [f"{where}{line}" for line in (table.loss, *table.examples, *table.suspicions) if line]
    if table.rows == 0:
        out.append(f"{where}no complete row")
    if table.time is None:
        out.append(f"{where}no column of time was found: name one, or give a rate")
    else:
        out += [f"{where}{line}" for line in _clock(table.time)]
    held = [column for column in table.columns if _held(column)]
    if held:
        most = max(held, key=lambda column: column.constant_rows)
        others = f" (and {len(held) - 1} more columns)" if len(held) > 1 else ""
        out.append(
            f"{where}{most.name}{others}: {most.constant_rows} equal values in a row from line "
            f"{most.constant_line}, usually {most.count / most.changes:.1f}: at rest or frozen"
        )
    return out


def _held(column: ColumnInfo) -> bool:
    """Whether a column that keeps changing once stood still for long."""
    if column.kind != "number" or column.changes <= 30:
        return False
    return column.constant_rows > max(_HELD * column.count / column.changes, 30)


def _clock(time: TimeInfo) -> Iterator[str]:
    if not time.sure:
        yield f"{time.column}: the unit of time is not clear ({time.reason}; {time.unit}?)"
    if time.gaps:
        yield (
            f"{time.column}: {time.gaps}{' or more' if time.gaps >= 20 else ''} gaps of over 5 "
            f"periods, the longest {time.longest_gap:.4g} s before line {time.longest_gap_line}"
        )
    if time.period and time.jitter > 0.5 * time.period:
        yield (
            f"{time.column}: uneven steps, {time.period_low:.4g} to {time.period_high:.4g} s "
            "(5 to 95 %): resample before filtering"
        )


def column_findings(column: ColumnInfo, table: TableInfo) -> list[str]:
    """What is wrong with the values of one column."""
    where = f"{table.name}: " if table.name and not column.name.startswith(table.name) else ""
    return [f"{where}{column.name}: {line}" for line in _values(column)]


def _values(column: ColumnInfo) -> Iterator[str]:
    unclear = unit_problem(column.unit)
    if unclear and column.kind == "number":
        yield f"its unit {unclear}"
    if column.missing and column.kind != "text":
        yield f"{column.missing} empty cells"
    if column.infinite:
        yield f"{column.infinite} infinite values"
    if column.text:
        yield f"{column.text}{' or more' if column.text >= 20 else ''} words in a column of numbers"
    if column.absurd:
        value, line = max(column.absurd, key=lambda pair: abs(pair[0]))
        yield f"{len(column.absurd)} or more absurd values, such as {value:.6g} in line {line}"
    for sentinel in column.sentinels:
        yield f"{sentinel:g} may stand for no measurement: name it as a sentinel"
    if column.kind == "number" and column.count > 1 and column.low == column.high:
        yield f"constant at {column.low:g}"
