"""Domain randomisation: a model that behaves like one of many machines, with noise.

Synthetic data of a simulation is pure and therefore narrower than the real thing (Müller, Jazdi,
Weyrich, "Self-improving Models for the Intelligent Digital Twin", section 2; Tobin et al., 2017).
Each parameter is drawn once per seed around its value; noise is added to inputs and outputs in
every row. The noise counts rows in the state: equal seed and rows give equal bits, however cut.

>>> import numpy as np
>>> from evertwin.models.function import FunctionModel
>>> from evertwin.models.parameters import Parameters
>>> from evertwin.signals import Layout
>>> robot = FunctionModel(lambda x, u, dt, p: ([x[0] + p[0] * u[0] * dt],) * 2,
...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"), Parameters.of(gain=(1.0, "1")))
>>> def end(seed):
...     noisy = Randomized(robot, seed, spread=(("gain", 0.05),), output_noise=(0.01,))
...     p = noisy.parameters.values
...     return noisy.simulate(noisy.initial(p), np.ones((10, 1)), np.ones(10), p)[1][-1, 0].item()
>>> end(1) == end(1), end(1) == end(2), abs(end(1) - 10) < 2
(True, False, True)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evertwin.errors import UsageError
from evertwin.models import noise_kernels as kernels
from evertwin.models.batch import grouped, rolled
from evertwin.models.compiled import Compiled
from evertwin.models.contract import BatchModel
from evertwin.models.kernel import Restart
from evertwin.models.parameters import Parameters
from evertwin.models.wrapper import Wrapper
from evertwin.signals.channels import Channel, Layout
from evertwin.types import (
    Inputs,
    Intervals,
    OutputRuns,
    ParameterVector,
    ParameterVectors,
    StateVector,
    StateVectors,
    Vector,
)


@dataclass(frozen=True)
class Randomized(Wrapper):
    """One random member of a family of models. See the module for an example.

    Raises:
        UsageError: noise has not one entry per channel, or the spread names no parameter.
    """

    around = kernels.__name__
    seed: int
    spread: tuple[tuple[str, float], ...] = ()
    """(parameter, relative standard deviation); drawn once per seed."""
    input_noise: tuple[float, ...] = ()
    """Standard deviation per input, in its unit, drawn in every row."""
    output_noise: tuple[float, ...] = ()
    """Standard deviation per output, drawn in every row; the state stays free of it."""

    def __post_init__(self) -> None:
        for name, _ in self.spread:
            self.model.parameters.index(name)
        for what, noise, layout in (
            ("input_noise", self.input_noise, self.model.inputs),
            ("output_noise", self.output_noise, self.model.outputs),
        ):
            if noise and (len(noise) != len(layout) or min(noise) < 0):
                raise UsageError(
                    f"{what}: expected {len(layout)} numbers of 0 or more, got {noise}"
                )

    @cached_property
    def states(self) -> Layout:
        return self.model.states + Layout((Channel("randomized.row", "1"),))

    @property
    def parameters(self) -> Parameters:
        return self.model.parameters

    def initial(self, p: ParameterVector) -> StateVector:
        return np.append(self.model.initial(p * self.factors), 0.0)

    @cached_property
    def factors(self) -> Vector:
        """What each parameter is multiplied with, (np,)."""
        factors = np.ones(len(self.model.parameters))
        rng = np.random.default_rng(self.seed)
        for name, sigma in self.spread:
            factors[self.model.parameters.index(name)] = 1.0 + sigma * rng.standard_normal()
        return factors

    @cached_property
    def compiled(self) -> Compiled:
        """The kernel; its context holds the plan and points to the inner kernel."""
        model, inner = self.model, self.inner
        sizes = len(model.inputs), len(model.states), len(model.parameters), len(model.outputs)
        nu, _, _, ny = sizes
        numbers = np.concatenate([
            self.factors, self.input_noise or np.zeros(nu), self.output_noise or np.zeros(ny),
        ])  # fmt: skip
        plan = (
            kernels.HEADER + len(numbers), inner.step, inner.observe,
            int(inner.context.ctypes.data), *sizes, self.seed % 2**31,
            *numbers.view(np.int64).tolist(),
        )  # fmt: skip
        return Compiled(
            self.inputs, self.outputs, self.states, self.parameters, kernels.step.address,
            kernels.adopt.address, plan,
        )  # fmt: skip

    def simulate_batch(
        self, x: StateVectors, u: Inputs, dt: Intervals, p: ParameterVectors,
        restart: Restart | None = None,
    ) -> OutputRuns:  # fmt: skip
        """Outputs under each row of ``p``; see `evertwin.models.BatchModel`."""
        restart = restart or Restart.never(len(u), len(self.outputs))
        model, nx, seed, code = self.model, len(self.model.states), self.seed % 2**31, restart.code
        if not isinstance(model, BatchModel):
            return rolled(self.kernel(), x, (u, dt, restart), p)
        noise = np.array(self.input_noise or np.zeros(len(self.inputs)), dtype=np.float64)
        seen = np.array(self.output_noise or np.zeros(len(self.outputs)), dtype=np.float64)

        def work(of: list[int]) -> Any:
            given, begin = np.array(u, dtype=np.float64, order="C"), int(x[of[0], nx])
            kernels.disturbed_run(given, noise, seed, begin, 0, code)
            runs = model.simulate_batch(x[of, :nx], given, dt, p[of] * self.factors, restart)
            for run in runs:
                kernels.disturbed_run(run, seen, seed, begin, len(noise), code)
            return runs

        return grouped(x[:, nx:], work)
