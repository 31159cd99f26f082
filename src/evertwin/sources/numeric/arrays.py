"""Arrays that a file holds whole (npy, npz, MAT) as tables, most often one.

A vector of n values is a column; a matrix of n rows is one column per matrix column, called
``q.1``, ``q.2``, …; arrays of another length are a table of their own where they have a clock, else
they are left out and named, as texts and single numbers are.
``npy`` is mapped into memory page by page. ``npz`` and MAT have to be unpacked whole, so they are
refused beyond a gigabyte: Parquet streams. Object arrays are pickles inside and never loaded.
"""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from evertwin.errors import DataError
from evertwin.sources.clocks.own_clocks import by_clock, stems, units_of
from evertwin.sources.clocks.time_unit import time_column
from evertwin.sources.columns.names import distinct, listed, samples
from evertwin.sources.columns.table import WIDEST, Column, Recording, Rows
from evertwin.sources.foreign import Damaged, foreign

LARGEST = 1 << 30
"""Bytes that a file may unpack to."""
CALM = 1 << 28
"""Bytes up to which it does not matter from how few they come."""
SQUEEZED = 100
"""Beyond them, how many times its own size a file may unpack to: measured data never does."""
PIECE = 1 << 16
"""Rows read at once."""
Array = np.ndarray


@dataclass(frozen=True)
class ArrayTable:
    """Columns that are arrays of one length.

    >>> table = ArrayTable(Path("x.npz"), (Column("v", "number"),), (np.array([1.0, 2.0]),))
    >>> next(table.rows(["v"], None)).values[:, 0].tolist()
    [1.0, 2.0]
    """

    path: Path
    columns: tuple[Column, ...]
    arrays: tuple[Array, ...]
    name: str = ""

    def rows(self, numbers: Sequence[str], time: str | None, strict: bool = True) -> Iterator[Rows]:
        """See `Table`."""
        names = [column.name for column in self.columns]
        use = [self.arrays[names.index(name)] for name in numbers]
        clock = None if time is None else self.arrays[names.index(time)]
        for start in range(0, len(self.arrays[0]) if self.arrays else 0, PIECE):
            stop = min(start + PIECE, len(self.arrays[0]))
            order = np.arange(start, stop, dtype=np.int64)
            values = [
                numbers_of(array[start:stop], f"{self.path.name}: column {name!r}")
                for array, name in zip(use, numbers, strict=True)
            ]
            stacked = np.stack(values, axis=1) if values else np.zeros((stop - start, 0))
            stamps = order if clock is None else np.asarray(clock[start:stop])
            yield Rows(order + 1, order, stamps, stacked)


def numbers_of(array: Array, where: str) -> Array:
    """An array as float64.

    Raises:
        DataError: it holds text or dates.
    """
    if array.dtype.kind not in "fiub":
        raise DataError(f"{where}: expected numbers, got {array.dtype}: map another column")
    return np.asarray(array, dtype=np.float64)


def kind_of(array: Array) -> str:
    """The kind of a column, see `Column`."""
    if array.dtype.kind == "b":
        return "boolean"
    if array.dtype.kind in "mM":
        return "time"
    return "number" if array.dtype.kind in "fiu" else "text"


def table_of(
    path: Path, arrays: Mapping[str, Array], kind: str, notes: Sequence[str],
    texts: Mapping[str, str] = MappingProxyType({}),
) -> Recording:  # fmt: skip
    """The tables that named arrays make: those of one length, or of one clock, are one.

    Args:
        path: the file.
        arrays: by their path in it.
        kind: of the file.
        notes: what was left out already.
        texts: what it says in words, by their path: units.

    Raises:
        DataError: no array can be a column.
    """
    left_out = list(notes)
    flat: dict[str, Array] = {}
    every = {
        name: array.item() for name, array in arrays.items()
        if array.size == 1 and array.dtype.kind in "fiu" and samples(name)
    }  # fmt: skip
    for name, array in arrays.items():
        if name in every:
            continue
        squeezed = array.reshape(-1) if array.ndim == 2 and 1 in array.shape else array
        wide = squeezed.ndim > 1 and squeezed.shape[-1] > WIDEST
        if array.dtype.kind not in "fiubMSU" or array.ndim > 2 or squeezed.size < 2 or wide:
            left_out.append(f"{name}: {array.dtype} of shape {array.shape} is no column")
        elif squeezed.dtype.names or squeezed.ndim == 1:
            flat[name] = squeezed
        else:
            flat.update({f"{name}.{j + 1}": squeezed[:, j] for j in range(squeezed.shape[-1])})
    if not flat:
        raise DataError(
            f"{path.name}: expected arrays of at least two rows, got none "
            f"({listed(left_out) or 'the file is empty'}): save each signal as a vector"
        )
    usual = Counter(map(len, flat.values())).most_common(1)[0][0]
    flat |= {name: np.full(usual, value) for name, value in every.items()}
    tables, short = _tables(path, flat, texts)
    left_out += short
    return Recording(path, kind, tables, tuple(left_out))


