"""A one-axis drive: a force moves a mass against friction.

    M·dv/dt = F − friction(v),        dq/dt = v

with the friction laws of `evertwin.machines.friction`. Two forms of one machine share their
parameters. `Drive` goes forwards, from force to motion: for free runs. `DriveForce` goes backwards,
from motion to force: static and linear in the parameters, so that tuning solves at once.

>>> import numpy as np
>>> axis = Drive("sign+direction")
>>> axis.parameters.names
('mass', 'Fv', 'Fv_back', 'Fc', 'offset')
>>> p = axis.parameters.with_values({"Fc": 2.0}).values
>>> _, y = axis.simulate(np.zeros(2), np.array([[1.9], [2.5]]), np.array([0.1, 0.1]), p)
>>> y[:, 1].round(3).tolist()      # 1.9 N do not break it loose, 2.5 N do
[0.0, 0.05]

Where the free run starts: position and speed of the first row are adopted from the measurement,
the speed by `edge_speed` or from a channel that was differentiated by the same rule.

Coulomb friction by direction is offered too (``two_sided``), because recorded motion often seems to
ask for it. While the axis moves it cannot be told from an offset: the rank says so over moving
samples, and the fit keeps one of the two (see `evertwin.tuning`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64
from numba import cfunc, njit

from evertwin.errors import DataError, UsageError
from evertwin.machines.friction import (
    BACKWARD,
    COULOMB,
    INERTIA,
    SLOTS,
    VISCOUS,
    VS,
    WIDTH,
    Law,
    Rung,
    feature,
    force,
    sliding,
    switch,
)
from evertwin.models import OBSERVE, STEP, Compiled, Parameter, Parameters
from evertwin.signals import Layout
from evertwin.types import Inputs, Intervals, Outputs, ParameterVector, StateVector, Vector

__all__ = ["Drive", "DriveForce", "edge_speed"]

TWO_SIDED = SLOTS
"""Place in the context, after the law's table, of the extra Coulomb friction backwards."""
PARTS = 1000


@njit(cache=True)
def _friction(context: Any, p: Any, v: float, standstill: float) -> float:
    """Friction at speed ``v`` [N], positive against positive motion."""
    total = force(context, 0, p, v, 0.0, standstill)
    extra = context[TWO_SIDED]
    if extra >= 0:
        width = p[context[WIDTH]] if context[WIDTH] >= 0 else 0.0
        total += p[extra] * min(switch(v, width, standstill), 0.0)
    return float(total)


@njit(cache=True)
def _parts(context: Any, dt: float, p: Any) -> int:
    """Parts of a step such that each is at most a tenth of the time constant; 0: too many."""
    steep = abs(p[context[VISCOUS]])
    if context[BACKWARD] >= 0:
        steep = max(steep, abs(p[context[VISCOUS]] + p[context[BACKWARD]]))
    if context[WIDTH] >= 0:
        steep += abs(p[context[COULOMB]]) / p[context[WIDTH]]
    parts = math.ceil(10.0 * dt * steep / p[context[INERTIA]])
    if not 0.0 <= parts <= PARTS:
        return 0
    return max(1, int(parts))


@njit(cache=True)
def _acceleration(context: Any, p: Any, v: float, pull: float) -> float:
    """dv/dt under the force ``pull``; a drive at rest stays so within its Coulomb friction."""
    speed = v
    if v == 0.0 and context[WIDTH] < 0:
        tiny = 1e-300
        if pull > _friction(context, p, tiny, 0.0):
            speed = tiny
        elif pull < _friction(context, p, -tiny, 0.0):
            speed = -tiny
        else:
            return 0.0
    return float((pull - _friction(context, p, speed, 0.0)) / p[context[INERTIA]])


@cfunc(STEP, cache=True)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row forwards: Euler for the speed, trapezoid for the position, exact standstill."""
    parts = _parts(context, dt, p)
    if parts == 0:
        return 1
    h = dt / parts
    q, v = x[0], x[1]
    for _ in range(parts):
        after = v + h * _acceleration(context, p, v, u[0])
        if v * after < 0.0 and context[WIDTH] < 0:
            after = 0.0
        q += h * 0.5 * (v + after)
        v = after
    ahead[0] = q
    ahead[1] = v
    y[0] = q
    y[1] = v
    return 0


@cfunc(OBSERVE, cache=True)
def observe(context: Any, x: Any, y: Any) -> int:
    """Position and speed adopt their measurements."""
    for i in range(2):
        if not math.isnan(y[i]):
            x[i] = y[i]
    return 0


@cfunc(STEP, cache=True)
def force_step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row backwards: the force of a motion."""
    y[0] = p[context[INERTIA]] * u[1] + _friction(context, p, u[0], context[TWO_SIDED + 1] * 1e-9)
    return 0


@cfunc(OBSERVE, cache=True)
def force_observe(context: Any, x: Any, y: Any) -> int:
    """A static map has nothing to adopt."""
    return 0


