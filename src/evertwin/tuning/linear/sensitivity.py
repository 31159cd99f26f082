"""How outputs change with the tuned parameters, kept compact: what the rows tell about them.

An output is moved by few of the parameters. So its rows are kept with the columns that act on it
and summed once; whatever is asked of the information afterwards (weights, intervals, what cannot be
told apart) is small algebra on these sums.

>>> j = np.array([[[1.0, 0.0]], [[1.0, 2.0]]])     # two rows, one output, two parameters
>>> found = Sensitivity.dense(j, np.ones((2, 1), dtype=bool))
>>> found.information(np.array([2.0])).tolist(), found.acts.tolist()
([[0.5, 0.5], [0.5, 1.0]], [[True, True]])
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.tuning.linear.closed import Regressor, summed
from evertwin.tuning.linear.gram import effects, unit, weighed, widened
from evertwin.types import Bool, Float64, Int64, Outputs, PerOutput, Vector

FEW = 50
"""Rows from which on they tell whether the form holds on them."""
CHANCE = 3.0
"""Standard deviations by which their mean square may be larger by chance."""


class Spectrum(NamedTuple):
    """Information H by the directions of its unit columns, so that the question has no units.

    >>> found = Spectrum.of(np.array([[4.0, 0.0], [0.0, 0.0]]))
    >>> found.length.tolist(), found.squares.tolist()
    ([2.0, 0.0], [0.0, 1.0])
    """

    length: Vector
    """Of each parameter's column, √H_jj."""
    squares: Vector
    """Squared singular values, rising; 0 for each column without length."""
    vectors: Float64[np.ndarray, "k k"]
    """Their directions, as columns."""

    @classmethod
    def of(cls, information: Float64[np.ndarray, "k k"]) -> Spectrum:
        """Of a matrix without negative directions."""
        length, scaled = unit(information)
        squares, vectors = np.linalg.eigh(scaled)
        return cls(length, np.maximum(squares, 0.0), vectors)


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """See the module for an example."""

    columns: Regressor
    at: Int64[np.ndarray, "ny m"]
    """Which tuned parameter each column belongs to; −1: none."""
    used: Bool[np.ndarray, "n ny"]
    """Rows that count."""
    blocks: Float64[np.ndarray, "ny k k"]
    """What each output tells of the parameters at unit noise: Σ of columns times columns."""

    @classmethod
    def of_columns(
        cls, columns: Regressor, at: Int64[np.ndarray, "ny m"], used: Bool[np.ndarray, "n ny"],
        size: int,
    ) -> Sensitivity:  # fmt: skip
        """Of ``size`` parameters, each output with columns of its own."""
        blocks = np.zeros((len(at), size, size))
        widened(summed(np.where(used, 0.0, np.nan), columns).products, at, blocks)
        return cls(columns, at, used, blocks)

    @classmethod
    def dense(cls, j: Float64[np.ndarray, "n ny k"], used: Bool[np.ndarray, "n ny"]) -> Sensitivity:
        """Of every output to every parameter."""
        ny, k = j.shape[1:]
        return cls.of_columns(np.ascontiguousarray(j), np.tile(np.arange(k), (ny, 1)), used, k)

    @cached_property
    def squares(self) -> Float64[np.ndarray, "ny k"]:
        """Sum of squares of each output's change per parameter."""
        return self.blocks.diagonal(axis1=1, axis2=2)

    @cached_property
    def acts(self) -> Bool[np.ndarray, "ny k"]:
        """Which parameter moves which output."""
        return np.asarray(self.squares > 0)

    @cached_property
    def paid(self) -> PerOutput:
        """Number of parameters that move each output."""
        return np.asarray(self.acts.sum(axis=1, dtype=np.float64))

    @property
    def finite(self) -> bool:
        """Is every change a number?"""
        return bool(np.isfinite(self.blocks).all())

    def information(self, sigma: PerOutput) -> Float64[np.ndarray, "k k"]:
        """Σ JᵀJ/σ² over outputs with the noise ``sigma``, in 1/parameter²."""
        return np.asarray(weighed(self.blocks, sigma))

    def share(self, direction: Vector, loaded: float, sigma: PerOutput) -> float:
        """Share of the rows that a direction of the parameters rests on.

        That is (Σ z²)²/Σ z⁴ of its effect z, over the rows on which the parameters act that it
        loads by more than ``loaded`` of the largest. Directions of different outputs with like
        singular values come out mixed; each output's rows are counted by themselves, so that a
        mixture is not taken for something that few rows tell.
        """
        size = np.abs(direction)
        heavy = size > loaded * size.max()
        found = np.zeros((3, len(sigma)))
        effects(self.columns, self.at, self.used, direction, heavy, found)
        total, fourth, active = found
        part = np.divide(total**2, fourth, out=np.zeros(len(total)), where=fourth > 0)
        weight = total / sigma / sigma
        whole = float(weight.sum())
        return float(part / np.maximum(active, 1.0) @ weight) / whole if whole > 0 else 0.0

    def believed(self, direction: Vector, r: Outputs, sigma: PerOutput) -> bool:
        """Are the rows that a direction of the parameters rests on predicted as well as the others?

        Args:
            r: residual, (n, ny).
            sigma: its standard deviation over all rows, (ny,).
        """
        mine = np.where(self.at >= 0, direction[self.at], 0.0)
        z = np.einsum("ioa,oa->io", self.columns, mine) / sigma
        z[~self.used] = 0.0
        weight = np.square(z).ravel()
        rows = weight.sum() ** 2 / np.square(weight).sum()
        off = float(weight @ np.square(np.nan_to_num(r) / sigma).ravel()) / weight.sum()
        return bool(rows >= FEW and off <= 1.0 + CHANCE * np.sqrt(2.0 / rows))

    def of(self, output: int) -> tuple[Float64[np.ndarray, "n m"], Int64[np.ndarray, " m"]]:
        """(columns that act on one output, the parameters they belong to)."""
        at = self.at[output]
        mine = at >= 0
        columns = self.columns[:, output]
        return (columns, at) if mine.all() else (columns[:, mine], at[mine])

    def without(self, held: Bool[np.ndarray, " k"]) -> Sensitivity:
        """As if the ``held`` parameters did not act."""
        at = np.where((self.at >= 0) & held[self.at], -1, self.at)
        acts = ~held
        return replace(self, at=at, blocks=self.blocks * acts * acts[:, None])
