"""Signals of one file that have clocks of their own: each clock with what it stamps is a table.

A structure with a field ``Time`` stamps what else of it has as many rows: so MATLAB's timeseries
are kept as structures (``level.Time``, ``level.Data``), and so Simulink saves them (``out.time``,
``out.signals.values``). Structures with the same stamps are one table. Of the other arrays those of
another length than most are a table where one of them is a time.

>>> a, b = np.arange(4.0), np.arange(3.0) / 2
>>> named = {"u.Time": a, "u.Data": a, "y.Time": b, "y.Data": b, "v.Time": a, "v.Data": a}
>>> found, _ = by_clock(named)
>>> {name: list(part) for name, part in found.items()}
{'u': ['u.Time', 'u.Data', 'v.Data'], 'y': ['y.Time', 'y.Data']}
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping

import numpy as np

from evertwin.sources.columns.names import distinct

_CLOCKS = ("time", "t")
_SIGNALS = ("signals", "data", "values", "value")
"""Words of a path that say nothing of the signal."""
_UNITS = ("datainfo.units", "units", "unit")
"""Where a structure says a unit."""


def by_clock(arrays: Mapping[str, np.ndarray]) -> tuple[dict[str, dict[str, np.ndarray]], set[str]]:
    """The vectors of each structure that has a clock, by the signal that is its first; and the
    names of all that are in one, the same stamps that another signal has too among them.

    Args:
        arrays: vectors by their path, each (n,).
    """
    clocks = {
        stem: name for name, array in arrays.items()
        for stem, _, last in (name.rpartition("."),)
        if stem and last.lower() in _CLOCKS and _is_clock(array)
    }  # fmt: skip
    parts: dict[tuple[int, bytes], dict[str, np.ndarray]] = {}
    names, used = dict[tuple[int, bytes], str](), set[str]()
    keys = {name: (len(arrays[name]), _digest(arrays[name])) for name in clocks.values()}
    for name, array in arrays.items():
        stem = next((one for one in stems(name) if one in clocks), "")
        clock = clocks.get(stem, name)
        if clock == name or len(array) != len(arrays[clock]):
            continue
        key = keys[clock]
        names.setdefault(key, _signal(stem))
        parts.setdefault(key, {clock: arrays[clock]})[name] = array
        used |= {clock, name}
    titles = distinct(list(names.values()))
    return dict(zip(titles, parts.values(), strict=True)), used


def stems(name: str) -> Iterator[str]:
    """The structures that a variable is in, the nearest first.

    >>> list(stems("log.level.Data"))
    ['log.level', 'log']
    """
    while "." in name:
        name = name.rpartition(".")[0]
        yield name


def _digest(array: np.ndarray) -> bytes:
    return hashlib.sha256(np.ascontiguousarray(array, dtype=np.float64).tobytes()).digest()


def _is_clock(array: np.ndarray) -> bool:
    if array.dtype.kind not in "fiu" or len(array) < 2:
        return False
    return bool(np.all(np.diff(array.astype(np.float64)) >= 0.0))


def _signal(stem: str) -> str:
    """What a signal is called: the last part of its path that says something."""
    parts = [part for part in stem.split(".") if part.lower() not in _SIGNALS]
    return parts[-1] if parts else stem


def units_of(name: str, texts: Mapping[str, str]) -> str:
    """The unit that the structure around a vector says, or none.

    >>> units_of("log.level.Data", {"log.level.DataInfo.Units": "cm"})
    'cm'
    """
    stem, _, last = name.rpartition(".")
    known = {path.lower(): text for path, text in texts.items()}
    places = ("timeinfo.units",) if last.lower() in _CLOCKS else _UNITS
    return next(
        (said for place in places if (said := known.get(f"{stem}.{place}".lower(), ""))), ""
    )
