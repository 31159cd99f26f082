"""Repeatability: do the recordings agree about a number, within what each of them is sure of?

Each recording (many short ones in up to `PARTS` groups; of a model with a state also parts of a
single one) tells the parameters anew: one step from the common fit on its rows alone. Where these
values scatter by more than their own errors (Cochran's Q), the number is not the same every day, or
the form lacks what differs. What they scatter beyond (DerSimonian and Laird 1986) is said, and
widens the interval: it holds for one more such recording, not for the mean of these.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> from evertwin.tuning import solve
>>> spring = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(z="m"),
...     Layout.of(force="N"), parameters=Parameters.of(stiffness=(2.0, "N/m")))
>>> rng, z = np.random.default_rng(0), np.linspace(-1.0, 1.0, 90)[:, None]
>>> def day(stiffness):
...     return make_block(t=np.arange(90), u=z, y=stiffness * z + rng.normal(0, 0.01, z.shape))
>>> problem = Problem(spring, tuple(day(k) for k in (2.9, 3.1, 3.0, 3.2, 2.8)))
>>> plain, told = solve(problem), repeated(problem, solve(problem))
>>> [round(high - low, 1) for low, high in (f.interval("stiffness") for f in (plain, told))]
[0.1, 0.9]
>>> told.reasons
('differs by ± 0.16 (1 σ) among 5 recordings',)
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import scipy

from evertwin.tuning.intervals.assemble import sizes_of, student
from evertwin.tuning.intervals.fit import Amend, Fit
from evertwin.tuning.intervals.identifiability import NULL, grade
from evertwin.tuning.linear.closed import dense
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.residuals.autocorrelation import Correlation
from evertwin.types import Bool, Float64, Vector

LEAST, PARTS = 3, 8
"""Fewest recordings that are compared; groups that many are put into."""
ROWS = 20
"""Rows that each part needs for each parameter."""
CHANCE = 1e-3
"""Probability of so large a scatter from the errors alone, below which it is believed."""


def repeated(problem: Problem, fit: Fit) -> Fit:
    """The fit, with what its recordings contradict each other by. Values stay."""
    free = np.array([verdict != "not" for verdict in fit.verdict])
    acting = problem.sensitivity(fit.values)
    parts, kind = _parts(problem, int(free.sum()))
    if not parts or not free.any() or not fit.converged or not acting.finite:
        return fit
    r = problem.residuals(fit.values)
    known = problem.rows.used & np.isfinite(r)
    scale = np.where(known, 1.0 / fit.noise, 0.0)
    columns = dense(acting.columns, acting.at, len(fit.names))[:, :, free]
    columns = np.where(known[:, :, None], columns, 0.0) * scale[:, :, None]
    left = np.where(known, r, 0.0) * scale
    told = [_step(columns[a:b], left[a:b]) for a, b in parts]
    # what is left once each part has its own numbers is the error of a row
    own = [left[a:b] - columns[a:b] @ one for (a, b), (one, _) in zip(parts, told, strict=True)]
    size = _size(np.concatenate(own), np.concatenate([known[a:b] for a, b in parts]))
    told = [_step(columns[a:b] / size[:, None], left[a:b] / size) for a, b in parts]
    change, variance = (np.stack(one) for one in zip(*told, strict=True))
    found = dict[int, Amend]()
    sizes = sizes_of(problem, acting, fit.values)
    for j, k in enumerate(np.flatnonzero(free).tolist()):
        tau, count = _beyond(change[:, j], variance[:, j])
        if not tau:
            continue
        low, high = fit.interval95[k].tolist()
        half = float(np.hypot((high - low) / 2.0, student(np.array([count - 1.0]))[0] * tau))
        interval = (low + high) / 2.0 - half, (low + high) / 2.0 + half
        (word,), (wide,) = grade([""], np.array([half / sizes[k]]))
        if abs(low + high) / 2.0 <= half:
            word, wide = "weak", wide or "not told from zero"
        said = f"differs by ± {tau:.2g} (1 σ) among {count} {kind}"
        found[k] = Amend(interval, "" if word == "identifiable" else "weak", (said, wide))
    return fit.amended(found)


def _parts(problem: Problem, parameters: int) -> tuple[list[tuple[int, int]], str]:
    """([start, stop) of the rows of each part, what the parts are); none where they are too few."""
    edges = np.cumsum([0, *(len(window.t) for window in problem.windows)])
    kind = "recordings"
    if len(edges) - 1 < LEAST:
        if not len(problem.model.states):
            return [], ""  # time is an input like any other there: `carried` asks for it
        edges, kind = np.linspace(0, edges[-1], PARTS + 1).astype(np.int64), "parts"
    elif len(edges) - 1 > PARTS:
        places = np.linspace(0, len(edges) - 1, PARTS + 1).astype(np.int64)
        edges, kind = edges[places], "groups of recordings"
    pairs = list(pairwise(edges.tolist()))
    enough = [(a, b) for a, b in pairs if b - a >= ROWS * parameters]
    return (enough, kind) if len(enough) >= LEAST else ([], "")


def _size(
    own: Float64[np.ndarray, "n ny"], known: Bool[np.ndarray, "n ny"]
) -> Float64[np.ndarray, " ny"]:
    """What a row of each output errs by, as one that counts for all that err alike."""
    e = np.where(known, own, np.nan)
    memory = [max(1.0 + 2.0 * float(rho[1:].sum()), 1.0) for rho in Correlation.of(e).memory]
    rows = np.maximum(known.sum(axis=0), 1)
    mean = np.square(np.where(known, own, 0.0)).sum(axis=0) / rows
    return np.asarray(np.sqrt(np.maximum(mean * memory, 1e-24)))


def _step(
    columns: Float64[np.ndarray, "n ny k"], left: Float64[np.ndarray, "n ny"]
) -> tuple[Vector, Vector]:
    """(how the rows would change the parameters, its variance); infinite where they do not say."""
    k = columns.shape[2]
    a, b = columns.reshape(-1, k), left.ravel()
    size = np.sqrt(np.square(a).sum(axis=0))
    size[size == 0] = 1.0
    square, vectors = np.linalg.eigh(a.T @ a / np.outer(size, size))
    told = square > NULL**2
    inverse = (vectors[:, told] / square[told]) @ vectors[:, told].T / np.outer(size, size)
    loose = np.square(vectors[:, ~told]).sum(axis=1) > NULL
    return inverse @ (a.T @ b), np.where(loose, np.inf, inverse.diagonal())


def _beyond(change: Vector, variance: Vector) -> tuple[float, int]:
    """(standard deviation between parts beyond their errors, parts that tell); 0: none is sure."""
    told = np.isfinite(variance) & (variance > 0)
    count = int(told.sum())
    if count < LEAST:
        return 0.0, count
    weight, value = 1.0 / variance[told], change[told]
    q = float(weight @ np.square(value - weight @ value / weight.sum()))
    if scipy.special.chdtrc(count - 1.0, q) >= CHANCE:
        return 0.0, count
    return float(
        np.sqrt((q - count + 1) / (weight.sum() - np.square(weight).sum() / weight.sum()))
    ), count
