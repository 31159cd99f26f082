"""What a run looked like, row by row, in bounded memory: for plots, tables and reports.

Up to ``most`` rows are kept as they are; beyond that every second one is dropped, again and again,
so that an hour at 1 kHz and a day at 1 Hz take the same room. Which rows are kept follows from
their numbers alone, never from where the data was cut.

>>> trace = Trace(most=4)
>>> for k in range(10):
...     trace.add({"row": np.array([k]), "x": np.array([[0.1 * k]])})
>>> trace.columns()["row"].tolist()
[0, 4, 8]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


class Tail:
    """The newest rows, one by one: ``most`` of them at least. Adding some costs what they cost,
    however many came before.

    >>> tail = Tail(most=2)
    >>> for k in range(7):
    ...     tail.add({"row": np.array([k])})
    >>> tail.columns()["row"].tolist()
    [3, 4, 5, 6]
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._room: dict[str, np.ndarray] = {}
        self._kept = 0

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """More rows."""
        most, came = self._most, len(columns["row"])
        if not self._room:
            self._room = {
                name: np.empty((2 * most, *column.shape[1:]), column.dtype)
                for name, column in columns.items()
            }
        stay = self._kept if self._kept + came <= 2 * most else max(most - came, 0)
        came = min(came, 2 * most)
        for name, column in columns.items():
            room = self._room[name]
            room[:stay] = room[self._kept - stay : self._kept]
            room[stay : stay + came] = column[len(column) - came :]
        self._kept = stay + came

    def columns(self) -> dict[str, np.ndarray]:
        """They, as views that hold until more rows are added."""
        return {name: column[: self._kept] for name, column in self._room.items()}


@dataclass
class Trace:
    """Named columns that share their rows.

    >>> Trace().step
    1
    """

    most: int = 100_000
    """Rows kept at most."""
    step: int = 1
    """Every how many rows one is kept."""
    remembers: bool = False
    """Is what was added kept for `fresh` too?"""
    _room: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
    _kept: int = 0
    _fresh: list[dict[str, np.ndarray]] = field(default_factory=list, repr=False)

    def places(self, row: int) -> slice:
        """Which rows of a piece that starts at ``row`` are worth handing to `add`."""
        return slice(-row % self.step, None, self.step)

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """More rows; ``row`` numbers them, increasing."""
        if self.remembers:
            self._fresh.append(dict(columns))
        if not self._room:
            # pages that are never written take no memory
            self._room = {
                name: np.empty((self.most, *column.shape[1:]), column.dtype)
                for name, column in columns.items()
            }
        rows, at = columns["row"], 0
        while True:
            wanted = at + np.flatnonzero(rows[at:] % self.step == 0)
            part = wanted[: self.most - self._kept]
            whole = len(part) == len(rows)
            for name, column in columns.items():
                kept = column if whole else column[part]
                self._room[name][self._kept : self._kept + len(part)] = kept
            self._kept += len(part)
            if len(part) == len(wanted):
                return
            at = int(wanted[len(part)])
            self._thin()

    def fresh(self) -> dict[str, np.ndarray]:
        """What was added since the last call: adding it to a trace as old makes the same trace."""
        parts, self._fresh = self._fresh, []
        names = parts[0] if parts else {}
        return {name: np.concatenate([part[name] for part in parts]) for name in names}

    def _thin(self) -> None:
        """Drops every second row."""
        self.step *= 2
        keep = np.flatnonzero(self._room["row"][: self._kept] % self.step == 0)
        for column in self._room.values():
            column[: len(keep)] = column[keep]
        self._kept = len(keep)

    def columns(self) -> dict[str, np.ndarray]:
        """The rows kept, as views that hold until more rows are added."""
        return {name: column[: self._kept] for name, column in self._room.items()}
