"""An `Info` as lines of text for a terminal, and what a person should read before a twin runs.

Each finding says what was found and where, worked out from the figures of an `Info` alone.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator

from evertwin.sources.columns.description import (
    ClockInfo,
    ColumnInfo,
    ImageInfo,
    Info,
    ScanInfo,
    TableInfo,
    TimeInfo,
)
from evertwin.sources.columns.names import listed, unit_problem

_YEAR_2000 = 946_684_800 * 10**9


def render(info: Info) -> str:
    """The description, line by line.

    >>> print(render(Info("run.csv", "csv", 10, ())))
    run.csv: csv, 10 bytes
    """
    lines = [f"{info.file}: {info.kind}, {info.bytes} bytes"]
    for table in info.tables:
        lines += _table(table)
    lines += [line for one in info.scans for line in ("", _scans(one))]
    lines += [line for one in info.images for line in ("", _images(one))]
    if info.findings:
        lines += ["", "findings"] + [f"  - {line}" for line in info.findings]
    return "\n".join(lines)


def _scans(scans: ScanInfo) -> str:
    rate = "no rate" if scans.rate is None else f"{scans.rate:.3g} Hz"
    degrees = (
        f"{math.degrees(scans.field_of_view):.4g}° in steps of {math.degrees(scans.step):.3g}°"
    )
    beside = "odometry beside them" if scans.odometry else "no odometry"
    return (
        f"{scans.name}: {scans.count} scans of {scans.beams} beams over {degrees}, {rate}, "
        f"{scans.nearest:.3g} to {scans.farthest:.4g} m, {100 * scans.empty:.2g} % without "
        f"return, {beside}"
    )


def _images(images: ImageInfo) -> str:
    rate = "no rate" if images.rate is None else f"{images.rate:.3g} Hz"
    kinds = ", ".join(f"{w} × {h} {kind}".rstrip() for w, h, kind in images.kinds) or "none read"
    lost = f", {images.lost} cannot be read" if images.lost else ""
    return f"{images.name}: {images.count} images, {kinds}, {rate}{lost}"


def _table(table: TableInfo) -> list[str]:
    lost = f"; {table.loss}" if table.loss else ""
    lines = ["", f"{table.name or 'table'}: {table.rows} rows, {len(table.columns)} columns{lost}"]
    if table.time is not None:
        lines += _time(table.time)
        lines += [_clock(clock, table.time) for clock in table.clocks]
    width = max((len(c.name) for c in table.columns), default=6)
    head = f"  {'column':{width}}  {'type':8} {'unit':8} {'low':>12} {'high':>12} {'mean':>12}"
    lines.append(f"{head} {'std':>12} {'empty':>7}")
    return lines + [_column(column, width) for column in table.columns]


def _time(time: TimeInfo) -> list[str]:
    return [
        f"  time {time.column} [{time.unit}, {time.reason}]: {stamp(time.start)} to "
        f"{stamp(time.end)}, {time.duration:.6g} s",
        f"  rate {time.rate:.5g} Hz, step {time.period_low:.4g} to {time.period_high:.4g} s "
        f"(5 to 95 %), {time.gaps} gaps, {time.repeated} repeated, {time.backward} backward",
    ]


def _clock(clock: ClockInfo, first: TimeInfo) -> str:
    return (
        f"  clock {clock.column} against {first.column}: {clock.offset:+.6g} s, growing by "
        f"{1e6 * clock.drift:.3g} ± {1.96e6 * clock.drift_sigma:.2g} µs a second, scatter "
        f"{1e3 * clock.jitter:.3g} ms"
    )


def stamp(t: int) -> str:
    """A stamp [ns] as UTC if it is counted from 1970, else in seconds.

    >>> stamp(1_614_859_007_119_846_022), stamp(1_500_000_000)
    ('2021-03-04T11:56:47.119846Z', '1.5 s')
    """
    if t < _YEAR_2000:
        return f"{t * 1e-9:.9g} s"
    utc = datetime.datetime.fromtimestamp(t // 10**9, datetime.UTC)
    return f"{utc:%Y-%m-%dT%H:%M:%S}.{t % 10**9 // 1000:06d}Z"


def _column(column: ColumnInfo, width: int) -> str:
    figures = " ".join(
        f"{value:12.5g}" if math.isfinite(value) else f"{'':12}"
        for value in (column.low, column.high, column.mean, column.std)
    )
    head = f"  {column.name:{width}}  {column.kind:8} {column.unit:8} {figures}"
    return f"{head} {column.missing:7d}"


_MANY = 5
"""Constant columns that are told one by one."""
_HELD = 20
"""A stretch of equal values is named when it is so many times the usual one."""


def table_findings(table: TableInfo) -> list[str]:
    """What is wrong with the rows and the clock of a table."""
    where = f"{table.name}: " if table.name else ""
    out = [f"{where}{line}" for line in (table.loss, *table.examples, *table.suspicions) if line]
    if table.rows == 0:
        out.append(f"{where}no complete row")
    if table.time is None:
        counter = next((f"{c.name} counts the rows, " for c in table.columns[:1] if c.counts), "")
        out.append(
            f"{where}{counter}no column of time was found: name one, or give the rate of the rows "
            "(evertwin init --answer log.rate='100 Hz')"
        )
    else:
        out += [f"{where}{line}" for line in _clock_findings(table.time)]
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


def _clock_findings(time: TimeInfo) -> Iterator[str]:
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


def column_findings(table: TableInfo, of_messages: bool = False) -> list[str]:
    """What is wrong with the values of the columns; of many constant ones, that they are.

    ``of_messages``: columns are members of messages, most of which nobody fills; one that never
    changes is odd where no other of its topic does.
    """
    still = [c for c in table.columns if _constant(c) and not (of_messages and _alive(c, table))]
    few = still if len(still) <= _MANY else []
    out = list[str]()
    for column in table.columns:
        where = f"{table.name}: " if table.name and not column.name.startswith(table.name) else ""
        found = [*_values(column), *[f"constant at {column.low:g}"] * (column in few)]
        out += [f"{where}{column.name}: {line}" for line in found]
    if still and not few:
        where = f"{table.name}: " if table.name else ""
        out.append(f"{where}constant columns: {listed([c.name for c in still], _MANY)}")
    return out


def _alive(column: ColumnInfo, table: TableInfo) -> bool:
    """Does another column of its topic change?"""
    topic = column.name.partition(".")[0]
    return any(_changes(one) for one in table.columns if one.name.partition(".")[0] == topic)


def _constant(column: ColumnInfo) -> bool:
    return column.kind == "number" and column.count > 1 and column.low == column.high


def _changes(column: ColumnInfo) -> bool:
    return column.kind == "number" and column.count > 1 and column.low < column.high


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
    if column.recurring is not None:
        value, count = column.recurring
        yield (
            f"{value:g} in {100 * count / column.count:.3g} % of its cells, each time far off "
            f"those beside it: where it stands for no value, write sentinels = [{value:g}]"
        )
    for sentinel in column.sentinels:
        yield f"{sentinel:g} may stand for no measurement: name it as a sentinel"
