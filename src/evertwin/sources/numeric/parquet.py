"""Parquet files, read in batches of rows; needs the extra ``formats``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.clocks.stamps import NO_STAMP, texts
from evertwin.sources.columns.names import split_unit
from evertwin.sources.columns.table import Column, Recording, Rows
from evertwin.sources.foreign import each, foreign, load
from evertwin.sources.numeric.arrays import numbers_of

PIECE = 1 << 13
"""Rows read at once."""


def open_parquet(path: Path) -> Recording:
    """A Parquet file; nested columns are left out by name.

    Raises:
        DataError: damaged or without rows.
        MissingExtra: pyarrow is not installed.
    """
    table = ParquetTable(path)
    nested = [n for n in table.schema.names if n not in {c.name for c in table.columns}]
    return Recording(path, "parquet", (table,), tuple(f"{n}: nested columns" for n in nested))


@dataclass(frozen=True)
class ParquetTable:
    """A Parquet file as a table.

    >>> import tempfile, pyarrow, pyarrow.parquet
    >>> file = Path(tempfile.mkdtemp()) / "run.parquet"
    >>> pyarrow.parquet.write_table(pyarrow.table({"t": [0, 1], "v": [0.5, None]}), file)
    >>> next(ParquetTable(file).rows(["v"], "t")).values[:, 0].tolist()
    [0.5, nan]
    """

    path: Path
    name: str = ""

    @cached_property
    def schema(self) -> Any:
        """The file's own schema."""
        with foreign(self.path.name), self._open() as file:
            if file.metadata.num_rows == 0:
                raise DataError(f"{self.path.name}: no rows: the recording may have been cut off")
            return file.schema_arrow

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Flat columns; the unit is the field's metadata ``unit``, or the one in its name."""
        out = []
        for field in self.schema:
            kind = _kind(field.type)
            if kind:
                unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
                out.append(Column(field.name, kind, unit or split_unit(field.name)[1]))
        return tuple(out)

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        yield from each(self.path.name, self._pieces(numbers, time))

    def _pieces(self, numbers: Sequence[str], time: str | None) -> Iterator[Rows]:
        wanted = list(dict.fromkeys([*numbers, *([] if time is None else [time])]))
        start = 0
        with self._open() as file:
            for batch in file.iter_batches(PIECE, columns=wanted, use_threads=False):
                order = np.arange(start, start + batch.num_rows, dtype=np.int64)
                start += batch.num_rows
                values = [
                    numbers_of(self._numpy(batch, n), f"{self.path.name}: column {n!r}")
                    for n in numbers
                ]
                stacked = np.stack(values, axis=1) if values else np.zeros((len(order), 0))
                stamps = order if time is None else self._stamps(batch, time)
                yield Rows(order + 1, order, stamps, stacked)

    def _open(self) -> Any:
        return load("pyarrow.parquet").ParquetFile(self.path, buffer_size=1 << 20, pre_buffer=False)

    def _numpy(self, batch: Any, name: str) -> Any:
        arrow = load("pyarrow")
        column = batch.column(name)
        if arrow.types.is_decimal(column.type):
            column = column.cast(arrow.float64())
        if arrow.types.is_boolean(column.type):
            column = column.cast(arrow.uint8())
        array = column.to_numpy(zero_copy_only=False)
        number = _kind(column.type) in ("number", "boolean")
        return array.astype(np.float64) if number else array

    def _stamps(self, batch: Any, name: str) -> Any:
        """Raw stamps; an empty integer must not turn its neighbours into floats."""
        arrow = load("pyarrow")
        column = batch.column(name)
        if arrow.types.is_signed_integer(column.type):
            column = column.cast(arrow.int64()).fill_null(NO_STAMP)
        raw = column.to_numpy(zero_copy_only=False)
        if raw.dtype.kind in "OU":
            return texts([str(cell or "").encode() for cell in raw])
        return raw


def _kind(type_: Any) -> str:
    """The kind of a column, empty for a nested one."""
    types = load("pyarrow").types
    if types.is_boolean(type_):
        return "boolean"
    if types.is_integer(type_) or types.is_floating(type_) or types.is_decimal(type_):
        return "number"
    if types.is_timestamp(type_) or types.is_date(type_) or types.is_duration(type_):
        return "time"
    flat = (types.is_string, types.is_large_string, types.is_dictionary, types.is_string_view)
    return "text" if any(test(type_) for test in flat) else ""
