"""What the breakdown file says of a component, its parameters, its data, its wear and its sensors.

Grades go from 1 to 5. Effect on the machine's health: 1 none, 2 little, 3 quality suffers, 4 the
machine runs badly, 5 it stops. Proneness to failure: 1 never, 2 once in its life, 3 every few
years, 4 every year, 5 more often.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

from annotated_types import Ge, Gt, Le, Lt

from evertwin.errors import UsageError
from evertwin.settings.kinds import Amount, Duration, Positive, Size, Spread
from evertwin.settings.notes import Free, Key, Quantity, Shorthand
from evertwin.settings.section import Section
from evertwin.types import Json

DataKind: TypeAlias = Literal["structural", "kinematic", "dynamic"]
Level: TypeAlias = Literal["white", "grey", "black"]
Role: TypeAlias = Literal["critical", "supporting"]
Grade: TypeAlias = Annotated[float, Ge(1.0), Le(5.0)]
Share: TypeAlias = Annotated[float, Quantity("1"), Ge(0.0)]


@dataclass(frozen=True)
class DataPart(Section):
    """``data``: modelling data that exists.

    >>> DataPart("dynamic", "catalogue", "rotor inertia").kind
    'dynamic'
    """

    kind: DataKind
    """What it is about: shape and mass, motion, or forces."""
    source: Annotated[
        Literal["manual", "CAD", "catalogue", "experiment", "literature"], Key("from")
    ]
    """Where it comes from."""
    what: str = ""
    """What it says."""


@dataclass(frozen=True)
class Wear(Section):
    """``wear``: a physical effect that wears the component, and what it changes.

    >>> Wear("abrasion", ("Fc",), 0.3).drift
    0.3
    """

    effect: str
    """The effect, in the words of the trade."""
    parameters: tuple[str, ...] = ()
    """Parameters of the component that it changes."""
    drift: Share = 0.0
    """Expected relative change of those within a year of service."""
    reason: str = ""
    """Where the expectation comes from."""


@dataclass(frozen=True)
class ParameterOverride(Section):
    """``override`` of a parameter: the engineer decides otherwise.

    >>> ParameterOverride(reason="measured yearly", editable=False).weight is None
    True
    """

    reason: str
    """Why; it stays in the file and in the report."""
    editable: bool | None = None
    """Tune it, whatever is proposed?"""
    weight: Annotated[float, Gt(0.0), Le(1.0)] | None = None
    """How often: 1 at every tuning, 0.5 at every second one."""


@dataclass(frozen=True)
class ParameterPart(Section):
    """``parameters.NAME``: a parameter of the component, with its initial value and its source.

    >>> ParameterPart(12.0, unit="Nm", source="literature").limit is None
    True
    """

    shorthand = Shorthand("value")

    value: Amount | None = None
    """Initial value; absent: the model's own."""
    unit: str | None = None
    """Unit of the bare numbers of this table; absent: SI."""
    source: Literal["manufacturer", "literature", "experiment", "description", "guess"] | None = (
        None
    )
    """Where the value comes from."""
    cite: str = ""
    """Data sheet, paper or test that it stands in."""
    low: Amount | None = None
    """Lower bound."""
    high: Amount | None = None
    """Upper bound."""
    sigma: Spread | None = None
    """Standard deviation of what is known of the value."""
    uncertain: Annotated[float, Quantity("1"), Gt(0.0)] = 0.5
    """Relative range around the value for the sensitivity analysis."""
    limit: Amount | None = None
    """Limit of health: at this value the component is worn out."""
    limit_reason: str = ""
    """Where the limit comes from."""
    override: ParameterOverride | None = None
    """What the engineer decides otherwise."""


