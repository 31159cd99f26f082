"""What the data proposes: the range of an input, the levels of a table, how long a lag may be.

"The action space has to cover the complete observed space", and "the resolution must be high
enough that the quantization noise is significantly smaller than the expected model deviation",
starting very rough (Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent Digital
Twin", section 3). Commands of a machine often come in few distinct values: then these are the
levels. Otherwise the range is cut evenly.

>>> import numpy as np
>>> propose_levels(np.repeat([0.0, 0.05, 0.10], 9)).tolist()
[0.0, 0.05, 0.1]
>>> propose_levels(np.linspace(0.0, 1.0, 999), count=4).round(3).tolist()
[0.125, 0.375, 0.625, 0.875]
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.fold import Block
from evertwin.models.contract import Model
from evertwin.types import Float64, Vector

LEVELS = 20
"""Levels of a table over a continuous range: rough on purpose, quantisation is tuned out later."""
MOST_LEVELS = 10_000
DISTINCT = 41
"""Up to this many distinct commands are taken as the levels themselves."""


@dataclass(frozen=True)
class Rows:
    """What a kind of term looks at before it proposes.

    >>> from evertwin.fold import make_block
    >>> from evertwin.machines.mobile import Robot1D
    >>> rows = make_block(t=np.arange(9) * 10**9, u=np.arange(9.0)[:, None], y=np.zeros((9, 1)))
    >>> seen = Rows(Robot1D(), (rows,), ("v",), 2.0)
    >>> seen.chosen, seen.span
    (('v',), 8.0)
    """

    model: Model
    """Base model, without terms."""
    windows: tuple[Block, ...]
    channels: tuple[str, ...]
    """Inputs or states that may be corrected; empty: all inputs."""
    horizon: float
    """Length of a prediction [s]: no lag is sought beyond it."""
    quantum: float = 0.0
    """Step of a table's levels; 0: proposed from the data."""

    @cached_property
    def reach(self) -> Mapping[str, float]:
        """Largest size of every input, bar outliers."""
        return {name: reach_of(self.inputs(name)) for name in self.model.inputs.names}

    def warm(self, channel: str) -> bool:
        """Is it a temperature, whose zero tells nothing of its size?"""
        inputs = self.model.inputs
        return bool(inputs.temperatures[inputs.index(channel)])

    def size(self, channel: str) -> float:
        """What a change of the input is large beside: its largest size; of a temperature its
        range."""
        return float(np.ptp(self.inputs(channel))) if self.warm(channel) else self.reach[channel]

    @property
    def chosen(self) -> tuple[str, ...]:
        """Inputs that may be corrected and that do something."""
        return tuple(
            name
            for name in (self.channels or self.model.inputs.names)
            if self.reach.get(name, 0.0) > 0.0
        )

    @property
    def states(self) -> tuple[str, ...]:
        """States that may be coupled to: those that are named."""
        return tuple(name for name in self.channels if name in self.model.states.names)

    def others(self, channel: str) -> tuple[str, ...]:
        """Other inputs that do something."""
        return tuple(name for name, size in self.reach.items() if name != channel and size > 0.0)

    def inputs(self, channel: str) -> Vector:
        """Finite values of one input."""
        return inputs_of(self.windows, self.model.inputs.index(channel))

    @cached_property
    def step(self) -> float:
        """Median time from row to row [s]."""
        return float(np.median(np.concatenate([w.dt[1:] for w in self.windows])))

    @property
    def span(self) -> float:
        """Length of the longest window [s]."""
        return max(float(w.t[-1] - w.t[0]) * 1e-9 for w in self.windows)


def inputs_of(windows: Sequence[Block], column: int) -> Vector:
    """Finite values of one input over all windows."""
    values = np.concatenate([w.u[:, column] for w in windows])
    return np.asarray(values[np.isfinite(values)])


def propose_levels(
    u: Vector, count: int = LEVELS, quantum: float = 0.0
) -> Float64[np.ndarray, " levels"]:
    """Levels that cover the observed inputs, rising.

    Args:
        u: observed inputs.
        count: levels over a continuous range.
        quantum: step between levels; 0: chosen here.

    Raises:
        DataError: the input never changes.
    """
    low, high = float(u.min()), float(u.max())
    if not low < high:
        raise DataError(
            f"correction: expected an input that changes, got {low:g} throughout: "
            "record other commands too"
        )
    if quantum > 0.0:
        level_count(low, high, quantum)
        first, last = np.floor(low / quantum + 1e-9), np.ceil(high / quantum - 1e-9)
        return np.arange(first, last + 1) * quantum
    distinct = np.unique(u.round(12))
    if len(distinct) <= min(DISTINCT, max(len(u) // 4, 2)):
        return distinct
    edges = np.linspace(low, high, count + 1)
    return 0.5 * (edges[1:] + edges[:-1])


def level_count(low: float, high: float, quantum: float) -> int:
    """Levels from ``low`` to ``high``, a ``quantum`` apart.

    Raises:
        UsageError: far too many.

    >>> level_count(0.0, 0.4, 0.1)
    5
    """
    count = (high - low) / quantum + 1.0
    if not count <= MOST_LEVELS:
        raise UsageError(
            f"quantum: {quantum:g} makes {count:.3g} levels from {low:g} to {high:g}: expected at "
            f"most {MOST_LEVELS}: take a coarser one"
        )
    return math.ceil(count - 1e-9)


def reach_of(u: Vector) -> float:
    """Largest size of the input, bar the odd outlier: 99.5 % of the non-zero ones lie below."""
    size = np.abs(u[u != 0.0])
    return float(np.quantile(size, 0.995)) if len(size) else 0.0


def quiet_level(u: Vector) -> float:
    """Half the smallest command that is not zero, where commands come in few distinct values.

    Below it "no command" is meant, whatever the drive makes of small commands.
    """
    distinct = np.unique(np.abs(u).round(12))
    distinct = distinct[distinct > 0.0]
    return 0.5 * float(distinct[0]) if 0 < len(distinct) <= DISTINCT else 0.0


def rows_within(windows: Sequence[Block], seconds: float) -> int:
    """The most rows in any stretch of ``seconds``: what a lag must remember, for a rate limit
    before it makes each row another one."""
    most = 1
    for window in windows:
        upto = np.searchsorted(window.t, window.t + round(seconds * 1e9), side="right")
        most = max(most, int((upto - np.arange(len(window.t))).max()))
    return most
