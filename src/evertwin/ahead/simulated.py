"""A case simulated: size and peak of each output with intervals, limits, path error, work done.

What parameters leave open is drawn; what start, sensor and process add has the size that open-loop
runs over the recordings had. Limits of the inputs (position, speed) hold exactly: they are told,
not measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.ahead.basis import draws, through
from evertwin.ahead.changes import Case, chain_of, inner
from evertwin.ahead.spread import BELL, Spread
from evertwin.machines.friction import Rubbing
from evertwin.machines.friction.resisting import rubbed
from evertwin.models import Model
from evertwin.signals import Layout, wrap
from evertwin.signals.units import compatible
from evertwin.types import Float64, Intervals, Outputs, StateVector, Vector

DRAWS = 64
PATHS = 1040
"""Courses of the residual that the interval of a peak is taken from."""
LARGEST = 50_000_000
"""Most numbers that are drawn for them, unless one course is longer."""
TAIL = 1.96


@dataclass(frozen=True)
class OutputSize:
    """Size of one output over the simulated time.

    >>> OutputSize("Nm", 2.0, (1.9, 2.1), 5.0, (4.5, 5.5)).rms
    2.0
    """

    unit: str
    rms: float
    rms95: tuple[float, float]
    """Interval of the rms that will be measured."""
    peak: float
    """Largest size, of the simulation with the values as they are."""
    peak95: tuple[float, float]
    """Interval of the largest size that will be measured."""
    limit: float | None = None
    chance: float | None = None
    """Probability that the limit is passed."""


@dataclass(frozen=True)
class Exceeded:
    """A limit that the case passes for certain.

    >>> Exceeded("qd1", "rad/s", 2.1, 2.0, 0.4).channel
    'qd1'
    """

    channel: str
    unit: str
    value: float
    limit: float
    at: float
    """When, from the start of the case [s]."""


@dataclass(frozen=True)
class PathError:
    """How far an output ends up from where it is meant to be.

    >>> PathError("m", 0.01, 0.02, 0.005, (0.0, 0.01)).largest
    0.02
    """

    unit: str
    rms: float
    largest: float
    end: float
    """At the end of the path."""
    end95: tuple[float, float]
    largest95: tuple[float, float] | None = None
    rms95: tuple[float, float] | None = None
    at: float | None = None
    """When it is largest, from the start of the path [s]."""
    where: tuple[float, ...] = ()
    """Where it is largest: the planned place of the tool [m]."""
    t: Vector = field(default_factory=lambda: np.zeros(0), repr=False)
    """Times of the path [s], where its course is known, and the size of the error then."""
    size: Vector = field(default_factory=lambda: np.zeros(0), repr=False)


@dataclass(frozen=True)
class Simulated:
    """What a case does.

    >>> Simulated(1.0, {}).exceeded
    ()
    """

    seconds: float
    outputs: Mapping[str, OutputSize]
    exceeded: tuple[Exceeded, ...] = ()
    path_error: Mapping[str, PathError] = field(default_factory=dict)
    work: Mapping[str, float] = field(default_factory=dict)
    """Work of friction by joint, or by the drive's force, over the case [J]."""
    t: Vector = field(default_factory=lambda: np.zeros(0), repr=False)
    y: Outputs = field(default_factory=lambda: np.zeros((0, 0)), repr=False)


