"""Base inertial parameters: the combinations of a chain's inertias that its torques depend on.

Ten numbers a link are too many: some never reach a torque, others only in sums. The choice made
here keeps single numbers whose effects on the torques are independent and as different as possible
(pivoting) and leaves the rest at their given values; the chosen ones absorb what the rest gets
wrong, so they are *not* a link's own mass moments. Rotor inertias come first: where a rotor and a
link cannot be told apart (the first joints), the rotor has it.

Gautier and Khalil, "Direct calculation of minimum set of inertial parameters of serial robots"
(1990); numerically, by QR: Gautier, "Numerical calculation of the base inertial parameters" (1991).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import scipy

from evertwin.compiled.functions import njit
from evertwin.machines.arm.coupling import Coupling
from evertwin.machines.arm.rnea import BODY, MOVED, WRENCH, inwards, outwards, wrench
from evertwin.types import Float64

SMALL = 1e-5
"""What two columns differ by relative to their size, or one counts relative to the largest, that
the digits of a description explain: they are one, or none."""

KEPT = 2**26
"""Bytes of columns that are kept at most."""


@njit(cache=True)
def _columns(geometry: Any, flats: Any, u: Any, out: Any) -> None:
    """Torques of each single inertial number, with all others zero: of a link those of the joints
    before it, from how its frame moves."""
    n = u.shape[1] // 3
    body, moved, forces, tau = (
        np.zeros(BODY),
        np.empty(MOVED * n),
        np.zeros(WRENCH * n),
        np.zeros(n),
    )
    for i in range(u.shape[0]):
        outwards(n, geometry, u[i], moved)
        for k in range(flats.shape[0]):
            link = flats[k] // BODY
            body[flats[k] % BODY] = 1.0
            wrench(link, body, 0, moved, forces, WRENCH * link)
            inwards(link + 1, geometry, u[i], moved, forces, 0, tau)
            body[flats[k] % BODY] = 0.0
            for j in range(WRENCH * link, WRENCH * (link + 1)):
                forces[j] = 0.0
            for j in range(n):
                out[i, j, k] = tau[j] if j <= link else 0.0


def body_columns(
    geometry: Float64[np.ndarray, " g"], flats: tuple[int, ...], u: Float64[np.ndarray, "n nu"]
) -> Float64[np.ndarray, "n ny k"]:
    """Derivative of the joint torques by the inertial numbers at ``flats`` (10·link + number)."""
    out = np.empty((len(u), u.shape[1] // 3, len(flats)))
    _columns(geometry, np.array(flats, dtype=np.int64), np.ascontiguousarray(u), out)
    return out


@dataclass
class BodyColumns:
    """The columns of tuned bodies. Those of the newest rows are kept, for a fit asks for them anew
    at every shape of friction.

    >>> BodyColumns(np.zeros(3 + 13 * 6), ()).of(np.zeros((2, 18))).shape
    (2, 6, 0)
    """

    geometry: Float64[np.ndarray, " g"]
    flats: tuple[int, ...]
    """Inertial numbers that are parameters."""
    payload: Float64[np.ndarray, "10 10"] | None = None
    """The last link's numbers by the payload's; None: it is none of the parameters."""
    _rows: Any = field(default=None, init=False)
    _newest: Any = field(default=None, init=False)

    def of(self, u: Float64[np.ndarray, "n nu"]) -> Float64[np.ndarray, "n ny k"]:
        """Columns of the bodies, then the payload's ten; not to be written to."""
        if self._rows is not None and np.array_equal(self._rows, u):
            return np.asarray(self._newest)
        parts = [body_columns(self.geometry, self.flats, u)]
        if self.payload is not None:
            first = BODY * (u.shape[1] // 3 - 1)
            last = tuple(range(first, first + BODY))
            parts.append(body_columns(self.geometry, last, u) @ self.payload)
        found = np.concatenate(parts, axis=2)
        self._rows, self._newest = (u.copy(), found) if found.nbytes <= KEPT else (None, None)
        return found


def base_parameters(
    geometry: Float64[np.ndarray, " g"], rotor: bool, coupling: Coupling | None = None,
    shafts: tuple[tuple[float, ...], ...] = (),
) -> tuple[int, ...]:  # fmt: skip
    """Positions of an independent set among the 10 n inertial numbers, in increasing order.

    Args:
        geometry: of a chain (`evertwin.machines.arm.rnea`).
        rotor: whether every motor has a rotor inertia of its own in the model.
        coupling: of motors and joints; None: each motor drives its joint.
        shafts: rows of those that turn with several axes.
    """
    return _base(geometry.tobytes(), rotor, coupling, shafts)


@cache
def _base(
    packed: bytes, rotor: bool, coupling: Coupling | None, shafts: tuple[tuple[float, ...], ...]
) -> tuple[int, ...]:
    geometry = np.frombuffer(packed).copy()
    n = (len(geometry) - 3) // 13
    u = np.random.default_rng(0).uniform(-2.0, 2.0, (20 * n, 3 * n))
    columns, motors = body_columns(geometry, tuple(range(BODY * n)), u), u
    if coupling is not None:
        columns, motors = coupling.felt(columns), coupling.of_joints(u)
    bodies = columns.reshape(-1, BODY * n)
    before = np.linalg.norm(bodies, axis=0)
    if rotor or shafts:
        rows = [*(np.eye(n) if rotor else ()), *map(np.array, shafts)]
        first, _ = np.linalg.qr(_rotors(motors, rows))
        bodies = bodies - first @ (first.T @ bodies)
    # Columns of unit length, so that pivoting compares directions and not units; what is left of
    # one that an angle of a few digits (1.5708 for π/2) keeps from zero has no direction.
    left = np.linalg.norm(bodies, axis=0)
    felt = left > SMALL * np.maximum(before, before.max())
    bodies = np.where(felt, bodies / np.where(felt, left, 1.0), 0.0)
    triangle, order = scipy.linalg.qr(bodies, mode="r", pivoting=True)
    size = np.abs(np.diag(triangle))
    return tuple(sorted(order[: np.count_nonzero(size > SMALL * size[0])].tolist()))


def _rotors(
    u: Float64[np.ndarray, "n nu"], rows: Sequence[Float64[np.ndarray, " n"]]
) -> Float64[np.ndarray, "all k"]:
    """The columns of inertias that turn with these combinations of the axes."""
    n = u.shape[1] // 3
    columns = [np.outer(u[:, 2 * n :] @ row, row).ravel() for row in rows]
    return np.stack(columns, axis=1)
