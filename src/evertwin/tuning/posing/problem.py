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
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Block
from evertwin.models import KernelModel, LinearModel, Model, Parameters, Restart, remembers
from evertwin.models.batch import Batch, mapped
from evertwin.models.kernels.kernel import ANEW
from evertwin.signals import wrap
from evertwin.sync.horizon.horizon import restarts
from evertwin.tuning.linear.closed import Reduced, dense, slots
from evertwin.tuning.linear.sensitivity import Sensitivity
from evertwin.tuning.posing.before import Begins, begins
from evertwin.tuning.posing.far import far_runs
from evertwin.tuning.posing.hidden_starts import Recording, starting
from evertwin.tuning.posing.newest import Newest
from evertwin.tuning.posing.recordings import extended
from evertwin.tuning.posing.rows import Filter, Rows, joined, prepared, smooth
from evertwin.tuning.posing.settings import Settings
from evertwin.types import (
    Float64,
    OutputRuns,
    Outputs,
    ParameterVector,
    ParameterVectors,
    PerOutput,
    Vector,
)

Loss: TypeAlias = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]
Moving: TypeAlias = Callable[[Any], Any]
"""``moving(u (n, nu)) -> bool (n, ny)``: which rows count as moving, per output."""
VAGUE = 10.0
"""Standard deviation of a prior that nobody gave, in natural sizes."""
SHARED = ("parameters", "_p", "rows", "restart", "batch", "parts", "_begins")
"""What does not depend on which parameters are tuned."""


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
    before: tuple[Block, ...] = ()
    """What is known of recordings that windows are cut from: they begin where it came to."""
    _newest: Newest = field(default_factory=Newest, init=False, repr=False)

    def __post_init__(self) -> None:
        ny = len(self.model.outputs)
        if not self.windows:
            raise UsageError("tuning: expected at least one window of rows, got none")
        if not self.names:
            raise UsageError("tuning: no parameter is editable: name some in `editable`")
        _ = self.places  # a name that is not there is told here
        if self.scale is not None and (self.scale.shape != (ny,) or not (self.scale > 0).all()):
            raise UsageError(f"scale: expected {ny} numbers above 0, got {self.scale}")
        if self.loss not in ("linear", "soft_l1", "huber", "cauchy", "arctan"):
            raise UsageError(
                f"loss: expected linear, soft_l1, huber, cauchy or arctan, got {self.loss!r}"
            )

    @cached_property
    def parameters(self) -> Parameters:
        """All parameters with start values, bounds and priors: of the model, then of `recordings`,
        then of `hidden_starts` where these are tuned."""
        own, given = self.model.parameters, self._given
        if given.names == own.names:
            given = extended(given, self.model, len(self.windows))
        elif given.names[: len(own)] != own.names:
            raise UsageError("prior: expected the model's parameters in the model's order")
        if all(name in given.names for name in self.editable):
            return given
        p, rows = given.values[: len(own)], (self.windows, self._begins)
        return given + starting(self.model, p, self.horizon, rows)

    @property
    def _given(self) -> Parameters:
        return self.model.parameters if self.prior is None else self.prior

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
        return np.asarray(self._p[self.places])

    @cached_property
    def bounds(self) -> tuple[Vector, Vector]:
        """Lower and upper bounds, (k,) each."""
        return self.parameters.low[self.places], self.parameters.high[self.places]

    @cached_property
    def information(self) -> Vector:
        """What the prior knows: 1/σ² of each tuned parameter, 0 without a prior, (k,).

        A number of a model with a state has a start near enough for `VAGUE`: a valley without a
        floor gets one, and an interval counts what the rows leave open.
        """
        sigma = self.sigma
        if len(self.model.states):
            sigma = np.where((self.start != 0.0) & np.isinf(sigma), VAGUE * self.sizes, sigma)
        return np.asarray(1.0 / np.square(sigma))

    @property
    def sigma(self) -> Vector:
        """Standard deviation of each tuned parameter's prior, infinite without one, (k,)."""
        items = self.parameters.items
        return np.array([items[place].sigma for place in self.places.tolist()])

    @cached_property
    def linear(self) -> bool:
        """True if the outputs are linear in every tuned parameter."""
        model = self.model
        # By name: to ask a protocol takes as long as to tune a short window.
        if not hasattr(model, "regressor") or len(model.states) or model.outputs.angles.any():
            return False
        columns: np.ndarray = model.columns  # type: ignore[attr-defined]
        return set(self.places.tolist()) <= set(columns.ravel().tolist())

    @cached_property
    def batch(self) -> Batch:
        """Roll-outs of the model."""
        return Batch(self.model)

    def tuning(self, names: tuple[str, ...]) -> Problem:
        """The same problem with other parameters to tune; what is known of its rows is shared."""
        other = replace(self, editable=names)
        other.__dict__.update((key, self.__dict__[key]) for key in SHARED if key in self.__dict__)
        return other

    @cached_property
    def rows(self) -> Rows:
        """The windows, concatenated and filtered."""
        u = joined([block.u for block in self.windows])
        dt = joined([block.dt for block in self.windows])
        stateful = len(self.model.states) > 0
        y, used, segments = prepared(self.windows, stateful, self.filter)
        moving = used if self.moving is None else np.asarray(self.moving(u)) & used
        if not self.only_moving:
            return Rows(u, dt, y, used, moving, segments)
        return Rows(u, dt, np.where(moving, y, np.nan), moving, moving, segments)

    @cached_property
    def restart(self) -> Restart:
        """Where predictions start anew, over all windows."""
        x0 = self.model.initial(self.parameters.values)
        keeps = remembers(self.model)
        found = [restarts(block, self.horizon, x0, keeps) for block in self.windows]
        return Restart(joined([r.y for r in found]), joined([r.code for r in found]), x0)

    def smooth(self, columns: Any) -> Any:
        """``columns`` (n, k) filtered as the measured outputs are."""
        return columns if self.filter is None else smooth(self.filter, columns, self.rows.segments)

    def full(self, values: Vector) -> ParameterVector:
        """All `parameters` with the tuned ones replaced by ``values`` (k,)."""
        p = self._p.copy()
        p[self.places] = values
        return p

    @cached_property
    def _p(self) -> ParameterVector:
        return self.parameters.values

    def predict(self, values: Vector) -> Outputs:
        """Filtered predictions of all rows, (n, ny); NaN where the model gave none."""
        return self._newest.at(values, lambda point: self.predictions([point])[0])

    def predictions(self, points: Sequence[Vector]) -> list[Outputs]:
        """`predict` at several points at once; each is simulated."""
        if self.linear or self._rowwise:
            return [self._linear_prediction(values) for values in points]
        p = np.stack([self.full(values) for values in points])
        runs = [self._runs(p, one) for one in self._recordings]
        return [np.asarray(self.smooth(y)) for y in joined(runs, 1)]

    def _runs(self, full: ParameterVectors, one: Recording) -> OutputRuns:
        here, far, p = slice(one.first, one.stop), self.settings.far, full[:, one.at]
        u, dt = self.rows.u[here], self.rows.dt[here]
        restart = Restart(self.restart.y[here], self.restart.code[here], self.model.initial(p[0]))
        starts = one.begins(self.model, full)
        if far is not None and starts is None and len(p) > 1:
            return far_runs(far, u, dt, p, restart)
        return self.batch.run(u, dt, p, restart, starts)

    @cached_property
    def _begins(self) -> Begins:
        p = self._given.values[: len(self.model.parameters)]
        return begins(self.model, p, self.horizon, (self.before, self.windows))

    @cached_property
    def _recordings(self) -> list[Recording]:
        """What begins with the same numbers."""
        found = Recording.of(self.parameters, self.model, self.names, (self.windows, self._begins))
        alike = all(one.alike(found[0]) for one in found)
        return [found[0]._replace(stop=found[-1].stop)] if alike else found

    @cached_property
    def _rowwise(self) -> bool:
        """Is the model's regressor the cheaper way to predict?"""
        rowwise = isinstance(self.model, LinearModel) and not isinstance(self.model, KernelModel)
        return rowwise and len(self.model.states) == 0

    def _linear_prediction(self, values: Vector) -> Outputs:
        p = self.full(values)
        y0, phi = self.parts if self.linear else self.regressor(values)
        columns = self.model.columns  # type: ignore[attr-defined]
        own = np.einsum("ika,ka->ik", phi, np.where(columns < 0, 0.0, p[columns]))
        return np.asarray(y0 + own)

    @cached_property
    def first(self) -> Outputs:
        """`residuals` at the start values; of a map without its columns, a tenth of the work."""
        if self.static and "reduced" not in self.__dict__:
            return np.asarray(self.rows.y - self.mapped)
        return self.residuals(self.start)

    @property
    def static(self) -> bool:
        """Is it a map, linear in what is tuned? What it expects depends on inputs alone."""
        return self.linear and not len(self.model.states)

    @cached_property
    def mapped(self) -> Outputs:
        """What it expects at the start values, filtered, (n, ny)."""
        return np.asarray(self.smooth(mapped(self.model, self.rows.u, self.rows.dt, self._p)))

    def residuals(self, values: Vector) -> Outputs:
        """Measured − predicted, (n, ny), angles wrapped; NaN where a row does not count.

        A row that counts and is NaN all the same was not predicted: the simulation diverged.
        """
        return self.residuals_of([values])[0]

    def residuals_of(self, points: Sequence[Vector]) -> list[Outputs]:
        """`residuals` at several points at once."""
        if self.linear:
            return [self.reduced.residual(values) for values in points]
        angles, one = self.model.outputs.angles, len(points) == 1
        found = [self.predict(points[0])] if one else self.predictions(points)
        return [wrap(self.rows.y - y, angles) for y in found]

    def jacobian(self, values: Vector) -> Float64[np.ndarray, "n ny k"]:
        """Sensitivity of the filtered predictions to the tuned parameters, (n, ny, k).

        Exact for linear models, else by differences: two roll-outs per parameter, all at once.
        """
        if self.linear:
            return dense(self.reduced.columns, self.reduced.at, len(values))
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

    def by_starts(
        self, points: Sequence[Vector], sizes: PerOutput, *, anew: bool = False
    ) -> Iterator[list[Outputs]]:
        """How predictions (n, ny) at several points change where the measured starts of one output
        after the other move; of none in a quick search.

        Args:
            points: values of the tuned parameters, (k,) each.
            sizes: how far each output's starts move, (ny,).
            anew: only where all begins anew, not where a measurement is adopted on the way.
        """
        if self.settings.quick:
            return
        here, (y, code, x0) = self.predictions(points), self.restart
        begun = np.flatnonzero(code == ANEW).tolist()
        known = [row for row in begun if np.array_equal(self.model.observe(x0, y[row]), x0)]
        for k, size in enumerate(sizes.tolist()):
            moved, there = self.tuning(self.names), y.copy()
            there[(code == ANEW) | (not anew), k] += size
            there[known] = y[known]  # at rest where the model begins: nobody measured it
            moved.__dict__["restart"] = Restart(there, code, x0)
            angles = self.model.outputs.angles
            yield [wrap(a - b, angles) for a, b in zip(moved.predictions(points), here)]

    def steps(self, values: Vector) -> Vector:
        """Step of the differences for each parameter, (k,)."""
        return np.asarray(1e-5 * np.maximum(np.abs(values), self.sizes))

    @cached_property
    def sizes(self) -> Vector:
        """Natural size of each tuned parameter: its start value, prior or range; else 1, (k,)."""
        low, high = self.bounds
        with np.errstate(invalid="ignore"):
            choices = np.stack(
                [np.abs(self.start), self.sigma, (high - low) / 2, np.ones(len(low))]
            )
        good = np.isfinite(choices) & (choices > 0)
        return np.asarray(choices[np.argmax(good, axis=0), np.arange(len(low))])

    def sensitivity(self, values: Vector) -> Sensitivity:
        """The same of the rows that count, each output with the columns that act on it."""
        if not self.linear:
            return Sensitivity.dense(self.jacobian(values), self.rows.used)
        _, _, columns, at = self.reduced
        return Sensitivity.of_columns(columns, at, self.rows.used, len(values))

    @cached_property
    def reduced(self) -> Reduced:
        """A linear problem without what is not tuned."""
        columns: np.ndarray = self.model.columns  # type: ignore[attr-defined]
        slot, at = slots(columns, self.places)
        partial = getattr(self.model, "partial", None)
        if partial is not None and "parts" not in self.__dict__:
            rows, p = self.rows, self._p
            found = partial(self.model.initial(p), rows.u, rows.dt, p, slot)
            return Reduced(rows.y, *self._smoothed(*found), at)
        y0, phi = self.parts
        stays = np.where((slot >= 0) | (columns < 0), 0.0, self._p[columns])
        chosen = np.zeros((*y0.shape, at.shape[1]))
        for k, a in np.argwhere(slot >= 0).tolist():
            chosen[:, k, slot[k, a]] = phi[:, k, a]
        return Reduced(self.rows.y, y0 + np.einsum("ika,ka->ik", phi, stays), chosen, at)

    @cached_property
    def parts(self) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """`regressor` of a problem that is linear in all: no tuned parameter changes it."""
        return self.regressor(self.start)

    def regressor(self, values: Vector) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """Filtered (y0, Phi) of a linear model; y0 holds all that is not in Phi's columns."""
        rows, p, model = self.rows, self.full(values), self.model
        return self._smoothed(*model.regressor(model.initial(p), rows.u, rows.dt, p))  # type: ignore[attr-defined]

    def _smoothed(self, y0: Outputs, phi: Any) -> tuple[Outputs, Any]:
        if self.filter is None:
            return y0, phi
        n, ny, m = phi.shape
        both = self.smooth(np.concatenate([y0, phi.reshape(n, ny * m)], axis=1))
        return both[:, :ny].copy(), both[:, ny:].reshape(n, ny, m).copy()
