"""Closed forms of machines of ours, and what heat and friction may do.

>>> from evertwin.machines.mobile import Differential
>>> base = Differential()
>>> [check.name for check in closed_forms(base, base.parameters.values)]
['a circle closes']
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from evertwin.engineering.verification import Check
from evertwin.machines.drive import Drive, DriveForce
from evertwin.machines.mobile import Bicycle, Differential, Odometer, Omni, Robot1D
from evertwin.machines.thermal import ThermalBox
from evertwin.models import Model
from evertwin.types import ParameterVector


def closed_forms(model: Model, p: ParameterVector) -> tuple[Check, ...]:
    """The checks that there are for this kind of machine."""
    if isinstance(model, ThermalBox):
        return _exponential(model, p), _second_law(model, p)
    if isinstance(model, Drive):
        return _slowing(model, p), _both_ways(model, p)
    if isinstance(model, DriveForce):
        return _rubbing(model, p), _both_ways(model, p)
    if isinstance(model, Bicycle | Differential | Omni):
        return (_circle(model, p),)
    if isinstance(model, Robot1D | Odometer):
        return (_straight(model, p),)
    missing = "none is known for this kind of model"
    return (Check.missing("closed form", "law", missing),)


def _exponential(box: ThermalBox, p: ParameterVector) -> Check:
    """The heat balances are linear: the matrix exponential solves them exactly."""
    k = dict(zip(box.parameters.names, p.tolist(), strict=True))
    n, gh, gb = len(box.states), k["heater_conductance"], k["box_conductance"]
    gw, cw = k.get("wall_conductance", 0.0), k.get("wall_capacity", 1.0)
    capacities = np.array([k["heater_capacity"], k["box_capacity"], cw])
    flows = np.array([[-gh, gh, 0.0], [gh, -gh - gb - gw, gw], [0.0, gw, -gw]])
    drive = np.array([[k["heater_power"], 0.0], [0.0, gb], [0.0, 0.0]])
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n] = (flows / capacities[:, None])[:n, :n]
    whole[:n, n:] = (drive / capacities[:, None])[:n]
    rows, dt, u = 200, 3.0, np.array([1.0, 290.0])
    start = box.initial(p)
    exact, turn = np.concatenate([start, u]), scipy.linalg.expm(whole * dt)
    expected = np.empty(rows)
    for i in range(rows):
        exact = turn @ exact
        expected[i] = exact[1]
    _, y = box.simulate(start, np.tile(u, (rows, 1)), np.full(rows, dt), p)
    off = float(np.abs(y[:, 0] - expected).max()) / max(float(np.ptp(expected)), 1e-9)
    said = f"{rows * dt:.0f} s of heating; of the rise"
    return Check("matrix exponential of the balances", "law", off, 1e-3, "1", said)


def _second_law(box: ThermalBox, p: ParameterVector) -> Check:
    """Without heating nothing becomes warmer than the warmest, or colder than the coldest."""
    room, rows = 290.0, 2000
    start = box.initial(p)
    u = np.tile([0.0, room], (rows, 1))
    _, y = box.simulate(start, u, np.full(rows, 3.0), p)
    lowest, highest = min(room, float(start.min())), max(room, float(start.max()))
    beyond = max(0.0, float(y.max()) - highest, lowest - float(y.min()))
    return Check("heat flows from warm to cold", "law", beyond, 1e-9, "K", "6000 s, heater off")


def _unbiased(drive: Drive | DriveForce, p: ParameterVector) -> ParameterVector:
    """Without a constant force."""
    free = p.copy()
    free[drive.parameters.indices(drive.law.biases())] = 0.0
    return free


def _slowing(drive: Drive, p: ParameterVector) -> Check:
    """A drive that nothing pushes only becomes slower, but for its constant force."""
    free, unit = _unbiased(drive, p), drive.outputs.units[1]
    worst, rows = 0.0, 2000
    for speed in (0.5, -0.5):
        _, y = drive.simulate(
            np.array([0.0, speed]), np.zeros((rows, 1)), np.full(rows, 1e-3), free
        )
        size = np.abs(np.concatenate([[speed], y[:, 1]]))
        worst = max(worst, float(np.diff(size).max()))
    return Check("friction takes power out", "law", max(0.0, worst), 1e-12, unit, "2 s each way")


def _rubbing(drive: DriveForce, p: ParameterVector) -> Check:
    """At constant speed the force pushes along the motion, but for its constant share."""
    free, unit = _unbiased(drive, p), drive.inputs.units[0]
    speeds = np.linspace(-1.0, 1.0, 201)
    u = np.stack([speeds, np.zeros(201)], axis=1)
    _, force = drive.simulate(drive.initial(free), u, np.zeros(201), free)
    power = force[:, 0] * speeds
    limit = 1e-9 * max(1.0, float(np.abs(power).max()))
    worst = max(0.0, float(-power.min()))
    return Check("friction takes power out", "law", worst, limit, "W", f"speeds up to 1 {unit}")


def _both_ways(drive: Drive | DriveForce, p: ParameterVector) -> Check:
    """The force that a motion needs, put into the drive, makes that motion: forwards, backwards."""
    law = replace(drive.law, standstill=0.0)
    forward, inverse = Drive(law), DriveForce(law)
    rows, dt, rate = 2000, 1e-3, np.pi
    t = dt * (np.arange(rows) + 0.5)
    worst = 0.0
    for sign in (1.0, -1.0):
        # The speed never crosses zero, where dry friction is undetermined.
        speed = sign * (0.3 - 0.25 * np.cos(rate * t))
        u = np.stack([speed, sign * 0.25 * rate * np.sin(rate * t)], axis=1)
        _, force = inverse.simulate(np.zeros(0), u, np.full(rows, dt), p)
        start = np.array([0.0, sign * 0.05])
        _, y = forward.simulate(start, force, np.full(rows, dt), p)
        expected = sign * (0.3 - 0.25 * np.cos(rate * (t + 0.5 * dt)))
        worst = max(worst, float(np.abs(y[:, 1] - expected).max()) / 0.5)
    said = "2 s each way; of the range of speed"
    return Check("forward and inverse agree", "law", worst, 0.01, "1", said)


def _circle(base: Bicycle | Differential | Omni, p: ParameterVector) -> Check:
    """Constant speed and turn rate lead back to the start."""
    rows, u = 1000, 0.5 * np.arange(1.0, len(base.inputs) + 1.0)
    start = base.initial(p)
    _, turned = base.simulate(start, u[None], np.ones(1), p)
    time = 2.0 * np.pi / abs(float(turned[0, 2] - start[2]))
    _, y = base.simulate(start, np.tile(u, (rows, 1)), np.full(rows, time / rows), p)
    across = max(float(np.ptp(y[:, 0])), 1e-12)
    off = float(np.hypot(y[-1, 0] - start[0], y[-1, 1] - start[1])) / across
    return Check("a circle closes", "law", off, 1e-6, "1", f"{rows} rows; of its diameter")


def _straight(base: Robot1D | Odometer, p: ParameterVector) -> Check:
    """Constant speed covers speed times time."""
    u = np.zeros((100, len(base.inputs)))
    u[:, 0] = 0.3
    gain = p[base.parameters.index("gain")]
    _, y = base.simulate(base.initial(p), u, np.full(100, 0.1), p)
    off = abs(float(y[-1, 0]) - 3.0 * gain) / abs(3.0 * gain)
    return Check("way is speed times time", "law", off, 1e-9, "1", "10 s at 0.3 m/s")
