"""An `Info` as lines of text for a terminal."""

from __future__ import annotations

import datetime
import math

from evertwin.sources.description import ClockInfo, ColumnInfo, Info, TableInfo, TimeInfo

_YEAR_2000 = 946_684_800 * 10**9


def render(info: Info) -> str:
    """The description, line by line.

    >>> print(render(Info("run.csv", "csv", 10, ())))
    run.csv: csv, 10 bytes
    """
    lines = [f"{info.file}: {info.kind}, {info.bytes} bytes"]
    for table in info.tables:
        lines += _table(table)
    if info.findings:
        lines += ["", "findings"] + [f"  - {line}" for line in info.findings]
    return "\n".join(lines)


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
