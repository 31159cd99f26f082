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

from evertwin.errors import UsageError, naming
from evertwin.machines.assembly import onward, shared
from evertwin.machines.assembly.boxed import box_start, box_states, reading_kernel
from evertwin.machines.assembly.context import Signals
from evertwin.machines.assembly.path import Joints, Limits, Motion, moves_of, plan
from evertwin.machines.assembly.reading import Laddered, Reading
from evertwin.machines.assembly.sensors import chosen
from evertwin.machines.assembly.shared import QUANTITIES
from evertwin.machines.assembly.train import Axis, Train
from evertwin.models import Kernel, Restart, roll
from evertwin.settings.quantity import in_unit
from evertwin.signals import Channel, Layout
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
    with naming(f"component {part.name!r}"):
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
    largest = step if step is not None else (ARM_STEP if train.chain is not None else np.inf)
    if not largest > 0:
        raise UsageError(f"assembly: expected step above 0 s, got {step}")
    picked = chosen(train, sensors, forward=True)
    return Forward(train, picked, train.parameters, float(largest), planned(train))


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
class Forward(Laddered, Reading):
    """See the module. Built by `forward`.

    >>> hasattr(Forward, "regressor")
    False
    """

    step: float
    """Largest part of a row [s]."""
    motion: Motion | None
    """What the path planner planned."""

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
        return Layout((*own, *self._outside()))

    @cached_property
    def outputs(self) -> Layout:
        """Positions and speeds of the joints, then the virtual sensors."""
        own = [*_kinematic(self.train.axes, "q", ""), *_kinematic(self.train.axes, "qd", "/s")]
        return self._shown(own)

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
                if axis.motor.drive == "voltage":
                    own.append(Channel(f"{axis.motor.name}.current", "A"))
        return tuple(own)

    @cached_property
    def _slow(self) -> tuple[Channel, ...]:
        own = [Channel(f"{name}.T", "K") for name in self._heated]
        return (*own, *([] if self.motion is None else [Channel("path.time", "s")]))

    def initial(self, p: ParameterVector) -> StateVector:
        """At rest, where the path starts or at zero; temperatures at ambient."""
        x, names = np.zeros(len(self._moving) + len(self._slow)), self.states.names
        if self.motion is not None:
            for j, q in enumerate(self.motion.q[0].tolist(), start=1):
                x[[k for k, name in enumerate(names) if name in (f"q{j}", f"qm{j}")]] = q
        x[len(self._moving) : len(self._moving) + len(self._heated)] = self._ambient(p)
        return np.append(x, box_start(self.train, p))

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """Positions and speeds adopt what is not NaN; a spring keeps its deflection."""
        state = np.array(x, dtype=np.float64)
        onward.adopt.plain(self._kernel.context, state, y)
        return state

    @cached_property
    def _kernel(self) -> Kernel:
        axes, motion, path = self.train.axes, self.motion, self.train.path
        codes = [QUANTITIES * axis.number + shared.POSITION for axis in axes]
        codes += [QUANTITIES * axis.number + shared.SPEED for axis in axes]
        signals = Signals(
            self.inputs.names, self.states.names, self._codes(codes), self.step,
            None if motion is None else np.concatenate([motion.q, motion.qd], axis=1),
            1.0 if path is None else float(path.option("rate")),
        )  # fmt: skip
        return reading_kernel(self.train, signals, onward)

    def simulate(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[StateVector, Outputs]:
        """State after the last row and the outputs of every row."""
        return roll(self._kernel, x, u, dt, p, Restart.never(len(u), len(self.outputs)))


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
    name = {"current": "i", "voltage": "U", "torque": "m"}[axis.motor.drive]
    return Channel(f"{name}{j}", axis.demand)
