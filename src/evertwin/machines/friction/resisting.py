"""Does friction resist? Where the sum of its terms pushes a drive on, power comes from nowhere.

Asked of the sum, because a fit trades terms for each other, on rows of a recording, because a law
is judged over the speeds and loads that it is used at. A constant force is no friction and left
out: what it takes one way it gives back the other. Validation, fits and the loop ask here.

>>> from evertwin.machines.drive import DriveForce
>>> axis, u = DriveForce(), np.array([[-0.5, 0.0], [0.1, 0.0], [0.5, 0.0]])
>>> p = axis.parameters.with_values({"Fv": -20.0, "Fc": 4.0}).values
>>> [str(push) for push in pushing(axis, u, np.zeros((3, 1)), p)]
['the drive gives power out from 0.5 to 0.5 m/s (6 N at 0.5 m/s) with Fv = -20']
>>> pushing(axis, u[1:2], np.zeros((1, 1)), p)
()
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from evertwin.fold import Block
from evertwin.models import Model
from evertwin.models.batch import mapped
from evertwin.signals import Layout
from evertwin.types import Float64, Inputs, Outputs, ParameterVector, Vector

LIMIT = 1e-9
"""Share of the largest power of friction that counts as none."""
SPEEDS = ("m/s", "rad/s")
WITHIN = 200
"""Rows that stand for a machine that was not seen."""


class Rubbed(NamedTuple):
    """The friction of one drive, row by row.

    >>> Rubbed("joint 1", ("Fv1",), ("rad/s", "Nm"), np.ones(1), -np.ones(1)).power.tolist()
    [-1.0]
    """

    name: str
    """What the drive is called."""
    coefficients: tuple[str, ...]
    """Names of the numbers that its friction is made of."""
    units: tuple[str, str]
    """Of speed and force."""
    speed: Vector
    force: Vector
    """Positive against positive motion, without constant forces."""

    @property
    def power(self) -> Vector:
        """What friction takes out; NaN where nothing is known."""
        return np.asarray(self.speed * self.force)


@runtime_checkable
class Resisting(Protocol):
    """A machine that can say what its friction does.

    >>> from evertwin.machines.drive import Drive
    >>> isinstance(Drive(), Resisting)
    True
    """

    def rubbed(self, u: Inputs, y: Outputs, p: ParameterVector) -> tuple[Rubbed, ...]:
        """The friction of each drive at rows of inputs and measured outputs."""
        ...


class Push(NamedTuple):
    """A drive whose friction gives power out.

    >>> Push("joint 1", {"Fv1": -2.0}, ("rad/s", "Nm"), (0.1, 0.5), (0.5, 1.0)).power
    0.5
    """

    name: str
    negative: dict[str, float]
    """Its coefficients below zero."""
    units: tuple[str, str]
    speeds: tuple[float, float]
    """Slowest and fastest speed at which it does."""
    worst: tuple[float, float]
    """Speed and force where it gives out most."""

    @property
    def power(self) -> float:
        """The most that it gives out [W, with forces and torques]."""
        return self.worst[0] * self.worst[1]

    def __str__(self) -> str:
        numbers = ", ".join(f"{name} = {value:.3g}" for name, value in self.negative.items())
        slow, fast = self.speeds
        speed, force = self.worst
        (per, unit), by = self.units, f" with {numbers}" if numbers else ""
        return (
            f"{self.name} gives power out from {slow:.2g} to {fast:.2g} {per} "
            f"({force:.3g} {unit} at {speed:.2g} {per}){by}"
        )


def not_physical(model: Model, p: ParameterVector, windows: Sequence[Block] = ()) -> str:
    """Why a model could not be a machine on these rows, in words; empty where it could.

    Args:
        model: of a version, corrected or not.
        p: its parameters, (np,).
        windows: rows that it was made from, taken both ways; without any: rows within the limits of
            its channels.
    """
    return "; ".join(map(str, pushes(model, p, windows)))


def pushes(model: Model, p: ParameterVector, windows: Sequence[Block] = ()) -> tuple[Push, ...]:
    """The drives of `not_physical`."""
    if not windows:
        return pushing(model, within(model.inputs), within(model.outputs), p)
    u, y = (np.concatenate([getattr(w, name) for w in windows]) for name in ("u", "y"))
    known = np.isfinite(u).all(axis=1)
    u, y = u[known], y[known]
    # the machine will go the other way as fast as it went this way
    u, y = (np.concatenate([rows, turned(of, rows)])
            for of, rows in ((model.inputs, u), (model.outputs, y)))  # fmt: skip
    return pushing(model, u, y, p)


def turned(layout: Layout, rows: Inputs) -> Inputs:
    """Rows with their speeds turned.

    >>> turned(Layout.of(q="rad", qd="rad/s"), np.array([[1.0, 2.0]])).tolist()
    [[1.0, -2.0]]
    """
    return rows * np.where([channel.unit in SPEEDS for channel in layout], -1.0, 1.0)


def within(layout: Layout) -> Inputs:
    """Random rows within the limits of channels, up to a unit from zero, (n, k).

    >>> bool(np.abs(within(Layout.of(v="m/s"))).max() < 1.0)
    True
    """
    low = np.clip([c.low for c in layout], -1.0, None)
    high = np.clip([c.high for c in layout], None, np.maximum(low, 0.0) + 1.0)
    return np.random.default_rng(0).uniform(low, high, (WITHIN, len(low)))


def pushing(model: Model, u: Inputs, y: Outputs, p: ParameterVector) -> tuple[Push, ...]:
    """Drives of a machine, corrected or not, whose friction pushes on at one of these rows."""
    machine, values = _machine(model, p)
    if machine is None:
        return ()
    known = dict(zip(machine.parameters.names, values.tolist(), strict=True))
    drives = machine.rubbed(u, y, values)
    largest = max((float(np.nanmax(np.abs(d.power), initial=0.0)) for d in drives), default=0.0)
    found = (_push(drive, known, LIMIT * max(1.0, largest)) for drive in drives)
    return tuple(push for push in found if push is not None)


def rubbed(model: Model, u: Inputs, y: Outputs, p: ParameterVector) -> tuple[Rubbed, ...]:
    """Friction of each drive of a machine, corrected or not; none where it cannot say."""
    machine, values = _machine(model, p)
    return () if machine is None else machine.rubbed(u, y, values)


def _machine(model: Model, p: ParameterVector) -> tuple[Any, Float64[np.ndarray, " own"]]:
    """The machine that can say its friction, and its own values; None where there is none."""
    machine, values = model, p
    while not isinstance(machine, Resisting) and isinstance(inner := _inside(machine), Model):
        values = values[machine.parameters.indices(inner.parameters.names)]
        machine = inner
    return (machine if isinstance(machine, Resisting) else None), values


def _inside(machine: Model) -> object:
    return getattr(machine, "model", None)


def _push(drive: Rubbed, known: dict[str, float], limit: float) -> Push | None:
    wrong = np.flatnonzero(drive.power < -limit)
    if not len(wrong):
        return None
    speeds = np.abs(drive.speed[wrong])
    worst = wrong[np.argmin(drive.power[wrong])]
    at = abs(float(drive.speed[worst])), abs(float(drive.force[worst]))
    negative = {name: known[name] for name in drive.coefficients if known[name] < 0.0}
    span = float(speeds.min()), float(speeds.max())
    return Push(drive.name, negative, drive.units, span, at)


def friction(
    model: Model, u: Inputs, p: ParameterVector, rubbing: Sequence[str], biases: Sequence[str]
) -> Outputs:
    """What friction adds to the outputs of a static map, without constant forces."""
    names, free = model.parameters, p.copy()
    free[names.indices(biases)] = 0.0
    bare = free.copy()
    bare[names.indices(rubbing)] = 0.0
    rows = np.ascontiguousarray(u), np.zeros(len(u))
    with_it, without = (mapped(model, *rows, each) for each in (free, bare))
    return np.asarray(with_it - without)
