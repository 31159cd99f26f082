"""The forward reading of an assembly as a Model: commands in, motion out.

What the commands are follows from the components: with a path planner one input signal
(``override``, the pace of the path, 0 … 1), with a controller position and speed set-points
(reached at the end of their row, at that speed), with a motor alone its current, voltage or torque,
without one the effort at the joint.

>>> from evertwin.machines.assembly.train import join
>>> axis = join([{"name": "table", "kind": "mass", "axis": 1, "mass": 2.0},
...              {"name": "guide", "kind": "guide", "axis": 1, "friction": "sign", "Fc": 1.0}])
>>> model = forward(axis)
>>> model.inputs.names, model.states.names, model.outputs.names
(('tau1',), ('q1', 'qd1'), ('q1', 'qd1'))
>>> p, pull = model.parameters.values, np.array([[0.9], [3.0]])
>>> model.simulate(model.initial(p), pull, np.full(2, 0.1), p)[1][:, 1].round(3).tolist()
[0.0, 0.1]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evertwin.errors import UsageError
from evertwin.machines.assembly import onward, shared
from evertwin.machines.assembly.boxed import box_channels, box_plan, box_start, box_states
from evertwin.machines.assembly.context import Columns, Places, context_of
from evertwin.machines.assembly.inverse import heat_channels
from evertwin.machines.assembly.ladder import Laddered
from evertwin.machines.assembly.path import Joints, Limits, Motion, moves_of, plan
from evertwin.machines.assembly.sensors import Sensor, sensors_of
from evertwin.machines.assembly.shared import QUANTITIES
from evertwin.machines.assembly.train import Axis, Train
from evertwin.models import Kernel, Parameters, Restart, roll
from evertwin.settings.quantity import in_unit
from evertwin.signals import Channel, Layout
from evertwin.signals.channels import position
from evertwin.types import Float64, Inputs, Intervals, Outputs, ParameterVector, StateVector

ARM_STEP = 1e-3
"""Largest part of a row of an arm by default [s]."""


def planned(train: Train) -> Motion | None:
    """The motion of the path planner among the components; None without one.

    Raises:
        UsageError: what cannot be planned; names the component.
    """
    part = train.path
    if part is None:
        return None
    try:
        start = _of_axes(train, "start", part.option("start") or (0.0,) * len(train.axes), "")
        limits = Limits(
            _of_axes(train, "speed", part.option("speed"), "/s"),
            _of_axes(train, "acceleration", part.option("acceleration"), "/s**2"),
        )
        rate = in_unit("rate", part.option("rate"), "1/s")
        moves = [
            Joints(_of_axes(train, "to", m.to, "")) if isinstance(m, Joints) else m
            for m in moves_of(part.option("moves"))
        ]
        if len(start) != len(train.axes):
            raise UsageError(f"expected start with {len(train.axes)} positions, got {len(start)}")
        motion = plan(moves, start, limits, rate, part.option("profile"), train.chain)
    except UsageError as error:
        raise UsageError(f"component {part.name!r}: {error}") from error
    if len(motion.t) < 2:
        raise UsageError(f"component {part.name!r}: expected moves, got a path without a row")
    return motion


def _of_axes(train: Train, what: str, values: Sequence[Any], order: str) -> tuple[float, ...]:
    """One number for each axis, in its unit; another count is the planner's to refuse."""
    units = [("m" if axis.slides else "rad") + order for axis in train.axes]
    units += ["1"] * (len(values) - len(units))
    return tuple(in_unit(what, v, unit) for v, unit in zip(values, units, strict=False))


def forward(train: Train, sensors: Sequence[str] = (), step: float | None = None) -> Forward:
    """The forward reading of joined components.

    Args:
        sensors: quantities inside components that are outputs too, ``<component>.<quantity>``.
        step: largest part of a row [s]; by default 1 ms for an arm and what the fastest rate of the
            parameters asks for otherwise.

    Raises:
        UsageError: something has no forward reading: a sign law in an arm, friction outside an arm
            that takes a share of the load, a black box that reads an acceleration, a spring without
            a rotor.
    """
    _check(train)
    known = sensors_of(train)
    for name in sensors:
        position(tuple(known), name, "virtual sensor")
    largest = step if step is not None else (ARM_STEP if train.chain is not None else np.inf)
    if not largest > 0:
        raise UsageError(f"assembly: expected step above 0 s, got {step}")
    chosen = tuple((name, known[name]) for name in sensors)
    return Forward(train, chosen, float(largest), planned(train), train.parameters)


