"""A heated box: a heater warms the air, the air loses heat to the room, the wall stores some.

Heat balances, with heater ``Th``, box air ``Tb``, wall ``Tw``, room ``Tr`` and switch ``s``:

    Ch·dTh/dt = P·s − Gh·(Th − Tb)
    Cb·dTb/dt = Gh·(Th − Tb) − Gb·(Tb − Tr) − Gw·(Tb − Tw)
    Cw·dTw/dt = Gw·(Tb − Tw)

with P ``heater_power``, Ch, Cb, Cw the ``…_capacity`` [J/K], Gh, Gb, Gw the ``…_conductance``
[W/K] of heater, box and wall; a switch of 1 heats, 0 does not, and what lies between heats in part.

Without the wall this is the four-parameter model (Ch, Gh, Cb, Gb); the wall adds one first-order
state. Only Tb is measured: the temperatures of heater and wall before the first row are the
parameters ``heater_start`` and ``wall_start``, listed in `ThermalBox.initials`, which belong to a
recording and not to the machine. The scale of all heat flows cannot be seen in temperatures, so
the heater's power is given, not tuned; its heat capacity is barely visible (a heater of any
capacity gives the same box, at another Gh) and is not tuned by default either.

>>> import numpy as np
>>> box = ThermalBox(wall=True)
>>> p = box.parameters.values
>>> _, warm = box.simulate(box.initial(p), np.array([[1.0, 293.15]] * 400), np.full(400, 3.0), p)
>>> bool(warm[-1, 0] > warm[0, 0] > 293.0)
True

One step is Runge-Kutta of fourth order, cut into parts of at most half the fastest time constant.
All is linear, so a part is a matrix and a constant: of many parts, as where a quick heater is
sampled slowly, twice as many are one product more.
Model after the INTO-CPS incubator: Feng, Gomes, Thule, Lausdahl, Iosifidis, Larsen, "Introduction
to digital twin engineering", 2021.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.models import Compiled, Parameter, Parameters
from evertwin.signals import Channel, Layout
from evertwin.types import ParameterVector, StateVector

POWER, CH, GH, CB, GB, HEATER_START, CW, GW, WALL_START = range(9)
PARTS = 1000
"""Most parts of one step; a row whose interval needs more is an error."""
MANY = 8
"""Parts of a step from which on they are doubled in place of taken one after the other."""


@njit(cache=True)
def _slopes(wall: int, x: Any, k: Any, u: Any, p: Any) -> None:
    """Time derivatives ``k`` of the states ``x`` [K/s]."""
    heat = p[GH] * (x[0] - x[1])
    loss = p[GB] * (x[1] - u[1])
    k[0] = (p[POWER] * u[0] - heat) / p[CH]
    if wall == 1:
        stored = p[GW] * (x[1] - x[2])
        k[1] = (heat - loss - stored) / p[CB]
        k[2] = stored / p[CW]
    else:
        k[1] = (heat - loss) / p[CB]


@njit(cache=True)
def _parts(wall: int, dt: float, p: Any) -> int:
    """Parts of a step such that each is at most half the fastest time constant; 0: too many."""
    lost = p[GH] + p[GB]
    fastest = p[GH] / p[CH]
    if wall == 1:
        lost += p[GW]
        fastest = max(fastest, p[GW] / p[CW])
    parts = math.ceil(2.0 * dt * (fastest + lost / p[CB]))
    if not 0.0 <= parts <= PARTS:
        return 0
    return max(1, int(parts))


@njit(cache=True)
def _part(wall: int, h: float, u: Any, p: Any, ahead: Any) -> None:
    """The states go on by ``h``, in place."""
    size = 2 + wall
    at, mean, k = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(size):
        at[i] = ahead[i]
    for stage in range(4):
        _slopes(wall, at, k, u, p)
        share = 1.0 / 6.0 if stage in (0, 3) else 1.0 / 3.0
        reach = 1.0 if stage == 2 else 0.5
        for i in range(size):
            mean[i] += share * k[i]
            at[i] = ahead[i] + reach * h * k[i]
    for i in range(size):
        ahead[i] += h * mean[i]


@njit(cache=True)
def _doubled(wall: int, dt: float, u: Any, p: Any, parts: int, ahead: Any) -> None:
    """As many parts or more, the next power of two, as one matrix and a constant, in place."""
    size, times = 2 + wall, 0
    while 1 << times < parts:
        times += 1
    h, off, one = dt / (1 << times), np.zeros(2), np.zeros(3)
    matrix, square, constant = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    _part(wall, h, u, p, constant)  # from zero
    for j in range(size):
        one[:] = 0.0
        one[j] = 1.0
        _part(wall, h, off, p, one)
        matrix[:, j] = one
    for _ in range(times):
        for i in range(size):
            one[i] = constant[i]
            for j in range(size):
                one[i] += matrix[i, j] * constant[j]
                square[i, j] = 0.0
                for k in range(size):
                    square[i, j] += matrix[i, k] * matrix[k, j]
        constant[:] = one
        matrix[:, :] = square
    for i in range(size):
        one[i] = constant[i]
        for j in range(size):
            one[i] += matrix[i, j] * ahead[j]
    for i in range(size):
        ahead[i] = one[i]


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """One row of the box."""
    wall = context[0]
    size = 2 + wall
    parts = _parts(wall, dt, p)
    if parts == 0:
        return 1
    for i in range(size):
        ahead[i] = x[i]
    if parts > MANY:
        _doubled(wall, dt, u, p, parts, ahead)
    else:
        for _ in range(parts):
            _part(wall, dt / parts, u, p, ahead)
    y[0] = ahead[1]
    return 0


@cfunc(OBSERVE)
def observe(context: Any, x: Any, y: Any) -> int:
    """The box adopts its measurement; heater and wall run on."""
    if not math.isnan(y[0]):
        x[1] = y[0]
    return 0


def _parameters(wall: bool) -> Parameters:
    items = [
        Parameter("heater_power", 120.0, "W", 0.0, 1e6, editable=False),
        Parameter("heater_capacity", 50.0, "J/K", 1e-3, 1e7, editable=False),
        Parameter("heater_conductance", 1.0, "W/K", 1e-4, 1e4),
        Parameter("box_capacity", 400.0, "J/K", 1e-1, 1e8),
        Parameter("box_conductance", 0.7, "W/K", 1e-4, 1e4),
        Parameter("heater_start", 293.15, "K", 200.0, 800.0),
    ]
    if wall:
        items += [
            Parameter("wall_capacity", 300.0, "J/K", 1e-1, 1e9),
            Parameter("wall_conductance", 1.0, "W/K", 1e-4, 1e4),
            Parameter("wall_start", 293.15, "K", 200.0, 800.0),
        ]
    return Parameters(tuple(items))


class ThermalBox(Compiled):
    """The heated box as a Model: inputs heater (0 … 1) and room [K], output box [K].

    >>> ThermalBox().states.names, ThermalBox(wall=True).initials
    (('heater', 'box'), ('heater_start', 'wall_start'))
    """

    def __init__(self, wall: bool = False) -> None:
        states = ("heater", "box", "wall")[: 3 if wall else 2]
        super().__init__(
            Layout(
                (
                    Channel("heater", "1", low=0.0, high=1.0),
                    Channel("room", "K", low=150.0, high=1500.0),
                )
            ),
            Layout((Channel("box", "K", low=150.0, high=1500.0),)),
            Layout.of(**dict.fromkeys(states, "K")),
            _parameters(wall),
            step,
            observe,
            (int(wall),),
        )

    @property
    def initials(self) -> tuple[str, ...]:
        """Parameters that are the unmeasured state before a recording: free for each of them."""
        return tuple(name for name in self.parameters.names if name.endswith("_start"))

    def initial(self, p: ParameterVector) -> StateVector:
        """Heater and wall at their start; the box as warm as the wall until it is measured."""
        if len(self.states) == 3:
            return np.array([p[HEATER_START], p[WALL_START], p[WALL_START]])
        return np.array([p[HEATER_START], p[HEATER_START]])
