"""The inverse reading of an assembly as a Model: motion imposed, effort, current or voltage out.

Without states it is a static map, linear in inertias and friction, so that tuning solves at once
(`StaticInverse`). Thermal states, a black box with states or a measured quantity that is not linear
make it an `Inverse`, which is tuned by iteration.

>>> from evertwin.machines.assembly.train import join
>>> axis = join([{"name": "motor", "kind": "motor", "axis": 1, "k": 0.5},
...              {"name": "screw", "kind": "ballscrew", "axis": 1, "lead": 0.01, "Fc": 20.0},
...              {"name": "table", "kind": "mass", "axis": 1, "mass": 100.0}])
>>> model = inverse(axis, "current")
>>> model.inputs.names, model.outputs.names
(('qd1', 'qdd1'), ('i1',))
>>> _, y = model.simulate(np.zeros(0), np.array([[0.5, 1.0]]), np.ones(1), model.parameters.values)
>>> round(float(y[0, 0]), 4)      # (100 kg · 1 m/s² + 20 N) · 10 mm / 2π / 0.5 Nm/A
0.382
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evertwin.errors import UsageError
from evertwin.machines.arm import layout
from evertwin.machines.assembly import backward, shared
from evertwin.machines.assembly.boxed import box_start, box_states, reading_kernel, run_over_rows
from evertwin.machines.assembly.columns import Column, axis_columns, features, scales
from evertwin.machines.assembly.context import Signals
from evertwin.machines.assembly.reading import Laddered, Reading
from evertwin.machines.assembly.sensors import chosen
from evertwin.machines.assembly.shared import QUANTITIES
from evertwin.machines.assembly.train import Train
from evertwin.machines.friction.resisting import Rubbed, friction
from evertwin.models import Kernel, Restart, roll
from evertwin.signals import Channel, Layout
from evertwin.types import Float64, Inputs, Int64, Intervals, Outputs, ParameterVector, StateVector

MEASURES = {
    "effort": ("tau", shared.EFFORT, ""),
    "torque": ("m", shared.MOTOR_TORQUE, "Nm"),
    "current": ("i", shared.MOTOR_CURRENT, "A"),
    "voltage": ("U", shared.MOTOR_VOLTAGE, "V"),
}
"""What is measured of each axis: name of the channel, quantity, unit."""


def inverse(
    train: Train, measure: str | Sequence[str] = "effort", sensors: Sequence[str] = ()
) -> Inverse:
    """The inverse reading of joined components.

    Args:
        measure: output of every axis, or of each: effort (at the joint), torque (of the motor),
            current or voltage.
        sensors: quantities inside components that are outputs too, ``<component>.<quantity>``.

    Raises:
        UsageError: an axis without a motor cannot show its current; no such quantity.
    """
    said = [measure] * len(train.axes) if isinstance(measure, str) else list(measure)
    if len(said) != len(train.axes) or not set(said) <= set(MEASURES):
        raise UsageError(
            f"assembly: expected measure = one of {', '.join(MEASURES)}, or one for each of "
            f"{len(train.axes)} axes, got {measure!r}"
        )
    for axis, what in zip(train.axes, said, strict=True):
        if what != "effort" and axis.motor is None:
            raise UsageError(
                f"assembly: axis {axis.number + 1} has no motor whose {what} is measured"
            )
    picked = chosen(train, sensors, forward=False)
    states = any(rub.temperature == "state" for rub in train.rubs) or any(
        len(box.model.states) for box in train.boxes
    )
    linear = not states and all(sensor.linear for _, sensor in picked)
    return (StaticInverse if linear else Inverse)(train, picked, train.parameters, tuple(said))


@dataclass(frozen=True, eq=False)
class Inverse(Reading):
    """See the module. Built by `inverse`.

    >>> hasattr(Inverse, "regressor")
    False
    """

    measures: tuple[str, ...]

    @cached_property
    def inputs(self) -> Layout:
        """Motion of every axis, then temperatures and other channels that components read."""
        train, own = self.train, []
        if train.chain is not None:
            own = list(layout.inputs_of(train.chain))
        else:
            reads = {box.axis for box in train.boxes if "position" in box.inputs}
            reads |= {rub.axis for rub in train.rubs if "q" in rub.law.reads}
            for order, name in enumerate(("q", "qd", "qdd")):
                for axis in train.axes:
                    unit = ("m" if axis.slides else "rad") + ("", "/s", "/s**2")[order]
                    if order > 0 or axis.number in reads:
                        own.append(Channel(f"{name}{axis.number + 1}", unit))
        return Layout((*own, *self._outside()))

    @cached_property
    def outputs(self) -> Layout:
        """What is measured of every axis, then the virtual sensors."""
        own = []
        for axis, what in zip(self.train.axes, self.measures, strict=True):
            name, _, unit = MEASURES[what]
            own.append(Channel(f"{name}{axis.number + 1}", unit or ("N" if axis.slides else "Nm")))
        return self._shown(own)

    @cached_property
    def states(self) -> Layout:
        """Temperatures that follow from heat, and the states of black boxes."""
        heated = (Channel(f"{name}.T", "K") for name in self._heated)
        return Layout((*heated, *box_states(self.train)))

    def initial(self, p: ParameterVector) -> StateVector:
        """Temperatures at ambient; black boxes as they start."""
        return np.array([*self._ambient(p), *box_start(self.train, p)], dtype=np.float64)

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """There is nothing to adopt into."""
        return np.array(x, dtype=np.float64)

    @cached_property
    def _signals(self) -> Signals:
        codes = [
            QUANTITIES * axis.number + MEASURES[what][1]
            for axis, what in zip(self.train.axes, self.measures, strict=True)
        ]
        return Signals(self.inputs.names, self.states.names, self._codes(codes))

    @cached_property
    def _kernel(self) -> Kernel:
        return reading_kernel(self.train, self._signals, backward)

    @cached_property
    def _given(self) -> Kernel:
        """The kernel that takes the efforts of the black boxes as further columns of ``u``."""
        return reading_kernel(self.train, self._signals, backward, given=True)

    def simulate(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[StateVector, Outputs]:
        """State after the last row and the outputs of every row.

        A black box simulates all rows at once: one in a process of its own is asked once.
        """
        never = Restart.never(len(u), len(self.outputs))
        if not self.train.boxes:
            return roll(self._kernel, x, u, dt, p, never)
        after, efforts = run_over_rows(self.train, self.inputs, (x, u, dt, p))
        end, y = roll(self._given, x, np.concatenate([u, efforts], axis=1), dt, p, never)
        end[len(end) - len(after) :] = after
        return end, y


@dataclass(frozen=True, eq=False)
class StaticInverse(Laddered, Inverse):
    """An inverse reading without states: linear in inertias and friction.

    >>> hasattr(StaticInverse, "regressor")
    True
    """

    def rubbed(self, u: Inputs, y: Outputs, p: ParameterVector) -> tuple[Rubbed, ...]:
        """Friction of every axis at rows of motion, in what is measured of it."""
        rubs, units = self.train.rubs, self.outputs.units
        biases = [f"{rub.name}.{name}" for rub in rubs for name in rub.law.biases()]
        force, found = friction(self, u, p, self.rubbing, biases), []
        for axis in self.train.axes:
            k, per = axis.number, "m/s" if axis.slides else "rad/s"
            own = [rub for rub in rubs if rub.axis == k]
            names = tuple(f"{rub.name}.{name}" for rub in own for name in rub.law.rubbing())
            speed = u[:, self.inputs.index(f"qd{k + 1}")]
            found.append(Rubbed(f"axis {k + 1}", names, (per, units[k]), speed, force[:, k]))
        return tuple(found)

    @cached_property
    def _columns(self) -> tuple[tuple[Column, ...], ...]:
        """Of every output."""
        axes = [axis_columns(self.train, axis) for axis in self.train.axes]
        rows = [axes[j] for j in range(len(axes))]
        for _, sensor in self.sensors:
            rows.append(tuple(c for c in axes[sensor.axis] if c.acts_on(sensor.code, len(axes))))
        return tuple(rows)

    @cached_property
    def columns(self) -> Int64[np.ndarray, "ny m"]:
        """Index into ``p`` of each output's regressor columns, −1 where unused."""
        width = max((len(row) for row in self._columns), default=0)
        places = np.full((len(self._columns), max(width, 1)), -1, dtype=np.int64)
        for k, row in enumerate(self._columns):
            places[k, : len(row)] = [column.place for column in row]
        return places

    def regressor(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """What is left without the linear parameters, and the compact regressor."""
        u, p = np.ascontiguousarray(u), np.ascontiguousarray(p)
        places = self.columns
        phi = np.zeros((len(u), *places.shape))
        found = features(self.train, self.inputs.names, u, p)
        factors = scales(self.train, self._signals.codes, p)
        for k, row in enumerate(self._columns):
            for m, column in enumerate(row):
                phi[:, k, m] = factors[k] * found[column.key]
        rest = p.copy()
        rest[np.unique(places[places >= 0])] = 0.0
        return self.simulate(x, u, dt, rest)[1], phi
