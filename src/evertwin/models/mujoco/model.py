"""A MuJoCo model (MJCF or URDF) as a Model: roll-outs from its state under its actuators.

>>> rod = MuJoCo.from_text('''<mujoco><option timestep="0.005"/><worldbody><body>
...   <joint name="pivot" axis="0 1 0" damping="0.02"/>
...   <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.5" mass="1"/></body></worldbody>
...   <actuator><motor name="motor" joint="pivot"/></actuator></mujoco>''')
>>> rod.inputs.names, rod.outputs.names, rod.parameters.names[:2]
(('motor',), ('pivot.pos', 'pivot.vel'), ('joint.pivot.damping', 'joint.pivot.frictionloss'))
>>> p = rod.parameters.values
>>> x, y = rod.simulate(rod.initial(p), np.ones((2, 1)), np.full(2, 0.01), p)
>>> y.round(4).tolist()
[[0.0009, 0.1164], [0.0029, 0.2322]]

`InverseDynamics`: joint motion in, joint torques out; a static map.

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

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import mujoco
import numpy as np

from evertwin.errors import ModelError, UsageError
from evertwin.models.compiled import StaticMap
from evertwin.models.functions.function import adopted
from evertwin.models.given import check_options
from evertwin.models.kernels.kernel import ADOPT, ANEW, CONTINUE, Restart
from evertwin.models.kernels.rollout import sized
from evertwin.models.mujoco.base import FromFile
from evertwin.models.mujoco.channels import Output, controls, outputs, states
from evertwin.models.mujoco.engine import Engine, Steps, steps_of
from evertwin.models.mujoco.guard import Source
from evertwin.models.mujoco.knobs import DEFAULT, parameters_of, tunable
from evertwin.models.mujoco.rooms import Rooms, stretches_of
from evertwin.models.tables.bodies import MOST_TABLES, UNITS, Plate, table_channels
from evertwin.settings.quantity import in_unit
from evertwin.signals.channels import Channel, Layout
from evertwin.types import (
    Float64,
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


@dataclass(frozen=True, eq=False, repr=False)
class MuJoCo(FromFile):
    """Forward roll-outs. Built by `MuJoCo.of` or `MuJoCo.from_text`; see the module.

    >>> MuJoCo.__name__
    'MuJoCo'
    """

    read: tuple[Output, ...]
    """Where the outputs are found."""
    driven: tuple[int, ...]
    """Place of each input among all controls."""
    states: Layout
    start: tuple[float, ...]
    """State before the first row: the model's own, or a keyframe's."""
    plate: Plate = Plate()
    """Of the tables that are inputs."""

    @classmethod
    def built(cls, source: Source, **options: Any) -> Self:
        """Options: ``parameters`` (patterns of names, `evertwin.models.mujoco.knobs`), ``inputs``,
        ``outputs`` (names, `evertwin.models.mujoco.channels`), ``keyframe`` (start state),
        ``timestep`` [s], ``contact`` (true), ``threads``; ``tables``: for how many its inputs have
        places (`evertwin.models.tables.bodies`), with ``plate`` (``height``, ``overhang``,
        ``solid``).

        Raises:
            ModelError: MuJoCo refuses the source.
            UsageError: an option does not fit the model.
        """
        known = {"parameters", "inputs", "outputs", "keyframe", "timestep", "contact", "threads",
                 "tables", "plate"}  # fmt: skip
        check_options("mujoco", options, known)
        patterns = tuple(options.get("parameters", DEFAULT))
        said = options.get("timestep")
        step = None if said is None else in_unit("timestep", said, "s")
        contact = bool(options.get("contact", True))
        model, knobs = tunable(source, patterns, step, contact)
        found = outputs(model, options.get("outputs"))
        if all(output.kept for output in found):
            model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
        driven, inputs = _driven(model, options.get("inputs"))
        inputs = Layout((*inputs.channels, *_places(options.get("tables", 0))))
        return cls(
            source, model, knobs, inputs, Layout(tuple(output.channel for output in found)),
            parameters_of(model, knobs, source.where), int(options.get("threads", 0)),
            found, driven, states(model), _start(model, options.get("keyframe")),
            _plate(options.get("plate", {})),
        )  # fmt: skip

    @cached_property
    def _rooms(self) -> Rooms:
        return Rooms(self.source, self.compiled, self.knobs, self.plate, self.threads)

    @cached_property
    def _adopts(self) -> list[tuple[int, int]]:
        """Outputs that are numbers of the state, and which."""
        return [(k, output.place) for k, output in enumerate(self.read) if output.kept]

    @cached_property
    def _sensed(self) -> tuple[int, ...]:
        """Outputs that only a sensor shows."""
        return tuple(k for k, output in enumerate(self.read) if not output.kept)

    def initial(self, p: ParameterVector) -> StateVector:
        """The state before the first row, (nx,)."""
        return np.array(self.start, dtype=np.float64)

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """The state with measured positions and velocities written into it."""
        return adopted(x, y, self._adopts)

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """State after the last row and the outputs of every row; a row that diverges is NaN."""
        sized(x, self.states, p, self.parameters)
        return self._roll(np.array(x, dtype=np.float64), u, dt, p)

    def simulate_batch(
        self, x: StateVectors, u: Inputs, dt: Intervals, p: ParameterVectors,
        restart: Restart | None = None,
    ) -> OutputRuns:  # fmt: skip
        """Outputs under each row of ``p``, in threads; see `evertwin.models.BatchModel`."""
        for state, values in zip(x, p, strict=True):
            sized(state, self.states, values, self.parameters)

        def one(j: int) -> Outputs:
            if restart is None:
                return self._roll(x[j], u, dt, p[j])[1]
            return self._restarted(x[j], u, dt, p[j], restart)

        return np.stack(self._engines.map(one, len(p)))

    def _restarted(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector, restart: Restart
    ) -> Outputs:
        """Stretches from restart to restart."""
        out = np.full((len(u), len(self.outputs)), np.nan)
        marks = np.flatnonzero(restart.code != CONTINUE).tolist()
        edges = sorted({0, *marks, *(k + 1 for k in marks if restart.code[k] == ANEW), len(u)})
        state = np.array(x, dtype=np.float64)
        for a, b in pairwise(edges):
            if restart.code[a] == ANEW:
                state = self.observe(x, restart.y[a])
                continue
            if restart.code[a] == ADOPT:
                state = self.observe(state, restart.y[a - 1])
            state, out[a:b] = self._roll(state, u[a:b], dt[a:b], p)
        return out

    def _roll(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """Rows in stretches between which no table changes."""
        if not (np.isfinite(p).all() and np.isfinite(x).all()):
            return np.array(x), np.full((len(u), len(self.outputs)), np.nan)
        tables = u[:, len(self.driven) :]
        if not tables.size:
            with self._engines.engine(p) as engine:
                return self._in_room(engine, x, u, dt)
        out = np.full((len(u), len(self.outputs)), np.nan)
        for a, b in stretches_of(np.nan_to_num(tables)):
            with self._rooms.engines(np.nan_to_num(tables[a])).engine(p) as engine:
                x, out[a:b] = self._in_room(engine, x, u[a:b], dt[a:b])
        return x, out

    def _in_room(self, engine: Engine, x: StateVector, u: Inputs, dt: Intervals) -> Rollout:
        """Rows in stretches of equal duration."""
        out = np.full((len(u), len(self.outputs)), np.nan)
        control = np.zeros((len(u), self.compiled.nu + self.compiled.nv))
        control[:, list(self.driven)] = u[:, : len(self.driven)]
        able = np.isfinite(u).all(axis=1) & np.isfinite(dt)
        for a, b, steps in _stretches(dt, able, float(self.compiled.opt.timestep)):
            rows = slice(a, b)
            if steps.number == 0:
                states = np.broadcast_to(x, (b - a, len(x)))
            else:
                x, states = engine.run(x, control[rows], steps)
            out[rows] = self._outputs(engine, states, control[rows])
        return x, out

    def _outputs(self, engine: Engine, states: Any, control: Any) -> Outputs:
        places = [output.place for output in self.read]
        if not self._sensed:
            return np.asarray(states[:, places])
        sensed = engine.sensors(states, control)
        columns = [(states if o.kept else sensed)[:, o.place] for o in self.read]
        return np.stack(columns, axis=1)


def _stretches(dt: Intervals, able: np.ndarray, step: float) -> list[tuple[int, int, Steps]]:
    """[start, stop) of neighbouring rows that are cut alike; rows that cannot run are left out."""
    if len(dt) == 1:
        steps = steps_of(float(dt[0]), step)
        return [(0, 1, steps)] if able[0] and steps.number >= 0 else []
    cuts = np.flatnonzero((np.diff(dt) != 0) | (np.diff(able.astype(np.int8)) != 0)) + 1
    edges = [0, *cuts.tolist(), len(dt)] if len(dt) else []
    found = [(a, b, steps_of(float(dt[a]), step)) for a, b in pairwise(edges) if able[a]]
    return [(a, b, steps) for a, b, steps in found if steps.number >= 0]


def _driven(model: Any, names: Sequence[str] | None) -> tuple[tuple[int, ...], Layout]:
    """Places of the inputs among all controls: the actuators, else the joints' torques."""
    every = controls(model)
    if names is None:
        first, last = (0, model.nu) if model.nu else (0, model.nv)
        return tuple(range(first, last)), Layout(every.channels[first:last])
    return tuple(every.index(name) for name in names), every.select(names)