def simulated(
    case: Case, x: StateVector | None, known: Spread, limits: Mapping[str, float],
    beyond: Outputs,
) -> Simulated:  # fmt: skip
    """Simulates a case.

    Args:
        case: what.
        x: state before the first row; None: the model's own.
        known: size of what the simulation leaves out, by the time from the start.
        limits: largest size by channel.
        beyond: what outputs may be off by because no such inputs were recorded, (n, ny).
    """
    model, future = case.model, case.future
    for name in limits:
        (model.inputs + model.outputs).index(name)
    ps = np.concatenate([case.p[None], draws(model, case.p, case.sigma, DRAWS, seed=2)])
    if not np.any(case.sigma > 0.0):
        ps = ps[:1]
    starts = [model.initial(p) if x is None else x for p in ps]
    y = through(model, starts, ps, future.u, future.dt)
    peaks, sizes = _measured(y, known, future.dt, beyond / BELL)
    outputs = {
        c.name: _size(c.unit, y[0, :, k], sizes[:, k], peaks[:, k], limits.get(c.name))
        for k, c in enumerate(model.outputs)
    }
    t = future.t
    told = [_over(c.name, c.unit, future.u[:, k], t, _ends(model, c, limits))
            for k, c in enumerate(model.inputs)]  # fmt: skip
    given = [
        _over(c.name, c.unit, y[0][:, k], t, (-limits[c.name], limits[c.name]))
        for k, c in enumerate(model.outputs) if c.name in limits
    ]  # fmt: skip
    return Simulated(
        float(future.dt.sum()), outputs, tuple(one for one in (*told, *given) if one is not None),
        _errors(case, y, known.sigma(t)), friction_work(case, y[0]), t, y[0],
    )  # fmt: skip


