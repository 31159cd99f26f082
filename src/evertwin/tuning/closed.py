"""Closed form: where outputs are linear in the parameters, tuning is one small system.

With y = y0 + Phi·p the part y0 (rigid bodies, say) is evaluated once; what is left is weighted
least squares about the present parameters p̄, with the prior as information:

    (Σ_k w_k Phi_kᵀ Phi_k + S⁻²) δ = Σ_k w_k Phi_kᵀ (y_k − y0_k − Phi_k p̄),     p = p̄ + δ

over outputs k, with w_k = 1/σ_k² from the residuals of a first solve. The inverse of the matrix is
the covariance. Columns are scaled to unit diagonal; if that is still ill-conditioned, a QR
decomposition of the rows takes over.

>>> import numpy as np
>>> from evertwin.models import Parameters
>>> from evertwin.signals import Layout
>>> class Line:
...     inputs, outputs, states = Layout.of(v="rad/s"), Layout.of(torque="Nm"), Layout()
...     parameters = Parameters.of(Fc=(1.0, "Nm"), Bm=(1.0, "Nms/rad"))
...     columns = np.array([[0, 1]])
...     def initial(self, p): return np.zeros(0)
...     def observe(self, x, y): return x
...     def simulate(self, x, u, dt, p): return x, p[0] * np.sign(u) + p[1] * u
...     def regressor(self, x, u, dt, p):
...         return np.zeros((len(u), 1)), np.stack([np.sign(u), u], axis=2)
>>> v = np.array([[-2.0], [-1.0], [1.0], [2.0]])
>>> plan = ClosedForm(Line())
>>> plan.solve(v, np.full(4, 0.1), 3 * np.sign(v) + 2 * v).values.round(6).tolist()
[3.0, 2.0]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.models import LinearModel, Parameters
from evertwin.tuning.gram import FINE, gram, normal
from evertwin.tuning.problem import Filter, PerOutput
from evertwin.types import Float64, Inputs, Int64, Intervals, Outputs, Vector

__all__ = ["ClosedForm", "Solution", "Sums"]

CHUNK = 2048
"""Rows that are summed up at a time."""


class Sums(NamedTuple):
    """Rows summed per output; sums of windows add up.

    >>> Sums._fields
    ('products', 'sides', 'squares', 'rows')
    """

    products: Float64[np.ndarray, "ny m m"]
    """Phiᵀ Phi (lower triangle)."""
    sides: Float64[np.ndarray, "ny m"]
    """Phiᵀ r, with r the residual at the present parameters."""
    squares: PerOutput
    """rᵀ r, (ny,)."""
    rows: PerOutput
    """Rows that count, (ny,)."""


class Solution(NamedTuple):
    """Parameters and what the rows say about their accuracy.

    >>> Solution._fields
    ('values', 'covariance', 'noise', 'dof', 'solved')
    """

    values: Vector
    """Tuned values, (k,)."""
    covariance: Float64[np.ndarray, "k k"]
    """For independent noise."""
    noise: PerOutput
    """Standard deviation of each output's residual, (ny,)."""
    dof: PerOutput
    """Degrees of freedom of that estimate, (ny,)."""
    solved: bool
    """False where the rows do not determine the parameters; the values are then the start's."""


