"""A model whose inputs arrive later: transport delay in front of any model.

>>> import numpy as np
>>> from evertwin.models.function import FunctionModel
>>> from evertwin.signals import Layout
>>> robot = FunctionModel(lambda x, u, dt, p: ([x[0] + u[0] * dt],) * 2,
...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
>>> late = delayed(robot, 0.5)
>>> late.parameters.names, late.parameters.values.tolist()
(('lag.delay',), [0.5])
>>> u = np.array([[0.0], [1.0], [1.0]])
>>> p = late.parameters.values
>>> late.simulate(late.initial(p), u, np.ones(3), p)[1].ravel().tolist()
[0.0, 0.5, 1.5]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from evertwin.errors import UsageError
from evertwin.models.contract import Model
from evertwin.models.corrected import Corrected, Term
from evertwin.models.parameters import Parameters

__all__ = ["Delayed", "delayed"]


@dataclass(frozen=True)
class Delayed(Corrected):
    """All inputs of a Model reach it ``delay`` later; the delay is a parameter.

    `delayed` builds one; see the module.

    >>> from evertwin.models.function import FunctionModel
    >>> from evertwin.signals import Layout
    >>> still = FunctionModel(lambda x, u, dt, p: (x, x), Layout.of(v="m/s"), Layout.of(x="m"),
    ...     Layout.of(x="m"))
    >>> Delayed(still, (Term("lag", "*", variant="delay"),), 0.1).parameters["lag.delay"].value
    0.1
    """

    delay: float = 0.0
    """Start value of ``lag.delay`` [s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.delay >= 0.0:
            raise UsageError(f"delay: expected 0 s or more, got {self.delay}")

    @cached_property
    def parameters(self) -> Parameters:
        return super().parameters.with_values({"lag.delay": self.delay})


def delayed(model: Model, delay: float, capacity: int = 16) -> Delayed:
    """The model behind a transport delay of ``delay`` [s].

    Args:
        capacity: changes of the input that fit into the delay; older ones count as held.
    """
    return Delayed(model, (Term("lag", "*", variant="delay", levels=(float(capacity),)),), delay)
