"""What every living machine is: it advances from sample to sample and can be told things.

>>> Sample("pose", 0.5, 3, {"x": 1.0}).columns
{'t': 0.5, 'seq': 3, 'x': 1.0}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from evertwin.worlds.live.orders import Knobs


class Sample(NamedTuple):
    """What a machine publishes at one time, as one. See the module for an example."""

    topic: str
    """What it is about; a machine has one or several."""
    t: float
    """Seconds of the machine's clock; whoever publishes adds the clock's start."""
    seq: int
    """Number of the sample in its topic, from 0 at each start."""
    values: Mapping[str, float | Sequence[float] | bytes]
    """By name; NaN for no value; bytes are a picture (PNG)."""

    @property
    def columns(self) -> dict[str, float | Sequence[float] | bytes]:
        """Time, number and values by name."""
        return {"t": self.t, "seq": self.seq, **self.values}


class Machine(Protocol):
    """A machine that runs.

    >>> hasattr(Machine, "advance")
    True
    """

    name: str
    knobs: Knobs
    units: Mapping[str, Mapping[str, str]]
    """Topic to the unit of each of its values."""

    @property
    def clock(self) -> float:
        """Seconds since it was switched on."""
        ...

    def advance(self) -> list[Sample]:
        """Runs up to its next samples."""
        ...
