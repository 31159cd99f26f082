"""The base of models that have a kernel: `simulate` and `observe` follow from it.

A machine then consists of its layouts, its parameters and two compiled functions.

A static map has no state: nothing to start from and nothing to adopt into (`StaticMap`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import SupportsIndex

import numpy as np

from evertwin.compiled.calls import call
from evertwin.models.kernels.kernel import Kernel, Restart
from evertwin.models.kernels.rollout import roll
from evertwin.models.one_line import one_line
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout
from evertwin.types import Float64, Inputs, Intervals, ParameterVector, Rollout, StateVector


@dataclass(frozen=True)
class Compiled:
    """A model given by its kernel. Machines derive from it or fill it directly.

    See `evertwin.machines` for examples; `evertwin.models.check_model` tests the laws.

    >>> Compiled(Layout(), Layout(), Layout.of(x="m"), Parameters(), 0, 0).initial(np.zeros(0))
    array([0.])
    """

    __repr__ = one_line

    inputs: Layout
    outputs: Layout
    states: Layout
    parameters: Parameters
    step: SupportsIndex
    """The compiled step, or its address."""
    adopt: SupportsIndex
    """The compiled observe, or its address."""
    context: tuple[int, ...] = (0,)
    start: tuple[float, ...] = field(default=())
    """State before the first row when nothing is known; zeros by default."""

    def initial(self, p: ParameterVector) -> StateVector:
        """The state before the first row, (nx,)."""
        return np.array(self.start or (0.0,) * len(self.states), dtype=np.float64)

    @cached_property
    def _context(self) -> np.ndarray:
        return np.array(self.context, dtype=np.int64)

    def kernel(self) -> Kernel:
        """Addresses for the fused loop."""
        return Kernel(self.step, self.adopt, self._context)

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """State after the last row and the outputs of every row."""
        return roll(self.kernel(), x, u, dt, p, Restart.never(len(u), len(self.outputs)))

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """The state that agrees with the outputs in ``y`` that are not NaN."""
        state = np.array(x, dtype=np.float64)
        told = np.ascontiguousarray(y, dtype=np.float64)
        call(self.adopt, self._context.ctypes.data, state.ctypes.data, told.ctypes.data)
        return state


class StaticMap:
    """Base of models whose outputs depend on the inputs of the same row alone.

    >>> StaticMap().initial(np.ones(3)).tolist(), StaticMap().states.names
    ([], ())
    """

    __repr__ = one_line

    @property
    def states(self) -> Layout:
        """None."""
        return Layout()

    def initial(self, p: ParameterVector) -> StateVector:
        """Empty."""
        return np.zeros(0)

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """There is nothing to adopt into."""
        return np.array(x, dtype=np.float64)
