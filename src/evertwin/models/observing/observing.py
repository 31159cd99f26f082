"""A model whose unmeasured states are estimated where its predictions start again.

Nothing measures a wall's temperature or a second tank, and what a recording begins with is unknown;
until the model has forgotten it, every prediction would carry it. At each restart the outputs are
compared with what was expected of them, and a recursive least-squares estimate of what the hidden
states began with moves them by what is left of it. That start is all that is estimated: a model
that is wrong is not pulled back by it for longer than it remembers where it began.

The derivatives come from one run of the model beside it per hidden state, which ends once its start
is forgotten (`evertwin.models.observing.observing_kernel`).

>>> from evertwin.models.functions.function import FunctionModel
>>> from evertwin.signals import Layout
>>> def step(x, u, dt, p):
...     air, wall = x
...     ahead = air + 0.2 * (wall - air) * dt
...     return [ahead, wall + 0.02 * (air - wall) * dt], [ahead]
>>> air = Layout.of(air="K")
>>> box = FunctionModel(step, Layout.of(heat="W"), air, Layout.of(air="K", wall="K"))
>>> code = np.tile(np.array([1, 0, 0, 0, 0], dtype=np.uint8), 8)
>>> code[0] = 2
>>> u, dt, none = np.zeros((40, 1)), np.ones(40), np.zeros(0)
>>> y = box.simulate(np.array([0.0, 5.0]), u, dt, none)[1]
>>> found = [
...     roll(kernel_of(one), one.initial(none), u, dt, none, Restart(y, code, one.initial(none)))[1]
...     for one in (box, observed(box))
... ]
>>> [float(np.abs(y - given)[20:].max().round(3)) for given in found]
[2.444, 0.0]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evertwin.models.compiled import Compiled
from evertwin.models.contract import Model
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.kernel import Kernel, Restart
from evertwin.models.kernels.rollout import roll
from evertwin.models.observing import observing_kernel as kernels
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Channel, Layout
from evertwin.types import (
    Bools,
    Float64,
    Inputs,
    Int64,
    Intervals,
    ParameterVector,
    Rollout,
    StateVector,
)

MOST = 8
"""Hidden states that are worth a run each."""


def observed(model: Model, measured: Bools | None = None) -> Model:
    """The model with an observer of its `unmeasured` states; itself where there are none, or more
    than `MOST`."""
    hidden = () if isinstance(model, Observed) else unmeasured(model, measured)
    return Observed(model, hidden) if 0 < len(hidden) <= MOST else model


def remembers(model: Model) -> bool:
    """Does a model keep states through a gap in the rows, which its observer then puts right?

    >>> from evertwin.machines.mobile import Robot1D
    >>> remembers(Robot1D())
    False
    """
    return bool(hidden_of(model) or hidden_of(observed(model)))


def hidden_of(model: Model) -> tuple[int, ...]:
    """Places of the states that a model's observer estimates.

    >>> from evertwin.machines.thermal import ThermalBox
    >>> hidden_of(observed(ThermalBox()))
    (0,)
    """
    return model.hidden if isinstance(model, Observed) else ()


def unmeasured(model: Model, measured: Bools | None = None) -> tuple[int, ...]:
    """Places of the model's own states that no output that is ``measured`` sets, and of those whose
    start is a parameter; none where it lives in another process or runs its own batches.

    >>> from evertwin.machines.thermal import ThermalBox
    >>> unmeasured(ThermalBox())
    (0,)
    """
    if isinstance(model, Observed):
        return model.hidden
    inner = model.model if isinstance(model, Corrected) else model
    # By name: to ask a protocol takes as long as all the rest.
    if not len(model.states) or hasattr(inner, "simulate_batch") or kernel_of(model).remote:
        return ()
    p = model.parameters.values
    x, y = model.initial(p), np.full(len(model.outputs), 0.5)
    if measured is not None:
        y[~measured] = np.nan
    found = model.observe(x, y) != model.observe(x + 1.0, y)
    other = p.copy()
    for name in getattr(model, "initials", ()):
        other[model.parameters.index(name)] += 1.0
    own = np.arange(len(x)) < len(inner.states)  # a term's memory is short, but for such a start
    return tuple(np.flatnonzero(found & (own | (model.initial(other) != x))).tolist())


@dataclass(frozen=True)
class Observed:
    """See the module. Its state holds the model's own first.

    >>> Observed.__name__
    'Observed'
    """

    model: Model
    hidden: tuple[int, ...]
    """Places of the states that are estimated."""

    @property
    def inputs(self) -> Layout:
        return self.model.inputs

    @property
    def outputs(self) -> Layout:
        return self.model.outputs

    @property
    def parameters(self) -> Parameters:
        return self.model.parameters

    @cached_property
    def states(self) -> Layout:
        more = range(len(self.model.states), self._place.end)
        return self.model.states + Layout(tuple(Channel(f"observer{k}", "1") for k in more))

    @cached_property
    def _place(self) -> kernels.Place:
        sizes = len(self.model.states), len(self.model.outputs), len(self.hidden)
        return kernels.Place(*kernels.place.plain(*sizes))

    def initial(self, p: ParameterVector) -> StateVector:
        at = self._place
        x = np.zeros(at.end)
        x[: at.begun] = self.model.initial(p)
        x[at.expected : at.slope], x[at.counts :] = np.nan, -1.0
        return x

    @cached_property
    def _inner(self) -> Kernel:
        return kernel_of(self.model)

    @cached_property
    def _plan(self) -> Int64[np.ndarray, " k"]:
        model, inner = self.model, self._inner
        head = [
            kernels.HEADER + len(self.hidden) + len(model.outputs), int(inner.step),
            int(inner.observe), int(inner.context.ctypes.data), len(model.inputs),
            len(model.states), len(model.parameters), len(model.outputs), len(self.hidden),
        ]  # fmt: skip
        return np.array([*head, *self.hidden, *model.outputs.angles], dtype=np.int64)

    @cached_property
    def _compiled(self) -> Compiled:
        return Compiled(
            self.inputs, self.outputs, self.states, self.parameters, kernels.step, kernels.adopt,
            tuple(self._plan.tolist()),
        )  # fmt: skip

    def kernel(self) -> Kernel:
        """Addresses for the fused loop; the context points to the inner kernel."""
        return self._compiled.kernel()._replace(keep=(self._compiled, self._inner))

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        return roll(self.kernel(), x, u, dt, p, Restart.never(len(u), len(self.outputs)))

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        return self._compiled.observe(x, y)
