"""What of a model goes along with a result to another process: its channels and numbers.

A model itself may be compiled code, a function of a file or a process of its own, which do not
travel.

>>> from evertwin.machines.mobile import Robot1D
>>> Shell.of(Robot1D()).outputs.names
('x',)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from evertwin.errors import UsageError
from evertwin.models import Model, Parameters
from evertwin.signals import Layout
from evertwin.types import Float64, Inputs, Intervals, ParameterVector, Rollout, StateVector

STAYED = (
    "the model of a result stays in the process that made it: open the twin here "
    "(Twin.open) and take its version"
)


@dataclass(frozen=True)
class Shell:
    """A model that tells what it is of, and simulates nothing.

    >>> import numpy as np
    >>> Shell(Layout(), Layout(), Layout(), Parameters(())).initial(np.zeros(0))
    Traceback (most recent call last):
    evertwin.errors.UsageError: the model of a result stays in the process that made it: ...
    """

    inputs: Layout
    outputs: Layout
    states: Layout
    parameters: Parameters

    @classmethod
    def of(cls, model: Model) -> Shell:
        """Of a model."""
        return cls(model.inputs, model.outputs, model.states, model.parameters)

    def initial(self, p: ParameterVector) -> StateVector:
        """See `Model`.

        Raises:
            UsageError: always.
        """
        self._stayed()

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """See `Model`.

        Raises:
            UsageError: always.
        """
        self._stayed()

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """See `Model`.

        Raises:
            UsageError: always.
        """
        self._stayed()

    def _stayed(self) -> NoReturn:
        raise UsageError(STAYED)
