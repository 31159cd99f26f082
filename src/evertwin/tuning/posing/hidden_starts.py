"""What a window begins with in states that nothing measures: a number of the fit for each.

A window that is cut from a machine's motion begins anywhere: a fit that takes the model's own start
for it would take the difference for the machine. So the start of each such state of each window is
tuned with the machine's numbers, from the model's start, or from what the rows before came to.

>>> from evertwin.machines.thermal import ThermalBox
>>> own_starts(ThermalBox(), 2)  # it has a parameter for that
()
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block, take
from evertwin.models import Model, Parameter, Parameters, observed, remembers, unmeasured
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.rollout import roll
from evertwin.sync.horizon.horizon import residuals, restarts
from evertwin.tuning.posing.before import Begins
from evertwin.tuning.posing.recordings import given, initials, places
from evertwin.types import (
    Int64,
    ParameterVector,
    ParameterVectors,
    StateVector,
    StateVectors,
    Vector,
)

MOST = 24
"""Numbers of this kind that a fit carries; more windows tell little of what each began with."""
NEARER, HUGE = 1.0 / 3.0, 1e100
"""Share of a deviation that an observer leaves of it at most, and the square of one without end."""
WIDE, PARTS = 10.0, 16
"""Standard deviation of a start in sizes of its state, and the parts that tell that size."""
PLACES, TINY = (0.1, 0.3, 0.5, 0.7, 0.9), 1e-300
"""Where in the course of a state other starts are tried, as quantiles."""


class Recording(NamedTuple):
    """Rows of a fit that begin with numbers of their own.

    >>> Recording._fields
    ('first', 'stop', 'at', 'states', 'starts', 'known')
    """

    first: int
    stop: int
    at: Int64[np.ndarray, " np"]
    """Places of the model's parameters among all, (np,)."""
    states: Int64[np.ndarray, " hidden"]
    """Those whose start is tuned, (hidden,)."""
    starts: Int64[np.ndarray, " hidden"]
    """Places of that among all parameters, (hidden,)."""
    known: StateVector | None
    """What the rows before came to, (nx,)."""

    @classmethod
    def of(
        cls, parameters: Parameters, model: Model, names: Sequence[str],
        rows: tuple[Sequence[Block], Begins],
    ) -> list[Recording]:  # fmt: skip
        """One for each window; ``rows`` as for `starting`."""
        edges = np.cumsum([0, *(len(window.t) for window in rows[0])]).tolist()
        found = list[Recording]()
        for k, window in enumerate(rows[0]):
            own = {_name(name, k): h for h, name in enumerate(model.states.names)}
            tuned = [name for name in own if name in names]
            states = np.array([own[name] for name in tuned], dtype=np.int64)
            at, starts = places(parameters, model, names, k), parameters.indices(tuned)
            known = rows[1].get(window.row)
            found.append(cls(edges[k], edges[k + 1], at, states, starts, known))
        return found

    def alike(self, other: Recording) -> bool:
        """Do both begin with the same numbers, those of the model?"""
        own = len(self.states) or self.known is not None or other.known is not None
        return not own and np.array_equal(self.at, other.at)

    def begins(self, model: Model, full: ParameterVectors) -> StateVectors | None:
        """States it begins with under all parameters (k, …), (k, nx); None: those of the model."""
        if self.known is None and not len(self.states):
            return None
        p = full[:, self.at]
        found = np.stack([model.initial(one) for one in p])
        if self.known is not None:
            found = np.where(given(model, p[0]), found, self.known)
        found[:, self.states] = full[:, self.starts]
        return found


def own_starts(model: Model, windows: int) -> tuple[str, ...]:
    """Their names, window by window; none where they would be more than `MOST`."""
    places = _unmeasured(model)
    names = [model.states.names[place] for place in places]
    if len(names) * windows > MOST:
        return ()
    return tuple(_name(name, k) for k in range(windows) for name in names)


def kept_near(model: Model, p: ParameterVector, windows: Sequence[Block], horizon: float) -> Model:
    """The model; with its observer where a simulation runs away without: no start of a state that
    nothing measures keeps an unstable one near its machine.

    Args:
        p: the model's parameters, (np,).
        horizon: of its predictions [s].
    """
    seen = observed(model)
    if seen is model:
        return model
    off = np.zeros((2, len(model.outputs)))
    for window in windows:
        for k, one in enumerate((model, seen)):
            plan = restarts(window, horizon, one.initial(p), remembers(one))
            y = roll(kernel_of(one), plan.x0, window.u, window.dt, p, plan)[1]
            off[k] += np.nan_to_num(np.square(residuals(model, window, y)), posinf=HUGE).sum(axis=0)
    sizes = sum(np.nansum(np.square(w.y - np.nanmean(w.y, axis=0)), axis=0) for w in windows)
    astray = (off[0] > sizes) & (off[1] < NEARER**2 * off[0])
    return seen if astray.any() else model


