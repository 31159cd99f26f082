"""What another reader makes of a file: every value that evertwin gives has to be there too.

Text is read by Python's own ``csv``; NumPy's files by hand from their header; MAT, HDF5, Parquet
and MCAP by their libraries without what evertwin puts on top; bags by the reader of rosbags and by
SQLite; twin files by tomlkit. Where the other reader gives up there is nothing to compare.
"""

from __future__ import annotations

import ast
import csv
import io
import json
import math
import re
import sqlite3
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from defusedxml import ElementTree

__all__ = ["wrong"]

Cells = dict[str, Any]
"""Column → value by row, or the set of its values where rows have no common number."""
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?|[+-]?nan", re.I | re.A
)
BLANK = " \t\r\v\f\x1c\x1d\x1e\x1f\xa0"
"""White space, but not byte 85: a new line in Latin-1, an ellipsis in Windows-1252."""
_EMPTY = {"", "nan", "na", "n/a", "null", "none", "-", "--", "nil", "#n/a"}
UNITS = {"": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1e3, "s": 1.0, "min": 60.0, "Nm": 1.0,
         "%": 0.01, "kg": 1.0, "cm/s": 0.01, "m/s": 1.0, "Hz": 1.0}  # fmt: skip


def wrong(kind: str, path: Path) -> list[str]:
    """The values of a file that another reader reads otherwise; empty where all agree.

    Args:
        kind: which reader, as in `Seed.reader`.
        path: the file.
    """
    if kind in SETTINGS:
        return SETTINGS[kind](path)
    from evertwin.sources import open_recording

    recording = open_recording(path)
    found: list[str] = []
    for table in recording.tables:
        names = [c.name for c in table.columns if c.kind in ("number", "boolean")]
        try:
            other = READERS[kind](path, table)
        except Exception:  # noqa: BLE001  it gave up: nothing to compare
            continue
        for rows in table.rows(names, None, strict=False):
            for j, name in enumerate(names):
                found += _compared(name, other.get(name), rows.line, rows.values[:, j])
    return found[:5]


def _compared(name: str, other: Any, line: np.ndarray, values: np.ndarray) -> Iterator[str]:
    for at, value in zip(line.tolist(), values.tolist(), strict=True):
        if isinstance(other, set):
            good = value in other or (math.isnan(value) and any(map(math.isnan, other)))
            expected: Any = f"one of {len(other)}"
        else:
            expected = None if other is None else other.get(at)
            good = expected is not None and (
                value == expected or (math.isnan(value) and math.isnan(expected))
            )
        if not good:
            yield f"{name}, row {at}: {value!r}, the other reader says {expected!r}"


def _text(path: Path, table: Any) -> Cells:
    raw = path.read_bytes()
    if raw[:2] == b"\x1f\x8b":
        raw = _gunzip(raw)
    lines = raw.removeprefix(b"\xef\xbb\xbf").decode("latin-1").split("\n")
    d = table.dialect
    sign = None if d.delimiter is None else d.delimiter.decode("latin-1")
    out: Cells = {column.name: {} for column in table.columns}
    for number, line in enumerate(lines, 1):
        text = line.rstrip("\r")
        cells = text.split() if sign is None else next(csv.reader([text], delimiter=sign), [])
        for column, cell in zip(table.columns, cells, strict=False):
            out[column.name][number] = _cell(cell, d.decimal_comma)
    return out


def _gunzip(raw: bytes) -> bytes:
    out, rest = b"", raw
    while rest[:2] == b"\x1f\x8b":
        unpacker = zlib.decompressobj(31)
        for start in range(0, len(rest), 64):  # all that comes before the damage
            try:
                out += unpacker.decompress(rest[start : start + 64])
            except zlib.error:
                return out
            if unpacker.eof:
                rest = unpacker.unused_data + rest[start + 64 :]
                break
        else:
            break
    return out


