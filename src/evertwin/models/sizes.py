"""Sizes checked before compiled code runs: a kernel reads memory and cannot complain.

>>> import numpy as np
>>> sized(np.zeros(1), Layout.of(x="m"), np.zeros(0), Parameters())
"""

from __future__ import annotations

from evertwin.errors import UsageError
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout
from evertwin.types import ParameterVector, StateVector


def sized(x: StateVector, states: Layout, p: ParameterVector, parameters: Parameters) -> None:
    """Do state and parameters have the model's sizes?

    Raises:
        UsageError: they have not.
    """
    if x.shape != (len(states),) or p.shape != (len(parameters),):
        raise UsageError(
            f"expected a state of {len(states)} and {len(parameters)} parameters, got "
            f"{x.shape} and {p.shape}: start from model.initial(p)"
        )
