"""The contract of a model: a pure simulator.

``simulate`` runs rows: ``x`` is the state *before* the first row; row ``i`` advances it by
``dt[i]`` under the input ``u[i]`` held over that interval, and gives the output at its end. Hence
where rows are cut cannot matter. ``observe`` adopts measured outputs that are not NaN into the
state (the position update). A static map has no state (nx = 0). A wrapper of a Model is a Model.

Beyond it a model may offer `KernelModel.kernel` (C addresses, for the fused loop) and
`LinearModel.regressor` (outputs linear in parameters: tuning solves instead of iterating) and
`BatchModel.simulate_batch` (many parameter vectors over the same rows at once).
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from evertwin.models.kernels.kernel import Kernel, Restart
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout
from evertwin.types import (
    Bools,
    Float64,
    Inputs,
    Int64,
    Intervals,
    OutputRuns,
    Outputs,
    ParameterVector,
    ParameterVectors,
    Rollout,
    StateVector,
    StateVectors,
)


@runtime_checkable
class Model(Protocol):
    """A pure simulator; frozen. `evertwin.models.check_model` tests its laws.

    >>> hasattr(Model, "simulate")
    True
    """

    @property
    def inputs(self) -> Layout:
        """Channels of ``u``."""
        ...

    @property
    def outputs(self) -> Layout:
        """Channels of ``y``."""
        ...

    @property
    def states(self) -> Layout:
        """Channels of ``x``; empty for a static map."""
        ...

    @property
    def parameters(self) -> Parameters:
        """Parameters of ``p``, with their initial values."""
        ...

    def initial(self, p: ParameterVector) -> StateVector:
        """State before the first row when nothing is known, (nx,)."""
        ...

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """State after the last row, and the output of every row. Never changes its arguments."""
        ...

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """The state that agrees with the outputs in ``y`` that are not NaN."""
        ...


@runtime_checkable
class KernelModel(Model, Protocol):
    """A model with compiled step and observe functions.

    >>> hasattr(KernelModel, "kernel")
    True
    """

    def kernel(self) -> Kernel:
        """Addresses of the C functions; their signatures: `evertwin.models.kernels.kernel`."""
        ...


@runtime_checkable
class LinearModel(Model, Protocol):
    """A static map (nx = 0) whose outputs are linear in parameters:

    ``y[i, k] = y0[i, k] + Σ_j Phi[i, k, j] · p[columns[k, j]]``

    with ``m`` parameters at most per output; an unused place has ``columns = −1`` and Phi = 0.
    Parameters that do not appear in ``columns`` act through ``y0`` (which must not depend on those
    that do).

    >>> hasattr(LinearModel, "regressor")
    True
    """

    @property
    def columns(self) -> Int64[np.ndarray, "ny m"]:
        """Index into ``p`` of each regressor column."""
        ...

    def regressor(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[Outputs, Float64[np.ndarray, "n ny m"]]:
        """The part that does not depend on the columns, and the compact regressor."""
        ...


@runtime_checkable
class PartialModel(LinearModel, Protocol):
    """A linear model that gives some columns alone, which costs less than all of them.

    >>> hasattr(PartialModel, "partial")
    True
    """

    def partial(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector,
        slot: Int64[np.ndarray, "ny m"],
    ) -> tuple[Outputs, Float64[np.ndarray, "n ny t"]]:  # fmt: skip
        """Columns that have a ``slot`` (0 … t − 1 in each output; else −1), and all that is not in
        them, with the other linear parameters as in ``p``. Where an output has fewer, 0."""
        ...


@runtime_checkable
class BatchModel(Model, Protocol):
    """A model that simulates many parameter vectors over the same rows at once, in threads.

    Tuning takes its differences from it. Row by row a native engine pays for every call; here it
    runs whole stretches between restarts.

    >>> hasattr(BatchModel, "simulate_batch")
    True
    """

    def simulate_batch(
        self, x: StateVectors, u: Inputs, dt: Intervals, p: ParameterVectors,
        restart: Restart | None = None,
    ) -> OutputRuns:  # fmt: skip
        """Outputs under each parameter vector from its own state before the first row.

        Run ``j`` has the bits of ``roll(kernel, x[j], u, dt, p[j], restart)`` with ``x[j]`` as the
        state that `ANEW` starts from (`Restart.x0` is not read): an initial state may depend on
        parameters. Without ``restart`` it is one free run. What diverges is NaN; it never raises.
        """
        ...


def is_adopted(model: Model, measured: Bools | None = None) -> bool:
    """Do the outputs, or those that are ``measured``, tell the whole state? What they do not is
    lost where it starts anew.

    >>> from evertwin.machines.mobile import Robot1D
    >>> is_adopted(Robot1D())
    True
    """
    y = np.full(len(model.outputs), 0.5)
    if measured is not None:
        y[~measured] = np.nan
    x = model.initial(model.parameters.values)
    return np.array_equal(model.observe(x, y), model.observe(x + 1.0, y))