@dataclass(frozen=True)
class ClosedForm:
    """A prepared solve; use it again for every window. See the module for an example."""

    model: LinearModel
    editable: tuple[str, ...] = ()
    """Names to tune; by default all editable parameters."""
    prior: Parameters | None = None
    """Start values and prior standard deviations; by default the model's own."""
    scale: tuple[float, ...] = ()
    """Standard deviation of each output's noise; estimated by default."""
    filter: Filter | None = None
    """Linear filter over measured output and regressor alike."""

    @cached_property
    def parameters(self) -> Parameters:
        """All parameters with their start values."""
        return self.prior or self.model.parameters

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the tuned parameters.

        Raises:
            UsageError: one of them is not linear in this model.
        """
        names = self.editable or self.parameters.editable
        for name in names:
            if self.parameters.index(name) not in self.model.columns:
                raise UsageError(
                    f"{name}: the outputs are not linear in it: leave it out or use `solve`"
                )
        return names

    @cached_property
    def _fixed(self) -> tuple[Any, ...]:
        """Everything that no row changes."""
        columns = np.asarray(self.model.columns)
        p = self.parameters.values
        places = self.parameters.indices(self.names)
        at = np.full(columns.shape, -1, dtype=np.int64)
        for j, place in enumerate(places.tolist()):
            at[columns == place] = j
        sigma = np.array([self.parameters[name].sigma for name in self.names])
        around = np.where(columns < 0, 0.0, p[columns])
        scale = np.array(self.scale or [np.nan] * len(columns))
        x0 = self.model.initial(p)
        return p, places, at, 1.0 / np.square(sigma), around, scale, x0, np.zeros(len(places))

    @property
    def at(self) -> Int64[np.ndarray, "ny m"]:
        """Position of each regressor column among the tuned parameters; −1: not tuned."""
        return np.asarray(self._fixed[2])

    def solve(self, u: Inputs, dt: Intervals, y: Outputs) -> Solution:
        """Parameters from inputs and measured outputs; rows with NaN are left out."""
        p, x0 = self._fixed[0], self._fixed[6]
        if self.filter is None and len(u) > CHUNK:
            solution = self.solve_sums(self._by_chunks(u, dt, y))
            if solution.solved:
                return solution
        y0, phi = self.model.regressor(x0, u, dt, p)
        if self.filter is not None:
            n, ny, m = phi.shape
            sides = self.filter(np.concatenate([y, y0, phi.reshape(n, ny * m)], axis=1))
            y, y0 = sides[:, :ny], sides[:, ny : 2 * ny]
            phi = sides[:, 2 * ny :].reshape(n, ny, m)
        return self.solve_rows(y, y0, phi)

    def solve_rows(self, y: Outputs, y0: Outputs, phi: Float64[np.ndarray, "n ny m"]) -> Solution:
        """Parameters from rows whose regressor is known already."""
        solution = self.solve_sums(self.sums(y, y0, phi))
        return solution if solution.solved else self._careful(y, y0, phi)

    def _by_chunks(self, u: Inputs, dt: Intervals, y: Outputs) -> Sums:
        """The same sums, piece by piece: a regressor that fits the cache is never stored."""
        p, x0, around = self._fixed[0], self._fixed[6], self._fixed[4]
        total = self._empty()
        for a in range(0, len(u), CHUNK):
            rows = slice(a, a + CHUNK)
            y0, phi = self.model.regressor(x0, u[rows], dt[rows], p)
            gram(y[rows], y0, phi, around, *total)
        return total

    def _empty(self) -> Sums:
        ny, m = self._fixed[4].shape
        return Sums(np.zeros((ny, m, m)), np.zeros((ny, m)), np.zeros(ny), np.zeros(ny))

    def sums(self, y: Outputs, y0: Outputs, phi: Float64[np.ndarray, "n ny m"]) -> Sums:
        """Rows summed per output."""
        around, out = self._fixed[4], self._empty()
        gram(y, y0, phi, around, *out)
        return out

    def solve_sums(self, sums: Sums, at: Int64[np.ndarray, "ny m"] | None = None) -> Solution:
        """Parameters from sums."""
        p, places, own, information, _, scale, _, pull = self._fixed
        k, ny = len(places), len(scale)
        delta, covariance = np.zeros(k), np.full((k, k), np.inf)
        noise, dof = np.zeros(ny), np.zeros(ny)
        code = normal(
            *sums,
            own if at is None else at,
            information,
            pull,
            scale,
            delta,
            covariance,
            noise,
            dof,
        )
        if code != FINE:
            delta[:] = 0.0
        return Solution(p[places] + delta, covariance, np.sqrt(noise), dof, bool(code == FINE))

    def _careful(self, y: Outputs, y0: Outputs, phi: Float64[np.ndarray, "n ny m"]) -> Solution:
        """By orthogonal decomposition of the rows; parameters without effect stay."""
        p, places, at, information, around, scale, _, _ = self._fixed
        k, ny = len(places), len(scale)
        r = y - y0 - (phi * around).sum(axis=2)
        rows = dense(phi, at, k)
        used = ~np.isnan(r)
        given = np.where(np.isnan(scale), 1.0, scale)
        count = np.maximum(used.sum(axis=0), 1)
        spread = np.sqrt(np.square(np.where(used, r, 0.0)).sum(axis=0) / count)
        noise = np.where(np.isnan(scale), spread, scale)
        delta, covariance, used_dof = np.zeros(k), np.full((k, k), np.inf), np.zeros(ny)
        for _ in range(2):
            weight = 1.0 / np.where(noise > 0, noise, given)
            a = np.concatenate([(rows * weight[:, None])[used], np.diag(np.sqrt(information))])
            b = np.concatenate([(r * weight)[used], np.zeros(k)])
            size = np.sqrt((a**2).sum(axis=0))
            free = size > 0
            u, s, v = np.linalg.svd(a[:, free] / size[free], full_matrices=False)
            keep = s > 1e-10 * s[0] if len(s) else np.zeros(0, dtype=np.bool_)
            delta[free] = ((v[keep].T / s[keep]) @ (u[:, keep].T @ b)) / size[free]
            inner = (v[keep].T / s[keep] ** 2) @ v[keep] / np.outer(size[free], size[free])
            covariance[np.ix_(free, free)] = inner
            left = np.where(used, r - rows @ delta, 0.0)
            used_dof = np.maximum(used.sum(axis=0) - keep.sum() / ny, 1.0)
            found = np.sqrt((left**2).sum(axis=0) / used_dof)
            noise = np.where(np.isnan(scale), found, scale)
        complete = bool(free.all() and keep.all())
        return Solution(p[places] + delta, covariance, noise, used_dof, complete)


def dense(
    phi: Float64[np.ndarray, "n ny m"], at: Int64[np.ndarray, "ny m"], k: int
) -> Float64[np.ndarray, "n ny k"]:
    """The compact regressor with one column per tuned parameter."""
    out = np.zeros((*phi.shape[:2], k))
    for o, row in enumerate(at.tolist()):
        for a, j in enumerate(row):
            if j >= 0:
                out[:, o, j] += phi[:, o, a]
    return out