def _cell(cell: str, comma: bool) -> float:
    text = cell.strip(BLANK).replace(",", ".") if comma else cell.strip(BLANK)
    if text.lower() in _EMPTY:
        return math.nan
    if text.lower() in ("true", "false"):
        return float(text.lower() == "true")
    return float(text) if _NUMBER.fullmatch(text) else math.nan


def _npy(raw: bytes) -> np.ndarray:
    version = raw[6]
    form, at = ("<H", 10) if version == 1 else ("<I", 12)
    (size,) = struct.unpack(form, raw[8:at])
    head = ast.literal_eval(raw[at : at + size].decode("utf-8" if version == 3 else "latin-1"))
    kind = np.lib.format.descr_to_dtype(head["descr"])
    count = math.prod(head["shape"])
    flat = np.frombuffer(raw, kind, count, at + size)
    return flat.reshape(head["shape"], order="F" if head["fortran_order"] else "C")


def _columns(name: str, array: np.ndarray) -> Cells:
    if array.dtype.names:
        return {k: v for f in array.dtype.names for k, v in _columns(f, array[f]).items()}
    if array.dtype.kind not in "fiub":
        return {}
    square = array.ndim == 2 and 1 not in array.shape
    if square:
        return {f"{name}.{j + 1}": _rows(array[:, j]) for j in range(array.shape[1])}
    return {name: _rows(array.reshape(-1))}


def _rows(values: Any) -> dict[int, float]:
    return {i: float(v) for i, v in enumerate(values, 1)}


def _npz(path: Path) -> Cells:
    out: Cells = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            out |= _columns(member.filename.removesuffix(".npy"), _npy(archive.read(member)))
    return out


def _mat(path: Path) -> Cells:
    import scipy.io

    out: Cells = {}
    for name, value in scipy.io.loadmat(path, simplify_cells=True).items():
        for key, inner in (value if isinstance(value, dict) else {"": value}).items():
            if isinstance(inner, np.ndarray):
                out |= _columns(f"{name}.{key}".removesuffix("."), inner)
    return out


def _mat73(path: Path) -> Cells:
    import h5py

    with h5py.File(path) as file:
        return {
            name: cells
            for name in file
            for cells in _columns(name, np.asarray(file[name]).T).values()
        }


def _parquet(path: Path) -> Cells:
    import pandas

    table = pandas.read_parquet(path)
    return {name: _rows(table[name].astype(float)) for name in table.columns}


def _mcap(path: Path) -> Cells:
    from mcap.reader import make_reader

    out: Cells = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            for key, value in json.loads(message.data).items():
                out.setdefault(f"{channel.topic}.{key}", set()).add(float(value))
    return out


def _ros1(path: Path) -> Cells:
    from rosbags.highlevel import AnyReader

    out: Cells = {}
    with AnyReader([path]) as reader:
        for link, _, raw in reader.messages():
            message = reader.deserialize(raw, link.msgtype)
            for axis in ("x", "y", "z"):
                out.setdefault(f"{link.topic}.{axis}", set()).add(float(getattr(message, axis)))
    if not out:
        raise ValueError("no message: it gave up at a damaged index")
    return out


def _db3(path: Path) -> Cells:
    link = sqlite3.connect(path)
    out: Cells = {}
    query = "SELECT name, type, data FROM messages JOIN topics ON topics.id = topic_id"
    for topic, kind, data in link.execute(query):
        if kind == "std_msgs/msg/Float64":
            order = "<" if data[1] & 1 else ">"
            out.setdefault(f"{topic}.data", set()).add(struct.unpack(f"{order}d", data[4:12])[0])
    link.close()
    return out


READERS: dict[str, Callable[[Path, Any], Cells]] = {
    "csv": _text,
    "npy": lambda path, table: _columns("c", _npy(path.read_bytes())),
    "npz": lambda path, table: _npz(path),
    "mat": lambda path, table: _mat(path),
    "mat73": lambda path, table: _mat73(path),
    "parquet": lambda path, table: _parquet(path),
    "mcap": lambda path, table: _mcap(path),
    "ros1": lambda path, table: _ros1(path),
    "db3": lambda path, table: _db3(path),
}


