"""The rows that a form is asked about: an output's columns, and the shapes of the inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.tuning.residuals.autocorrelation import Series
from evertwin.tuning.residuals.shapes import shapes
from evertwin.types import Float64

Columns = Float64[np.ndarray, "n m"]
Basis = Float64[np.ndarray, "n b"]
Widths = Float64[np.ndarray, " m"]


class Term(NamedTuple):
    """A coefficient that changes with an input.

    >>> Term(0, "speed", 3, "size").input
    'speed'
    """

    column: int
    """Of the output's columns."""
    input: str
    shape: int
    kind: str


@dataclass(frozen=True, eq=False)
class Shaped:
    """An input's rows, shared by the outputs that know the same ones.

    >>> Shaped(np.linspace(0.0, 1.0, 9)).every(2).u.tolist()
    [0.0, 0.25, 0.5, 0.75, 1.0]
    """

    u: Series
    _thinned: dict[int, Shaped] = field(default_factory=dict)

    def every(self, step: int) -> Shaped:
        """Every so many rows."""
        if step not in self._thinned:
            self._thinned[step] = self if step == 1 else Shaped(self.u[::step])
        return self._thinned[step]

    @cached_property
    def shapes(self) -> tuple[tuple[str, ...], Columns]:
        """The kinds, and their values."""
        return shapes(self.u)


@dataclass(frozen=True)
class Asked:
    """One output's rows.

    >>> one = Asked(np.ones((9, 2)), np.array([0, 1]), np.ones(9), {})
    >>> len(one.thinned(3).r), one.candidates()[0]
    (3, [])
    """

    columns: Columns
    at: np.ndarray
    """Which tuned parameter each column belongs to."""
    r: Series
    """What is left of it."""
    inputs: Mapping[str, Shaped]

    @property
    def basis(self) -> Basis:
        """Its columns, made orthonormal."""
        return np.asarray(np.linalg.qr(scaled(self.columns)[0])[0])

    def thinned(self, rows: int) -> Asked:
        """Every so many rows, at most so many in all."""
        step = -(-len(self.r) // max(rows, 1))
        inputs = {name: one.every(step) for name, one in self.inputs.items()}
        return Asked(self.columns[::step], self.at, self.r[::step], inputs)

    def only(self, names: Sequence[str]) -> Asked:
        """With these inputs."""
        return replace(self, inputs={name: self.inputs[name] for name in names})

    def candidates(self) -> tuple[list[Term], Columns]:
        """Every column times every shape of every input, each of unit length."""
        terms, found = list[Term](), list[np.ndarray]()
        for name, one in self.inputs.items():
            kinds, values = one.shapes
            for a in range(self.columns.shape[1]):
                terms += [Term(a, name, s, kind) for s, kind in enumerate(kinds)]
                found.append(self.columns[:, a : a + 1] * values)
        whole = np.concatenate(found, axis=1) if found else np.empty((len(self.r), 0))
        length = np.sqrt(np.square(whole).sum(axis=0))
        return terms, whole / np.where(length > 0, length, 1.0)


def scaled(columns: Columns) -> tuple[Columns, Widths]:
    """(columns of unit length, how long each was; 1 where there is nothing of it).

    >>> scaled(np.array([[3.0, 0.0], [4.0, 0.0]]))[1].tolist()
    [5.0, 1.0]
    """
    size = np.sqrt(np.square(columns).sum(axis=0))
    size[size == 0] = 1.0
    return columns / size, size
