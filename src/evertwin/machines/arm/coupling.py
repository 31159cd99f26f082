"""Motors that drive more than one joint, as in the wrists of industrial arms.

    q = C·θ        τ_motor = Cᵀ·τ_joint

with the motors' positions θ counted behind their gears, so that an uncoupled motor has a 1. Power
is the same on both sides. Where motor 4 turns joint 5 back by 2 % of its own way, C[5, 4] = −0.02.

>>> wrist = Coupling.of([[1.0, 0.0], [-0.02, 1.0]])
>>> wrist.of_motors(np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])).tolist()
[[1.0, -0.02, 0.0, 0.0, 0.0, 0.0]]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evertwin.errors import UsageError
from evertwin.types import Float64, Inputs

WORST = 1e6
"""Largest condition number of the matrix."""


@dataclass(frozen=True)
class Coupling:
    """A coupling matrix. See the module.

    >>> Coupling.of([[1.0]]).first
    (0,)
    """

    rows: tuple[tuple[float, ...], ...]
    motors: bool = False
    """Is the measured motion that of the motors?"""

    @classmethod
    def of(cls, rows: Sequence[Sequence[float]], motors: bool = False) -> Coupling:
        """From rows of numbers.

        Raises:
            UsageError: not square, not finite, or motors cannot be told from joints.
        """
        made = cls(tuple(tuple(float(v) for v in row) for row in rows), motors)
        n = len(made.rows)
        if not n or any(len(row) != n for row in made.rows):
            raise UsageError(f"coupling: expected {n} rows of {n} numbers: q = C·θ")
        matrix = np.array(made.rows)
        if not np.isfinite(matrix).all() or not np.linalg.cond(matrix) < WORST:
            raise UsageError("coupling: the matrix has no inverse: motors do not drive all joints")
        return made

    @cached_property
    def matrix(self) -> Float64[np.ndarray, "k k"]:
        """C, joints by motors."""
        return np.array(self.rows, dtype=np.float64)

    @cached_property
    def inverse(self) -> Float64[np.ndarray, "k k"]:
        """From joints to motors."""
        return np.asarray(np.linalg.inv(self.matrix))

    @cached_property
    def first(self) -> tuple[int, ...]:
        """The first joint that each motor moves."""
        return tuple(int(np.flatnonzero(column)[0]) for column in self.matrix.T)

    def of_motors(self, u: Inputs) -> Inputs:
        """Motors' q, q̇, q̈ (n, 3 k) become the joints'."""
        return _times(self.matrix, u)

    def of_joints(self, u: Inputs) -> Inputs:
        """Joints' q, q̇, q̈ (n, 3 k) become the motors'."""
        return _times(self.inverse, u)

    def felt(self, torques: Any) -> Any:
        """Joint torques (n, k, …) become the motors'."""
        return np.einsum("jo,ij...->io...", self.matrix, torques)


def _times(matrix: Float64[np.ndarray, "k k"], u: Inputs) -> Inputs:
    parts = u.reshape(len(u), 3, len(matrix))
    return np.ascontiguousarray(np.einsum("ij,rkj->rki", matrix, parts).reshape(u.shape))
