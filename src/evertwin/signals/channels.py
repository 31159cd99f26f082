"""Channels and layouts: what the columns of an array mean.

>>> pose = Layout((Channel("x", "m", group="pose"), Channel("heading", "rad", kind="angle")))
>>> pose.names, pose.index("heading"), len(pose)
(('x', 'heading'), 1, 2)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from evertwin.errors import UsageError, few, nearest
from evertwin.signals.units import conversion, si_unit
from evertwin.types import Outputs


def position(names: Sequence[str], name: str, what: str) -> int:
    """Where ``name`` stands among ``names``.

    Raises:
        UsageError: nowhere; ``what`` was looked for, and the nearest name is given.
    """
    if name in names:
        return names.index(name)
    raise UsageError(f"no {what} {name!r}, {nearest(name, names)}")


@dataclass(frozen=True)
class Channel:
    """One signal: its name, SI unit and what is physically possible.

    >>> Channel("speed", "m/s", low=-1.0, high=1.0).group
    'speed'
    """

    name: str
    unit: str
    """SI unit that the values are stored in; '1' for a pure number."""
    kind: Literal["linear", "angle"] = "linear"
    """Residuals of an angle wrap to (−π, π]."""
    group: str = ""
    """Channels of one group are voted on and adopted together; by default its own name."""
    low: float = -math.inf
    """Smallest physically possible value."""
    high: float = math.inf
    """Largest physically possible value."""
    rate: float = math.inf
    """Largest physically possible change per second."""
    stated: str = ""
    """The unit in which a function of the user's own has it, where that is not SI."""

    def __post_init__(self) -> None:
        conversion(self.unit)
        if not self.group:
            object.__setattr__(self, "group", self.name)
        if not self.low < self.high:
            raise UsageError(f"{self.name}: expected low < high, got {self.low} and {self.high}")

    def in_si(self) -> Channel:
        """The channel in SI, which remembers the unit that was stated.

        >>> pressure = Channel("p", "bar", high=6.0).in_si()
        >>> pressure.unit, pressure.high, pressure.stated
        ('Pa', 600000.0, 'bar')
        """
        factor, zero = conversion(self.unit)
        if (factor, zero) == (1.0, 0.0):
            return self
        low, high = self.low * factor + zero, self.high * factor + zero
        return replace(
            self, unit=si_unit(self.unit), low=low, high=high, rate=self.rate * factor,
            stated=self.unit,
        )  # fmt: skip


@dataclass(frozen=True)
class Layout:
    """Channels in the order of an array's columns.

    >>> Layout.of(q1="rad", q2="rad").names
    ('q1', 'q2')
    """

    channels: tuple[Channel, ...] = field(default=())

    def __post_init__(self) -> None:
        names = [channel.name for channel in self.channels]
        for name in names:
            if names.count(name) > 1:
                raise UsageError(f"layout: expected each name once, got {name!r} twice")

    def __repr__(self) -> str:
        return f"<Layout: {few(f'{one.name} [{one.unit}]' for one in self.channels)}>"

    @classmethod
    def of(cls, **units: str) -> Layout:
        """A layout of linear channels, given as ``name="unit"``."""
        return cls(tuple(Channel(name, unit) for name, unit in units.items()))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names in order."""
        return tuple(channel.name for channel in self.channels)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Units in order."""
        return tuple(channel.unit for channel in self.channels)

    @cached_property
    def angles(self) -> np.ndarray:
        """True where a channel is an angle, (k,)."""
        return np.array([channel.kind == "angle" for channel in self.channels], dtype=np.bool_)

    @cached_property
    def temperatures(self) -> np.ndarray:
        """True where a channel is a temperature, whose zero tells nothing of its size, (k,)."""
        return np.array([channel.unit == "K" for channel in self.channels], dtype=np.bool_)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups, in order of their first channel."""
        return tuple(dict.fromkeys(channel.group for channel in self.channels))

    @cached_property
    def group_of(self) -> np.ndarray:
        """Number of each channel's group, (k,) int64."""
        return np.array([self.groups.index(c.group) for c in self.channels], dtype=np.int64)

    def in_si(self) -> Layout:
        """The same channels in SI; each remembers the unit that was stated."""
        return Layout(tuple(channel.in_si() for channel in self.channels))

    @cached_property
    def stated(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Factor and offset of each channel, (k,): SI = factor · stated + offset; None: all SI."""
        if not any(channel.stated for channel in self.channels):
            return None
        pairs = [conversion(channel.stated or channel.unit) for channel in self.channels]
        return np.array([f for f, _ in pairs]), np.array([zero for _, zero in pairs])

    def to_stated(self, values: Any) -> Any:
        """Values in SI, (…, k), in the units that were stated.

        >>> Layout.of(p="bar", t="degC").in_si().to_stated(np.array([2e5, 283.15])).tolist()
        [2.0, 10.0]
        """
        return values if self.stated is None else (values - self.stated[1]) / self.stated[0]

    def from_stated(self, values: Any) -> Any:
        """Values in the units that were stated, (…, k), in SI."""
        if self.stated is None:
            return values
        factor, offset = self.stated
        return np.multiply(values, factor) + offset

    def index(self, name: str) -> int:
        """Column of ``name``.

        Raises:
            UsageError: there is no such channel; names the nearest one.
        """
        return position(self.names, name, "channel")

    def __len__(self) -> int:
        return len(self.channels)

    def __iter__(self) -> Iterator[Channel]:
        return iter(self.channels)

    def __add__(self, other: Layout) -> Layout:
        return Layout(self.channels + other.channels)

    def select(self, names: Sequence[str]) -> Layout:
        """The channels called ``names``, in that order."""
        return Layout(tuple(self.channels[self.index(name)] for name in names))


def wrap(residual: Outputs, angles: np.ndarray) -> Outputs:
    """Residuals with angles wrapped to (−π, π].

    >>> wrap(np.array([[7.0, 7.0]]), np.array([False, True])).round(3).tolist()
    [[7.0, 0.717]]
    """
    if not angles.any():
        return residual
    wrapped = residual.copy()
    wrapped[..., angles] = np.pi - np.mod(np.pi - residual[..., angles], 2 * np.pi)
    return wrapped


def unwrapped(angle: np.ndarray) -> np.ndarray:
    """An angle [rad] that goes on past ±π, (n,); NaN stays, and the turn goes on behind it.

    >>> unwrapped(np.array([3.0, np.nan, -3.0])).round(3).tolist()
    [3.0, nan, 3.283]
    """
    found, known = angle.copy(), np.isfinite(angle)
    found[known] = np.unwrap(angle[known])
    return found


def same_turn(values: Outputs, measured: Outputs, angles: np.ndarray) -> Outputs:
    """Values with angles in the turn of what is measured beside them, or was measured last.

    >>> measured = np.array([[-0.6], [np.nan]])
    >>> same_turn(np.array([[12.0], [12.1]]), measured, np.array([True])).round(3).tolist()
    [[-0.566], [-0.466]]
    """
    if not angles.any():
        return values
    known = np.isfinite(measured)
    newest = np.maximum.accumulate(np.where(known, np.arange(len(measured))[:, None], -1), axis=0)
    beside = np.where(newest < 0, 0.0, np.take_along_axis(measured, np.maximum(newest, 0), axis=0))
    return np.where(angles, beside - wrap(beside - values, angles), values)
