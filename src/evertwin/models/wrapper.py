"""What models around another model have in common: its channels, and one kernel around its kernel.

A wrapper names its states, its parameters and `Wrapper.compiled`; see `evertwin.models.corrected`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from evertwin.models.compiled import Compiled
from evertwin.models.contract import Model
from evertwin.models.function import kernel_of
from evertwin.models.kernel import Kernel, Layer, Restart
from evertwin.models.parameters import Parameters
from evertwin.models.rollout import roll
from evertwin.models.sizes import sized
from evertwin.signals.channels import Layout
from evertwin.types import Float64, Inputs, Intervals, ParameterVector, Rollout, StateVector


@dataclass(frozen=True)
class Wrapper(ABC):
    """Base of models around ``model``.

    >>> Wrapper.around
    ''
    """

    model: Model
    around: ClassVar[str] = ""
    """Module of the compiled functions, for a kernel that lives in another process."""

    @property
    def inputs(self) -> Layout:
        return self.model.inputs

    @property
    def outputs(self) -> Layout:
        return self.model.outputs

    @property
    @abstractmethod
    def states(self) -> Layout:
        """The inner model's, then the wrapper's own."""

    @property
    @abstractmethod
    def parameters(self) -> Parameters:
        """The inner model's, then the wrapper's own."""

    @property
    @abstractmethod
    def compiled(self) -> Compiled:
        """The wrapper's kernel, whose context points to ``inner``."""

    @cached_property
    def inner(self) -> Kernel:
        """The kernel of the model inside."""
        return kernel_of(self.model)

    def kernel(self) -> Kernel:
        """Addresses for the fused loop; the context points to the inner kernel."""
        own = self.compiled.kernel()
        layer = Layer(self.around, own.context, self.kinds)
        return own.over(self.inner, layer, (self.compiled,))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of correction term whose functions the kernel calls."""
        return ()

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        sized(x, self.states, p, self.parameters)
        return roll(self.kernel(), x, u, dt, p, Restart.never(len(u), len(self.outputs)))

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        return self.compiled.observe(x, y)
