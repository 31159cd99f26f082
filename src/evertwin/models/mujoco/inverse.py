"""Inverse dynamics in MuJoCo: joint motion in, joint torques out; a static map.

    τ = M(q)·q̈ + bias(q, q̇) − passive forces − constraint forces

so friction losses, damping, springs and joint limits count; the torque is what drives have to add.

>>> rod = InverseDynamics.from_text('''<mujoco><worldbody><body>
...   <joint name="pivot" axis="0 1 0"/>
...   <geom type="capsule" size="0.02" fromto="0 0 0 0.5 0 0" mass="1"/></body></worldbody></mujoco>
...   ''')
>>> rod.inputs.names, rod.outputs.names
(('pivot.pos', 'pivot.vel', 'pivot.acc'), ('pivot.torque',))
>>> p = rod.parameters.values
>>> rod.simulate(np.zeros(0), np.zeros((1, 3)), np.zeros(1), p)[1].round(4).tolist()
[[-2.4525]]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import mujoco
import numpy as np

from evertwin.errors import ModelError
from evertwin.models.given import check_options
from evertwin.models.kernel import ANEW, Restart
from evertwin.models.mujoco.base import FromFile
from evertwin.models.mujoco.channels import controls, states
from evertwin.models.mujoco.guard import Source
from evertwin.models.mujoco.knobs import parameters_of, tunable
from evertwin.models.sizes import sized
from evertwin.models.static import StaticMap
from evertwin.signals.channels import Channel, Layout
from evertwin.types import (
    Inputs,
    Intervals,
    OutputRuns,
    Outputs,
    ParameterVector,
    ParameterVectors,
    Rollout,
    StateVector,
    StateVectors,
)

_DEFAULT = ("joint.*.damping", "joint.*.frictionloss", "joint.*.armature")


@dataclass(frozen=True, eq=False)
class InverseDynamics(StaticMap, FromFile):
    """Inverse dynamics of an MJCF or URDF model whose joints turn or slide. See the module.

    >>> InverseDynamics.__name__
    'InverseDynamics'
    """

    @classmethod
    def built(cls, source: Source, **options: Any) -> Self:
        """Options: ``parameters``, ``contact`` (false), ``threads``.

        Raises:
            ModelError: MuJoCo refuses the source, or a joint has more than one degree of freedom.
            UsageError: an option does not fit the model.
        """
        known = {"parameters", "contact", "threads"}
        check_options("mujoco", options, known)
        patterns = tuple(options.get("parameters", _DEFAULT))
        contact = bool(options.get("contact", False))
        model, knobs = tunable(source, patterns, None, contact)
        if model.nq != model.nv or model.njnt != model.nv:
            raise ModelError(f"{source.where}: inverse dynamics needs joints that turn or slide")
        torques = controls(model).channels[model.nu :]
        return cls(
            source, model, knobs, _motion(model), Layout(torques),
            parameters_of(model, knobs, source.where), int(options.get("threads", 0)),
        )  # fmt: skip

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """Torques of every row; NaN where the motion is not finite."""
        sized(x, self.states, p, self.parameters)
        return np.zeros(0), self._torques(u, p)

    def simulate_batch(
        self, x: StateVectors, u: Inputs, dt: Intervals, p: ParameterVectors,
        restart: Restart | None = None,
    ) -> OutputRuns:  # fmt: skip
        """Torques under each row of ``p``, in threads; see `evertwin.models.BatchModel`."""
        for values in p:
            sized(np.zeros(0), self.states, values, self.parameters)
        out = np.stack(self._engines.map(lambda j: self._torques(u, p[j]), len(p)))
        if restart is not None:
            out[:, restart.code == ANEW] = np.nan
        return out

    def _torques(self, u: Inputs, p: ParameterVector) -> Outputs:
        out = np.full((len(u), len(self.outputs)), np.nan)
        if not np.isfinite(p).all():
            return out
        with self._engines.engine(p) as engine:
            model, data, n = engine.model, engine.data, self.compiled.nv
            q, v, a, tau = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
            for i in np.flatnonzero(np.isfinite(u).all(axis=1)).tolist():
                q[:], v[:], a[:] = u[i, :n], u[i, n : 2 * n], u[i, 2 * n :]
                mujoco.mj_inverse(model, data)
                out[i] = tau
        return out


def _motion(model: Any) -> Layout:
    """Positions, velocities, accelerations, joint by joint."""
    known = states(model).channels
    speeds = known[model.nq : model.nq + model.nv]
    faster = [Channel(c.name.removesuffix("vel") + "acc", f"{c.unit}^2") for c in speeds]
    return Layout((*known[: model.nq], *speeds, *faster))
