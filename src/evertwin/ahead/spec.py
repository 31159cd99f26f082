"""What a scenario file says: what is different from today. Everything else stays.

>>> text = 'schema = 1\\nname = "faster"\\n[speed]\\nfactor = 1.2'
>>> SCENARIO.parse(text, "faster.toml").speed.factor
1.2
>>> SCENARIO.parse(text + "\\n[laod]", "faster.toml")
Traceback (most recent call last):
evertwin.errors.ConfigError: faster.toml:5: unknown key 'laod', did you mean 'load'?
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from annotated_types import Ge, Gt, Le

from evertwin.errors import UsageError
from evertwin.models.spec import ChangeSpec
from evertwin.settings.form import Form
from evertwin.settings.kinds import Amount, Duration, Hertz
from evertwin.settings.notes import Free, Hidden, Quantity, Shorthand
from evertwin.settings.section import Section
from evertwin.types import Json

STEPS = 1_000_000
"""Exchanges of poses in a docking."""
Metres: TypeAlias = Annotated[float, Quantity("m")]


@dataclass(frozen=True)
class SpeedSpec(Section):
    """``[speed]``: the same motion, faster or slower.

    >>> SpeedSpec(1.2).factor
    1.2
    """

    factor: Annotated[float, Gt(0.0), Le(100.0)]
    """Above 1: faster."""


WATER = 1000.0
"""Density [kg/m³]: what an arm carries, hollow or of metal, is about as heavy."""


@dataclass(frozen=True)
class LoadSpec(Section):
    """``[load]``: what the tip carries.

    >>> round(LoadSpec(2.0).loose, 3), LoadSpec(2.0, centre=(0.0, 0.0, 0.1)).loose
    (0.063, 0.0)
    """

    mass: Annotated[float, Quantity("kg"), Ge(0.0)]
    """Mass at the tip."""
    centre: tuple[Metres, ...] | None = None
    """Its centre in the tip's frame; absent: about the tip, as far off as a body of that mass may
    be large."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.centre is not None and len(self.centre) != 3:
            raise UsageError(f"centre: expected three lengths, got {len(self.centre)}")

    @property
    def loose(self) -> float:
        """Standard deviation of where its centre is [m]: half the side of a cube of water."""
        return 0.0 if self.centre is not None else 0.5 * (self.mass / WATER) ** (1.0 / 3.0)


@dataclass(frozen=True)
class PathSpec(Section):
    """``[path]``: another path, before the machine runs it.

    >>> PathSpec(file="new.csv").rate
    100.0
    """

    shorthand = Shorthand("file")

    file: str | None = None
    """CSV: ``t``, the model's inputs, and outputs where they are planned, as the recordings have
    them or in the units that they are recorded in; relative to this file."""
    moves: Annotated[Json, Free()] = ()
    """Moves of an arm: ``{ move = "joints" | "line" | "circle" | "pause", … }``."""
    start: tuple[float, ...] = ()
    """Joint positions at the start; absent: those of the newest recorded row."""
    speed: tuple[float, ...] = ()
    """Highest speed of each joint; absent: the description's."""
    acceleration: tuple[float, ...] = ()
    """Highest acceleration of each joint; absent: 2 rad/s²."""
    rate: Hertz = 100.0
    """Rows a second."""
    profile: Literal["trapezoid", "quintic"] = "trapezoid"
    """How each move speeds up and slows down."""
    controller: Annotated[Json, Free()] = ()
    """Controllers that follow an arm's path: kp, kv, ki, feedforward, limit …: one number, or one
    for each axis."""
    components: Annotated[Json, Free()] = ()
    """What else the model lacks for following the path: a line for each controller, motor, …"""

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, lines in (("moves", self.moves), ("components", self.components)):
            rows = lines if isinstance(lines, list | tuple) else [None]
            if not all(isinstance(one, Mapping) for one in rows):
                raise UsageError(f"{key}: expected a list of tables, [{{ … }}, …], got {lines!r}")
        if self.controller != () and not isinstance(self.controller, Mapping):
            raise UsageError(f"controller: expected a table, {{ kp = … }}, got {self.controller!r}")
        if (self.file is None) == (not self.moves):
            raise UsageError("expected either a file or moves")