def _check(train: Train) -> None:
    for rub in train.rubs:
        if train.chain is not None and rub.law.switch == "sign":
            raise UsageError(
                f"component {rub.name!r}: expected a smooth law in an arm that moves forward, "
                f"'tanh' instead of 'sign', got {str(rub.law)!r}"
            )
        if "load" in rub.law.reads and (train.chain is None or rub.inside):
            raise UsageError(
                f"component {rub.name!r}: forward, friction takes a share of the load only at the "
                "joints of an arm without springs; take 'load' out of its law"
            )
    for box in train.boxes:
        if "acceleration" in box.inputs:
            raise UsageError(f"component {box.name!r}: forward there is no acceleration to read")
    for axis in train.axes:
        rotor = train.at(axis.motor, "J")
        if axis.elastic and (rotor < 0 or not train.parameters.values[rotor] > 0.0):
            assert axis.gearbox is not None
            raise UsageError(
                f"component {axis.gearbox.name!r}: a spring needs a motor with a rotor inertia J "
                "above 0 on its other side"
            )
        if train.path is not None and axis.controller is None:
            raise UsageError(
                f"axis {axis.number + 1}: a path needs a controller that follows it on every axis"
            )


@dataclass(frozen=True, eq=False)
class Forward(Laddered):
    """See the module. Built by `forward`.

    >>> hasattr(Forward, "regressor")
    False
    """

    train: Train
    sensors: tuple[tuple[str, Sensor], ...]
    step: float
    """Largest part of a row [s]."""
    motion: Motion | None
    """What the path planner planned."""
    parameters: Parameters

    @cached_property
    def inputs(self) -> Layout:
        """Commands, then temperatures and other channels that components read."""
        axes, own = self.train.axes, []
        if self.motion is not None:
            own.append(Channel("override", "1", low=0.0))
        else:
            for order, suffix in enumerate(("", "d")):
                for axis in axes:
                    if axis.controller is not None:
                        unit = ("m" if axis.slides else "rad") + ("", "/s")[order]
                        own.append(Channel(f"q{suffix}{axis.number + 1}_set", unit))
        own += [_command(axis) for axis in axes if axis.controller is None]
        return Layout((*own, *heat_channels(self.train), *box_channels(self.train)))

    @cached_property
    def outputs(self) -> Layout:
        """Positions and speeds of the joints, then the virtual sensors."""
        own = [*_kinematic(self.train.axes, "q", ""), *_kinematic(self.train.axes, "qd", "/s")]
        return Layout((*own, *(Channel(name, sensor.unit) for name, sensor in self.sensors)))

    @cached_property
    def states(self) -> Layout:
        """Positions and speeds, the motor's where there is a spring, integrals, currents, …"""
        return Layout((*self._moving, *self._slow, *box_states(self.train)))

    @cached_property
    def _moving(self) -> tuple[Channel, ...]:
        train, values = self.train, self.parameters.values
        springs = tuple(axis for axis in train.axes if axis.elastic)
        own = [*_kinematic(train.axes, "q", ""), *_kinematic(train.axes, "qd", "/s")]
        own += [*_kinematic(springs, "qm", ""), *_kinematic(springs, "qmd", "/s")]
        for axis in train.axes:
            gain, coil = train.at(axis.controller, "ki"), train.at(axis.motor, "L")
            if gain >= 0 and values[gain] > 0.0:
                assert axis.controller is not None
                own.append(
                    Channel(f"{axis.controller.name}.integral", "m" if axis.slides else "rad")
                )
            if coil >= 0 and values[coil] > 0.0:
                assert axis.motor is not None
                if axis.motor.option("drive") == "voltage":
                    own.append(Channel(f"{axis.motor.name}.current", "A"))
        return tuple(own)

    @cached_property
    def _slow(self) -> tuple[Channel, ...]:
        own = [Channel(f"{r.name}.T", "K") for r in self.train.rubs if r.temperature == "state"]
        if self.motion is not None:
            own.append(Channel("path.time", "s"))
        return tuple(own)

    def initial(self, p: ParameterVector) -> StateVector:
        """At rest, where the path starts or at zero; temperatures at ambient."""
        x = np.zeros(len(self._moving) + len(self._slow))
        names = self.states.names
        if self.motion is not None:
            for j, q in enumerate(self.motion.q[0].tolist()):
                x[names.index(f"q{j + 1}")] = q
                if f"qm{j + 1}" in names:
                    x[names.index(f"qm{j + 1}")] = q
        for rub in self.train.rubs:
            if rub.temperature == "state":
                x[names.index(f"{rub.name}.T")] = p[self.parameters.index(f"{rub.name}.ambient")]
        return np.append(x, box_start(self.train, self.parameters, p))

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """Positions and speeds adopt what is not NaN; a spring keeps its deflection."""
        state, n = np.array(x, dtype=np.float64), len(self.train.axes)
        for k in range(2 * n):
            if not np.isnan(y[k]):
                spring = f"qm{'d' if k >= n else ''}{k % n + 1}"
                if spring in self.states.names:
                    state[self.states.names.index(spring)] += y[k] - state[k]
                state[k] = y[k]
        return state

    @cached_property
    def _places(self) -> Places:
        inputs, names, train = self.inputs.names, self.states.names, self.train
        columns, states = [], []
        for axis in train.axes:
            j = axis.number + 1
            command = -1 if axis.controller is not None else inputs.index(_command(axis).name)
            columns.append(
                Columns(_at(inputs, f"q{j}_set"), _at(inputs, f"qd{j}_set"), -1, command)
            )
            control, motor = axis.controller, axis.motor
            own = [f"q{j}", f"qd{j}", f"qm{j}", f"qmd{j}"]
            own += [f"{'' if control is None else control.name}.integral"]
            own += [f"{'' if motor is None else motor.name}.current"]
            states.append(tuple(_at(names, name) for name in own))
        codes = [
            QUANTITIES * axis.number + quantity
            for quantity in (shared.POSITION, shared.SPEED)
            for axis in train.axes
        ]
        motion, path = self.motion, train.path
        return Places(
            tuple(columns), tuple(states),
            tuple(_at(inputs, f"{rub.name}.T") for rub in train.rubs),
            tuple(_at(names, f"{rub.name}.T") for rub in train.rubs),
            (*codes, *(sensor.code for _, sensor in self.sensors)), len(names),
            _at(names, "path.time"), _at(inputs, "override"),
            len(self._moving) + len(self._slow), self.step,
            None if motion is None else np.concatenate([motion.q, motion.qd], axis=1),
            1.0 if path is None else float(path.option("rate")),
        )  # fmt: skip

    @cached_property
    def _kernel(self) -> Kernel:
        places = self._places
        context, kept = context_of(self.train, places)
        more, inner = box_plan(self.train, self.parameters, self.inputs, places.boxed)
        whole = np.concatenate([context, more])
        return Kernel(onward.step, onward.adopt, whole, (*kept, *inner))

    def kernel(self) -> Kernel:
        """Addresses for the fused loop."""
        return self._kernel

    def __getstate__(self) -> dict[str, Any]:
        """Without what is computed: addresses mean nothing in another process."""
        return {key: value for key, value in self.__dict__.items() if key != "_kernel"}

    def simulate(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[StateVector, Outputs]:
        """State after the last row and the outputs of every row."""
        return roll(self._kernel, x, u, dt, p, Restart.never(len(u), len(self.outputs)))


def _at(names: Sequence[str], name: str) -> int:
    return names.index(name) if name in names else -1


def _kinematic(axes: Sequence[Axis], name: str, order: str) -> list[Channel]:
    return [
        Channel(f"{name}{axis.number + 1}", ("m" if axis.slides else "rad") + order)
        for axis in axes
    ]


def _command(axis: Axis) -> Channel:
    """The input of an axis without a controller."""
    j = axis.number + 1
    if axis.motor is None:
        return Channel(f"tau{j}", "N" if axis.slides else "Nm")
    drive = str(axis.motor.option("drive") or "current")
    name, unit = {"current": ("i", "A"), "voltage": ("U", "V"), "torque": ("m", "Nm")}[drive]
    return Channel(f"{name}{j}", unit)
