"""What is said when an FMU breaks down.

>>> str(BrokenDown(Fault("crashed", "SIGSEGV", 3, 0.02)))
'the FMU crashed in step 3 of a block: SIGSEGV (known after 0.02 s)'
"""

from __future__ import annotations

from dataclasses import dataclass

from evertwin.models.fmu import slots as at

STATUS = {
    at.DISCARD: "fmi Discard", at.ERROR: "fmi Error", at.PENDING: "fmi Pending",
    at.NOT_FINITE: "a result that is not finite", at.TOO_MANY: "too many steps in a row",
    at.ENDED: "the wish to end the simulation", at.TOO_LARGE: "a saved state that grew",
}  # fmt: skip
"""Status of a failed row in words; break-downs are told otherwise."""


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
