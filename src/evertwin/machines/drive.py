"""A one-axis drive: a force moves a mass against friction.

    M·dv/dt = F − friction(v),        dq/dt = v

with the friction laws of `evertwin.machines.friction`. Position q, speed v and force F are positive
in one direction, friction against positive motion: the force of a motion is M·dv/dt + friction(v).

Two forms of one machine share their parameters. `Drive` goes forwards, from force to motion: for
free runs. `DriveForce` goes backwards, from motion to force: static and linear in the parameters,
so that tuning solves at once.

>>> import numpy as np
>>> axis = Drive("sign+direction")
>>> axis.parameters.names
('mass', 'Fv', 'Fv_back', 'Fc', 'offset')
>>> p = axis.parameters.with_values({"Fc": 2.0}).values
>>> _, y = axis.simulate(np.zeros(2), np.array([[1.9], [2.5]]), np.array([0.1, 0.1]), p)
>>> y[:, 1].round(3).tolist()      # 1.9 N do not break it loose, 2.5 N do
[0.0, 0.05]

An axis that turns (``rotary``) has an inertia instead of a mass, a torque instead of a force, and
an angle that may wrap.

>>> spindle = DriveForce(rotary=True)
>>> spindle.outputs.units[0], spindle.parameters.names[0], spindle.parameters.items[2].unit
('Nm', 'inertia', 'Nm')

Where the free run starts: position and speed of the first row are adopted from the measurement,
the speed from a channel that was differentiated.

``two_sided`` adds `evertwin.machines.friction.terms.two_sided`, which only the rows near rest tell
from an offset: the rank over moving samples says so, and a fit keeps one of the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.machines.friction import Law, Rung
from evertwin.machines.friction.kernel import (
    WIDTH,
    columns_of,
    fill,
    force,
    record_of,
    steepness,
    width_of,
)
from evertwin.machines.friction.resisting import Rubbed
from evertwin.machines.friction.terms.two_sided import TWO_SIDED
from evertwin.models import Compiled, Parameter, Parameters
from evertwin.signals import Channel, Layout
from evertwin.types import (
    Float64,
    Inputs,
    Int64,
    Intervals,
    Outputs,
    ParameterVector,
    StateVector,
    Vector,
)

INERTIA, STANDSTILL, PLACE, WARMTH, LAW = range(5)
"""Places in the context: of the mass in ``p``, the standstill [nm/s], of position and temperature
among the inputs (−1: none), then the law's record."""
PARTS = 1000


class Quantities(NamedTuple):
    """What an axis is described with: one that slides, or one that turns.

    >>> TURNS.effort, TURNS.torque
    ('torque', 'Nm')
    """

    place: str
    """Unit of the way; of speed and acceleration with ``/s``, ``/s**2``."""
    effort: str
    torque: str
    inertia: str
    mass: str

    def motion(self, *names: str) -> Layout:
        """Channels of position, speed, acceleration."""
        units = {"position": "", "speed": "/s", "acceleration": "/s**2"}
        turns = {"position"} if self.place == "rad" else set[str]()
        return Layout(
            tuple(
                Channel(name, f"{self.place}{units[name]}", "angle" if name in turns else "linear")
                for name in names
            )
        )

    @property
    def efforts(self) -> Layout:
        """The channel of force or torque."""
        return Layout.of(**{self.effort: self.torque})


SLIDES = Quantities("m", "force", "N", "mass", "kg")
TURNS = Quantities("rad", "torque", "Nm", "inertia", "kg*m**2")


@njit(cache=True)
def _friction(context: Any, p: Any, v: float, T: float, q: float, standstill: float) -> float:
    """Friction at speed ``v`` [N], positive against positive motion."""
    return float(force(context, LAW, p, v, math.nan, T, q, standstill))


@njit(cache=True)
def _parts(context: Any, dt: float, p: Any) -> int:
    """Parts of a step such that each is at most a tenth of the time constant; 0: too many."""
    steep = steepness(context, LAW, p, math.nan, math.nan)
    parts = math.ceil(10.0 * dt * steep / p[context[INERTIA]])
    if not 0.0 <= parts <= PARTS:
        return 0
    return max(1, int(parts))