@dataclass(frozen=True)
class DockSpec(Section):
    """``[docking]``: the mobile robot drives to a second machine and docks.

    >>> DockSpec(machine="lift.toml").tolerance
    0.02
    """

    machine: str
    """Twin file of the second machine; relative to this file."""
    output: str = ""
    """Its output that moves the dock along the way; absent: the dock stands still."""
    lift: float = 1.0
    """Metres that the dock moves per unit of that output."""
    dock: tuple[float, ...] = (2.0, 0.0, 0.0)
    """Where the dock is when that output is zero: x, y [m], heading [rad]."""
    speed: Annotated[float, Quantity("m/s"), Gt(0.0)] = 0.1
    """Highest speed of the approach."""
    turn: Annotated[float, Quantity("rad/s"), Gt(0.0)] = 0.5
    """Highest turn rate of the approach."""
    step: Duration = 0.1
    """Time from one exchange of poses to the next."""
    limit: Duration = 120.0
    """Longest approach."""
    tolerance: Annotated[float, Quantity("m"), Gt(0.0)] = 0.02
    """Largest position error of a docking that holds."""
    command: Mapping[str, float] = field(default_factory=dict)
    """Inputs of the second machine while the robot is under way; absent: zero."""
    arrived: Mapping[str, float] = field(default_factory=dict)
    """Its inputs from when the robot is within ``near`` of the dock."""
    near: Annotated[float, Quantity("m"), Ge(0.0)] = 0.0
    """Distance at which the second machine is told that the robot comes."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.dock) != 3:
            raise UsageError(
                f"dock: expected x [m], y [m] and heading [rad], got {len(self.dock)} numbers"
            )
        if not self.limit / self.step <= STEPS:
            raise UsageError(
                f"expected at most {STEPS} steps, got a limit of {self.limit:g} s in steps of "
                f"{self.step:g} s"
            )


@dataclass(frozen=True)
class ScenarioSpec(Section):
    """A whole scenario file.

    >>> ScenarioSpec(name="as it is").horizon is None
    True
    """

    name: str
    """Name of the scenario."""
    schema: int = 1
    """Version of the file's form."""
    horizon: Duration | None = None
    """How long is simulated; absent: the newest recorded task."""
    speed: SpeedSpec | None = None
    """The same motion, faster or slower."""
    load: LoadSpec | None = None
    """What the tip carries."""
    path: PathSpec | None = None
    """Another path."""
    parameters: Mapping[str, ChangeSpec] = field(default_factory=dict)
    """Other values of parameters; ``*`` matches any text."""
    components: Mapping[str, Mapping[str, Amount]] = field(default_factory=dict)
    """Components that are replaced: values of the new one; absent: as the twin file says."""
    wear: Annotated[Amount, Gt(0.0)] | None = None
    """Wear of all components this far ahead, on the clock of the prognosis."""
    limits: Mapping[str, Annotated[Amount, Gt(0.0)]] = field(default_factory=dict)
    """Largest size of a channel (torque, speed, current) that the machine can give."""
    docking: DockSpec | None = None
    """Docking at a second machine."""
    folder: Annotated[str, Hidden()] = field(default=".", compare=False)
    """Folder of the scenario file; set when it is read."""


_ABOUT = """# The scenario file

A scenario file is TOML and says what is different from today; `evertwin whatif` simulates it.
Everything else stays as the twin file says.

The JSON schema for editors comes from `evertwin schema --scenario`.
"""

SCENARIO = Form(ScenarioSpec, 1, "scenario", _ABOUT)
"""How scenario files are read."""


def read_scenario(path: str | Path) -> ScenarioSpec:
    """The scenario file at ``path``.

    Raises:
        ConfigError: one line for each problem, ``file:line: what was expected, what came``.
    """
    found = SCENARIO.parse(SCENARIO.load(path), str(path))
    return dataclasses.replace(found, folder=str(Path(path).resolve().parent))
