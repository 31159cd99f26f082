"""A chunk: samples of ONE source as they arrived, before they share a clock.

>>> import numpy as np
>>> Chunk("pose", np.array([0, 10]), np.array([[0.0], [0.1]])).v.shape
(2, 1)
"""

from __future__ import annotations

from typing import NamedTuple

from evertwin.types import Outputs, Stamps


class Chunk(NamedTuple):
    """n ≥ 1 samples of one source, in the order of their arrival.

    >>> import numpy as np
    >>> Chunk("odometry", np.array([5]), np.array([[0.2, 0.0]])).source
    'odometry'
    """

    source: str
    """Name of the source in the twin file."""
    t: Stamps
    """Stamps [ns] on the source's own clock, already corrected by its known offset."""
    v: Outputs
    """Values in SI units, (n, channels of the source)."""
    task: int = 0
    """Number of the task (one file, one work cycle) that the samples belong to."""
    clock: tuple[int, ...] | None = None
    """What a live source knows of the machine's clock: is given to its ``go_on``, if it has one,
    after a restart."""
