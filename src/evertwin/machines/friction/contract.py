"""What a friction term is: coefficients with units, and what each of them is multiplied with.

A feature is a plain function of numbers, with `math` alone, that Numba can compile:

    feature(v, s, load, T, q, k)

``v``: speed [rad/s or m/s]; ``s``: the law's switch at ``v``, between −1 and 1; ``load``: effort
that the drive transmits [Nm or N]; ``T``: temperature [K]; ``q``: position [rad or m]; ``k``: the
term's shape numbers, ``k[0]``, ``k[1]`` … It is positive against positive motion. Of ``load``,
``T`` and ``q`` it gets NaN unless the term says that it reads them; a machine that does not know
what a law reads refuses the law. The slope bound

    slope(width, load, T, k)

is the largest size of ∂feature/∂v: from it a forward simulation takes its step. ``width`` is the
switch's; 0: a sign, whose jump a machine treats exactly, so that only the rest counts.

>>> def fading(v, s, load, T, q, k):
...     return s / (1.0 + abs(v) / k[0])
>>> def steepest(width, load, T, k):
...     return (1.0 / width if width > 0.0 else 0.0) + 1.0 / k[0]
>>> term = FrictionTerm("fading", (Coefficient("Fh", "Nm", "N", fading, steepest),),
...     (Shape("vh", 0.1, "rad/s", "m/s"),), confused_with=("coulomb",))
>>> term.coefficients[0].parameter("2", slides=True).unit
'N'
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, runtime_checkable

from evertwin.errors import UsageError
from evertwin.models.parameters import Parameter


@runtime_checkable
class Numbers(Protocol):
    """A term's shape numbers: an array in Python, a pointer in compiled code.

    >>> import numpy as np
    >>> isinstance(np.zeros(1), Numbers)
    True
    """

    def __getitem__(self, place: int, /) -> float:
        """The number at ``place``."""
        ...


Feature: TypeAlias = Callable[..., float]
"""``feature(v, s, load, T, q, k)``."""
Slope: TypeAlias = Callable[..., float]
"""``slope(width, load, T, k)``."""


@dataclass(frozen=True)
class Shape:
    """A number inside a term's features: it is not linear, and starts fixed.

    >>> Shape("vs", 0.2, "rad/s", "m/s").parameter("1").name
    'vs1'
    """

    name: str
    value: float
    unit: str
    """Where the drive turns."""
    sliding: str
    """Unit where it slides."""
    low: float = 1e-6
    high: float = 100.0

    def parameter(self, suffix: str = "", slides: bool = False) -> Parameter:
        """As a parameter of a model."""
        unit = self.sliding if slides else self.unit
        return Parameter(self.name + suffix, self.value, unit, self.low, self.high, editable=False)


@dataclass(frozen=True)
class Coefficient:
    """A linear number of a term, with its feature. See the module.

    >>> Coefficient("Fv", "Nms/rad", "Ns/m", lambda v, *_: v, lambda *_: 1.0).bias
    False
    """

    name: str
    """Letters and underscores: the number of a joint is put behind it."""
    unit: str
    """Where the drive turns."""
    sliding: str
    """Unit where it slides."""
    feature: Feature
    slope: Slope
    resists: bool = False
    """Does physics know it above zero, unless another term of the law is confused with it?"""
    bias: bool = False
    """Is it a force of rest (constant, of the position)? What that takes out one way it gives back
    the other: no friction."""

    def parameter(self, suffix: str = "", slides: bool = False, resists: bool = False) -> Parameter:
        """As a parameter of a model."""
        unit = self.sliding if slides else self.unit
        return Parameter(self.name + suffix, 0.0, unit, resists=self.resists and resists)


@dataclass(frozen=True)
class FrictionTerm:
    """One term of a friction law. See the module for an example."""

    name: str
    """As in a law's text: ``stribeck`` in ``tanh+stribeck``."""
    coefficients: tuple[Coefficient, ...]
    shape: tuple[Shape, ...] = ()
    reads: tuple[Literal["load", "T", "q"], ...] = ()
    """What its features depend on besides speed and switch."""
    confused_with: tuple[str, ...] = ()
    """Terms that a fit trades for this one: only their sum has to resist, not each of them."""
    always: bool = False
    """Is it in every law? Else it is a rung of the ladder."""
    cause: str = ""
    """What the drive does where this term pays, in a few words."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its numbers, linear ones first."""
        return (*(x.name for x in self.coefficients), *(x.name for x in self.shape))

    def __post_init__(self) -> None:
        for item in self.coefficients:
            if not item.name.replace("_", "").isalpha():
                raise UsageError(
                    f"friction term {self.name!r}: expected coefficients named by letters and '_' "
                    f"(a joint's number is put behind them), got {item.name!r}"
                )
        if not self.coefficients or not self.name.isidentifier():
            raise UsageError(
                f"friction term {self.name!r}: expected a name such as 'stribeck' and at least one "
                "coefficient"
            )
        if not set(self.reads) <= {"load", "T", "q"}:
            raise UsageError(
                f"friction term {self.name!r}: expected reads of load, T and q, got {self.reads}"
            )
