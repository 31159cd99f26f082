"""A serial arm: joint motion in, joint torques or motor currents out.

    τ = ID(q, q̇, q̈; inertias, payload) + Ia·q̈ + friction(q̇, load)        i = τ / K

rigid bodies by recursive Newton-Euler, reflected rotor inertia ``Ia`` (ratio² times the rotor's
own), a friction law per joint (`evertwin.machines.friction`), the torque constant ``K`` at the
joint (ratio times the motor's). With the motion given, this is linear in all but the widths, the
delay and K, so tuning solves at once. The load that friction takes its share of is the rigid
torque of the arm as described (URDF), without what is tuned: that keeps it linear.

>>> arm = Arm.of("ur5_like", law="sign", payload=True)
>>> arm.inputs.names[:2], arm.outputs.names[:2], arm.parameters.names[:5]
(('q1', 'q2'), ('tau1', 'tau2'), ('Ia1', 'Fv1', 'Fc1', 'offset1', 'Ia2'))
>>> rest, p = np.zeros((1, 18)), arm.parameters.values
>>> _, tau = arm.simulate(np.zeros(0), rest, np.zeros(1), p)
>>> p[arm.parameters.index("payload.m")] = 2.0
>>> _, loaded = arm.simulate(np.zeros(0), rest, np.zeros(1), p)
>>> bool(abs(loaded[0, 1]) > abs(tau[0, 1]))
True
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.errors import UsageError
from evertwin.machines.arm import kernel as compiled
from evertwin.machines.arm import layout, linear
from evertwin.machines.arm.base import BodyColumns, base_parameters
from evertwin.machines.arm.chain import Chain, serial
from evertwin.machines.arm.coupling import Coupling
from evertwin.machines.arm.dh import robot_of, vector
from evertwin.machines.arm.lanes import batch, switches
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.arm.shafts import Shaft, columns
from evertwin.machines.arm.urdf import Robot, parse, read
from evertwin.machines.friction import Law, Rung, shape_of
from evertwin.machines.friction.kernel import WIDTH
from evertwin.machines.friction.resisting import Rubbed, friction
from evertwin.models import Kernel, Parameter, Parameters, Restart, roll
from evertwin.models.compiled import StaticMap
from evertwin.models.given import check_options
from evertwin.signals import Layout
from evertwin.types import Float64, Inputs, Int64, Intervals, Outputs, ParameterVector, StateVector

BUILT_IN = ("ur5_like",)
"""Descriptions that come with the package."""


def robot(description: str | Path) -> Robot:
    """The robot of a built-in name or of a URDF file.

    >>> robot("ur5_like").root
    'base_link'
    """
    if str(description) in BUILT_IN:
        text = files("evertwin.machines").joinpath("data", f"{description}.urdf")
        return parse(text.read_text(encoding="utf-8"), f"{description}.urdf")
    return read(description)


_MORE = {
    "tip", "gravity", "rotor", "delay", "width", "vs", "standstill", "coupling", "motion", "dh",
    "convention", "before", "tool", "shafts",
}  # fmt: skip
_NAMED = ("urdf", "law", "base", "payload", "motor")


def _described(urdf: str | Path, more: Mapping[str, Any]) -> Robot:
    """The robot of a URDF or of a Denavit-Hartenberg table."""
    table = {key: more[key] for key in ("convention", "before", "tool") if key in more}
    if ("dh" in more) == bool(urdf) or (table and urdf):
        raise UsageError("arm: expected either 'urdf' or 'dh' with its convention, before and tool")
    return robot(urdf) if urdf else robot_of(more["dh"], **table)


def _coupling(more: Mapping[str, Any]) -> Coupling | None:
    motion = more.get("motion", "joint")
    if motion not in ("joint", "motor"):
        raise UsageError(f"motion: expected 'joint' or 'motor', got {motion!r}")
    if "coupling" in more:
        return Coupling.of(more["coupling"], motion == "motor")
    if motion == "motor":
        raise UsageError("motion = 'motor' needs a 'coupling': q = C·θ")
    return None


@dataclass(frozen=True, eq=False, repr=False)
class Arm(StaticMap):
    """Inverse dynamics of a serial arm as a Model. Built by `Arm.of`; see the module.

    >>> Arm.of("ur5_like").columns.shape
    (6, 4)
    """

    chain: Chain
    laws: tuple[Law, ...]
    """Friction of each joint."""
    base: tuple[int, ...] = ()
    """Inertial numbers that are parameters (`evertwin.machines.arm.base`)."""
    rotor: bool = True
    """Does every joint have a rotor inertia?"""
    payload: bool = False
    """Are the tip's ten payload numbers parameters?"""
    delay: bool = False
    """Is there a parameter ``delay``: how much earlier the motion of an output was [s]?"""
    motor: tuple[float, ...] = ()
    """Torque constants at the joints [Nm/A]: outputs are currents; empty: torques."""
    parameters: Parameters = Parameters()
    """Filled in when empty; replace it to start elsewhere."""
    coupling: Coupling | None = None
    """Of motors and joints; drives, friction and outputs are then the motors'."""
    shafts: tuple[Shaft, ...] = ()
    """Those that turn with several axes and rub as well (`evertwin.machines.arm.shafts`)."""

    def __post_init__(self) -> None:
        n = self.chain.n
        if len(self.laws) != n or len(self.motor) not in (0, n):
            raise UsageError(f"arm: expected {n} friction laws and 0 or {n} torque constants")
        if self.coupling is not None and len(self.coupling.rows) != n:
            raise UsageError(f"coupling: expected {n} rows of {n} numbers, one for each joint")
        for law in self.laws:
            law.known_to("arm", ("load", "q"))
        if not len(self.parameters):
            object.__setattr__(self, "parameters", self._proposal())

    @classmethod
    def of(
        cls,
        urdf: str | Path = "",
        law: str | Sequence[str] = "sign",
        base: bool = False,
        payload: bool = False,
        motor: Sequence[float] = (),
        **more: Any,
    ) -> Arm:
        """An arm from its description.

        Args:
            urdf: a built-in name or a file; in its place ``dh``, a Denavit-Hartenberg table with
                ``convention``, ``before`` and ``tool`` (`evertwin.machines.arm.dh`).
            law: friction of all joints, or of each: ``sign``, ``tanh+stribeck+load``, …
            base: are the base inertial parameters to be tuned?
            payload: does the tip carry something to be tuned?
            motor: torque constants at the joints [Nm/A]; then outputs are currents.
            more: ``tip`` (link at the end), ``gravity`` [m/s²] in the base's frame, ``rotor``,
                ``delay``, ``width``, ``vs``, ``standstill`` of all laws, ``coupling`` (rows of C,
                `evertwin.machines.arm.coupling`) and ``motion`` (``joint`` or ``motor``),
                ``shafts`` (`evertwin.machines.arm.shafts`).
        """
        check_options("arm", more, (*_NAMED, *_MORE))
        where = {"tip": more["tip"]} if "tip" in more else {}
        if "gravity" in more:
            where["gravity"] = tuple(vector("gravity", more["gravity"], (3,), "m/s**2"))
        chain = serial(_described(urdf, more), **where)
        if chain.undescribed and not base:
            raise UsageError(f"{chain.notes[-1]}: set it, or give each an <inertial>")
        texts = [law] * chain.n if isinstance(law, str) else list(law)
        shape = shape_of({key: more[key] for key in ("width", "vs", "standstill") if key in more})
        laws = tuple(Law.parse(text).shaped(shape) for text in texts)
        rotor, coupling = bool(more.get("rotor", True)), _coupling(more)
        shafts = Shaft.of(more.get("shafts", {}), chain.n)
        turning = tuple(one.row for one in shafts)
        chosen = base_parameters(chain.geometry, rotor, coupling, turning) if base else ()
        return cls(
            chain, laws, chosen, rotor, payload, bool(more.get("delay", False)),
            tuple(motor), Parameters(), coupling, shafts,
        )  # fmt: skip

    def _proposal(self) -> Parameters:
        items = layout.drive_items(self.chain, self.laws, self.rotor)
        items += layout.base_items(self.chain, self.base)
        items += layout.payload_parameters() if self.payload else []
        items += [item for shaft in self.shafts for item in shaft.parameters()]
        items += [Parameter("delay", 0.0, "s", -0.1, 0.1, editable=False)] if self.delay else []
        for j, k in enumerate(self.motor):
            unit = "N/A" if self.chain.sliding[j] else "Nm/A"
            items.append(Parameter(f"K{j + 1}", k, unit, 1e-9, 1e9, editable=False))
        return Parameters(tuple(items))

    @cached_property
    def inputs(self) -> Layout:
        """Positions q1…qn, velocities qd1…qdn, accelerations qdd1…qddn."""
        return layout.inputs_of(self.chain, self.coupling is not None and self.coupling.motors)

    @cached_property
    def outputs(self) -> Layout:
        """Torques tau1…taun, or currents i1…in."""
        return layout.outputs_of(self.chain, bool(self.motor))

    @cached_property
    def _drives(self) -> layout.Drives:
        return layout.drives_of(self.laws, self.parameters.names)

    @cached_property
    def _standstill(self) -> Float64[np.ndarray, " ny"]:
        return np.array([law.standstill for law in self.laws])

    @cached_property
    def _widths(self) -> Int64[np.ndarray, " ny"]:
        """Place in ``p`` of the width of each joint's switch; −1: a sign."""
        return np.array([law[WIDTH] for law in self._drives.laws])

    @cached_property
    def _payload_map(self) -> Float64[np.ndarray, "10 10"]:
        return layout.payload_map(self.chain)

    @cached_property
    def _kernel(self) -> Kernel:
        parts = [self._standstill, self._payload_map.ravel()]
        if self.coupling is not None:
            parts += [self.coupling.matrix.ravel(), self.coupling.inverse.ravel()]
        parts += [np.array(shaft.row) for shaft in self.shafts]
        others = np.concatenate(parts)
        kept = (self.chain.geometry.copy(), self.chain.inertia.copy(), others)
        addresses = (kept[0].ctypes.data, kept[1].ctypes.data, kept[2].ctypes.data)
        own = (self.parameters, addresses, (self.coupling, self.shafts))
        context = layout.context_of(self.chain, self.base, self._drives, *own)
        return Kernel(compiled.step, compiled.adopt, context, kept)

    def kernel(self) -> Kernel:
        """Addresses for the fused loop; under a microsecond a row."""
        return self._kernel

    def __getstate__(self) -> dict[str, Any]:
        """Without what is computed: addresses mean nothing in another process."""
        return {k: v for k, v in self.__dict__.items() if k not in ("_kernel", "_bodies")}

    def simulate(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[StateVector, Outputs]:
        """The outputs of every row."""
        return roll(self._kernel, x, u, dt, p, Restart.never(len(u), self.chain.n))

    @cached_property
    def _linear(self) -> linear.Columns:
        names = self.parameters.names
        carried = names.index("payload.m") if self.payload else -1
        shaft = names.index(self.shafts[0].rung.add[0]) if self.shafts else -1
        carries = range(self.chain.n) if self.coupling is None else self.coupling.first
        firsts = self._first, carried, shaft
        return linear.columns_of(self._drives, self.base, firsts, tuple(carries), self.shafts)

    @property
    def columns(self) -> Int64[np.ndarray, "ny m"]:
        """Index into ``p`` of each joint's regressor columns, −1 where unused."""
        return self._linear.places

    def regressor(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """Torques of what is not tuned, and the compact regressor."""
        y0, *seen = self._seen(u, p)
        phi = np.empty((len(u), *self.columns.shape))
        linear.fill(self._linear, p, *seen, phi)
        return self._driven(p, y0, phi)

    def partial(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector,
        slot: Int64[np.ndarray, "ny m"],
    ) -> tuple[Outputs, Float64[np.ndarray, "n ny t"]]:  # fmt: skip
        """The columns that have a ``slot``; torques of all else."""
        known = not self.shafts and bool(self.base or self.payload)
        known &= not np.any(slot[self._linear.code >= 0] >= 0)
        y0, *seen = self._seen(u, p, bodies=not known)
        y0 = y0.copy()  # it may be the load that friction goes by
        phi = np.empty((len(u), len(slot), int(slot.max(initial=-1)) + 1))
        columns = self._linear.without_bodies if known else self._linear
        linear.split(columns, slot, p, *seen, y0, phi)
        return self._driven(p, y0, phi)

    def _seen(self, u: Inputs, p: ParameterVector, *, bodies: bool = True) -> tuple[Any, ...]:
        """Rigid torques, without those of ``bodies`` that are tuned; then what columns are made of:
        the motors' motion, switches, rigid torques as described, columns of bodies."""
        motors = joints = self._motion(np.ascontiguousarray(u), p)
        if self.coupling is not None and self.coupling.motors:
            joints = self.coupling.of_motors(motors)
        elif self.coupling is not None:
            motors = self.coupling.of_joints(joints)
        described = rest = self.chain.inertia
        if not bodies:
            rest = self.bodies(p).ravel()
        elif self.base:
            rest = rest.copy()
            rest[list(self.base)] = 0.0
        y0 = load = self._felt(batch(self.chain.geometry, rest, joints))
        if rest is not described:
            load = self._felt(batch(self.chain.geometry, described, joints))
        s = switches(motors, self._widths, p, self._standstill)
        seen = self._felt(self._bodies.of(joints) if bodies else np.empty((*y0.shape, 0)))
        turning = columns(self.shafts, motors, p, self._widths, self._standstill)
        return y0, motors, s, load, np.concatenate([seen, *turning], axis=2) if turning else seen

    def _driven(self, p: ParameterVector, y0: Any, phi: Any) -> tuple[Any, Any]:
        """Currents, where motors are known."""
        if not self.motor:
            return y0, phi
        at = self.parameters.index("K1")
        k = p[at : at + len(self.motor)]
        return y0 / k, phi / k[:, None]

    def _felt(self, torques: Any) -> Any:
        """Joint torques as the motors feel them."""
        return torques if self.coupling is None else self.coupling.felt(torques)

    def _motion(self, u: Inputs, p: ParameterVector) -> Inputs:
        """The motion ``delay`` earlier; see `evertwin.machines.arm.kernel.moved_motion`."""
        late = float(p[self.parameters.index("delay")]) if self.delay else 0.0
        if late == 0.0:
            return u
        q, v, a = np.split(u, 3, axis=1)
        return np.concatenate([q - late * (v - 0.5 * late * a), v - late * a, a], axis=1)

    @cached_property
    def _bodies(self) -> BodyColumns:
        payload = self._payload_map if self.payload else None
        return BodyColumns(self.chain.geometry, self.base, payload)

    @cached_property
    def _first(self) -> int:
        """Place in ``p`` of the first tuned number of a body; 0: there is none."""
        items = layout.base_items(self.chain, self.base)
        return self.parameters.index(items[0].name) if items else 0

    def bodies(self, p: ParameterVector) -> Float64[np.ndarray, "ny 10"]:
        """The ten numbers of each link at ``p``, the payload's in the last."""
        out = self.chain.inertia.copy()
        out[list(self.base)] = p[self._first : self._first + len(self.base)]
        if self.payload:
            first = self.parameters.index("payload.m")
            out[-BODY:] += self._payload_map @ p[first : first + BODY]
        return out.reshape(-1, BODY)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, from base to tip."""
        return self.chain.joints

    @property
    def notes(self) -> tuple[str, ...]:
        """What the description leaves out, or cannot mean."""
        return self.chain.notes

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Friction's coefficients."""
        return tuple(n for j, law in enumerate(self.laws) for n in law.rubbing(str(j + 1)))

    @property
    def biases(self) -> tuple[str, ...]:
        """Constant forces of the drives."""
        return tuple(n for j, law in enumerate(self.laws) for n in law.biases(str(j + 1)))

    def rubbed(self, u: Inputs, y: Outputs, p: ParameterVector) -> tuple[Rubbed, ...]:
        """Friction of every joint at rows of motion, as its motor feels it."""
        force = friction(self, u, p, self.rubbing, self.biases)
        if self.motor:
            at = self.parameters.index("K1")
            force = force * p[at : at + len(self.motor)]
        motors = u
        if self.coupling is not None and not self.coupling.motors:
            motors = self.coupling.of_joints(u)
        n, slides = self.chain.n, self.chain.sliding
        return tuple(
            Rubbed(
                f"joint {j + 1}", law.rubbing(str(j + 1)),
                ("m/s", "N") if slides[j] else ("rad/s", "Nm"), motors[:, n + j], force[:, j],
            )
            for j, law in enumerate(self.laws)
        ) + tuple(one.rubbed(motors, self.parameters, p) for one in self.shafts)  # fmt: skip

    def rungs(self) -> tuple[Rung, ...]:
        """Steps up the ladder of friction laws, joint by joint; each has to pay on unseen data."""
        laws = ((j, law.rungs(str(j + 1))) for j, law in enumerate(self.laws))
        rungs = (rung._replace(output=j) for j, some in laws for rung in some)
        return (*(shaft.rung for shaft in self.shafts), *rungs)

    def law_name(self, output: int, terms: Sequence[str]) -> str:
        """The law of a joint that has these of its terms."""
        own = (one.name for one in self.shafts if one.axis == output and "shaft" in terms)
        return "+".join((str(self.laws[output].only(terms)), *own))

    def moving(self, threshold: float = 0.05) -> Any:
        """``moving(u) -> bool (n, ny)``: where a joint is faster than ``threshold`` [rad/s]."""
        n = self.chain.n
        joints = self.coupling if self.coupling and not self.coupling.motors else None

        def faster(u: Inputs) -> Any:
            own = u if joints is None else joints.of_joints(u)
            return np.abs(own[:, n : 2 * n]) > threshold

        return faster
