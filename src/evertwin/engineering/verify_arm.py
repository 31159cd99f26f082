"""Verification of a serial arm: against MuJoCo, and by the laws of energy and momentum.

* Against an independent engine: torques, mass matrix and gravity of the same chain. What is
  compared is the model as it runs, kernel, payload, chosen base parameters, coupling and motor
  constants included; only friction is zero, because it is a law of our own.
* Power: along a motion, joint torques times speeds are the change of kinetic and potential energy.
* Energy: a free motion without friction, integrated step by step, keeps it.
* Momentum: without gravity the first joint's momentum changes by its torque alone, because the
  kinetic energy does not depend on where the first joint stands.
* Friction takes power out at every speed that the rows show.

>>> from evertwin.machines.arm import Arm
>>> checks = verify_arm(Arm.of("ur5_like"), np.zeros((1, 18)), Arm.of("ur5_like").parameters.values)
>>> all(check.passed for check in checks)
True
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.engineering.verification import Check
from evertwin.errors import MissingExtra, ModelError
from evertwin.machines.arm import Arm, layout
from evertwin.machines.arm.chain import Chain
from evertwin.machines.arm.lanes import batch
from evertwin.machines.arm.mjcf import central, mjcf_of
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.assembly.kinematics import frames
from evertwin.machines.catalog import machine
from evertwin.machines.friction.resisting import pushing
from evertwin.models import Model
from evertwin.types import Float64, Inputs, Outputs, ParameterVector, Vector

TORQUE, EXACT, POWER, ENERGY = 1e-7, 1e-12, 1e-6, 1e-6
"""Limits: torque [Nm], mass matrix and gravity, power and energy relative to what flows."""
ROWS = 200
"""Rows of the recording that are looked at, and random ones besides."""


def mass_matrices(torques: Callable[[Inputs], Outputs], q: Outputs) -> Float64[np.ndarray, "n k k"]:
    """Torques of unit accelerations at rest; ``torques`` without gravity, of q, q̇, q̈."""
    n, k = q.shape
    out = np.empty((n, k, k))
    for j in range(k):
        unit = np.zeros((n, 3 * k))
        unit[:, :k], unit[:, 2 * k + j] = q, 1.0
        out[:, :, j] = torques(unit)
    return out


class Rigid(NamedTuple):
    """The rigid bodies of an arm.

    >>> Rigid._fields
    ('chain', 'still')
    """

    chain: Chain
    still: Float64[np.ndarray, " g"]
    """Geometry without gravity."""

    @classmethod
    def of(cls, chain: Chain) -> Rigid:
        """The bodies of a chain."""
        still = chain.geometry.copy()
        still[:3] = 0.0
        return cls(chain, still)

    def torques(self, u: Inputs, gravity: bool = True) -> Outputs:
        """Inverse dynamics of q, q̇, q̈, (n, 3 k) to (n, k)."""
        geometry = self.chain.geometry if gravity else self.still
        return np.asarray(batch(geometry, self.chain.inertia, np.ascontiguousarray(u)))

    def mass(self, q: Outputs) -> Float64[np.ndarray, "n k k"]:
        """Mass matrices."""
        return mass_matrices(lambda u: self.torques(u, gravity=False), q)

    def energy(self, q: Outputs, v: Outputs) -> Float64[np.ndarray, "n 2"]:
        """Kinetic and potential energy [J]."""
        kinetic = 0.5 * np.einsum("ni,nij,nj->n", v, self.mass(q), v)
        height = np.zeros(len(q))  # −Σ g·(m x + R h): the first moments in the base's frame
        for frame, body in zip(
            frames(self.chain, q), self.chain.inertia.reshape(-1, BODY), strict=True
        ):
            moment = body[0] * frame[:, :3, 3] + frame[:, :3, :3] @ body[1:4]
            height -= moment @ self.chain.geometry[:3]
        return np.stack([kinetic, height], axis=1)


def verify_arm(arm: Arm, u: Inputs, p: ParameterVector) -> tuple[Check, ...]:
    """All checks of an arm at the parameters ``p``, on rows ``u`` of joint (or motor) motion."""
    p, said = _physical(arm, p)
    whole = u[np.isfinite(u).all(axis=1)]
    seen = whole[:: max(1, len(u) // ROWS)][:ROWS]
    rng = np.random.default_rng(0)
    rows = np.concatenate([seen, rng.uniform(-2.0, 2.0, (ROWS, 3 * arm.chain.n))])
    rigid = Rigid.of(replace(arm.chain, inertia=arm.bodies(p).ravel()))
    joints = arm.coupling.of_motors(rows) if arm.coupling and arm.coupling.motors else rows
    return (
        *_against_engine(arm, p, rows, joints, (rigid, said)),
        *_laws(rigid, joints, rng),
        resists(arm, whole if len(whole) else rows, p),
    )


def _physical(arm: Arm, p: ParameterVector) -> tuple[ParameterVector, str]:
    """Parameters whose links could be bodies: tuned base parameters are sums that no body has."""
    try:
        for body in arm.bodies(p):
            central(body)
    except ModelError:
        described = [*layout.base_items(arm.chain, arm.base), *layout.payload_parameters()]
        out, names = p.copy(), arm.parameters.names
        for item in described:
            if item.name in names:
                out[names.index(item.name)] = item.value
        return out, "at the description's inertias: the tuned base parameters are those of no body"
    return p, "at the present parameters"


def _bare(arm: Arm, p: ParameterVector) -> ParameterVector:
    """Without friction and delay."""
    out = _unbiased(arm, p)
    out[arm.parameters.indices(arm.rubbing)] = 0.0
    return out


def _unbiased(arm: Arm, p: ParameterVector) -> ParameterVector:
    """Without constant forces and delay."""
    out = p.copy()
    out[arm.parameters.indices((*arm.biases, *(["delay"] if arm.delay else [])))] = 0.0
    return out


def _torques(arm: Arm, u: Inputs, p: ParameterVector) -> Outputs:
    """The model's torques at its outputs, whatever it puts out (torques or currents)."""
    _, y = arm.simulate(np.zeros(0), np.ascontiguousarray(u), np.zeros(len(u)), p)
    first = arm.parameters.index("K1") if arm.motor else -1
    return y * p[first : first + arm.chain.n] if arm.motor else y


