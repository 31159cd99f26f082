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

from functools import cache
from typing import Any

import numpy as np
import scipy

from evertwin.compiled.functions import njit
from evertwin.machines.arm.coupling import Coupling
from evertwin.machines.arm.rnea import BODY, joint_torques
from evertwin.types import Float64


@njit(cache=True)
def _columns(geometry: Any, flats: Any, u: Any, out: Any) -> None:
    """Torques of each single inertial number, with all others zero."""
    n = u.shape[1] // 3
    inertia, kept, tau = np.zeros(BODY * n), np.empty(8 * n), np.empty(n)
    for i in range(u.shape[0]):
        for k in range(flats.shape[0]):
            inertia[flats[k]] = 1.0
            joint_torques(n, geometry, inertia, u[i], tau, kept)
            inertia[flats[k]] = 0.0
            for j in range(n):
                out[i, j, k] = tau[j]


def body_columns(
    geometry: Float64[np.ndarray, " g"], flats: tuple[int, ...], u: Float64[np.ndarray, "n nu"]
) -> Float64[np.ndarray, "n ny k"]:
    """Derivative of the joint torques by the inertial numbers at ``flats`` (10·link + number)."""
    out = np.empty((len(u), u.shape[1] // 3, len(flats)))
    _columns(geometry, np.array(flats, dtype=np.int64), np.ascontiguousarray(u), out)
    return out


def base_parameters(
    geometry: Float64[np.ndarray, " g"], rotor: bool, coupling: Coupling | None = None
) -> tuple[int, ...]:
    """Positions of an independent set among the 10 n inertial numbers, in increasing order.

    Args:
        geometry: of a chain (`evertwin.machines.arm.rnea`).
        rotor: whether every motor has a rotor inertia of its own in the model.
        coupling: of motors and joints; None: each motor drives its joint.
    """
    return _base(geometry.tobytes(), rotor, coupling)


@cache
def _base(packed: bytes, rotor: bool, coupling: Coupling | None) -> tuple[int, ...]:
    geometry = np.frombuffer(packed).copy()
    n = (len(geometry) - 3) // 13
    u = np.random.default_rng(0).uniform(-2.0, 2.0, (20 * n, 3 * n))
    columns, motors = body_columns(geometry, tuple(range(BODY * n)), u), u
    if coupling is not None:
        columns, motors = coupling.felt(columns), coupling.of_joints(u)
    bodies = columns.reshape(-1, BODY * n)
    whole = np.linalg.norm(bodies)
    if rotor:
        first, _ = np.linalg.qr(_rotors(motors, n))
        bodies = bodies - first @ (first.T @ bodies)
    # Columns of unit length, so that pivoting compares directions and not units.
    bodies = bodies / np.maximum(np.linalg.norm(bodies, axis=0), 1e-9 * whole)
    triangle, order = scipy.linalg.qr(bodies, mode="r", pivoting=True)
    size = np.abs(np.diag(triangle))
    return tuple(sorted(order[: np.count_nonzero(size > 1e-6 * size[0])].tolist()))


def _rotors(u: Float64[np.ndarray, "n nu"], n: int) -> Float64[np.ndarray, "all n"]:
    """The columns of the rotor inertias: q̈ of the own joint."""
    columns = np.zeros((len(u), n, n))
    for j in range(n):
        columns[:, j, j] = u[:, 2 * n + j]
    return columns.reshape(-1, n)
