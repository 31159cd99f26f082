"""How much each parameter changes each output, over its whole range: Sobol and Morris, by SALib.

An output is a whole course over time, not one number. Its variance over the parameters' ranges is
split by row and summed (generalised Sobol indices: Gamboa, Janon, Klein, Lagnoux, "Sensitivity
analysis for multidimensional and functional outputs", 2014). The sum does not depend on the axes
that the course is described in, so it is taken over its few principal components instead of its
rows: SALib then sees a handful of numbers per output. Where the outputs are linear in the
parameters those components need no simulation at all.

* Sobol **share**: part of an output's variance that a parameter takes, with all its interactions;
* Morris: mean absolute change over the range (``mu``) and its spread (``spread``: not linear, or
  interacting);
* **effect**: standard deviation that the parameter makes in the output, relative to its rms.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> import numpy as np
>>> v = np.linspace(-1, 1, 6)[:, None]
>>> axis = FunctionModel(lambda x, u, dt, p: ([], [p[0] * np.sign(u[0]) + p[1] * u[0]]),
...     Layout.of(speed="rad/s"), Layout.of(torque="Nm"),
...     parameters=Parameters.of(Fc=(9.0, "Nm"), Fv=(1.0, "Nms/rad")))
>>> rows = make_block(t=np.arange(6), u=v, y=10 * v)
>>> found = sobol(Problem(axis, (rows,)), np.array([4.5, 0.5]), seed=1)
>>> found.share.round(1).tolist()
[[1.0, 0.0]]
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import ModelError, needs
from evertwin.fold.block import first
from evertwin.tuning import Problem
from evertwin.tuning.form.unseen import on
from evertwin.types import Float64, Vector

Samples: TypeAlias = Float64[np.ndarray, "s k"]
PerOutputParameter: TypeAlias = Float64[np.ndarray, "ny k"]

LINEAR = 1024
"""Base samples where none has to be simulated."""
BUDGET = 4_000_000
"""Rows that are simulated for Sobol, about; a quarter of it for Morris. Not a time: the same seed
gives the same figures on any machine."""
FEWEST, MOST = 32, 1024
KEPT = 1e-6
"""Principal components with less of the variance than this are left out."""
TRAJECTORIES = 32
RESAMPLES = 50
ROWS = 3000
PILOT = 64
"""Simulations that principal components are taken from."""


class _Course(NamedTuple):
    """The principal components of one output, and how to get their scores."""

    basis: np.ndarray
    """(rows that count, r)"""
    centre: np.ndarray
    """(rows that count,)"""
    on: np.ndarray
    """Rows that count."""
    size: float
    """rms of the measured output."""


@dataclass(frozen=True)
class _Figures:
    names: tuple[str, ...]
    outputs: tuple[str, ...]
    samples: int
    """Evaluations of the model."""
    seconds: float


@dataclass(frozen=True)
class Sobol(_Figures):
    """Shares of the outputs' variance.

    >>> Sobol.__name__
    'Sobol'
    """

    share: PerOutputParameter
    """Total index, interactions included."""
    alone: PerOutputParameter
    """First-order index: without interactions."""
    half: PerOutputParameter
    """Half width of the share's 95 % interval (bootstrap)."""
    effect: PerOutputParameter
    """Standard deviation that the parameter makes, relative to the output's rms."""


@dataclass(frozen=True)
class Morris(_Figures):
    """Elementary effects over the ranges, relative to the outputs' rms.

    >>> Morris.__name__
    'Morris'
    """

    mu: PerOutputParameter
    """Mean absolute effect of going through the whole range."""
    spread: PerOutputParameter
    """Its standard deviation: 0 where the effect is the same everywhere."""


def sobol(problem: Problem, spans: Vector, seed: int) -> Sobol:
    """Sobol indices of every tuned parameter on every output.

    Args:
        problem: model, rows and parameters; its start values are the middle of the ranges.
        spans: half range of each parameter, (k,), above 0.
        seed: of the samples.

    Raises:
        ModelError: a simulation inside the ranges diverged.
    """
    began, problem = time.perf_counter(), problem if problem.linear else few(problem)
    form, base, (sample, analyze) = _form(problem, spans), _base_samples(problem), _by("sobol")
    x = sample(form, base, calc_second_order=False, seed=seed)
    given = {"calc_second_order": False, "num_resamples": RESAMPLES, "seed": seed}
    sums = np.zeros((3, len(problem.model.outputs), len(problem.names)))
    effect = np.zeros(sums.shape[1:])
    for o, (course, scores) in enumerate(_scores(problem, spans, x)):
        variance = scores.var(axis=0)
        if not variance.sum() > 0.0:
            continue
        for score, weight in zip(scores.T, variance / variance.sum()):
            found = _quietly(analyze, form, score, **given)
            sums[:, o] += weight * np.array([found[key] for key in ("ST", "S1", "ST_conf")])
        total = variance.sum() / len(course.centre)
        effect[o] = np.sqrt(np.maximum(sums[0, o], 0.0) * total) / course.size
    share, alone, half = sums
    return Sobol(*_about(problem, x, began), share, alone, half, effect)


