"""Settings of the model: which one, with which options and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from evertwin.errors import UsageError
from evertwin.settings.kinds import Amount, Finite, Spread
from evertwin.settings.notes import Free, Shorthand
from evertwin.settings.section import Section
from evertwin.types import Json


@dataclass(frozen=True)
class ParameterSpec(Section):
    """``[model.parameters.NAME]``: what differs from the model's own proposal.

    >>> ParameterSpec(value=1.0).editable is None
    True
    """

    shorthand = Shorthand("value")

    value: Amount | None = None
    """Start value."""
    unit: str | None = None
    """Unit of the bare numbers of this table; absent: the parameter's, which is SI but in a
    Python model of your own."""
    low: Amount | None = None
    """Lower bound."""
    high: Amount | None = None
    """Upper bound."""
    sigma: Spread | None = None
    """Standard deviation of the prior around the value."""
    editable: bool | None = None
    """May tuning change it?"""
    source: str | None = None
    """Where the value comes from: data sheet, literature, experiment."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unit is not None and {self.value, self.low, self.high, self.sigma} == {None}:
            raise UsageError(f"expected a number in '{self.unit}', got a unit alone")


@dataclass(frozen=True)
class ModelSpec(Section):
    """``[model]``: which model, with which options.

    >>> ModelSpec(kind="thermal").options
    {}
    """

    kind: str
    """Name of a built-in model or of an entry point in the group ``evertwin.models``."""
    options: Annotated[Mapping[str, Json], Free()] = field(default_factory=dict)
    """Keywords of the model's factory."""
    parameters: Mapping[str, ParameterSpec] = field(default_factory=dict)
    """Parameters by name; those not named stay as the model proposes them."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, said in self.options.items():
            if said == "?":
                raise UsageError(f"options: {name}: a question that was left open, answer it")


@dataclass(frozen=True)
class ChangeSpec(Section):
    """``[parameters]``: another value of a parameter.

    >>> ChangeSpec(factor=1.2).value is None
    True
    """

    shorthand = Shorthand("value")

    value: Amount | None = None
    """The new value."""
    factor: Finite | None = None
    """Times the value of today."""
    add: Finite | None = None
    """More than today, in the parameter's unit."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if sum(x is not None for x in (self.value, self.factor, self.add)) != 1:
            raise UsageError("expected one of value, factor or add")