def _tables(
    path: Path, flat: Mapping[str, Array], texts: Mapping[str, str]
) -> tuple[tuple[ArrayTable, ...], list[str]]:
    """The vectors that share a clock, clock by clock; the others by their length, the commonest
    first, others where one is a time; and what is left out of these."""
    clocked, used = by_clock(flat)
    parts = list(clocked.items())
    rest = {n: a for n, a in flat.items() if n not in used}
    main = Counter(len(a) for a in flat.values()).most_common(1)[0][0]
    timed = {stem for name in used for stem in stems(name)}
    left_out = [f"{n}: char is no number" for n in texts if timed.isdisjoint(stems(n))]
    for length in sorted({len(a) for a in rest.values()}, key=lambda n: n != main):
        part = {n: a for n, a in rest.items() if len(a) == length}
        table = _table(path, part, "", texts)
        time = time_column(table) if len(part) > 1 else None
        if time is not None or (length == main and not clocked):
            parts.append(("" if time is None else time.name, part))
        else:
            left_out += [f"{n}: {length} rows, the table has {main}" for n in part]
    named = distinct([name or "table" for name, _ in parts]) if len(parts) > 1 else ("",)
    tables = (_table(path, part, name, texts) for name, (_, part) in zip(named, parts, strict=True))
    return tuple(tables), left_out


def _table(
    path: Path, part: Mapping[str, Array], name: str, texts: Mapping[str, str]
) -> ArrayTable:
    names = distinct(list(part))
    columns = (
        Column(n, kind_of(a), units_of(original, texts))
        for n, (original, a) in zip(names, part.items(), strict=True)
    )
    return ArrayTable(path, tuple(columns), tuple(part.values()), name)


def named_fields(name: str, array: Array) -> dict[str, Array]:
    """A structured array as its fields, any other as itself."""
    if array.dtype.names is None:
        return {name: array}
    return {field: array[field] for field in array.dtype.names}


@contextmanager
def _unpickled(path: Path) -> Iterator[None]:
    """`foreign`, with the sentence for what would have to be unpickled."""
    try:
        with foreign(path.name):
            yield
    except Damaged as error:
        if not re.search("allow_pickle|Object arrays|Python objects", error.reason):
            raise
        raise DataError(
            f"{path.name}: holds Python objects, which are never loaded: save numbers as float64"
        ) from None


def bounded(path: Path, size: float, packed: float) -> None:
    """Refuses a file that unpacks to more than fits, or to far more than data ever does.

    Args:
        path: the file.
        size: bytes that it says it unpacks to.
        packed: bytes that it has.

    Raises:
        DataError: too large.
    """
    if size > LARGEST or size > max(CALM, SQUEEZED * packed):
        raise DataError(
            f"{path.name}: {packed:.0f} bytes unpack to {size:.0f}: expected at most {LARGEST}, "
            f"and beyond {CALM} at most {SQUEEZED} times as many: save it as Parquet, which is "
            "read in pieces"
        )


def open_npy(path: Path) -> Recording:
    """An npy file, mapped into memory.

    Raises:
        DataError: damaged, cut off, or an object array.
    """
    with _unpickled(path):
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    return table_of(path, named_fields("c", array), "npy", ())


def open_npz(path: Path) -> Recording:
    """An npz archive, unpacked whole.

    Raises:
        DataError: damaged, cut off, too large, another kind of archive, or with object arrays.
    """
    arrays: dict[str, Array] = {}
    with _unpickled(path), zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        others = [m.filename for m in members if not m.filename.endswith(".npy")]
        if others or not members:
            raise DataError(
                f"{path.name}: expected an npz archive, got a zip with "
                f"{others[0] if others else 'nothing'!r}: save the table as CSV or npz"
            )
        if len(members) > WIDEST:
            raise DataError(f"{path.name}: {len(members)} arrays, the limit is {WIDEST}")
        bounded(path, sum(m.file_size for m in members), path.stat().st_size)
        for member in members:
            with archive.open(member) as file:
                array = np.lib.format.read_array(file, allow_pickle=False)
            arrays.update(named_fields(member.filename.removesuffix(".npy"), array))
    return table_of(path, arrays, "npz", ())
