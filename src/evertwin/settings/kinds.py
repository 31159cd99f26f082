"""Kinds of number that settings of several rooms share; the unit and the range are said once.

>>> from dataclasses import dataclass
>>> from evertwin.settings.section import Section
>>> @dataclass(frozen=True)
... class Clock(Section):
...     gap: Duration = 1.0
>>> Clock(gap=0.0)
Traceback (most recent call last):
evertwin.errors.UsageError: gap: expected a number above 0, got 0.0
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

from annotated_types import Ge, Gt, Le, Lt

from evertwin.settings.notes import Quantity

Amount: TypeAlias = Annotated[float, Quantity()]
"""In the unit of the channel or parameter that it is about."""
Spread: TypeAlias = Annotated[float, Quantity(difference=True), Ge(0.0)]
"""A span or deviation of such an amount."""
Size: TypeAlias = Annotated[float, Quantity(difference=True), Gt(0.0)]
"""A `Spread` that is not zero."""
Seconds: TypeAlias = Annotated[float, Quantity("s", difference=True)]
Duration: TypeAlias = Annotated[float, Quantity("s", difference=True), Gt(0.0)]
Hertz: TypeAlias = Annotated[float, Quantity("Hz"), Ge(1e-9), Le(1e7)]
Radians: TypeAlias = Annotated[float, Quantity("rad"), Gt(0.0)]
Finite: TypeAlias = Annotated[float, Ge(-1e15), Le(1e15)]
Positive: TypeAlias = Annotated[float, Gt(0.0)]
Fraction: TypeAlias = Annotated[float, Gt(0.0), Lt(1.0)]
