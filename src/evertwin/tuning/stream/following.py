"""Parameters that follow a machine in the stream, beside a version that stays as it is.

Between two beats rows are learned from; at a beat the estimate is renewed, and predicts from then
on: every row is predicted before it is learned. With the memory T, the prior p̄ (the version's
values) of information Λ₀, and an output's noise σ, over a row of length dt from which something is
learned,

    a = exp(−dt/T)
    Λ ← a·Λ + (1 − a)·Λ₀ + φ φᵀ/σ²
    λ ← a·λ + φ (y − y0 − φ·p̄)/σ²,      p = p̄ + Λ⁻¹λ

so that the estimate forgets by what has been learned since, not by the clock: what stands, or is
not trusted, tells nothing new, and what was known of it stays. Outputs that share no followed
parameter learn and forget apart (P2's decoupling). The noise is that of the predictions so far,
with the same memory.

The estimate of a group of outputs predicts for the twin only while it has predicted better than the
version did, both a beat ahead over the same rows. What a beat has learned can be taken back by the
next one: rows may turn out to be not the machine's own.

>>> from evertwin.fold import make_block
>>> from evertwin.models import Parameter, Parameters
>>> from evertwin.signals import Layout
>>> class Gain:
...     inputs, outputs, states = Layout.of(v="m/s"), Layout.of(w="m/s"), Layout()
...     parameters = Parameters((Parameter("gain", 1.0, "1"),))
...     columns = np.array([[0]])
...     def initial(self, p): return np.zeros(0)
...     def observe(self, x, y): return x
...     def simulate(self, x, u, dt, p): return x, p[0] * u
...     def regressor(self, x, u, dt, p): return np.zeros_like(u), u[:, :, None]
>>> stage = Following(Gain(), ("gain",), np.array([1.0]))
>>> state, u = stage.init(), np.ones((50, 1))
>>> for k in range(9):
...     y = 1.2 * u + 0.01 * np.sin(np.arange(50.0 * k, 50.0 * k + 50.0))[:, None]
...     rows = make_block(t=np.arange(50) * 10**7, u=u, y=y)
...     state = stage.beat(stage.step(state, rows))
>>> round(float(stage.live(state)[0]), 1)
1.2
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from evertwin.fold import Block
from evertwin.models import LinearModel
from evertwin.tuning.stream.following_loop import learn
from evertwin.tuning.stream.recursive_loop import solve_information
from evertwin.types import Float64, Int64, ParameterVector, Vector

UNIT = 0.2
"""A value's prior is at least as wide as for this share of the largest one of its unit."""
KEPT = 0.1
"""Share of what was learned that still counts where the machine may have changed meanwhile."""
WORSE = 1.05
"""Mean square, by that of the version, from which on an estimate that predicts is dropped."""


class Learned(NamedTuple):
    """What rows have told so far.

    >>> Learned._fields
    ('matrix', 'vector', 'noise', 'losses')
    """

    matrix: Float64[np.ndarray, "k k"]
    """Information Λ."""
    vector: Vector
    """λ, (k,)."""
    noise: Float64[np.ndarray, "ny 2"]
    """Σ residual² of the estimate, and rows, with the memory."""
    losses: Float64[np.ndarray, "ny 2"]
    """Σ residual² of the version, and of the estimate."""


class FollowingState(NamedTuple):
    """State of `Following`.

    >>> FollowingState._fields
    ('p', 'weight', 'chosen', 'learned', 'before')
    """

    p: ParameterVector
    """The version's parameters with the estimate in place of what is followed, (np,)."""
    weight: Vector
    """1/σ² per output until the next beat, (ny,); 0: not known."""
    chosen: Int64[np.ndarray, " ny"]
    """Per group: 1 while its estimate predicts for the twin."""
    learned: Learned
    before: Learned
    """The same at the last beat."""


