"""Cells of a source, and the SI values that are made of them.

``si = to_si(cell · scale + offset, unit)``; a sentinel becomes infinite.

>>> in_si = InSi.of((Cell("v", "v", "cm/s", sentinels=(-99.0,)), Cell("q", 1, "rad", scale=-1.0)))
>>> in_si(np.array([[5.0, 1.0], [-99.0, 2.0]]))[0].tolist()
[[0.05, -1.0], [inf, -2.0]]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.signals import conversion
from evertwin.signals.whole_steps import whole_steps
from evertwin.types import Bool, Float64, Outputs


@dataclass(frozen=True)
class Cell:
    """Where a channel comes from.

    >>> Cell("q1", 1, "deg").scale
    1.0
    """

    channel: str
    column: str | int
    """Name, or position from 0."""
    unit: str
    """Unit of the cell after scale and offset."""
    scale: float = 1.0
    offset: float = 0.0
    sentinels: tuple[float, ...] = ()
    """Raw cells that mean "no measurement", such as -9999 or 65535."""
    step: float = 0.0
    """What is no whole number of these is cut towards 0; 0: nothing is."""

    def __post_init__(self) -> None:
        conversion(self.unit)
        if not (np.isfinite([self.scale, self.offset]).all() and self.scale):
            raise UsageError(f"{self.channel}: expected a finite scale other than 0 and an offset")


class InSi(NamedTuple):
    """What makes SI values of cells: one number for each of them, (k,).

    >>> InSi.of((Cell("v", "v", "cm/s"),)).factor.tolist()
    [0.01]
    """

    scale: Float64[np.ndarray, " k"]
    offset: Float64[np.ndarray, " k"]
    step: Float64[np.ndarray, " k"]
    factor: Float64[np.ndarray, " k"]
    zero: Float64[np.ndarray, " k"]
    sentinels: tuple[tuple[int, tuple[float, ...]], ...]
    """Of the cells that have some."""

    @classmethod
    def of(cls, cells: Sequence[Cell]) -> InSi:
        """Of these cells."""
        told = [(c.scale, c.offset, c.step, *conversion(c.unit)) for c in cells]
        scale, offset, step, factor, zero = np.array(told, dtype=np.float64).reshape(-1, 5).T.copy()
        known = tuple((j, c.sentinels) for j, c in enumerate(cells) if c.sentinels)
        return cls(scale, offset, step, factor, zero, known)

    def __call__(self, raw: Outputs) -> tuple[Outputs, Bool[np.ndarray, "n k"]]:
        """SI values (n, k) of raw ones, and where one is a sentinel."""
        value = whole_steps(raw * self.scale + self.offset, self.step)
        si, none = value * self.factor + self.zero, np.zeros(raw.shape, dtype=np.bool_)
        for j, known in self.sentinels:
            none[:, j] = np.isin(raw[:, j], known)
        si[none] = np.inf
        return si, none
