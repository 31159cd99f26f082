"""What an FMU may take of this machine, and what is said when it breaks down.

>>> str(BrokenDown(Fault("crashed", "SIGSEGV", 3, 0.02)))
'the FMU crashed in step 3 of a block: SIGSEGV (known after 0.02 s)'
"""

from __future__ import annotations

from dataclasses import dataclass

from evertwin.errors import UsageError
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.guard import Unpacking

__all__ = ["STATUS", "BrokenDown", "Fault", "Limits"]

STATUS = {
    at.DISCARD: "fmi Discard", at.ERROR: "fmi Error", at.PENDING: "fmi Pending",
    at.NOT_FINITE: "a result that is not finite", at.TOO_MANY: "too many steps in a row",
    at.ENDED: "the wish to end the simulation", at.TOO_LARGE: "a saved state that grew",
}  # fmt: skip
"""Status of a failed row in words; break-downs are told otherwise."""


@dataclass(frozen=True)
class Limits:
    """What an FMU may take.

    >>> Limits().row_seconds
    5.0
    """

    row_seconds: float = 5.0
    """Wall-clock time of one row."""
    start_seconds: float = 30.0
    """Wall-clock time to load and initialise."""
    cpu_seconds: float = 600.0
    """Processor time of one call: a block of rows."""
    memory: int = 1_000_000_000
    """Address space beside the bare interpreter's [bytes]."""
    faults: int = 8
    """Break-downs after which the FMU is given up; a thousand good rows make up for them."""
    unpacking: Unpacking = Unpacking()

    def __post_init__(self) -> None:
        numbers = self.row_seconds, self.start_seconds, self.cpu_seconds, self.memory, self.faults
        if not all(number > 0 for number in numbers):
            raise UsageError(f"limits of the FMU: expected numbers above 0, got {numbers}")


@dataclass(frozen=True)
class Fault:
    """One break-down, or rows of one call that failed.

    >>> Fault("crashed", "SIGSEGV", 3, 0.01).kind
    'crashed'
    """

    kind: str
    """``crashed``, ``exited``, ``hung``, ``fatal``, ``start``, or ``failed`` (no success)."""
    detail: str
    row: int
    """Step of the call, from 0; −1: outside of a step."""
    seconds: float
    """From the begin of a hanging row, or of the call, to the moment it was known."""

    def __str__(self) -> str:
        where = f" in step {self.row} of a block" if self.row >= 0 else ""
        kind = "did not start" if self.kind == "start" else self.kind
        return f"the FMU {kind}{where}: {self.detail} (known after {self.seconds:.3g} s)"


class BrokenDown(RuntimeError):
    """The child process is gone; never leaves this package.

    >>> BrokenDown(Fault("exited", "exit code 0", -1, 0.1)).fault.kind
    'exited'
    """

    def __init__(self, fault: Fault) -> None:
        super().__init__(str(fault))
        self.fault = fault