def _quantity(value: Any) -> float | None:
    """A number in SI, from a number or a text with one of a few units; None for anything else."""
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float):
        return float(value)
    found = re.fullmatch(rf"\s*({_NUMBER.pattern})\s*(\S*)\s*", str(value), re.I | re.A)
    unit = None if found is None else found[found.lastindex or 0] if found[0].strip() else None
    if found is None or unit is None:
        return None
    number = found[1]
    unit = str(value).strip()[len(number) :].strip()
    return float(number) * UNITS[unit] if unit in UNITS else None


def _settings(path: Path) -> list[str]:
    """Numbers of a twin file by tomlkit, beside what evertwin makes of them."""
    import tomlkit

    from evertwin.config import read

    spec, document = read(path), tomlkit.parse(path.read_text("utf-8-sig")).unwrap()
    checked = {
        "clock.gap": spec.clock.gap, "arbiter.tolerance": spec.arbiter.tolerance,
        "arbiter.vote": spec.arbiter.vote, "prediction.horizon": spec.prediction.horizon,
        "anomaly.requirement": spec.anomaly.requirement, "tuning.every": spec.tuning.every,
        "trial.alpha": spec.trial.alpha, "trial.segments": spec.trial.segments,
        "prognosis.windows": spec.prognosis.windows, "prognosis.ahead": spec.prognosis.ahead,
    }  # fmt: skip
    for name, value in spec.signals.items():
        checked |= {f"signals.{name}.low": value.low, f"signals.{name}.high": value.high}
    for name, parameter in spec.model.parameters.items():
        checked |= {f"model.parameters.{name}.{key}": getattr(parameter, key)
                    for key in ("value", "low", "high")}  # fmt: skip
    out = []
    for key, ours in checked.items():
        node: Any = document
        for part in key.split("."):
            node = node.get(part) if isinstance(node, dict) else None
        other = None if node is None else _quantity(node)
        if (
            other is not None
            and isinstance(ours, int | float)
            and not math.isclose(float(ours), other, rel_tol=1e-12)
        ):
            out.append(f"{key}: {ours!r}, tomlkit says {other!r}")
    return out


def _history(path: Path) -> list[str]:
    from evertwin.sources.texts.small_table import read_table

    table = read_table(path)
    text = path.read_text("utf-8-sig")
    rows = list(csv.reader(io.StringIO(text)))
    out = []
    for name, values in table.numbers.items():
        heads = [head.partition(" [")[0].strip() for head in rows[0]]
        if name not in heads or (
            name in table.units and table.units[name] not in rows[0][heads.index(name)]
        ):
            continue
        for place, value in zip(table.lines, values.tolist(), strict=True):
            record = next(csv.reader([text.split("\n")[place - 1]]), [])
            other = _cell(record[heads.index(name)], False) if len(record) == len(heads) else None
            if (
                other is not None
                and other != value
                and not (math.isnan(other) and math.isnan(value))
            ):
                out.append(f"{name}, line {place}: {value!r}, csv says {other!r}")
    return out[:5]


def _urdf(path: Path) -> list[str]:
    from evertwin.machines.arm import urdf

    robot = urdf.read(path)
    root = ElementTree.fromstring(path.read_bytes())
    theirs = sorted(float(m.get("value", "nan")) for m in root.iter("mass"))
    ours = sorted(link.mass for link in robot.links.values() if link.mass)
    return [] if ours == [m for m in theirs if m] else [f"masses {ours}, ElementTree says {theirs}"]


SETTINGS: dict[str, Callable[[Path], list[str]]] = {
    "toml": _settings, "history": _history, "urdf": _urdf,
}  # fmt: skip