@njit(cache=True)
def _regressor(context: Any, slots: Any, u: Any, p: Any, phi: Any) -> None:
    """Fills ``phi`` (n, 1, m): mass, the law's linear terms, the extra backwards friction."""
    width = p[context[WIDTH]] if context[WIDTH] >= 0 else 0.0
    vs = p[context[VS]] if context[VS] >= 0 else 1.0
    for i in range(u.shape[0]):
        s = switch(u[i, 0], width, context[TWO_SIDED + 1] * 1e-9)
        for j in range(slots.shape[0]):
            if slots[j] == INERTIA:
                phi[i, 0, j] = u[i, 1]
            elif slots[j] == TWO_SIDED:
                phi[i, 0, j] = min(s, 0.0)
            else:
                phi[i, 0, j] = feature(slots[j], u[i, 0], s, 0.0, vs)


def _build(
    law: Law | str, two_sided: bool, standstill: float
) -> tuple[Law, Parameters, tuple[int, ...]]:
    """The law, the parameters and the context that both forms share."""
    form = Law.parse(law) if isinstance(law, str) else law
    form = replace(form, standstill=standstill)
    if form.load:
        raise UsageError("drive: expected a law without 'load': a drive transmits no load torque")
    items = [Parameter("mass", 1.0, "kg", 1e-6, 1e9), *map(sliding, form.parameters())]
    if two_sided:
        items.append(Parameter("Fc_minus", 0.0, "N"))
    parameters = Parameters(tuple(items))
    table = form.table(parameters.names)
    table[INERTIA] = 0
    extra = parameters.index("Fc_minus") if two_sided else -1
    return form, parameters, (*table, extra, round(form.standstill * 1e9))


class Drive(Compiled):
    """From force [N] to position [m] and speed [m/s]: for free runs and what-if.

    >>> Drive().inputs.names, Drive().outputs.names
    (('force',), ('position', 'speed'))
    """

    def __init__(self, law: Law | str = "sign", two_sided: bool = False) -> None:
        self.law, parameters, context = _build(law, two_sided, 0.0)
        motion = Layout.of(position="m", speed="m/s")
        super().__init__(
            Layout.of(force="N"), motion, motion, parameters, step.address, observe.address, context
        )

    def rungs(self) -> tuple[Rung, ...]:
        """Steps up the ladder of friction laws; each has to pay on unseen data."""
        return self.law.rungs()

    def law_name(self, output: int, terms: Sequence[str]) -> str:
        """The law with these of its terms."""
        return str(self.law.only(terms))


@dataclass(frozen=True, init=False)
class DriveForce(Compiled):
    """From speed [m/s] and acceleration [m/s²] to force [N], linear in mass and friction.

    Below ``standstill`` [m/s] the sign of the speed counts as zero.

    >>> model = DriveForce("sign+direction", two_sided=True)
    >>> model.columns.tolist(), model.rungs()[0].add
    ([[0, 1, 2, 3, 4, 5]], ('Fv_back',))
    """

    law: Law = field(default_factory=Law)

    def __init__(
        self, law: Law | str = "sign", two_sided: bool = False, standstill: float = 0.0
    ) -> None:
        form, parameters, context = _build(law, two_sided, standstill)
        super().__init__(
            Layout.of(speed="m/s", acceleration="m/s**2"),
            Layout.of(force="N"),
            Layout(),
            parameters,
            force_step.address,
            force_observe.address,
            context,
        )
        object.__setattr__(self, "law", form)

    def rungs(self) -> tuple[Rung, ...]:
        """Steps up the ladder of friction laws; each has to pay on unseen data."""
        return self.law.rungs()

    def law_name(self, output: int, terms: Sequence[str]) -> str:
        """The law with these of its terms."""
        return str(self.law.only(terms))

    @property
    def _slots(self) -> Int64[np.ndarray, " m"]:
        linear = [s for s in (INERTIA, *range(INERTIA), TWO_SIDED) if self.context[s] >= 0]
        return np.array(linear, dtype=np.int64)

    @property
    def columns(self) -> Int64[np.ndarray, "1 m"]:
        """Index into ``p`` of each regressor column."""
        return np.array([[self.context[slot] for slot in self._slots]], dtype=np.int64)

    def regressor(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[Outputs, Float64[np.ndarray, "n 1 m"]]:
        """Zeros and the compact regressor."""
        slots = self._slots
        phi = np.empty((len(u), 1, len(slots)))
        _regressor(self._context, slots, np.ascontiguousarray(u), np.ascontiguousarray(p), phi)
        return np.zeros((len(u), 1)), phi


def edge_speed(t: Vector, q: Vector, samples: int = 40) -> float:
    """Speed at the first sample: the derivative there of a cubic through the first samples.

    Args:
        t: time [s], (n,).
        q: position [m], (n,).
        samples: how many of them the cubic is fitted to.

    Raises:
        DataError: fewer samples than asked for, or fewer than four.

    >>> t = np.arange(50) * 0.01
    >>> round(edge_speed(t, 1.0 + 2.0 * t - 3.0 * t**3), 9)
    2.0
    """
    if len(t) < samples or samples < 4:
        raise DataError(
            f"edge speed: expected at least 4 samples and {samples} in the window, got {len(t)}"
        )
    cubic = np.polynomial.Polynomial.fit(t[:samples] - t[0], q[:samples], 3)
    return float(cubic.deriv()(0.0))
