"""Checks of a model against what must hold whatever the machine does: verification as data.

Verification asks whether the equations are solved right; validation (`validation`) whether they are
the right ones. A check has a figure and a limit. One that could not run says why: nothing counts as
verified that was not looked at.

>>> report = VerificationReport("arm", (
...     Check("energy is kept", "law", 2e-9, 1e-6, "1", "without friction"),
...     Check.missing("independent engine", "engine", "mujoco is not installed")))
>>> report.passed, [check.name for check in report.not_run]
(True, ['independent engine'])
>>> print(report)
arm: verification: 1 of 1 checks passed, 1 could not run
  ok      energy is kept                     2e-09 ≤ 1e-06 (without friction)
  not run independent engine                 mujoco is not installed
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from evertwin.fold import plain
from evertwin.types import Json


@dataclass(frozen=True)
class Check:
    """One check: the largest violation found, and the largest that is allowed.

    >>> Check("mass matrix", "engine", 1e-9, 1e-12, "kgm2").passed
    False
    """

    name: str
    kind: Literal["engine", "law", "numerics", "contract"]
    """Against another engine, a law of physics, the solver's steps, the contract of a model."""
    figure: float = math.nan
    limit: float = math.nan
    unit: str = "1"
    said: str = ""
    """On what it was looked at, or why it could not be."""

    @classmethod
    def missing(
        cls, name: str, kind: Literal["engine", "law", "numerics", "contract"], why: str
    ) -> Check:
        """A check that could not run."""
        return cls(name, kind, said=why)

    @property
    def ran(self) -> bool:
        """Could it run?"""
        return not math.isnan(float(self.limit))

    @property
    def passed(self) -> bool:
        """Did it run, and is the figure a number within the limit?"""
        return bool(self.ran and self.figure <= self.limit)

    def __str__(self) -> str:
        if not self.ran:
            return f"not run {self.name:<34} {self.said}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        sign, word = ("≤", "ok     ") if self.passed else (">", "MISSED ")
        said = f" ({self.said})" if self.said else ""
        return f"{word} {self.name:<34} {self.figure:.3g} {sign} {self.limit:.3g}{unit}{said}"

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        return {
            "name": self.name, "kind": self.kind, "ran": self.ran, "passed": self.passed,
            "figure": self.figure if self.ran else None,
            "limit": self.limit if self.ran else None, "unit": self.unit, "said": self.said,
        }  # fmt: skip


@dataclass(frozen=True)
class VerificationReport:
    """All checks of one model.

    >>> VerificationReport("robot", ()).passed
    True
    """

    model: str
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Did all checks pass that could run?"""
        return all(check.passed for check in self.checks if check.ran)

    @property
    def not_run(self) -> tuple[Check, ...]:
        """Checks that could not run, each with its reason."""
        return tuple(check for check in self.checks if not check.ran)

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.verification/1"``."""
        checks = [check.to_dict() for check in self.checks]
        head = {"schema": "evertwin.verification/1", "model": self.model, "passed": self.passed}
        return plain({**head, "checks": checks})  # type: ignore[return-value]

    def __str__(self) -> str:
        ran = [check for check in self.checks if check.ran]
        good, left = sum(check.passed for check in ran), len(self.checks) - len(ran)
        head = f"{self.model}: verification: {good} of {len(ran)} checks passed"
        head += f", {left} could not run" if left else ""
        return "\n".join([head, *(f"  {check}" for check in self.checks)])