def _places(tables: object) -> Iterator[Channel]:
    """Inputs that say where tables stand."""
    if not isinstance(tables, int) or not 0 <= tables <= MOST_TABLES:
        raise UsageError(f"tables: expected 0 to {MOST_TABLES} places, got {tables!r}")
    for name in table_channels(tables):
        yield Channel(name, UNITS[name.partition(".")[2]])


def _plate(said: Mapping[str, Any]) -> Plate:
    check_options("mujoco: plate", said, Plate._fields)
    numbers = {name: in_unit(name, said[name], "m") for name in ("height", "overhang")
               if name in said}  # fmt: skip
    return Plate(**numbers, solid=bool(said.get("solid", False)))


def _start(model: Any, keyframe: str | None) -> tuple[float, ...]:
    if keyframe is None:
        return (*model.qpos0.tolist(), *np.zeros(model.nv + model.na).tolist())
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_KEY, k) for k in range(model.nkey)]
    if keyframe not in names:
        raise UsageError(f"keyframe: no {keyframe!r} in the model; there are {names}")
    k = names.index(keyframe)
    parts = (model.key_qpos[k], model.key_qvel[k], model.key_act[k])
    return tuple(float(value) for part in parts for value in part)


_DEFAULT = ("joint.*.damping", "joint.*.frictionloss", "joint.*.armature")


@dataclass(frozen=True, eq=False, repr=False)
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


def model_of_file(
    file: str | Path = "", inverse: bool = False, text: str = "", **options: Any
) -> MuJoCo | InverseDynamics:
    """What a twin file's ``kind = "mujoco"`` means: roll-outs, or with ``inverse`` torques.

    Raises:
        UsageError: neither ``file`` nor ``text`` (XML at hand), or both.
    """
    if bool(file) == bool(text):
        raise UsageError("mujoco: expected the option 'file' (MJCF or URDF), or 'text' (XML)")
    kind = InverseDynamics if inverse else MuJoCo
    return kind.of(file, **options) if file else kind.from_text(text, **options)