def _motors(arm: Arm, rows: Inputs) -> Inputs:
    """The motion of the motors."""
    if arm.coupling is None or arm.coupling.motors:
        return rows
    return arm.coupling.of_joints(rows)


def _against_engine(
    arm: Arm, p: ParameterVector, rows: Inputs, joints: Inputs, known: tuple[Rigid, str]
) -> tuple[Check, ...]:
    rigid, said = known
    names = ("torques against MuJoCo", "mass matrix against MuJoCo", "gravity against MuJoCo")
    try:
        engine = _Engine.of(rigid.chain)
    except (MissingExtra, ModelError) as error:
        return tuple(Check.missing(name, "engine", str(error)) for name in names)
    n, free = arm.chain.n, _bare(arm, p)
    expected = engine.torques(joints)
    if arm.coupling is not None:
        expected = arm.coupling.felt(expected)
    if arm.rotor:
        inertia = p[arm.parameters.indices([f"Ia{j + 1}" for j in range(n)])]
        expected = expected + inertia * _motors(arm, rows)[:, 2 * n :]
    off = np.abs(_torques(arm, rows, free) - expected).max()
    poses = joints[-50:, :n]
    rest = np.concatenate([poses, np.zeros((len(poses), 2 * n))], axis=1)
    mass = np.abs(rigid.mass(poses) - engine.mass(poses)).max()
    weight = np.abs(rigid.torques(rest) - engine.torques(rest)).max()
    # Beyond a hundred Nm (kgm2) a unit in the last place is near the limit: it grows with them.
    large = [max(1.0, float(np.abs(m).max()) / 100.0) for m in (rigid.mass(poses), expected)]
    return (
        Check(names[0], "engine", float(off), TORQUE, "Nm", f"{len(rows)} rows, {said}"),
        Check(names[1], "engine", float(mass), EXACT * large[0], "kgm2", "50 poses"),
        Check(names[2], "engine", float(weight), EXACT * large[1], "Nm", "50 poses"),
    )


class _Engine(NamedTuple):
    """The chain in MuJoCo, with and without gravity."""

    heavy: Any
    still: Any

    @classmethod
    def of(cls, chain: Chain) -> _Engine:
        options = [{"text": mjcf_of(chain, on), "inverse": True} for on in (True, False)]
        return cls(*(machine("mujoco", o) for o in options))

    def torques(self, u: Inputs, model: Any = None) -> Outputs:
        model = model or self.heavy
        y = model.simulate(np.zeros(0), u, np.zeros(len(u)), model.parameters.values)[1]
        return np.asarray(y)

    def mass(self, q: Outputs) -> Float64[np.ndarray, "n k k"]:
        return mass_matrices(lambda u: self.torques(u, self.still), q)