@dataclass(frozen=True)
class Following:
    """The stage for one version. See the module for its equations and an example."""

    model: LinearModel
    names: tuple[str, ...]
    """What is followed; the outputs are linear in it."""
    values: ParameterVector
    """The version's parameters: the prior, (np,)."""
    memory: float = 20.0
    """Time constant of forgetting [s]."""
    spread: float = 0.1
    """Standard deviation of the prior, relative to each value."""
    caution: float = 3.0
    """σ in units of the residual's rms: rows that follow each other are alike."""
    moving: tuple[tuple[int, int, float], ...] = field(default=())
    """(output, input, threshold): an output tells something where |input| > threshold."""

    @cached_property
    def _places(self) -> Int64[np.ndarray, " k"]:
        return self.model.parameters.indices(self.names)

    @cached_property
    def _at(self) -> Int64[np.ndarray, "ny m"]:
        """Place of each column among what is followed; −1: it is not."""
        at = np.full(self.model.columns.shape, -1, dtype=np.int64)
        for j, place in enumerate(self._places.tolist()):
            at[self.model.columns == place] = j
        return at

    @cached_property
    def groups(self) -> tuple[Int64[np.ndarray, " ny"], Int64[np.ndarray, " k"]]:
        """Group of each output, and of each followed parameter; groups share none."""
        ny = len(self._at)
        of_output = np.arange(ny)
        for _ in range(ny):
            for j in range(len(self.names)):
                mine = (self._at == j).any(axis=1)
                if mine.any():
                    of_output[mine] = of_output[mine].min()
        of_parameter = np.array(
            [of_output[(self._at == j).any(axis=1)].min(initial=ny) for j in range(len(self.names))]
        )
        return of_output, of_parameter.astype(np.int64)

    @cached_property
    def _information(self) -> Vector:
        """Λ₀, its diagonal."""
        units = [self.model.parameters[name].unit for name in self.names]
        sizes = np.abs(self.values[self._places])
        largest = {unit: max(s for s, u in zip(sizes, units, strict=True) if u == unit)
                   for unit in units}  # fmt: skip
        sigma = self.spread * (sizes + UNIT * np.array([largest[unit] for unit in units]))
        return np.asarray(1.0 / np.square(np.maximum(sigma, 1e-12)))

    @cached_property
    def prior(self) -> Vector:
        """Standard deviations of the prior, (k,)."""
        return np.asarray(1.0 / np.sqrt(self._information))

    @cached_property
    def _limits(self) -> tuple[Int64[np.ndarray, " ny"], Vector]:
        ny = len(self._at)
        gate, above = np.full(ny, -1, dtype=np.int64), np.zeros(ny)
        for output, source, threshold in self.moving:
            gate[output], above[output] = source, threshold
        return gate, above

    def init(self) -> FollowingState:
        """Nothing was learned yet."""
        k, ny = len(self.names), len(self._at)
        learned = Learned(
            np.diag(self._information), np.zeros(k), np.zeros((ny, 2)), np.zeros((ny, 2))
        )
        return FollowingState(
            self.values.copy(), np.zeros(ny), np.zeros(ny, dtype=np.int64), learned,
            Learned(*(part.copy() for part in learned)),
        )  # fmt: skip

    def step(self, state: FollowingState, rows: Block) -> FollowingState:
        """The rows are learned from. Consumes ``state``.

        Args:
            state: from `init`, or an earlier step or beat.
            rows: judged rows, none of them behind the next beat.
        """
        p = self.values
        y0, phi = self.model.regressor(self.model.initial(p), rows.u, rows.dt, p)
        columns = np.ascontiguousarray(self.model.columns, dtype=np.int64)
        linear: Any = (y0, phi, columns, self._at)
        prior = (p, self._information)
        learn(
            (rows.dt, rows.u, rows.y, rows.mark), linear, self.groups, self._limits, self.memory,
            prior, (state.p, state.weight, *state.learned),
        )  # fmt: skip
        return state

    def beat(self, state: FollowingState, *, back: bool = False) -> FollowingState:
        """The estimate is renewed, and judged. Consumes ``state``.

        Args:
            state: with the rows since the last beat.
            back: were these rows not the machine's own? Then nothing was learned from them.
        """
        learned = state.before if back else state.learned
        delta, sigma = np.empty(len(self.names)), np.empty(len(self.names))
        p = state.p
        if solve_information(learned.matrix, learned.vector, delta, sigma):
            p = self.values.copy()
            p[self._places] += delta
        square, rows = learned.noise.T
        known = (rows > 0.0) & (square > 0.0)
        weight = np.where(known, np.where(known, rows, 0.0) / np.where(known, square, 1.0), 0.0)
        return FollowingState(
            p, weight / self.caution**2, self._chosen(state.chosen, learned), learned,
            Learned(*(part.copy() for part in learned)),
        )  # fmt: skip

    def sigma(self, state: FollowingState) -> Vector:
        """Standard deviations of the estimate, in the order of ``names``, (k,)."""
        delta, sigma = np.empty(len(self.names)), np.empty(len(self.names))
        solve_information(state.learned.matrix, state.learned.vector, delta, sigma)
        return sigma

    def left(self, state: FollowingState) -> Vector:
        """Rms residual of each output by that of the version over the same rows, (ny,); 1 where the
        version predicts."""
        version, estimate = state.learned.losses.T
        ratio = np.sqrt(estimate / np.where(version > 0.0, version, np.inf))
        return np.where(state.chosen[self.groups[0]] == 1, ratio, 1.0)

    def followed(self, state: FollowingState) -> tuple[str, ...]:
        """Names of what is followed by outputs that the estimate predicts."""
        taken = state.chosen[np.minimum(self.groups[1], len(state.chosen) - 1)] == 1
        return tuple(name for name, one in zip(self.names, taken, strict=True) if one)

    def as_sure(self, other: FollowingState) -> FollowingState:
        """Begins at this version's values, as sure of them as another state is of its own. Consumes
        ``other``."""
        learned = other.learned._replace(
            vector=np.zeros(len(self.names)), losses=np.zeros_like(other.learned.losses)
        )
        before = Learned(*(part.copy() for part in learned))
        return self.init()._replace(weight=other.weight, learned=learned, before=before)

    def loosened(self, state: FollowingState) -> FollowingState:
        """The same estimate, of which less is sure: the machine may be another one by now. Consumes
        ``state``, which is that of a beat."""
        old = state.learned
        matrix = KEPT * old.matrix
        np.fill_diagonal(matrix, matrix.diagonal() + (1.0 - KEPT) * self._information)
        # the estimate that the new matrix gives is the old one
        delta = state.p[self._places] - self.values[self._places]
        vector = (matrix * delta).sum(axis=1)
        learned = old._replace(matrix=matrix, vector=vector)
        return state._replace(learned=learned, before=Learned(*(part.copy() for part in learned)))

    def _chosen(self, chosen: Int64[np.ndarray, " ny"], learned: Learned) -> Any:
        """Which groups have predicted better than the version, in units of their noise."""
        found, group = np.zeros_like(chosen), self.groups[0]
        size = np.where(learned.noise[:, 0] > 0.0, learned.noise[:, 0], np.inf)
        for g in set(group.tolist()):
            mine = np.flatnonzero(group == g).tolist()
            version, estimate = (
                sum(float(learned.losses[o, side] / size[o]) for o in mine) for side in (0, 1)
            )
            found[g] = estimate < version * (WORSE if chosen[g] else 1.0)
        return found

    def live(self, state: FollowingState) -> ParameterVector:
        """What predicts for the twin, (np,)."""
        p, places = self.values.copy(), self.model.parameters.indices(self.followed(state))
        p[places] = state.p[places]
        return p
