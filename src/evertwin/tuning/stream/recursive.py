"""Recursive tuning: predict first, then learn, row by row, with a prior and a memory.

The information matrix Λ and its vector λ (so that Λ(p − p̄) = λ) forget towards the prior, not
towards nothing: over a row of length dt with memory T,

    a = exp(−dt/T)
    Λ ← a·Λ + (1 − a)·Λ₀ + Σ_k φ_k φ_kᵀ/σ_k²
    λ ← a·λ + Σ_k φ_k (y_k − y0_k − φ_k·p̄)/σ_k²

so that a parameter that is no longer excited drifts back to its prior p̄ instead of blowing up.
Every ``every`` rows (a beat) the estimate p = p̄ + Λ⁻¹λ replaces the parameters that predict:
"predict 1 s, then learn" is ``every`` = the rows of a second. Samples that are not trusted never
enter. A matrix that is not positive definite (no prior, nothing seen yet) keeps the parameters.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.models import Parameter, Parameters
>>> from evertwin.signals import Layout
>>> class Gain:
...     inputs, outputs, states = Layout.of(v="m/s"), Layout.of(w="m/s"), Layout()
...     parameters = Parameters((Parameter("gain", 1.0, "1", sigma=0.5),))
...     columns = np.array([[0]])
...     def initial(self, p): return np.zeros(0)
...     def observe(self, x, y): return x
...     def simulate(self, x, u, dt, p): return x, p[0] * u
...     def regressor(self, x, u, dt, p): return np.zeros_like(u), u[:, :, None]
>>> u = np.ones((50, 1))
>>> stage = Recursive(Gain(), scale=(0.01,))
>>> state, out = stage.step(stage.init(), make_block(t=np.arange(50), u=u, y=1.2 * u))
>>> out.rows.y[0, 0], round(float(state.p[0]), 3)
(np.float64(1.0), 1.2)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Block, Out
from evertwin.models import LinearModel, Parameters
from evertwin.tuning.stream.recursive_loop import learn
from evertwin.types import Float64, Int64, Outputs, ParameterVector, Vector


class RecursiveSettings(NamedTuple):
    """What no row changes, of k tuned parameters.

    >>> RecursiveSettings._fields[:2]
    ('columns', 'at')
    """

    columns: Int64[np.ndarray, "ny m"]
    """Parameter of each column of the regressor; −1: none."""
    at: Int64[np.ndarray, "ny m"]
    """Its place among the tuned ones, −1: it is none."""
    places: Int64[np.ndarray, " k"]
    """Which parameters are tuned."""
    prior: ParameterVector
    information: Vector
    """Of the prior, (k,)."""
    weight: Vector
    """Of each output, (ny,)."""
    gate: Int64[np.ndarray, " ny"]
    """Input that says whether it moves, −1: none; and above which size."""
    above: Vector
    memory: float
    every: int


class RecursiveState(NamedTuple):
    """State of `Recursive`.

    >>> RecursiveState._fields[:2]
    ('p', 'matrix')
    """

    p: ParameterVector
    """Parameters that predict, all of them, (np,)."""
    matrix: Float64[np.ndarray, "k k"]
    """Information Λ."""
    vector: Vector
    """λ, (k,)."""
    sigma: Vector
    """Standard deviations at the last beat, (k,); infinite before there are any."""


class RecursiveRows(NamedTuple):
    """One row out per row in.

    >>> RecursiveRows._fields
    ('y', 'residual', 'values')
    """

    y: Outputs
    """Predicted before the row was learned, (n, ny)."""
    residual: Outputs
    """Measured − predicted, NaN where not measured or not trusted, (n, ny)."""
    values: Float64[np.ndarray, "n k"]
    """Tuned parameters that predicted the row, (n, k)."""


@dataclass(frozen=True)
class Recursive:
    """Recursive least squares as a stage of the stream. See the module for its equations."""

    model: LinearModel
    editable: tuple[str, ...] = ()
    scale: tuple[float, ...] = ()
    """Standard deviation of each output's noise; ones by default."""
    memory: float = math.inf
    """Time constant of forgetting [s]."""
    every: int = 1
    """Rows from beat to beat: predict so many, then learn."""
    prior: Parameters | None = None
    """Values and standard deviations to start from; by default the model's own."""
    moving: tuple[tuple[int, int, float], ...] = field(default=())
    """(output, input, threshold): learn from this output only where |input| > threshold."""

    def __post_init__(self) -> None:
        if self.every < 1 or not self.memory > 0:
            raise UsageError(
                f"recursive: expected every ≥ 1 row and memory > 0 s, got {self.every}, "
                f"{self.memory}"
            )
        ny = len(self.model.outputs)
        if self.scale and (len(self.scale) != ny or not all(s > 0 for s in self.scale)):
            raise UsageError(f"scale: expected {ny} numbers above 0, got {self.scale}")
        for name in self.names:
            if self._parameters.index(name) not in self.model.columns:
                raise UsageError(f"{name}: the outputs are not linear in it: leave it out")

    @cached_property
    def _parameters(self) -> Parameters:
        return self.prior or self.model.parameters

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the tuned parameters."""
        return self.editable or self._parameters.editable

    @cached_property
    def fixed(self) -> RecursiveSettings:
        """Everything that no row changes."""
        columns = np.ascontiguousarray(self.model.columns, dtype=np.int64)
        ny = len(columns)
        places = self._parameters.indices(self.names)
        at = np.full(columns.shape, -1, dtype=np.int64)
        for j, place in enumerate(places.tolist()):
            at[columns == place] = j
        sigma = np.array([self._parameters[name].sigma for name in self.names])
        weight = 1.0 / np.square(np.array(self.scale or (1.0,) * ny))
        gate = np.full(ny, -1, dtype=np.int64)
        above = np.zeros(ny)
        for output, source, threshold in self.moving:
            gate[output], above[output] = source, threshold
        p = self._parameters.values
        return RecursiveSettings(
            columns, at, places, p, 1.0 / np.square(sigma), weight, gate, above, self.memory,
            self.every,
        )  # fmt: skip

    def init(self) -> RecursiveState:
        p, information = self.fixed.prior, self.fixed.information
        k = len(information)
        with np.errstate(divide="ignore"):
            sigma = 1.0 / np.sqrt(information)
        return RecursiveState(p.copy(), np.diag(information), np.zeros(k), sigma)

    def step(self, state: RecursiveState, block: Block) -> tuple[RecursiveState, Out]:
        n, ny = block.y.shape
        prior = self.fixed.prior
        y0, phi = self.model.regressor(self.model.initial(prior), block.u, block.dt, prior)
        k = len(state.vector)
        rows = RecursiveRows(np.empty((n, ny)), np.empty((n, ny)), np.empty((n, k)))
        given = block.dt, block.u, block.y, block.mark
        learn(block.row, given, (y0, phi), self.fixed, state, rows)
        return state, Out(rows)

    def estimate(self, state: RecursiveState) -> tuple[Vector, Vector]:
        """(values, standard deviations) at the last beat, (k,) each."""
        return state.p[self.fixed.places], state.sigma