def _laws(rigid: Rigid, rows: Inputs, rng: np.random.Generator) -> tuple[Check, ...]:
    n = rigid.chain.n
    q, v, a = rows[:, :n], rows[:, n : 2 * n], rows[:, 2 * n :]
    tau = rigid.torques(rows)
    power, step = (tau * v).sum(axis=1), 1e-4
    ahead, behind = (rigid.energy(*_moved((q, v, a), s)).sum(axis=1) for s in (step, -step))
    flow = float(np.abs(tau * v).sum(axis=1).max()) or 1.0
    balance = float(np.abs((ahead - behind) / (2 * step) - power).max()) / flow
    still = rigid.torques(rows, gravity=False)[:, 0]
    after, before = (_momentum(rigid, *_moved((q, v, a), s)) for s in (step, -step))
    scale = float(np.abs(still).max()) or 1.0
    moment = float(np.abs((after - before) / (2 * step) - still).max()) / scale
    shown, least = f"{len(rows)} rows", float(np.linalg.eigvalsh(rigid.mass(q)).min())
    definite = f"{shown}; least eigenvalue {least:.3g}"
    return (
        Check("power balance", "law", balance, POWER, "1", f"{shown}; of {flow:.3g} W"),
        Check("momentum of the first joint", "law", moment, POWER, "1", f"{shown}; no gravity"),
        Check("mass matrix is positive definite", "law", max(0.0, -least), 0.0, "kgm2", definite),
        _free_motion(rigid, rng),
    )


def _moved(motion: tuple[Outputs, Outputs, Outputs], s: float) -> tuple[Outputs, Outputs]:
    """Position and speed ``s`` seconds on, by the motion's own acceleration."""
    q, v, a = motion
    return q + s * v + 0.5 * s * s * a, v + s * a


def _momentum(rigid: Rigid, q: Outputs, v: Outputs) -> Vector:
    return np.asarray(np.einsum("nj,nj->n", rigid.mass(q)[:, 0], v))


def _free_motion(rigid: Rigid, rng: np.random.Generator) -> Check:
    """A fall without friction for half a second."""
    n, name = rigid.chain.n, "energy of a free motion"
    start = np.concatenate([rng.uniform(-1.0, 1.0, n), rng.uniform(-0.5, 0.5, n)])
    moments = np.linalg.eigvalsh(rigid.mass(start[None, :n]))
    if moments.min() <= 1e-14 * moments.max():
        why = "a joint turns no inertia: its links are masses in points on its axis"
        return Check.missing(name, "law", why)

    def slope(_: float, x: Vector) -> Vector:
        q, v = x[None, :n], x[None, n:]
        bias = rigid.torques(np.concatenate([q, v, np.zeros((1, n))], axis=1))[0]
        return np.concatenate([x[n:], np.linalg.solve(rigid.mass(q)[0], -bias)])

    found = scipy.integrate.solve_ivp(slope, (0.0, 0.5), start, rtol=1e-10, atol=1e-10)
    x = found.y.T
    parts = rigid.energy(x[:, :n], x[:, n:])
    at_start = 0.5 * float(start[n:] @ rigid.mass(start[None, :n])[0] @ start[n:])
    # where gravity does no work nothing is exchanged: the energy of the motion itself is the scale
    total, flow = parts.sum(axis=1), max(float(np.ptp(parts[:, 0])), at_start)
    drift = float(np.abs(total - total[0]).max()) / flow
    said = f"0.5 s, {len(x)} steps; of {flow:.3g} J"
    return Check(name, "law", drift, ENERGY, "1", said)


def resists(model: Model, u: Inputs, p: ParameterVector) -> Check:
    """Power that the friction of a static map gives out; an offset is no friction and left out."""
    found = pushing(model, u, np.empty((len(u), 0)), p)
    said = "; ".join((f"{len(u)} rows", *map(str, found)))
    worst = max((push.power for push in found), default=0.0)
    return Check("friction takes power out", "law", worst, 0.0, "W", said)