def _measured(
    y: Float64[np.ndarray, "k n ny"], known: Spread, dt: Intervals, beyond: Outputs
) -> tuple[Float64[np.ndarray, "m ny"], Float64[np.ndarray, "m ny"]]:
    """Largest and rms sizes that may be measured: of each simulation with what it is off by.

    The largest of many noisy rows lies above the largest row without noise.
    """
    rng = np.random.default_rng(5)
    count = min(max(LARGEST // y.size, 1), max(PATHS // len(y), 1))
    peaks, sizes = [], []
    for one in y:
        wrong = rng.standard_normal((count, 1, y.shape[2])) * beyond
        courses = known.paths(one, dt, count, rng) + wrong
        peaks.append(np.abs(courses).max(axis=1))
        sizes.append(np.sqrt(np.mean(courses**2, axis=1)))
    return np.concatenate(peaks), np.concatenate(sizes)


def _size(
    unit: str, y: Float64[np.ndarray, " n"], sizes: Float64[np.ndarray, " m"],
    peaks: Float64[np.ndarray, " m"], limit: float | None,
) -> OutputSize:  # fmt: skip
    rms, peak = float(np.sqrt(np.mean(y**2))), float(np.abs(y).max())
    chance = None if limit is None else float(np.mean(peaks > limit))
    return OutputSize(unit, rms, _around(rms, sizes), peak, _around(peak, peaks), limit, chance)


def _around(peak: float, peaks: Float64[np.ndarray, " m"]) -> tuple[float, float]:
    """95 % of the sizes that may be measured, with the one without noise, which lies below most."""
    low, high = (float(np.quantile(peaks, q)) for q in (0.025, 0.975))
    if peak < low:
        return peak, float(np.quantile(peaks, 0.95 + np.mean(peaks < peak)))
    if peak > high:
        return float(np.quantile(peaks, 0.05 - np.mean(peaks > peak))), peak
    return low, high


def _ends(model: Model, channel: Any, limits: Mapping[str, float]) -> tuple[float, float]:
    """Lowest and highest value of an input: the scenario's, else the description's."""
    if channel.name in limits:
        return -limits[channel.name], limits[channel.name]
    chain = chain_of(model)
    joint = channel.name.removesuffix("_set").lstrip("qd")
    if chain is not None and joint.isdigit() and int(joint) <= chain.n:
        low, high, speed = chain.limits[int(joint) - 1]
        order = channel.name.removesuffix("_set").count("d")
        if order == 0 and low < high:
            return low, high
        if order == 1:
            return -speed, speed
    return channel.low, channel.high


def _over(
    name: str, unit: str, values: Vector, t: Vector, ends: tuple[float, float]
) -> Exceeded | None:
    """Where a channel is farthest outside its limits."""
    low, high = ends
    over = np.maximum(values - high, low - values)
    worst = int(np.argmax(over))
    if not over[worst] > 0.0:
        return None
    value = float(values[worst])
    return Exceeded(name, unit, value, high if value > high else low, float(t[worst]))


def _errors(case: Case, y: Float64[np.ndarray, "k n ny"], sigma: Outputs) -> dict[str, PathError]:
    """Path errors of planned outputs; of x and y of a pose together as one distance."""
    found = {}
    outputs, angles = case.model.outputs, case.model.outputs.angles
    planned = np.full(y.shape[1:], np.nan)
    for name, column in case.planned.items():
        planned[:, outputs.index(name)] = column
    apart = wrap((y - planned).reshape(-1, y.shape[2]), angles).reshape(y.shape)
    for name in case.planned:
        k = outputs.index(name)
        found[name] = _error(outputs.units[k], apart[:, :, k], sigma[:, k])
    pair = _pair(outputs, tuple(case.planned))
    if pair:
        i, k = (outputs.index(name) for name in pair)
        both = np.hypot(apart[:, :, i], apart[:, :, k])
        found["position"] = _error(outputs.units[i], both, np.hypot(sigma[:, i], sigma[:, k]))
    return found


def _pair(outputs: Layout, planned: Sequence[str]) -> tuple[str, str] | None:
    """The two lengths of a pose, if both are planned."""
    lengths = [c.name for c in outputs if c.name in planned and compatible(c.unit, "m")]
    return (lengths[0], lengths[1]) if len(lengths) == 2 else None


def _error(
    unit: str, apart: Float64[np.ndarray, "k n"], sigma: Float64[np.ndarray, " n"]
) -> PathError:
    known = np.isfinite(apart[0])
    size = np.abs(apart[:, known])
    end = size[:, -1]
    spread = TAIL * math.hypot(float(end.std()), float(sigma[known][-1]))
    return PathError(
        unit, float(np.sqrt(np.mean(size[0] ** 2))), float(size[0].max()), float(end[0]),
        (max(float(end[0]) - spread, 0.0), float(end[0]) + spread),
    )  # fmt: skip


def friction_work(case: Case, y: Outputs) -> dict[str, float]:
    """Work that goes into each output's friction over the case [J]; empty where none is known.

    It is what the torque loses when friction is taken out of the model: ∫ |τ_friction · q̇| dt.
    """
    model = case.model
    speeds = {name: f"qd{name[3:]}" for name in model.outputs.names if name.startswith("tau")}
    pairs = {name: speed for name, speed in speeds.items() if speed in model.inputs.names}
    if not pairs:
        return _of_drives(case, y)
    machine = inner(model)
    bare = case.p.copy()
    if isinstance(machine, Rubbing):
        bare[model.parameters.indices(machine.rubbing)] = 0.0
    u, dt = case.future
    x = model.initial(case.p)
    lost = model.simulate(x, u, dt, case.p)[1] - model.simulate(x, u, dt, bare)[1]
    return {
        name: float(
            np.sum(
                np.abs(lost[:, model.outputs.index(name)] * u[:, model.inputs.index(speed)]) * dt
            )
        )
        for name, speed in pairs.items()
    }


def _of_drives(case: Case, y: Outputs) -> dict[str, float]:
    """The same of drives, by the channel of their force, or by their name."""
    u, dt = case.future
    drives = [one for one in rubbed(case.model, u, y, case.p) if one.units[1] in ("N", "Nm")]
    channels = case.model.inputs + case.model.outputs
    names = [c.name for c in channels if c.unit in ("N", "Nm")]
    if len(drives) != 1 or len(names) != 1:
        names = [one.name for one in drives]
    work = [float(np.nansum(np.abs(one.power) * dt)) for one in drives]
    return dict(zip(names, work, strict=True))
