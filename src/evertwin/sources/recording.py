"""Opening a recording: the format is told from the content.

>>> import tempfile
>>> file = Path(tempfile.mkdtemp()) / "run.txt"
>>> _ = file.write_text("0.0 1.5\\n0.1 1.6\\n")
>>> [column.name for column in open_recording(file).tables[0].columns]
['c1', 'c2']
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path

from evertwin.errors import DataError
from evertwin.sources.clocks.exported import exported
from evertwin.sources.columns.table import WIDEST, Recording, Table
from evertwin.sources.foreign import foreign
from evertwin.sources.numeric.arrays import open_npy, open_npz
from evertwin.sources.numeric.mat import open_mat, open_mat73
from evertwin.sources.numeric.parquet import open_parquet
from evertwin.sources.robot_logs.bags import open_bag
from evertwin.sources.robot_logs.carmen import open_carmen
from evertwin.sources.sniff import opened, sniff
from evertwin.sources.texts.dialect import FOUND, Stated
from evertwin.sources.texts.echoed import echoed
from evertwin.sources.texts.lvm import MAGIC, open_lvm
from evertwin.sources.texts.scope import open_scope
from evertwin.sources.texts.text import TextTable

_OPEN = {
    "carmen": open_carmen, "mat": open_mat, "mat73": open_mat73, "parquet": open_parquet,
    "npy": open_npy, "npz": open_npz,
}  # fmt: skip
_OWN = frozenset(
    (
        "",
        "csv",
        "txt",
        "tsv",
        "dat",
        "log",
        "mat",
        "lvm",
        "parquet",
        "npy",
        "npz",
        "mcap",
        "bag",
        "db3",
        "gz",
    )
)
"""Endings that no other package reads."""
LONGEST = 200
"""Signs of the longest name of a column."""


def _opened(reader: Callable[[Path], Recording], path: Path) -> Recording:
    with foreign(path.name):
        found = reader(path)
    if not isinstance(found, Recording):
        raise DataError(
            f"{path.name}: its reader {reader.__module__}.{reader.__qualname__} gave "
            f"{type(found).__name__}, expected evertwin.sources.Recording"
        )
    return found


def open_recording(path: Path | str, stated: Stated = FOUND) -> Recording:
    """The tables of a file, or of a folder that holds a ROS 2 bag.

    A file whose ending another package has registered (entry point group ``evertwin.sources``) is
    opened by that package. What is ``stated`` holds for text tables; every other kind of file says
    it itself.

    Raises:
        DataError: no such file, a damaged one, or a kind that is never read.
        MissingExtra: the library that reads it is not installed.
    """
    path = Path(path)
    recording = _recording(path, stated)
    for table in recording.tables:
        _check(table)
    return recording


def _recording(path: Path, stated: Stated) -> Recording:
    ending = path.suffix.lower().removeprefix(".")
    if ending not in _OWN and path.is_file():
        for point in entry_points(group="evertwin.sources", name=ending):
            return _opened(point.load(), path)
    kind = sniff(path)
    if kind == "text":
        with opened(path) as file:
            if file.read(len(MAGIC)) == MAGIC:
                return open_lvm(path)
        scope = open_scope(path)
        if scope is not None:
            return exported(scope)
        text = TextTable(path, stated=stated)
        note = echoed(text)
        return exported(Recording(path, "csv", (text,), (note,) * bool(note)))
    if kind in _OPEN:
        return exported(_OPEN[kind](path))
    return open_bag(path, kind)


def _check(table: Table) -> None:
    """Columns that can be told apart and shown.

    Raises:
        DataError: none, too many, two of one name, or a name that is none.
    """
    names = [column.name for column in table.columns]
    where = f"{table.path.name}: {table.name}".removesuffix(": ")
    if not 0 < len(names) <= WIDEST:
        raise DataError(f"{where}: {len(names)} columns, expected 1 to {WIDEST}")
    for name, count in Counter(names).items():
        if len(name) > LONGEST or not name.isprintable():
            raise DataError(
                f"{where}: column {names.index(name)}: expected a name of up to {LONGEST} signs "
                f"that can be shown, got {name[:40]!r}"
            )
        if count > 1:
            raise DataError(f"{where}: {count} columns are called {name!r}: rename them")