def starting(
    model: Model, p: ParameterVector, horizon: float, rows: tuple[Sequence[Block], Begins]
) -> Parameters:
    """The starts of windows, with priors wider than their states move by themselves.

    Args:
        p: the model's parameters, (np,).
        horizon: of its predictions [s].
        rows: the windows, and what is known of where they begin.
    """
    items, channels = list[Parameter](), model.states.channels
    for k, window in enumerate(rows[0]):
        x0 = rows[1].get(window.row, model.initial(p))
        course = _course(model, p, x0, horizon, window)
        sizes = _sizes(course)
        if window.row not in rows[1]:
            x0 = _likeliest(model, p, course, horizon, window)
        for h in _unmeasured(model):
            name, unit, sigma = _name(channels[h].name, k), channels[h].unit, WIDE * sizes[h]
            items.append(Parameter(name, float(x0[h]), unit, sigma=float(sigma)))
    return Parameters(tuple(items))


def begun(
    model: Model, p: ParameterVector, fitted: tuple[Sequence[str], Vector], k: int
) -> tuple[StateVector, dict[str, float]]:
    """States that window ``k`` of a fit (names, values) begins with, NaN where none, (nx,), and
    what of a window nothing measures, by name."""
    values, names = dict(zip(*fitted, strict=True)), model.states.names
    x0 = np.array([values.get(_name(name, k), np.nan) for name in names])
    told = {name: float(p[model.parameters.index(name)]) for name in initials(model)}
    found = {f"start of {n}": x for n, x in zip(names, x0.tolist(), strict=True) if x == x}
    return x0, told | found


def _unmeasured(model: Model) -> tuple[int, ...]:
    hidden = unmeasured(model)
    own = given(model, model.parameters.values) if hidden else ()
    return tuple(h for h in hidden if not own[h])


def _course(
    model: Model, p: ParameterVector, x0: StateVector, horizon: float, window: Block
) -> StateVectors:
    """States that a window leads through, its start first, (`PARTS` + 1, nx)."""
    kernel, x, seen = kernel_of(model), x0, [x0]
    for part in _parts(window):
        x = roll(kernel, x, part.u, part.dt, p, restarts(part, horizon, x))[0]
        seen.append(x)
    return np.stack(seen)


def _sizes(course: StateVectors) -> StateVector:
    """How far each state moves; 1 where it does not, (nx,)."""
    size = np.ptp(course, axis=0)
    return np.where(np.isfinite(size) & (size > 0.0), size, 1.0)


def _likeliest(
    model: Model, p: ParameterVector, course: StateVectors, horizon: float, window: Block
) -> StateVector:
    """The start that leaves least, of the model's own and of where each state comes to, (nx,): a
    search from a start at a stop of the state, such as an empty tank, finds no slope there."""
    kernel, best = kernel_of(model), np.asarray(course[0], dtype=np.float64)
    noise = np.nanstd(window.y, axis=0) + TINY

    plan = restarts(window, horizon, best, remembers(model))

    def left(x0: StateVector) -> tuple[int, float]:
        """Rows that are lost, as where it runs away, and the squares of the others."""
        y = roll(kernel, x0, window.u, window.dt, p, plan._replace(x0=x0))[1]
        found = residuals(model, window, y) / noise
        return -int(np.isfinite(found).sum()), float(np.nansum(np.square(found)))

    least = left(best)
    for h in _unmeasured(model):
        for value in np.quantile(course[:, h], PLACES):
            other = np.where(np.arange(len(best)) == h, value, best)
            cost = left(other)
            if cost < least:
                least, best = cost, other
    return best


def _parts(window: Block) -> list[Block]:
    edges = np.linspace(0, len(window.t), PARTS + 1).astype(int).tolist()
    return [take(window, a, b) for a, b in pairwise(edges) if a < b]


def _name(state: str, k: int) -> str:
    return f"start of {state} in recording {k + 1}"
