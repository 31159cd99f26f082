"""What static maps have in common: no state, so nothing to start from and nothing to adopt into."""

from __future__ import annotations

import numpy as np

from evertwin.signals.channels import Layout
from evertwin.types import Float64, ParameterVector, StateVector


class StaticMap:
    """Base of models whose outputs depend on the inputs of the same row alone.

    >>> StaticMap().initial(np.ones(3)).tolist(), StaticMap().states.names
    ([], ())
    """

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
