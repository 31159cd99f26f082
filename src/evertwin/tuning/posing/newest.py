"""Arrays that were computed last, for whoever asks for them again.

A search, the checks before it and after it, and whoever judges the fit ask for predictions at the
same few points: they took two fifths of all that were simulated.

>>> kept, asked = Newest(), []
>>> def double(values):
...     asked.append(values.tolist())
...     return 2.0 * values
>>> [kept.at(np.array([value]), double).tolist() for value in (1.0, 1.0, 3.0)], asked
([[2.0], [2.0], [6.0]], [[1.0], [3.0]])
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evertwin.types import Float64, Vector

MANY = 4
"""So many are kept,"""
LARGE = 2**25
"""of no more than so many bytes together, but for the last one."""


class Newest:
    """Arrays by the point that they were computed at; nobody writes into them.

    >>> Newest().at(np.zeros(1), np.cos).flags.writeable
    False
    """

    def __init__(self) -> None:
        self._by_point: dict[bytes, Float64[np.ndarray, "..."]] = {}

    def at(
        self, point: Vector, compute: Callable[[Vector], Float64[np.ndarray, "..."]]
    ) -> Float64[np.ndarray, "..."]:
        """What ``compute`` gives at a point (k,)."""
        kept, key = self._by_point, point.tobytes()
        found = kept.pop(key, None)
        if found is None:
            found = compute(point)
            found.flags.writeable = False
        kept[key] = found
        while len(kept) > MANY or (
            len(kept) > 1 and sum(one.nbytes for one in kept.values()) > LARGE
        ):
            del kept[next(iter(kept))]
        return found
