"""A tuning problem: which parameters of which model, judged on which rows.

The residual of a parameter vector is *measured − predicted*, where predictions run over one
horizon from the measured state (`evertwin.sync.horizon`). The same filter goes over both sides:
over the measured outputs exactly as over the predictions (or over the regressor). What was not
measured, not trusted or not predicted is left out.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> spring = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(z="m"),
...     Layout.of(force="N"), parameters=Parameters.of(stiffness=(2.0, "N/m")))
>>> rows = make_block(t=range(3), u=[[0.0], [1.0], [2.0]], y=[[0.0], [3.0], [6.0]])
>>> problem = Problem(spring, (rows,))
>>> problem.residuals(np.array([2.0])).ravel().tolist()
[0.0, 1.0, 2.0]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.fold import Block, Mark
from evertwin.models import (
    KernelModel,
    LinearModel,
    Model,
    Parameters,
    Restart,
)
from evertwin.models.batch import Batch
from evertwin.signals import wrap
from evertwin.sync.horizon import openings, residuals, restarts
from evertwin.tuning.far import far_runs
from evertwin.tuning.settings import Settings
from evertwin.types import Bool, Float64, Inputs, Intervals, Outputs, ParameterVector, Vector

__all__ = ["Filter", "Loss", "Moving", "PerOutput", "Problem", "Rows"]

Segments: TypeAlias = tuple[tuple[int, int], ...]
"""[start, stop) of stretches of rows."""
Filter: TypeAlias = Callable[[Any], Any]
"""``filter(columns (n, k)) -> (n, k)``: linear, over the rows of one task."""
PerOutput: TypeAlias = Float64[np.ndarray, " ny"]
Loss: TypeAlias = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]
Moving: TypeAlias = Callable[[Any], Any]
"""``moving(u (n, nu)) -> bool (n, ny)``: which rows count as moving, per output."""


class Rows(NamedTuple):
    """All windows one after another, prepared once.

    >>> Rows._fields[:3]
    ('u', 'dt', 'y')
    """

    u: Inputs
    dt: Intervals
    y: Outputs
    """Measured outputs, filtered; NaN where they do not count."""
    used: Bool[np.ndarray, "n ny"]
    code: np.ndarray
    """Restart codes, uint8 (n,)."""
    adopts: Outputs
    """Outputs that each restart takes over, (n, ny)."""
    segments: Segments
    """[start, stop) of each stretch that a filter may run over."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What to tune, on what. See the module for an example.

    Raises:
        UsageError: no window, no parameter, a wrong size of ``scale``.
    """

    model: Model
    windows: tuple[Block, ...]
    editable: tuple[str, ...] = ()
    """Names of the parameters to tune; by default those that the model calls editable."""
    horizon: float = math.inf
    """Length of a prediction [s]; ``inf``: free run over each task."""
    scale: PerOutput | None = None
    """Standard deviation of each output's noise, (ny,); None: estimated."""
    filter: Filter | None = None
    prior: Parameters | None = None
    """Start values, bounds and prior standard deviations; by default the model's own."""
    loss: Loss = "linear"
    """``linear`` or one of SciPy's robust losses: soft_l1, huber, cauchy, arctan."""
    moving: Moving | None = None
    only_moving: bool = False
    """Only moving rows count; the filter still runs over all. At standstill friction is not
    determined, so it has nothing to say there."""
    settings: Settings = Settings()
    """Of the nonlinear search, unless `solve` is given others."""

    def __post_init__(self) -> None:
        ny = len(self.model.outputs)
        if not self.windows:
            raise UsageError("tuning: expected at least one window of rows, got none")
        if not self.names:
            raise UsageError("tuning: no parameter is editable: name some in `editable`")
        self.parameters.indices(self.names)
        if self.scale is not None and (self.scale.shape != (ny,) or not (self.scale > 0).all()):
            raise UsageError(f"scale: expected {ny} numbers above 0, got {self.scale}")
        if self.loss not in ("linear", "soft_l1", "huber", "cauchy", "arctan"):
            raise UsageError(
                f"loss: expected linear, soft_l1, huber, cauchy or arctan, got {self.loss!r}"
            )

    @cached_property
    def parameters(self) -> Parameters:
        """All parameters of the model with start values, bounds and priors."""
        given = self.prior
        if given is None:
            return self.model.parameters
        if given.names != self.model.parameters.names:
            raise UsageError("prior: expected the model's parameters in the model's order")
        return given

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the tuned parameters, in the order of ``values``."""
        return self.editable or self.parameters.editable

    @cached_property
    def places(self) -> np.ndarray:
        """Position of each tuned parameter in ``p``, (k,)."""
        return self.parameters.indices(self.names)

    @cached_property
    def start(self) -> Vector:
        """Start (and prior) values of the tuned parameters, (k,)."""
        return np.asarray(self.parameters.values[self.places])

    @cached_property
    def bounds(self) -> tuple[Vector, Vector]:
        """Lower and upper bounds, (k,) each."""
        return self.parameters.low[self.places], self.parameters.high[self.places]

    @cached_property
    def information(self) -> Vector:
        """What the prior knows: 1/σ² of each tuned parameter, 0 without a prior, (k,)."""
        sigma = np.array([self.parameters[name].sigma for name in self.names])
        return np.asarray(1.0 / np.square(sigma))

    @cached_property
    def linear(self) -> bool:
        """True if the outputs are linear in every tuned parameter."""
        model = self.model
        known = isinstance(model, LinearModel) and len(model.states) == 0
        known = known and not model.outputs.angles.any()
        return known and bool(np.isin(self.places, model.columns).all())  # type: ignore[attr-defined]

    @cached_property
    def batch(self) -> Batch:
        """Roll-outs of the model."""
        return Batch(self.model)

    @cached_property
    def rows(self) -> Rows:
        """The windows, concatenated and filtered."""
        x0 = self.model.initial(self.parameters.values)
        restart = [restarts(block, self.horizon, x0) for block in self.windows]
        code = np.concatenate([r.code for r in restart])
        adopts = np.concatenate([r.y for r in restart])
        u = np.ascontiguousarray(np.concatenate([block.u for block in self.windows]))
        dt = np.ascontiguousarray(np.concatenate([block.dt for block in self.windows]))
        zeros = [np.zeros_like(block.y) for block in self.windows]
        pairs = zip(self.windows, zeros, strict=True)
        known = np.concatenate([residuals(self.model, block, zero) for block, zero in pairs])
        fed = np.concatenate([_fed(block) for block in self.windows])
        used = ~np.isnan(known) & fed[:, None]
        opens = np.concatenate([openings(block) for block in self.windows])
        if len(x0):
            used &= ~opens[:, None]
        y = np.where(used, np.concatenate([block.y for block in self.windows]), np.nan)
        # A row that is not predicted (the start of a state, an input that is not known) is none to
        # filter over.
        segments = _segments(opens, opens if len(x0) else ~np.isfinite(u).all(axis=1))
        if self.filter is not None:
            segments = self._filterable(y, segments)
            y = self.smooth(_bridge(y, segments), segments)
            used &= ~np.isnan(y)
        if self.only_moving and self.moving is not None:
            used &= np.asarray(self.moving(u))
        return Rows(u, dt, np.where(used, y, np.nan), used, code, adopts, segments)

    def _filterable(self, y: Outputs, segments: Segments) -> Segments:
        """The stretches that are long enough for the filter; the others do not count.

        Raises:
            DataError: none is.
        """
        kept, reason = [], "there is none"
        for a, b in segments:
            try:
                self.smooth(np.nan_to_num(y), ((a, b),))
            except ValueError as error:
                reason = f"rows {a} to {b} ({b - a} rows) cannot be filtered: {error}"
                continue
            kept.append((a, b))
        if not kept:
            raise DataError(f"filter: no stretch of rows is long enough; {reason}")
        return tuple(kept)

    def smooth(self, columns: Any, segments: Segments) -> Any:
        """``columns`` (n, k) filtered stretch by stretch, the same for every side; NaN between."""
        if self.filter is None:
            return columns
        out = np.full_like(columns, np.nan)
        for a, b in segments:
            out[a:b] = self.filter(columns[a:b])
        return out

    def full(self, values: Vector) -> ParameterVector:
        """All parameters with the tuned ones replaced by ``values`` (k,)."""
        p = self.parameters.values
        p[self.places] = values
        return p

    def predict(self, values: Vector) -> Outputs:
        """Filtered predictions of all rows, (n, ny); NaN where the model gave none."""
        return self.predictions([values])[0]

    def predictions(self, points: Sequence[Vector]) -> list[Outputs]:
        """`predict` at several points at once."""
        model = self.model
        rowwise = isinstance(model, LinearModel) and not isinstance(model, KernelModel)
        if self.linear or (rowwise and len(model.states) == 0):
            return [self._linear_prediction(values) for values in points]
        rows, p = self.rows, np.stack([self.full(values) for values in points])
        restart = Restart(rows.adopts, rows.code, model.initial(p[0]))
        far = self.settings.far
        if far is not None and len(points) > 1:
            runs = far_runs(far, rows.u, rows.dt, p, restart)
        else:
            runs = self.batch.run(rows.u, rows.dt, p, restart)
        return [np.asarray(self.smooth(y, rows.segments)) for y in runs]

    def _linear_prediction(self, values: Vector) -> Outputs:
        p = self.full(values)
        y0, phi = self._parts if self.linear else self.regressor(values)
        columns = self.model.columns  # type: ignore[attr-defined]
        return np.asarray(y0 + (phi * np.where(columns < 0, 0.0, p[columns])).sum(axis=2))

    def residuals(self, values: Vector) -> Outputs:
        """Measured − predicted, (n, ny), angles wrapped; NaN where a row does not count.

        A row that counts and is NaN all the same was not predicted: the simulation diverged.
        """
        return self.residuals_of([values])[0]

    def residuals_of(self, points: Sequence[Vector]) -> list[Outputs]:
        """`residuals` at several points at once."""
        angles = self.model.outputs.angles
        return [wrap(self.rows.y - y, angles) for y in self.predictions(points)]

    def jacobian(self, values: Vector) -> Float64[np.ndarray, "n ny k"]:
        """Sensitivity of the filtered predictions to the tuned parameters, (n, ny, k).

        Exact for linear models, else by differences: two roll-outs per parameter, all at once.
        """
        if self.linear:
            return self._linear_jacobian(len(values))
        out = np.empty((*self.rows.y.shape, len(values)))
        low, high = self.bounds
        points = []
        for j, step in enumerate(self.steps(values).tolist()):
            for end in np.clip([values[j] - step, values[j] + step], low[j], high[j]):
                points.append(values.copy())
                points[-1][j] = end
        runs = self.predictions(points)
        for j in range(len(values)):
            change = points[2 * j + 1][j] - points[2 * j][j]
            # A simulation that diverges gives NaN here, and the solver says so.
            with np.errstate(invalid="ignore"):
                moved = runs[2 * j + 1] - runs[2 * j]
            out[:, :, j] = wrap(moved, self.model.outputs.angles) / change
        return out

    def steps(self, values: Vector) -> Vector:
        """Step of the differences for each parameter, (k,)."""
        return np.asarray(1e-5 * np.maximum(np.abs(values), self.sizes))

    @cached_property
    def sizes(self) -> Vector:
        """Natural size of each tuned parameter: its start value, prior or range; else 1, (k,)."""
        low, high = self.bounds
        sigma = np.array([self.parameters[name].sigma for name in self.names])
        with np.errstate(invalid="ignore"):
            choices = np.stack([np.abs(self.start), sigma, (high - low) / 2, np.ones(len(low))])
        good = np.isfinite(choices) & (choices > 0)
        return np.asarray(choices[np.argmax(good, axis=0), np.arange(len(low))])

    @cached_property
    def _parts(self) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """`regressor` of a problem that is linear in all: no tuned parameter changes it."""
        return self.regressor(self.start)

    def regressor(self, values: Vector) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """Filtered (y0, Phi) of a linear model; y0 holds all that is not in Phi's columns."""
        rows, p = self.rows, self.full(values)
        x0 = self.model.initial(p)
        y0, phi = self.model.regressor(x0, rows.u, rows.dt, p)  # type: ignore[attr-defined]
        if self.filter is None:
            return y0, phi
        n, ny, m = phi.shape
        both = self.smooth(np.concatenate([y0, phi.reshape(n, ny * m)], axis=1), rows.segments)
        return both[:, :ny].copy(), both[:, ny:].reshape(n, ny, m).copy()

    def _linear_jacobian(self, k: int) -> Float64[np.ndarray, "n ny k"]:
        phi = self._parts[1]
        out = np.zeros((*self.rows.y.shape, k))
        for o, row in enumerate(self.model.columns.tolist()):  # type: ignore[attr-defined]
            for m, place in enumerate(row):
                if place in self.places:
                    out[:, o, np.flatnonzero(self.places == place)[0]] += phi[:, o, m]
        return out


def _fed(block: Block) -> np.ndarray:
    """Rows whose inputs are known and trusted, (n,)."""
    mark = block.mark[:, : block.u.shape[1]]
    trusted = (mark <= Mark.HELD) | (mark == Mark.OVERRULED)
    return np.asarray((trusted & np.isfinite(block.u)).all(axis=1))


def _segments(opens: np.ndarray, without: np.ndarray) -> Segments:
    """Stretches between openings; an opening row that is ``without`` a prediction is left out."""
    edges = [*np.flatnonzero(opens).tolist(), len(opens)]
    starts = ((a + int(without[a]), b) for a, b in pairwise(edges))
    return tuple((a, b) for a, b in starts if b > a)


def _bridge(y: Outputs, segments: Segments) -> Outputs:
    """Missing values filled by straight lines, so that a filter can run over them."""
    out = y.copy()
    for a, b in segments:
        for k in range(y.shape[1]):
            bad = np.isnan(y[a:b, k])
            if bad.all() or not bad.any():
                continue
            at = np.arange(b - a)
            out[a:b, k] = np.interp(at, at[~bad], y[a:b, k][~bad])
    return out