@njit(cache=True)
def _acceleration(context: Any, p: Any, q: float, v: float, pull: float) -> float:
    """dv/dt under the force ``pull``; a drive at rest stays so within its Coulomb friction."""
    speed = v
    if v == 0.0 and context[LAW + WIDTH] < 0:
        tiny = 1e-300
        if pull > _friction(context, p, tiny, math.nan, q, 0.0):
            speed = tiny
        elif pull < _friction(context, p, -tiny, math.nan, q, 0.0):
            speed = -tiny
        else:
            return 0.0
    return float((pull - _friction(context, p, speed, math.nan, q, 0.0)) / p[context[INERTIA]])


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row forwards: Euler for the speed, trapezoid for the position, exact standstill."""
    parts = _parts(context, dt, p)
    if parts == 0:
        return 1
    h = dt / parts
    q, v = x[0], x[1]
    for _ in range(parts):
        after = v + h * _acceleration(context, p, q, v, u[0])
        if v * after < 0.0 and context[LAW + WIDTH] < 0:
            after = 0.0
        q += h * 0.5 * (v + after)
        v = after
    ahead[0] = q
    ahead[1] = v
    y[0] = q
    y[1] = v
    return 0


@cfunc(OBSERVE)
def observe(context: Any, x: Any, y: Any) -> int:
    """Position and speed adopt their measurements."""
    for i in range(2):
        if not math.isnan(y[i]):
            x[i] = y[i]
    return 0


@cfunc(STEP)
def force_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row backwards: the force of a motion."""
    standstill = context[STANDSTILL] * 1e-9
    q = u[context[PLACE]] if context[PLACE] >= 0 else math.nan
    T = u[context[WARMTH]] if context[WARMTH] >= 0 else math.nan
    y[0] = p[context[INERTIA]] * u[1] + _friction(context, p, u[0], T, q, standstill)
    return 0


@cfunc(OBSERVE)
def force_observe(context: Any, x: Any, y: Any) -> int:
    """A static map has nothing to adopt."""
    return 0


def _build(
    law: Law, axis: Quantities, known: tuple[str, ...], given: int = 0
) -> tuple[Law, Parameters, tuple[int, ...]]:
    """The law, the parameters and the context that both forms share; ``known``: besides speed,
    behind the first ``given`` inputs."""
    form = law.known_to("drive", known)
    mass = Parameter(axis.inertia, 1.0, axis.mass, 1e-9 if axis is TURNS else 1e-6, 1e9)
    parameters = Parameters((mass, *form.parameters(slides=axis is SLIDES)))
    more = [what for what in known if given and what in form.reads]
    places = (given + more.index(what) if what in more else -1 for what in ("q", "T"))
    record = record_of(form, 1).tolist()
    return form, parameters, (0, round(form.standstill * 1e9), *places, *record)


def _law(law: Law | str, two_sided: bool, standstill: float = 0.0) -> Law:
    form = replace(Law.parse(law) if isinstance(law, str) else law, standstill=standstill)
    return form.plus(TWO_SIDED) if two_sided else form


class _Rubs:
    """What both forms say of their friction."""

    law: Law
    rotary: bool

    @property
    def _axis(self) -> Quantities:
        return TURNS if self.rotary else SLIDES

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Friction's coefficients."""
        return self.law.rubbing()

    def _drive(
        self, context: Any, p: ParameterVector, rows: tuple[Vector, Vector, Vector]
    ) -> tuple[Rubbed, ...]:
        """Friction at rows of speed, temperature and position, without its constant force."""
        free = np.array(p)
        for k, (_, one) in enumerate(self.law.coefficients, start=1):
            free[k] = 0.0 if one.bias else free[k]
        force = [
            _friction(context, free, v, T, q, self.law.standstill)
            for v, T, q in zip(*(each.tolist() for each in rows), strict=True)
        ]
        units = (f"{self._axis.place}/s", self._axis.torque)
        return (Rubbed("the drive", self.rubbing, units, rows[0], np.array(force)),)

    def rungs(self) -> tuple[Rung, ...]:
        """Steps up the ladder of friction laws; each has to pay on unseen data."""
        return self.law.rungs()

    def law_name(self, output: int, terms: Sequence[str]) -> str:
        """The law with these of its terms."""
        return str(self.law.only(terms))


