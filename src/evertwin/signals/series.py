"""A series: channels over strictly increasing stamps; windows are cut, resampled and written so.

>>> import numpy as np
>>> s = Series(Layout.of(v="m/s"), np.array([0, 10**9, 2 * 10**9]), np.array([[0.0], [1.0], [0.5]]))
>>> s.between(10**9, 2 * 10**9).v[:, 0].tolist(), s.period
([1.0, 0.5], 1000000000)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evertwin.errors import DataError
from evertwin.signals.channels import Layout
from evertwin.types import Intervals, Outputs, Stamps, Vector


@dataclass(frozen=True)
class Series:
    """Values (n, k) of the layout's k channels at n stamps [ns].

    >>> import numpy as np
    >>> Series(Layout.of(v="m/s"), np.array([0, 5]), np.zeros((2, 1))).column("v").tolist()
    [0.0, 0.0]
    """

    layout: Layout
    t: Stamps
    v: Outputs

    def __post_init__(self) -> None:
        if self.v.shape != (len(self.t), len(self.layout)):
            raise DataError(
                f"series: expected values of shape ({len(self.t)}, {len(self.layout)}), got "
                f"{self.v.shape}"
            )
        back = np.flatnonzero(np.diff(self.t) <= 0)
        if len(back):
            raise DataError(
                f"series: expected stamps that increase, row {int(back[0]) + 1} does not: "
                "read it through a source, which drops or marks such rows"
            )

    @property
    def seconds(self) -> Intervals:
        """Time since the first stamp [s]."""
        return np.asarray((self.t - self.t[:1]) * 1e-9)

    @property
    def period(self) -> int:
        """Median interval [ns]; 0 for fewer than two rows."""
        return int(np.median(np.diff(self.t))) if len(self.t) > 1 else 0

    def column(self, name: str) -> Vector:
        """One channel, (n,)."""
        return np.asarray(self.v[:, self.layout.index(name)])

    def select(self, names: Sequence[str]) -> Series:
        """The channels called ``names``, in that order."""
        columns = [self.layout.index(name) for name in names]
        return Series(self.layout.select(names), self.t, self.v[:, columns])

    def between(self, start: int, stop: int) -> Series:
        """Rows with ``start`` ≤ t ≤ ``stop`` [ns]."""
        a, b = np.searchsorted(self.t, [start, stop + 1])
        return Series(self.layout, self.t[a:b], self.v[a:b])
