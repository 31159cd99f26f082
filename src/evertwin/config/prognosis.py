"""What wears, where its life ends, what failing and mending cost, and what work lies ahead."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt, Le
from pydantic_core import CoreSchema, core_schema

from evertwin.errors import UsageError
from evertwin.models.spec import ChangeSpec
from evertwin.settings.kinds import Amount, Duration, Fraction, Positive
from evertwin.settings.notes import PlacedError, Quantity, expand
from evertwin.settings.quantity import number, written
from evertwin.settings.section import Section
from evertwin.signals.units import conversion

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue


@dataclass(frozen=True)
class AccuracySpec(Section):
    """``accuracy``: a limit that follows from what the process demands.

    The limit is the value of the parameter at which the simulated output leaves the tolerance.

    >>> AccuracySpec(output="tau1", tolerance=5.0).relative
    False
    """

    output: str
    """Output that must stay true."""
    tolerance: Amount
    """Largest change of it (rms over a task), in its unit, or a share of its rms."""
    relative: bool = False
    """Is the tolerance a share of the output's rms?"""


@dataclass(frozen=True)
class IndicatorSpec(Section):
    """``[[indicator]]``: a figure that tells how worn a component is.

    >>> IndicatorSpec(name="friction", parameter="Fc1", limit=20.0).direction
    'above'
    """

    name: str
    """Name of the indicator, and its column in a history file."""
    component: str = ""
    """Component whose life it tells; absent: the indicator's own name."""
    parameter: str | None = None
    """A tuned parameter."""
    formula: str | None = None
    """A function of several, as in ``"Fc1 + 0.5 * Fv1"``: + − * / ** sqrt abs."""
    output: str | None = None
    """Residual of an output: its deviation before each tuning, as a share of the output's rms."""
    file: str | None = None
    """A measured series or a quality figure by run: CSV, relative to the twin file."""
    column: str | None = None
    """Column of the file; absent: the indicator's name."""
    unit: str = ""
    """Unit of value and limit; absent: the parameter's, else '1'."""
    limit: Amount | None = None
    """Where life ends; absent: the accuracy, else the breakdown's."""
    direction: Literal["above", "below"] = "above"
    """The harmful side of the limit."""
    accuracy: AccuracySpec | None = None
    """A limit that follows from what the process demands."""
    covariates: tuple[str, ...] = ()
    """What adds to the value without wear (temperature, load): columns of the history, or tuned
    parameters."""
    factors: tuple[str, ...] = ()
    """What multiplies the value without wear, named as covariates are."""
    warm_up: Duration | None = None
    """Time constant τ of warm-up: the value is divided by 1 + a·e^(−t/τ), a found from the history,
    t the time since start: the time in the run, or the column ``since_start``."""
    reference: Mapping[str, float] = field(default_factory=dict)
    """Value of a covariate under which the limit holds; absent: its median."""
    usage: str | None = None
    """Column of the history that counts the work done, where wear goes with it. Beside ``[[work]]``
    it counts cycles of the newest task, unless ``[prognosis] past`` says how many were done."""
    wear: str | None = None
    """Wear per second of a simulated cycle, as in ``"abs(tau1) ** 3 * abs(qd1)"``: inputs, outputs,
    states (``state.x`` where another has its name), parameters, and ``x.rate`` for the change of x
    per second. Absent: effort times speed at a joint, else the way, else time."""
    exponent: Annotated[float, Gt(0.0), Le(20.0)] = 1.0
    """How the wear of a joint grows with its load: 1 for sliding, 3 for ball bearings."""
    laws: tuple[
        Literal["linear", "exponential", "power", "saturating", "cracking", "wiener"], ...
    ] = ()
    """Laws that are weighed against each other where a life is told alone; absent: all."""

    def __post_init__(self) -> None:
        super().__post_init__()
        given = [n for n in ("parameter", "formula", "output", "file") if getattr(self, n)]
        if len(given) > 1:
            raise UsageError(
                f"indicator {self.name}: expected one of parameter, formula, output or file, got "
                f"{' and '.join(given)}"
            )
        if self.wear is not None and self.exponent != 1.0:
            raise UsageError(
                f"indicator {self.name}: expected wear or exponent, got both: write the exponent "
                "into the formula"
            )
        if self.accuracy is not None and self.parameter is None:
            raise UsageError(
                f"indicator {self.name}: an accuracy gives the limit of a parameter: name one"
            )


