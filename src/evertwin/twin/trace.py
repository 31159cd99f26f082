"""What a run looked like, row by row, in bounded memory: for plots, tables and reports.

Up to ``most`` rows are kept as they are; beyond that every second one is dropped, again and again,
so that an hour at 1 kHz and a day at 1 Hz take the same room.

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

__all__ = ["Trace"]


@dataclass
class Trace:
    """Named columns that share their rows.

    >>> Trace().step
    1
    """

    most: int = 200_000
    """Rows kept at most."""
    step: int = 1
    """Every how many rows one is kept."""
    _pieces: list[dict[str, np.ndarray]] = field(default_factory=list, repr=False)
    _kept: int = 0

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """More rows; ``row`` numbers them."""
        keep = columns["row"] % self.step == 0
        if not keep.any():
            return
        self._pieces.append({name: column[keep] for name, column in columns.items()})
        self._kept += int(keep.sum())
        while self._kept > self.most:
            self.step *= 2
            kept = self.columns()
            keep = kept["row"] % self.step == 0
            self._pieces = [{name: column[keep] for name, column in kept.items()}]
            self._kept = int(keep.sum())

    def columns(self) -> dict[str, np.ndarray]:
        """The rows kept."""
        if not self._pieces:
            return {}
        return {
            name: np.concatenate([piece[name] for piece in self._pieces])
            for name in self._pieces[0]
        }
