"""Writing recordings: CSV, npz, Parquet and MCAP, told from the file's name.

Values are written so that reading gives the same bits again: shortest round-trip decimals in CSV,
float64 elsewhere; stamps stay int64 nanoseconds (in CSV, seconds with nine decimals). Units go into
the headings, or into the field's metadata. MCAP carries one topic per series, as JSON messages.

>>> import tempfile
>>> series = Series(Layout.of(v="m/s"), np.array([0, 10**9]), np.array([[0.1], [np.nan]]))
>>> file = Path(tempfile.mkdtemp()) / "run.csv"
>>> write(file, {"drive": series})
>>> print(file.read_text())
t [s],v [m/s]
0.000000000,0.1
1.000000000,
<BLANKLINE>
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from evertwin.errors import UsageError
from evertwin.signals import Layout
from evertwin.signals.series import Series
from evertwin.sources.foreign import load


def write(path: Path, series: Mapping[str, Series]) -> None:
    """Write ``series`` (name → series) to ``path``; only MCAP holds several.

    Raises:
        UsageError: an unknown suffix, or several series for a file that holds one.
        MissingExtra: the library that writes it is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise UsageError(f"{path.name}: expected one of {', '.join(sorted(WRITERS))}")
    if suffix != ".mcap" and len(series) != 1:
        raise UsageError(f"{path.name}: holds one series, got {len(series)}: write an MCAP file")
    WRITERS[suffix](path, series)


def _only(series: Mapping[str, Series]) -> Series:
    return next(iter(series.values()))


def _headings(layout: Layout) -> list[str]:
    return [f"{channel.name} [{channel.unit}]" for channel in layout]


def _csv(path: Path, series: Mapping[str, Series]) -> None:
    one = _only(series)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        headings = ["t [s]", *map(_no_formula, _headings(one.layout))]
        csv.writer(file, lineterminator="\n").writerow(headings)
        file.writelines(_lines(one))


def _no_formula(text: str) -> str:
    """Text that no spreadsheet takes for a formula.

    >>> _no_formula("=1+1"), _no_formula("x [m]")
    ("'=1+1", 'x [m]')
    """
    return f"'{text}" if text[:1] in "=+-@\t\r" else text


def _lines(series: Series) -> Iterator[str]:
    for t, row in zip(series.t.tolist(), series.v.tolist(), strict=True):
        sign = "-" if t < 0 else ""
        seconds, nanos = divmod(abs(t), 10**9)
        cells = ("" if value != value else repr(value) for value in row)
        yield f"{sign}{seconds}.{nanos:09d},{','.join(cells)}\n"


def _npz(path: Path, series: Mapping[str, Series]) -> None:
    one = _only(series)
    columns = {name: one.v[:, j] for j, name in enumerate(one.layout.names)}
    with path.open("wb") as file:
        np.savez_compressed(file, t_ns=one.t, **columns)  # type: ignore[arg-type]


def _parquet(path: Path, series: Mapping[str, Series]) -> None:
    one = _only(series)
    arrow, parquet = load("pyarrow"), load("pyarrow.parquet")
    fields = [arrow.field("t_ns", arrow.int64(), metadata={"unit": "ns"})]
    fields += [arrow.field(c.name, arrow.float64(), metadata={"unit": c.unit}) for c in one.layout]
    columns = [arrow.array(one.t), *(arrow.array(one.v[:, j]) for j in range(one.v.shape[1]))]
    parquet.write_table(arrow.Table.from_arrays(columns, schema=arrow.schema(fields)), path)


def _mcap(path: Path, series: Mapping[str, Series]) -> None:
    with path.open("wb") as file:
        writer = load("mcap.writer").Writer(file)
        writer.start(profile="", library="evertwin")
        channels = {name: _channel(writer, name, one.layout) for name, one in series.items()}
        for name, t, row in _by_stamp(series):
            names = series[name].layout.names
            content = {k: (v if np.isfinite(v) else None) for k, v in zip(names, row, strict=True)}
            data = json.dumps(content, allow_nan=False).encode()
            writer.add_message(channels[name], log_time=t, publish_time=t, data=data)
        writer.finish()


def _channel(writer: object, topic: str, layout: Layout) -> int:
    """A topic whose schema names the units."""
    properties = {c.name: {"type": "number", "description": f"[{c.unit}]"} for c in layout}
    schema = {"type": "object", "properties": properties}
    register: Callable[..., int] = writer.register_schema  # type: ignore[attr-defined]
    number = register(name=topic, encoding="jsonschema", data=json.dumps(schema).encode())
    channel: Callable[..., int] = writer.register_channel  # type: ignore[attr-defined]
    return channel(topic=topic, message_encoding="json", schema_id=number)


def _by_stamp(series: Mapping[str, Series]) -> Iterator[tuple[str, int, list[float]]]:
    names = list(series)
    stamps = np.concatenate([one.t for one in series.values()])
    owner = np.concatenate([np.full(len(one.t), i) for i, one in enumerate(series.values())])
    row = np.concatenate([np.arange(len(one.t)) for one in series.values()])
    for k in np.argsort(stamps, kind="stable").tolist():
        name = names[int(owner[k])]
        yield name, int(stamps[k]), series[name].v[int(row[k])].tolist()


WRITERS: Mapping[str, Callable[[Path, Mapping[str, Series]], None]] = {
    ".csv": _csv,
    ".mcap": _mcap,
    ".npz": _npz,
    ".parquet": _parquet,
}
"""Writer per suffix."""