@dataclass(frozen=True)
class CostSpec(Section):
    """``[prognosis.components.NAME]``: what a component costs.

    >>> CostSpec(failure=8000.0, maintenance=900.0).critical
    True
    """

    failure: Annotated[float, Ge(0.0)] | None = None
    """Cost of a failure in service; absent: no date is planned."""
    maintenance: Positive | None = None
    """Cost of maintenance in time, without the stop itself (``[prognosis] visit``)."""
    critical: bool = True
    """Does its failure stop the machine?"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.failure is None) != (self.maintenance is None):
            raise UsageError("expected both failure and maintenance cost, or neither")


@dataclass(frozen=True)
class WorkSpec(Section):
    """``[[work]]``: a piece of the work that lies ahead. Works at one time add; where none is
    planned the machine rests; after the last ``until`` it goes on as before.

    >>> WorkSpec(name="weld", cycles=400.0).speed
    1.0
    """

    name: str
    """Name in messages."""
    cycles: Annotated[float, Ge(0.0)]
    """How often, per unit of the prognosis' clock; 0: rest."""
    begin: Annotated[float, Ge(0.0)] = 0.0
    """From when on, in units of the prognosis' clock from now."""
    until: Positive | None = None
    """Until when; absent: for ever."""
    speed: Positive = 1.0
    """Faster (above 1) or slower than recorded."""
    load: Annotated[float, Quantity("kg"), Ge(0.0)] = 0.0
    """Payload at the tip."""
    path: str | None = None
    """Motion of one cycle: CSV with the model's inputs; absent: the newest recorded task."""
    parameters: Mapping[str, ChangeSpec] = field(default_factory=dict)
    """Other values of parameters, as in a scenario: the mass of a table, a friction."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.until is not None and self.until <= self.begin:
            raise UsageError(
                f"work {self.name}: expected until after begin ({self.begin:g}), got {self.until:g}"
            )


class Lead(NamedTuple):
    """How long before it a failure has to be foreseen.

    >>> Lead.parse("10 %", "run"), Lead.parse("2 d", "h"), Lead.parse("20 run", "run")
    (Lead(size=0.1, share=True), Lead(size=48.0, share=False), Lead(size=20.0, share=False))
    """

    size: float
    share: bool
    """Is it a part of the whole life, and no time on the clock?"""

    @classmethod
    def parse(cls, text: object, clock: str) -> Lead:
        """A lead as it is written.

        Raises:
            UsageError: a number alone may be either; or it is none on this clock.
        """
        size, unit = written(expand(text)) if isinstance(text, str) else (0.0, "")
        if unit == "%" and 0.0 < size < 100.0:
            return cls(0.01 * size, share=True)
        if size > 0.0 and unit.removesuffix("s") == clock and clock in COUNTS:
            return cls(size, share=False)
        if size > 0.0 and unit and clock not in COUNTS:
            return cls(number(f"{size} {unit}", "s") / conversion(clock)[0], share=False)
        raise UsageError(
            f"expected a time on the clock, as in '20 {clock}', or a share of the whole life, as "
            f"in '10 %', got {text!r}"
        )


COUNTS = ("run", "cycle")
"""Clocks that count, and tell no time."""


class Leads(NamedTuple):
    """Marks the text of a `Lead`, which a number alone is not: a time or a share?

    >>> Leads() == Leads()
    True
    """

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.any_schema()  # the section says what is wrong with it, by its clock

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": "string"}


@dataclass(frozen=True)
class PrognosisSpec(Section):
    """``[prognosis]``: how lives are counted and maintenance is planned.

    >>> PrognosisSpec().clock
    'run'
    """

    clock: Literal["run", "cycle", "s", "h", "d"] = "run"
    """What life is counted in: tasks (``run``, ``cycle``), or time by the recordings' stamps."""
    past: Positive | None = None
    """Work of the past per unit of the clock, in cycles of the newest task; absent: one a run or
    cycle, else as many as the indicator's ``usage`` counts."""
    breakdown: str | None = None
    """Breakdown file of the machine, for limits; relative to the twin file."""
    fleet: tuple[str, ...] = ()
    """Like machines: their histories (CSV), or the stores of their twins, as in
    ``"others/*.csv"``. Those that passed the limit, or are said to have failed, ended."""
    failed: tuple[str, ...] = ()
    """Of these or others, those that failed with their last row, wherever the limit lies."""
    components: Mapping[str, CostSpec] = field(default_factory=dict)
    """Cost of failure and of maintenance by component."""
    windows: Positive | None = None
    """Time from one possible maintenance to the next; absent: any time."""
    window: Annotated[float, Ge(0.0)] = 0.0
    """Time from now to the first possible maintenance."""
    visit: Annotated[float, Ge(0.0)] = 0.0
    """Cost of one stop for maintenance, whatever is done in it: components whose dates lie close
    share one. It comes on top of their ``maintenance``."""
    ahead: Annotated[str, Leads()] | None = None
    """An alarm is due when a failure within this time is likelier than ``risk`` (more, in ratio,
    where more than five times as much is left with a chance above 10 %): on the clock
    (``"20 run"``, ``"48 h"``), or a share of the whole life (``"10 %"``, which holds if absent)."""
    risk: Fraction = 0.1
    """Probability of failure that is not accepted."""
    alarms: Positive = 1.0
    """Budget: alarms per day of the recordings' stamps, per run where these begin at zero. That a
    limit is passed is told whatever the budget says."""

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            _ = self.lead
        except UsageError as error:
            raise PlacedError(f"ahead: {error}", ("ahead",)) from error

    @property
    def lead(self) -> Lead | None:
        """How long before it a failure has to be foreseen; None: nothing was said."""
        return None if self.ahead is None else Lead.parse(self.ahead, self.clock)
