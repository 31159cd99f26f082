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
>>> _, phi = Line().regressor(None, v, None, None)
>>> off = 3 * np.sign(v) + 2 * v - phi.sum(axis=2)   # measured - predicted with Fc = Bm = 1
>>> ClosedForm.of(Line()).solve(off, phi).values.round(6).tolist()
[3.0, 2.0]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.models import LinearModel, Parameters
from evertwin.tuning.linear.gram import FINE, Estimate, gram, normal, residual, slotted
from evertwin.types import Float64, Int64, Outputs, PerOutput, Vector

Regressor = Float64[np.ndarray, "n ny m"]


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


def summed(r: Outputs, phi: Regressor) -> Sums:
    """Rows summed per output; a row whose residual is NaN is left out."""
    ny, m = phi.shape[1:]
    sums = Sums(np.zeros((ny, m, m)), np.zeros((ny, m)), np.zeros(ny), np.zeros(ny))
    gram(r, phi, *sums)
    return sums


def places_of(
    columns: Int64[np.ndarray, "ny m"], tuned: Int64[np.ndarray, " k"]
) -> Int64[np.ndarray, "ny m"]:
    """Position of each regressor column among the ``tuned`` parameters; −1: not tuned.

    >>> places_of(np.array([[0, 3], [2, -1]]), np.array([3, 2])).tolist()
    [[-1, 0], [1, -1]]
    """
    found = np.full(columns.shape, -1, dtype=np.int64)
    for j, place in enumerate(tuned.tolist()):
        found[columns == place] = j
    return found


def slots(
    columns: Int64[np.ndarray, "ny m"], tuned: Int64[np.ndarray, " k"]
) -> tuple[Int64[np.ndarray, "ny m"], Int64[np.ndarray, "ny t"]]:
    """(where each tuned column goes among those of its output, −1: nowhere; whose they are).

    The second holds positions among the ``tuned`` parameters, −1 where an output has fewer.

    >>> slot, at = slots(np.array([[0, 3], [2, 3]]), np.array([3, 2]))
    >>> slot.tolist(), at.tolist()
    ([[-1, 0], [0, 1]], [[0, -1], [1, 0]])
    """
    slot, at = slotted(columns, tuned)
    return slot, at


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """A prepared solve; use it again for every window. See the module for an example."""

    at: Int64[np.ndarray, "ny m"]
    """Position of each regressor column among the tuned parameters; −1: not tuned."""
    start: Vector
    """Values that residuals are taken at, (k,)."""
    information: Vector
    """What the prior knows: 1/σ² of each tuned parameter, (k,)."""
    noise: PerOutput
    """Standard deviation of each output's noise; NaN: estimated, (ny,)."""

    @classmethod
    def of(
        cls, model: LinearModel, names: tuple[str, ...] = (), prior: Parameters | None = None
    ) -> ClosedForm:
        """Of a model.

        Args:
            model: linear in what is tuned.
            names: to tune; by default all editable parameters.
            prior: start values and prior standard deviations; by default the model's own.

        Raises:
            UsageError: the model is not linear in one of them.
        """
        parameters = prior or model.parameters
        names = names or parameters.editable
        tuned = parameters.indices(names)
        at = places_of(np.asarray(model.columns), tuned)
        for j, name in enumerate(names):
            if not (at == j).any():
                raise UsageError(
                    f"{name}: the outputs are not linear in it: leave it out or use `solve`"
                )
        sigma = np.array([parameters.items[place].sigma for place in tuned.tolist()])
        return cls(at, parameters.values[tuned], sigma**-2.0, np.full(len(at), np.nan))

    def solve(self, r: Outputs, phi: Regressor) -> Solution:
        """Parameters from the residual at the start values and the regressor, row by row."""
        solution = self.solve_sums(summed(r, phi))
        return solution if solution.solved else self.carefully(r, phi)

    def solve_sums(self, sums: Sums) -> Solution:
        """Parameters from sums."""
        k, ny = len(self.start), len(self.at)
        out = Estimate(np.zeros(k), np.full((k, k), np.inf), np.zeros(ny), np.zeros(ny))
        fine = normal(tuple(sums), self.at, self.information, self.noise, out) == FINE
        found = self.start + (out.change if fine else 0.0)
        return Solution(found, out.covariance, np.sqrt(out.noise), out.dof, bool(fine))

    def carefully(self, r: Outputs, phi: Regressor) -> Solution:
        """By orthogonal decomposition of the rows; parameters without effect stay."""
        k, ny, scale = len(self.start), len(self.at), self.noise
        rows = dense(phi, self.at, k)
        used = ~np.isnan(r)
        given = np.where(np.isnan(scale), 1.0, scale)
        count = np.maximum(used.sum(axis=0), 1)
        spread = np.sqrt(np.square(np.where(used, r, 0.0)).sum(axis=0) / count)
        noise = np.where(np.isnan(scale), spread, scale)
        delta, covariance, used_dof = np.zeros(k), np.full((k, k), np.inf), np.zeros(ny)
        for _ in range(2):
            weight = 1.0 / np.where(noise > 0, noise, given)
            prior = np.diag(np.sqrt(self.information))
            a = np.concatenate([(rows * weight[:, None])[used], prior])
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
        return Solution(self.start + delta, covariance, noise, used_dof, complete)


def dense(phi: Regressor, at: Int64[np.ndarray, "ny m"], k: int) -> Float64[np.ndarray, "n ny k"]:
    """The compact regressor with one column per tuned parameter."""
    out = np.zeros((*phi.shape[:2], k))
    for o, a in np.argwhere(at >= 0).tolist():
        out[:, o, at[o, a]] += phi[:, o, a]
    return out


class Reduced(NamedTuple):
    """What the tuned parameters of a linear problem have to explain, and with what.

    >>> part = Reduced(np.array([[5.0]]), np.array([[1.0]]), np.array([[[2.0]]]), np.array([[0]]))
    >>> part.residual(np.array([1.5])).tolist()
    [[1.0]]
    """

    y: Outputs
    """Measured; NaN where a row does not count."""
    y0: Outputs
    """All that is not tuned."""
    columns: Float64[np.ndarray, "n ny t"]
    at: Int64[np.ndarray, "ny t"]
    """Position of each column among the tuned parameters; −1: none."""

    def residual(self, values: Vector) -> Outputs:
        """What is left at ``values`` (k,)."""
        return np.asarray(residual(*self, values))
