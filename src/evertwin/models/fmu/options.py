"""How a twin uses an FMU: the options of ``[model] kind = "fmu"``.

>>> Options(inputs=("tau",), step=0.001).solver
'rk4'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evertwin.errors import UsageError
from evertwin.models.fmu.guard import Unpacking

_CHOICES = {
    "interface": ("", "co-simulation", "model-exchange"),
    "memory": ("", "none", "start", "saved"),
    "solver": ("euler", "heun", "rk4"),
}


@dataclass(frozen=True)
class Options:
    """Everything that may be said; by default the FMU's own description decides.

    Raises:
        UsageError: a choice that does not exist, or a number out of range.

    >>> Options(solver="magic")
    Traceback (most recent call last):
    evertwin.errors.UsageError: solver: expected one of euler, heun, rk4, got 'magic'
    """

    inputs: Sequence[str] | None = None
    """Variables that are set in every row; default: all of causality input."""
    outputs: Sequence[str] | None = None
    """Variables that are read after every row; default: all of causality output."""
    parameters: Sequence[str] | None = None
    """Variables that tuning may know; default: all of causality parameter. Tunable ones are
    editable, fixed ones only if they are named here."""
    states: Sequence[str] | Mapping[str, str] | None = None
    """Co-simulation: variables that hold the memory and take start values; as a table, state →
    the variable that takes its start value. Model exchange knows its own."""
    adopts: Mapping[str, str] = field(default_factory=dict)
    """Output → the state that it shows, where they differ in name and value reference."""
    interface: str = ""
    """``co-simulation`` or ``model-exchange``; default: co-simulation if its memory can be held."""
    memory: str = ""
    """Co-simulation: what holds the memory between rows: ``start`` (values of ``states``),
    ``saved`` (the FMU saves its state) or ``none`` (a static map)."""
    step: float = 0.0
    """Longest step [s]; 0: co-simulation one step a row, model exchange the FMU's default step or a
    millisecond."""
    solver: str = "rk4"
    """Model exchange: ``euler``, ``heun`` or ``rk4``, fixed steps."""
    start: Mapping[str, float] = field(default_factory=dict)
    """Start values of other variables, in the FMU's units."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units where the FMU says none."""
    angles: Sequence[str] = ()
    """Inputs, outputs and states whose residuals wrap."""
    clock: bool = False
    """Is the FMU's time part of the state? Needed where it depends on time itself."""
    row_seconds: float = 5.0
    """Wall-clock limit of one row."""
    start_seconds: float = 30.0
    """Wall-clock limit to load and initialise."""
    cpu_seconds: float = 600.0
    """Processor time of one block of rows."""
    memory_mb: float = 1000.0
    """Memory that the FMU may take."""
    unpacked_mb: float = 256.0
    """Size of the unpacked archive."""
    files: int = 10_000
    """Files in the archive."""
    ratio: float = 100.0
    """Unpacked over packed size."""
    faults: int = 8
    """Break-downs after which the FMU is given up; a thousand good rows make up for them."""

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            said = getattr(self, name)
            if said not in choices:
                names = ", ".join(choice for choice in choices if choice)
                raise UsageError(f"{name}: expected one of {names}, got {said!r}")
        if not 0.0 <= self.step < float("inf"):
            raise UsageError(f"step: expected 0 s or more, got {self.step}")
        named = ("row_seconds", "start_seconds", "cpu_seconds", "memory_mb", "faults")
        for name in named:
            if not getattr(self, name) > 0:
                raise UsageError(f"{name}: expected a number above 0, got {getattr(self, name)}")
        _ = self.unpacking

    @property
    def unpacking(self) -> Unpacking:
        """What the archive may take."""
        return Unpacking(int(self.unpacked_mb * 1e6), self.files, self.ratio)
