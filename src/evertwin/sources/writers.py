"""Writing recordings: CSV, npz, Parquet and MCAP, told from the file's name.

Values are written so that reading gives the same bits again: shortest round-trip decimals in CSV,
float64 elsewhere; stamps stay int64 nanoseconds (in CSV, seconds with nine decimals). Units go into
the headings, or into the field's metadata. MCAP carries one topic per series, as JSON messages,
and samples that are arrays as lists of numbers.

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
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.signals import Layout
from evertwin.signals.series import Series
from evertwin.sources.foreign import load
from evertwin.types import Stamps

EMPTY: Mapping[str, Lists] = MappingProxyType({})


class Lists(NamedTuple):
    """Samples that are arrays.

    >>> Lists("ranges", np.array([0]), np.zeros((1, 180)), np.zeros(1)).column
    'ranges'
    """

    column: str
    """What their values are called."""
    t: Stamps
    v: np.ndarray
    """(n, …)"""
    task: np.ndarray
    """Number of the task of each, (n,)."""


def write(path: Path, series: Mapping[str, Series], lists: Mapping[str, Lists] = EMPTY) -> None:
    """Write ``series`` (name → series) to ``path``; only MCAP holds several, and ``lists``.

    Raises:
        UsageError: an unknown suffix, or several series or lists for a file that holds one series.
        MissingExtra: the library that writes it is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise UsageError(f"{path.name}: expected one of {', '.join(sorted(WRITERS))}")
    if suffix == ".mcap":
        return _mcap(path, series, lists)
    if lists or len(series) != 1:
        names = ", ".join((*series, *lists))
        raise UsageError(f"{path.name}: holds one series of numbers, got {names}: write .mcap")
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


def _mcap(path: Path, series: Mapping[str, Series], lists: Mapping[str, Lists] = EMPTY) -> None:
    number, array = {"type": "number"}, {"type": "array", "items": {"type": "number"}}
    shapes: dict[str, Mapping[str, object]] = {
        name: {c.name: {**number, "description": f"[{c.unit}]"} for c in one.layout}
        for name, one in series.items()
    }
    shapes |= {name: {one.column: array, "task": number} for name, one in lists.items()}
    every: dict[str, Series | Lists] = {**series, **lists}
    with path.open("wb") as file:
        writer = load("mcap.writer").Writer(file)
        writer.start(profile="", library="evertwin")
        channels = {name: _channel(writer, name, shape) for name, shape in shapes.items()}
        for name, t, row in _by_stamp({name: one.t for name, one in every.items()}):
            data = json.dumps(_content(every[name], row), allow_nan=False).encode()
            writer.add_message(channels[name], log_time=t, publish_time=t, data=data)
        writer.finish()


def _content(one: Series | Lists, row: int) -> dict[str, object]:
    """One sample; what is no number is null."""
    values = [v if math.isfinite(v) else None for v in one.v[row].ravel().tolist()]
    if isinstance(one, Lists):
        return {one.column: values, "task": float(one.task[row])}
    return dict(zip(one.layout.names, values, strict=True))


def _channel(writer: object, topic: str, properties: Mapping[str, object]) -> int:
    """A topic whose schema names the units."""
    schema = {"type": "object", "properties": properties}
    register: Callable[..., int] = writer.register_schema  # type: ignore[attr-defined]
    number = register(name=topic, encoding="jsonschema", data=json.dumps(schema).encode())
    channel: Callable[..., int] = writer.register_channel  # type: ignore[attr-defined]
    return channel(topic=topic, message_encoding="json", schema_id=number)


def _by_stamp(every: Mapping[str, Stamps]) -> Iterator[tuple[str, int, int]]:
    """Name, stamp [ns] and row of each sample, in the order of all stamps."""
    names = list(every)
    stamps = np.concatenate(list(every.values()))
    owner = np.concatenate([np.full(len(t), i) for i, t in enumerate(every.values())])
    row = np.concatenate([np.arange(len(t)) for t in every.values()])
    for k in np.argsort(stamps, kind="stable").tolist():
        yield names[int(owner[k])], int(stamps[k]), int(row[k])


WRITERS: Mapping[str, Callable[[Path, Mapping[str, Series]], None]] = {
    ".csv": _csv,
    ".mcap": _mcap,
    ".npz": _npz,
    ".parquet": _parquet,
}
"""Writer per suffix."""