@dataclass(frozen=True)
class Override(Section):
    """``override`` of a component: the engineer decides otherwise.

    >>> Override(reason="spare part on the shelf", role="supporting").level is None
    True
    """

    reason: str
    """Why; it stays in the file and in the report."""
    role: Role | None = None
    """Critical or supporting."""
    level: Level | None = None
    """White, grey or black."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.reason.strip():
            raise UsageError("reason: expected why it is overridden, got nothing")


@dataclass(frozen=True)
class CostPart(Section):
    """``cost``: what its failure and its maintenance cost, in one currency for the machine.

    >>> CostPart(failure=8000.0, maintenance=900.0).failure
    8000.0
    """

    failure: Annotated[float, Ge(0.0)]
    """Cost of a failure in service."""
    maintenance: Positive
    """Cost of maintenance in time."""


@dataclass(frozen=True)
class Component(Section):
    """``[[system.component]]`` or ``[[system.subsystem.component]]``: a component.

    >>> Component("gearbox 1", kind="gearbox", axis=1, effect=4, proneness=3).needs
    ('kinematic', 'dynamic')
    """

    name: str
    """Name of the component, each once."""
    like: str | None = None
    """Its settings begin with those of ``[like.NAME]``; here stands what differs."""
    about: str = ""
    """What it does."""
    kind: str = ""
    """Kind of model component; absent: it is not part of the model."""
    axis: Annotated[int, Ge(1), Le(1_000)] | None = None
    """Number of its axis, where the machine has axes."""
    options: Annotated[Mapping[str, Json], Free()] = field(default_factory=dict)
    """Options of the model component."""
    role: Role | None = None
    """Critical, or supporting (it feeds a critical one); absent: from effect × proneness."""
    effect: Grade = 1.0
    """Effect on the machine's health, 1 (none) to 5 (it stops)."""
    effect_reason: str = ""
    """Why."""
    proneness: Grade | None = None
    """Proneness to failure, 1 (never) to 5 (often); absent: from the maintenance history."""
    proneness_reason: str = ""
    """Why."""
    cost: CostPart | None = None
    """What its failure and its maintenance cost: its date is then planned."""
    needs: tuple[DataKind, ...] = ("kinematic", "dynamic")
    """Modelling data that a detailed model needs."""
    data: tuple[DataPart, ...] = ()
    """Modelling data that exists."""
    physics: str = ""
    """Physical law that completes missing data, in words."""
    interest: bool = True
    """Is its inner working of interest to the study?"""
    wear: tuple[Wear, ...] = ()
    """Physical effects that wear it."""
    sensors: tuple[str, ...] = ()
    """Channels of the sensors that see it."""
    virtual: tuple[str, ...] = ()
    """Quantities inside it that the model can show: virtual sensors."""
    parameters: Mapping[str, ParameterPart] = field(default_factory=dict)
    """Its parameters by name."""
    override: Override | None = None
    """What the engineer decides otherwise."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for wear in self.wear:
            for name in wear.parameters:
                if name not in self.parameters:
                    raise UsageError(f"wear {wear.effect!r}: {self.name!r} has no parameter {name}")

    def drift(self, parameter: str) -> float:
        """Expected relative change of a parameter within a year: of the strongest effect.

        >>> worn = Component("g", parameters={"Fc": ParameterPart(1.0)},
        ...                  wear=(Wear("abrasion", ("Fc",), 0.3),))
        >>> worn.drift("Fc"), worn.drift("J")
        (0.3, 0.0)
        """
        return max((w.drift for w in self.wear if parameter in w.parameters), default=0.0)


@dataclass(frozen=True)
class ModelPart(Section):
    """``[model]``: how the components make up the model.

    >>> ModelPart().kind
    'assembly'
    """

    kind: str = "assembly"
    """``assembly``: components joined by their ports; or any model of evertwin."""
    options: Annotated[Mapping[str, Json], Free()] = field(default_factory=dict)
    """Options of the whole model."""
    names: str = "{component}.{parameter}"
    """What the model calls a component's parameter, of ``component``, ``parameter``, ``axis``."""

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.names.format(component="c", parameter="p", axis=1)
        except (KeyError, IndexError, ValueError) as error:
            raise UsageError(
                f"names: expected fields component, parameter and axis, got {self.names!r}"
            ) from error


@dataclass(frozen=True)
class Requirements(Section):
    """``[requirements]``: what the twin has to reach.

    >>> Requirements().accuracy
    0.05
    """

    accuracy: Annotated[float, Quantity("1"), Gt(0.0)] = 0.05
    """Largest relative deviation of every output, moving."""
    run_time: Duration | None = None
    """Longest time that one tuning may take."""
    interval: Duration = 86400.0
    """Time from one tuning to the next."""
    negligible: Annotated[float, Gt(0.0), Lt(1.0)] = 0.05
    """Sobol share below which a parameter's effect on every output is negligible."""
    identify: tuple[str, ...] = ()
    """Parameters, by the model's names, whose initial values a first fit finds; ``*`` matches any
    text. Those with ``source = "experiment"`` and no value are among them."""


@dataclass(frozen=True)
class Sensor(Section):
    """``[sensors.CHANNEL]``: a sensor, by the channel that it feeds.

    >>> Sensor("motor torque of axis 1").noise is None
    True
    """

    measures: str
    """What it measures, and where."""
    unit: str | None = None
    """Unit of the bare numbers of this table; absent: SI."""
    noise: Size | None = None
    """Standard deviation of its noise; absent: estimated from the recordings."""
    trouble: str = ""
    """What may undermine it: temperature, humidity, mounting."""