def morris(problem: Problem, spans: Vector, seed: int) -> Morris:
    """Morris' elementary effects of every tuned parameter on every output; arguments as `sobol`.

    Raises:
        ModelError: a simulation inside the ranges diverged.
    """
    began, problem = time.perf_counter(), problem if problem.linear else few(problem)
    form, (sample, analyze) = _form(problem, spans), _by("morris")
    x = sample(form, _paths(problem), num_levels=4, seed=seed)
    given = {"num_levels": 4, "num_resamples": 2, "seed": seed}
    sums = np.zeros((2, len(problem.model.outputs), len(problem.names)))
    for o, (course, scores) in enumerate(_scores(problem, spans, x)):
        for score in scores.T:
            found = _quietly(analyze, form, x, score, **given)
            sums[:, o] += [np.square(np.asarray(found[key])) for key in ("mu_star", "sigma")]
        sums[:, o] = np.sqrt(sums[:, o]) / (np.sqrt(len(course.centre)) * course.size)
    return Morris(*_about(problem, x, began), *sums)


def _by(method: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """How SALib samples and analyses. It is loaded when it is asked: that takes a second, which a
    service would start later by."""
    with needs("engineering"):
        modules = (import_module(f"SALib.{part}.{method}") for part in ("sample", "analyze"))
        sample, analyze = modules
    return sample.sample, analyze.analyze


def _about(
    problem: Problem, x: Samples, began: float
) -> tuple[tuple[str, ...], tuple[str, ...], int, float]:
    outputs = problem.model.outputs.names
    return problem.names, outputs, len(x), time.perf_counter() - began


def counted(problem: Problem) -> np.ndarray:
    """Rows that count, per output: measured and, where the problem says so, moving, (n, ny)."""
    rows = problem.rows
    return rows.used if problem.moving is None else rows.used & problem.moving(rows.u)


def few(problem: Problem) -> Problem:
    """The first recordings, `ROWS` rows about: where every parameter is simulated several times."""
    return on(problem, first(problem.windows, ROWS))


def _form(problem: Problem, spans: Vector) -> dict[str, Any]:
    """The question as SALib takes it: ranges, clipped to the bounds."""
    low, high = problem.bounds
    ends = np.clip(problem.start - spans, low, high), np.clip(problem.start + spans, low, high)
    bounds = np.stack(ends, axis=1).tolist()
    return {"num_vars": len(spans), "names": list(problem.names), "bounds": bounds}


def _base_samples(problem: Problem) -> int:
    if problem.linear:
        return LINEAR
    affordable = BUDGET / max(len(problem.rows.u), 1) / (len(problem.names) + 2)
    return int(2 ** np.floor(np.log2(np.clip(affordable, FEWEST, MOST))))


def _paths(problem: Problem) -> int:
    affordable = BUDGET // 4 // max(len(problem.rows.u), 1) // (len(problem.names) + 1)
    return TRAJECTORIES if problem.linear else int(np.clip(affordable, 8, TRAJECTORIES))


def _scores(problem: Problem, spans: Vector, x: Samples) -> list[tuple[_Course, np.ndarray]]:
    """Per output: its principal components, and their scores under every sample, (s, r)."""
    linear = problem.linear
    if linear:
        change = problem.jacobian(problem.start) * spans
        centre = problem.predict(problem.start)
        courses = [_course(problem, o, centre[:, o], change[:, o]) for o in range(change.shape[1])]
        moves = (x - problem.start) / spans
        return [(c, moves @ (change[c.on, o].T @ c.basis)) for o, c in enumerate(courses)]
    every = len(x) <= 4 * PILOT
    pick = np.arange(len(x)) if every else np.linspace(0, len(x) - 1, PILOT).astype(np.int64)
    pilot = np.stack([_simulated(problem, row) for row in x[pick]], axis=2)
    centre = pilot.mean(axis=2)
    courses = [
        _course(problem, o, centre[:, o], pilot[:, o] - centre[:, [o]])
        for o in range(pilot.shape[1])
    ]
    scores = [np.empty((len(x), c.basis.shape[1])) for c in courses]
    for s, row in enumerate(x):
        y = _simulated(problem, row)
        for o, c in enumerate(courses):
            scores[o][s] = (y[c.on, o] - c.centre) @ c.basis
    return list(zip(courses, scores, strict=True))


def _simulated(problem: Problem, values: Vector) -> np.ndarray:
    y = problem.predict(np.ascontiguousarray(values))
    if not np.isfinite(y[problem.rows.used]).all():
        told = ", ".join(f"{n} = {v:.4g}" for n, v in zip(problem.names, values, strict=True))
        raise ModelError(f"the simulation diverged with {told}: narrow `uncertain` of these")
    return y


def _course(problem: Problem, o: int, centre: np.ndarray, changes: np.ndarray) -> _Course:
    """Principal components of the changes (n, m) of output ``o``."""
    on = counted(problem)[:, o]
    left, size, _ = np.linalg.svd(changes[on], full_matrices=False)
    energy = np.square(size)
    kept = energy > KEPT * max(float(energy.sum()), 1e-300)
    measured = problem.rows.y[on, o]
    rms = float(np.sqrt(np.mean(np.square(measured)))) if on.any() else 1.0
    return _Course(left[:, kept], centre[on], on, rms if rms > 0 else 1.0)


def _quietly(analyse: Callable[..., Any], *given: Any, **more: Any) -> Any:
    """SALib divides by a variance that may be zero: that is a share of zero, no accident."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        return analyse(*given, **more)
