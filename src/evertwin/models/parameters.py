"""Parameters: named, with unit, bounds, prior and source.

>>> friction = Parameters((Parameter("Fc", 12.0, "Nm", low=0.0, high=100.0),))
>>> friction.values.tolist(), friction.index("Fc")
([12.0], 0)
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from evertwin.errors import UsageError, few
from evertwin.settings.quantity import Measured, own
from evertwin.signals.channels import position
from evertwin.signals.units import conversion
from evertwin.types import ParameterVector


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    >>> Parameter("mass", 95.0, "kg", low=0.0).editable
    True
    """

    name: str
    value: float
    unit: str
    """Unit of all its numbers; '1' for a pure number. SI but in a function of the user's own."""
    low: float = -math.inf
    high: float = math.inf
    sigma: float = math.inf
    """Standard deviation of the prior around ``value``; infinite: no prior."""
    editable: bool = True
    """May tuning change it? The twin file decides; this is the model's proposal."""
    source: str = ""
    """Where the value comes from: data sheet, literature, experiment, tuned."""
    resists: bool = False
    """Physics knows it above zero alone, as a friction: a fit below is told to be doubtful."""

    def __post_init__(self) -> None:
        conversion(self.unit)
        for name in ("value", "low", "high", "sigma"):
            given = getattr(self, name)
            if isinstance(given, Measured):
                told = own(self.name, given, self.unit, difference=name == "sigma")
                object.__setattr__(self, name, told)
        if not self.low <= self.value <= self.high:
            raise UsageError(
                f"{self.name}: expected a value in [{self.low}, {self.high}] {self.unit}, "
                f"got {self.value}: change the value or its bounds"
            )

    @property
    def fixed(self) -> bool:
        """Do its bounds leave it one value? Then nothing tunes it."""
        return self.low == self.high


@dataclass(frozen=True)
class Parameters:
    """Parameters in the order of the vector ``p``.

    >>> Parameters.of(gain=(1.0, "1")).names
    ('gain',)
    """

    items: tuple[Parameter, ...] = field(default=())

    def __post_init__(self) -> None:
        if len(self._places) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise UsageError(f"parameters: expected each name once, got {twice!r} twice")

    def __repr__(self) -> str:
        told = (f"{one.name}={one.value:.6g} {one.unit}".removesuffix(" 1") for one in self.items)
        return f"<Parameters: {few(told)}>"

    @classmethod
    def of(cls, **items: tuple[float, str]) -> Parameters:
        """Parameters without bounds, given as ``name=(value, unit)``."""
        return cls(tuple(Parameter(name, value, unit) for name, (value, unit) in items.items()))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names in order."""
        return tuple(item.name for item in self.items)

    @property
    def values(self) -> ParameterVector:
        """Values in order, (np,), a fresh array."""
        return np.array([item.value for item in self.items], dtype=np.float64)

    @cached_property
    def low(self) -> ParameterVector:
        """Lower bounds, (np,)."""
        return np.array([item.low for item in self.items], dtype=np.float64)

    @cached_property
    def high(self) -> ParameterVector:
        """Upper bounds, (np,)."""
        return np.array([item.high for item in self.items], dtype=np.float64)

    @cached_property
    def editable(self) -> tuple[str, ...]:
        """Names of the parameters that tuning may change."""
        return tuple(item.name for item in self.items if item.editable and not item.fixed)

    def index(self, name: str) -> int:
        """Position of ``name`` in ``p``.

        Raises:
            UsageError: there is no such parameter; names the nearest one.
        """
        place = self._places.get(name)
        return position(self.names, name, "parameter") if place is None else place

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: place for place, name in enumerate(self.names)}

    def indices(self, names: Sequence[str]) -> np.ndarray:
        """Positions of ``names``, int64."""
        return np.array([self.index(name) for name in names], dtype=np.int64)

    def with_values(self, values: Mapping[str, float] | ParameterVector) -> Parameters:
        """The same parameters with other values (a mapping may name only some)."""
        if isinstance(values, Mapping):
            for name in values:
                self.index(name)
            pairs = [(item, values.get(item.name, item.value)) for item in self.items]
            return self._valued(pairs)
        key = np.asarray(values, dtype=np.float64).tobytes()
        if key not in self._newest:  # asked for again and again, of one version
            self._newest.clear()
            self._newest[key] = self._valued(zip(self.items, values.tolist(), strict=True))
        return self._newest[key]

    @cached_property
    def _newest(self) -> dict[bytes, Parameters]:
        return {}

    def _valued(self, pairs: Iterable[tuple[Parameter, float]]) -> Parameters:
        return Parameters(tuple(replace(item, value=float(value)) for item, value in pairs))

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.items)

    def __getitem__(self, name: str) -> Parameter:
        return self.items[self.index(name)]

    def __add__(self, other: Parameters) -> Parameters:
        return Parameters(self.items + other.items)