class Drive(_Rubs, Compiled):
    """From force [N] to position [m] and speed [m/s]: for free runs and what-if.

    ``law``: terms of friction joined by ``+``; ``two_sided``: with that term too.
    ``rotary``: from torque [Nm] to angle [rad] and its speed [rad/s].

    >>> Drive().inputs.names, Drive().outputs.names
    (('force',), ('position', 'speed'))
    """

    def __init__(
        self, law: Law | str = "sign", two_sided: bool = False, rotary: bool = False
    ) -> None:
        self.rotary = rotary
        self.law, parameters, context = _build(_law(law, two_sided), self._axis, ("q",))
        motion = self._axis.motion("position", "speed")
        super().__init__(self._axis.efforts, motion, motion, parameters, step, observe, context)

    def rubbed(self, u: Inputs, y: Outputs, p: ParameterVector) -> tuple[Rubbed, ...]:
        """Friction at the measured speeds."""
        return self._drive(self._context, p, (y[:, 1], np.full(len(y), np.nan), y[:, 0]))


@dataclass(frozen=True, init=False, repr=False)
class DriveForce(_Rubs, Compiled):
    """From speed [m/s] and acceleration [m/s²] to force [N], linear in mass and friction.

    ``law``: terms of friction joined by ``+``; ``two_sided``: with that term too.
    ``rotary``: from rad/s and rad/s² to torque [Nm]. A law that reads them makes ``position`` [m,
    rad] and ``temperature`` [K] inputs too. Below
    ``standstill`` [m/s, rad/s] the sign of the speed counts as zero.

    >>> model = DriveForce("sign+direction", two_sided=True)
    >>> model.columns.tolist(), model.rungs()[0].add
    ([[0, 1, 2, 3, 4, 5]], ('Fv_back',))
    """

    law: Law = field(default_factory=Law)
    rotary: bool = False

    def __init__(
        self, law: Law | str = "sign", two_sided: bool = False, standstill: float = 0.0,
        rotary: bool = False,
    ) -> None:  # fmt: skip
        object.__setattr__(self, "rotary", rotary)
        axis, given = self._axis, _law(law, two_sided, standstill)
        form, parameters, context = _build(given, axis, ("q", "T"), 2)
        inputs = axis.motion("speed", "acceleration")
        for what, channel in (("q", axis.motion("position")), ("T", Layout.of(temperature="K"))):
            inputs = inputs + channel if what in form.reads else inputs
        super().__init__(
            inputs, axis.efforts, Layout(), parameters, force_step, force_observe, context
        )
        object.__setattr__(self, "law", form)

    def rubbed(self, u: Inputs, y: Outputs, p: ParameterVector) -> tuple[Rubbed, ...]:
        """Friction at the rows' speeds."""
        return self._drive(self._context, p, (u[:, 0], *self._known(u)))

    def _known(self, u: Inputs) -> tuple[Vector, Vector]:
        """Temperature and position, row by row; NaN where they are no inputs."""
        none = np.full(len(u), np.nan)
        warmth, place = self._context[WARMTH], self._context[PLACE]
        return (u[:, warmth] if warmth >= 0 else none), (u[:, place] if place >= 0 else none)

    @property
    def columns(self) -> Int64[np.ndarray, "1 m"]:
        """Index into ``p`` of each regressor column: mass and friction lie first."""
        return np.arange(1 + len(self.law.coefficients), dtype=np.int64)[None]

    def regressor(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[Outputs, Float64[np.ndarray, "n 1 m"]]:
        """Zeros and the compact regressor."""
        phi, out = np.empty((len(u), 1, self.columns.shape[1])), np.empty(len(u))
        phi[:, 0, 0], p = u[:, 1], np.ascontiguousarray(p)
        rows = np.full((4, len(u)), np.nan)  # speed, load (not known), temperature and place
        rows[0], rows[2:] = u[:, 0], self._known(u)
        width = width_of(self._context, LAW, p)
        for k, term in enumerate(columns_of(self.law, 1), start=1):
            fill(term, p, rows, self.law.standstill, width, out)
            phi[:, 0, k] = out
        return np.zeros((len(u), 1)), phi
