"""Scope exports (TwinCAT) whose head stands in front of each signal: pairs of stamp and value.

Each line of the head has its key where a column of time stands below, and says the same of every
signal behind it (``Name;position;Name;speed``, ``Unit;mm;Unit;mm/s``); signals with the same stamps
may share one.

>>> rows = [b"Name;a;b;Name;c", b"SampleTime[ms];2;2;SampleTime[ms];4", b"Unit;mm;A;Unit;V"]
>>> head_of([*rows, b"", b"0;1;2;0;3", b"2;1,5;2;4;3"]).clocks
((0, (1, 2)), (3, (4,)))
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from evertwin.sources.columns.table import Recording
from evertwin.sources.texts.dialect import encoding_of, shown
from evertwin.sources.texts.laid_out import Head, parts_of_text, spelled, top_of

_TOP = 100
"""Lines among which the head stands."""
_LEAST = 3
"""Lines of such a head."""
_STEP = {1.0: "ms", 1e-3: "s", 1e3: "us", 1e6: "ns"}
"""What the step of the stamps is over the sample time in ms → their unit."""


class _Block(NamedTuple):
    first: int
    stop: int
    sign: bytes
    rows: dict[bytes, list[bytes]]


def open_scope(path: Path) -> Recording | None:
    """The signals of such an export; None: it is none.

    Raises:
        DataError: its rows are not as its head says.
    """
    lines = top_of(path)
    block = _block(lines)
    head = None if block is None else head_of(lines)
    if block is None or head is None:
        return None
    encoding = encoding_of(lines[: head.skip])
    clocks = [clock for clock, _ in head.clocks]
    notes = [
        f"{shown(name, encoding)}: the scope scales it ({shown(key, encoding)} "
        f"{shown(block.rows[key][j], encoding)}): an export without scaled values holds raw ones"
        for key, usual in ((b"ScaleFactor", 1.0), (b"Offset", 0.0)) if key in block.rows
        for j, name in enumerate(head.names)
        if j not in clocks and _number(block.rows[key], j, usual) != usual
    ]  # fmt: skip
    return Recording(path, "csv", parts_of_text(path, head, lines), tuple(notes))


def head_of(lines: Sequence[bytes]) -> Head | None:
    """How a scope's export is laid out; None: there is no such head."""
    block = _block(lines)
    if block is None:
        return None
    names = block.rows[b"Name"]
    clocks = [j for j, cell in enumerate(names) if cell == names[0]]
    ends = [*clocks[1:], len(names)]
    skip = next((i for i in range(block.stop, len(lines)) if lines[i].strip()), block.stop)
    body = [line.split(block.sign) for line in lines[skip:_TOP] if line.strip()]
    comma = block.sign != b"," and any(b"," in cell for row in body for cell in row)
    encoding = encoding_of(lines[:skip])
    sample = next((row for key, row in block.rows.items() if key.startswith(b"SampleTime")), [])
    units = [
        _of_time(body, j, _number(sample, j + 1, 0.0)) if j in clocks
        else spelled(shown(_at(block.rows.get(b"Unit", []), j), encoding))
        for j in range(len(names))
    ]  # fmt: skip
    titles = [
        b"time of " + (_at(names, j + 1)) if j in clocks else names[j] for j in range(len(names))
    ]
    pairs = [(j, tuple(range(j + 1, end))) for j, end in zip(clocks, ends, strict=True)]
    return Head(block.sign, comma, tuple(titles), tuple(units), skip, tuple(pairs))


def _block(lines: Sequence[bytes]) -> _Block | None:
    """Lines that have their keys in the same places, several of them, or say how they sample."""
    for sign in (b"\t", b";", b","):
        places: tuple[int, ...] = ()
        first, rows = 0, dict[bytes, list[bytes]]()
        for i, line in enumerate([*lines[:_TOP], b""]):
            cells = [cell.strip() for cell in line.split(sign)]
            keys = tuple(j for j, cell in enumerate(cells) if cell and cell == cells[0])
            keyed = len(cells) > 1 and bool(cells[0]) and not _is_number(cells[0])
            if rows and not (keyed and keys == places):
                sampled = any(key.startswith(b"SampleTime") for key in rows)
                if len(rows) >= _LEAST and b"Name" in rows and (len(places) > 1 or sampled):
                    return _Block(first, i, sign, rows)
                rows = {}
            if keyed:
                first, places = (first, places) if rows else (i, keys)
                rows[cells[0]] = cells
    return None


def _is_number(cell: bytes) -> bool:
    try:
        float(cell.replace(b",", b"."))
    except ValueError:
        return False
    return True


def _at(cells: Sequence[bytes], j: int) -> bytes:
    return cells[j] if j < len(cells) else b""


def _number(cells: Sequence[bytes], j: int, usual: float) -> float:
    cell = _at(cells, j).replace(b",", b".")
    return float(cell) if cell and _is_number(cell) else usual


def _of_time(body: Sequence[Sequence[bytes]], j: int, sample: float) -> str:
    """The unit of stamps, by what they advance by; empty where it is not clear."""
    stamps = [_number(row, j, float("nan")) for row in body]
    steps = [b - a for a, b in pairwise(stamps) if b > a]
    if not steps or not sample > 0.0:
        return "ms"
    ratio = sorted(steps)[len(steps) // 2] / sample
    return next((unit for one, unit in _STEP.items() if abs(ratio / one - 1.0) < 0.2), "")
