"""A model from one plain Python function: the quickest way in.

>>> import numpy as np
>>> from evertwin.signals import Layout
>>> def tank(x, u, dt, p):
...     level = x[0] + dt * (u[0] - p[0] * x[0])
...     return [level], [level]
>>> model = FunctionModel(
...     tank, Layout.of(inflow="m/s"), Layout.of(level="m"), Layout.of(level="m"),
...     Parameters.of(leak=(0.1, "1/s")))
>>> x, y = model.simulate(np.zeros(1), np.ones((2, 1)), np.ones(2), model.parameters.values)
>>> y.ravel().tolist()
[1.0, 1.9]

By default an output that is named like a state adopts into that state.

In a twin it runs as machine code where it only computes: what it reads beside its arguments is
taken as it is when the twin is made (`evertwin.models.functions.translated`).

The function computes in the units that its layouts and parameters state; all around it is SI.

>>> pump = FunctionModel(lambda x, u, dt, p: ([], [p[0] + 0.05 * u[0]]), Layout.of(q="m^3/h"),
...     Layout.of(press="bar"), parameters=Parameters.of(a=(2.0, "bar")))
>>> u = np.full((1, 1), 0.01)
>>> pump.outputs.units, pump.simulate(np.zeros(0), u, np.ones(1), pump.parameters.values)[1]
(('Pa',), array([[380000.]]))
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from evertwin.errors import ModelError, UsageError
from evertwin.models.contract import Model
from evertwin.models.functions.failures import Failures, at_inputs, check_numbers, raised
from evertwin.models.kernels.kernel import RAISED, Kernel
from evertwin.models.one_line import one_line
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout
from evertwin.signals.units import compatible, to_si
from evertwin.types import Float64, Inputs, Intervals, ParameterVector, Rollout, StateVector, Vector

log = logging.getLogger("evertwin")

Step: TypeAlias = Callable[[Any, Any, float, Any], tuple[Sequence[float], Sequence[float]]]
_REAL = ctypes.POINTER(ctypes.c_double)
_INT = ctypes.POINTER(ctypes.c_int64)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int64, _INT, _REAL, _REAL, ctypes.c_double, _REAL, _REAL, _REAL)
_OBSERVE = ctypes.CFUNCTYPE(ctypes.c_int64, _INT, _REAL, _REAL)


@dataclass(frozen=True)
class FunctionModel:
    """``step(x, u, dt, p) -> (x_next, y)`` as a Model. See the module for an example.

    >>> FunctionModel.__name__
    'FunctionModel'
    """

    __repr__ = one_line

    step: Step
    inputs: Layout
    outputs: Layout
    states: Layout = Layout()
    parameters: Parameters = Parameters()
    start: tuple[float | str, ...] = ()
    """State before the first row, one entry a state; zeros by default. The name of a parameter: a
    state that nothing measures, fitted to each recording."""

    def __post_init__(self) -> None:
        if self.start and len(self.start) != len(self.states):
            raise UsageError(
                f"start: expected one entry for each state ({', '.join(self.states.names)}), a "
                f"number or the name of a parameter, got {len(self.start)}: {self.start!r}"
            )
        for side in ("inputs", "outputs", "states"):
            object.__setattr__(self, side, getattr(self, side).in_si())
        for state, name in zip(self.states, self.start, strict=False):
            if not isinstance(name, str):
                continue
            unit = self.parameters[name].unit
            if not compatible(unit, state.unit) and (unit != "1" or state.stated):
                raise UsageError(
                    f"start: the state {state.name} is in '{state.stated or state.unit}', and the "
                    f"parameter {name} in '{unit}': state one unit for both"
                )

    @property
    def initials(self) -> tuple[str, ...]:
        """Parameters that are a state before the first row: each recording has its own."""
        return tuple(value for value in self.start if isinstance(value, str))

    def initial(self, p: ParameterVector) -> StateVector:
        """The state before the first row, (nx,)."""
        start = self.start or (0.0,) * len(self.states)
        told = [0.0 if isinstance(v, str) else v for v in start]
        x = np.array(self.states.from_stated(told), dtype=np.float64)
        for k, name in enumerate(start):
            if isinstance(name, str):
                at = self.parameters.index(name)
                x[k] = to_si(p[at], self.parameters.items[at].unit)
        return x

    @cached_property
    def _adopts(self) -> tuple[tuple[int, int], ...]:
        names = self.states.names
        return tuple((i, names.index(n)) for i, n in enumerate(self.outputs.names) if n in names)

    @cached_property
    def _in_si(self) -> bool:
        sides = (self.states, self.inputs, self.outputs)
        return all(side.stated is None for side in sides)

    def _stated(self, x: StateVector, u: Vector) -> tuple[Any, Any]:
        return self.states.to_stated(x), self.inputs.to_stated(u)

    @cached_property
    def _shapes(self) -> tuple[tuple[int], tuple[int]]:
        return (len(self.states),), (len(self.outputs),)

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """State after the last row and the outputs of every row.

        Raises:
            ModelError: the function raised something, or gave another number of states or outputs
                than declared.
        """
        state = np.array(x, dtype=np.float64)
        out = np.empty((len(u), len(self.outputs)))
        for i in range(len(u)):
            ahead, out[i] = self.row(state, u[i], float(dt[i]), p)
            state = np.array(ahead, dtype=np.float64)
        return state, out

    def row(self, x: StateVector, u: Vector, dt: float, p: ParameterVector) -> tuple[Any, Any]:
        """State after one row, and its outputs.

        Raises:
            ModelError: the function raised something, or gave NaN, or another number of states or
                outputs than declared.
        """
        state, inputs = (x, u) if self._in_si else self._stated(x, u)
        try:
            given: Any = self.step(state, inputs, dt, p)
        except Exception as error:  # it is the user's code
            raise raised(self.step, error) from error
        try:
            ahead, y = given
            ahead, y = np.asarray(ahead, dtype=np.float64), np.asarray(y, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ModelError(
                "step: expected two lists of numbers, the states ahead and the outputs, got "
                f"{given!r:.60}"
            ) from error
        if (ahead.shape, y.shape) != self._shapes:
            raise ModelError(
                f"step: expected {len(self.states)} states and {len(self.outputs)} outputs, "
                f"got {_size(ahead)} and {_size(y)}"
            )
        total = sum(ahead.tolist(), sum(y.tolist()))
        if total != total:  # NaN, or infinities that cancel
            check_numbers(self.step, (x, u, p), ((self.states, ahead), (self.outputs, y)))
        if self._in_si:
            return ahead, y
        return self.states.from_stated(ahead), self.outputs.from_stated(y)

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """The state that agrees with the outputs in ``y`` that are not NaN."""
        return adopted(x, y, self._adopts)

    def kernel(self) -> Kernel:
        """Callbacks with the compiled signatures, about a microsecond a row and more."""
        return self._kernel

    @cached_property
    def _kernel(self) -> Kernel:
        return python_kernel(self)


def adopted(
    x: StateVector, y: Float64[np.ndarray, " ny"], pairs: Sequence[tuple[int, int]]
) -> StateVector:
    """The state with the outputs written into it that are not NaN; ``pairs``: (output, state)."""
    state = np.array(x, dtype=np.float64)
    for output, place in pairs:
        if not np.isnan(y[output]):
            state[place] = y[output]
    return state


def kernel_of(model: Model) -> Kernel:
    """The kernel of any Model: its own, or one made of its Python functions.

    >>> still = FunctionModel(lambda x, u, dt, p: (x, x), Layout(), Layout())
    >>> kernel_of(still) is still.kernel()
    True
    """
    return model.kernel() if hasattr(model, "kernel") else python_kernel(model)


def python_kernel(model: Any) -> Kernel:
    """A kernel from any Model's ``simulate`` and ``observe``, called row by row.

    An exception in a callback cannot pass through compiled code: it becomes the return code
    `RAISED`, and the row an error (NaN); a number that is too large for Python is a simulation that
    runs away, code 1. The first one is logged and kept (`evertwin.models.functions.failures`).
    """
    nx, nu = len(model.states), len(model.inputs)
    ny, n_p = len(model.outputs), len(model.parameters)
    first: list[str] = []

    def row(x: StateVector, u: Vector, dt: float, p: ParameterVector) -> tuple[Any, Any]:
        ahead, y = model.simulate(x, u[None, :], np.array([dt]), p)
        return ahead, y[0]

    one = model.row if isinstance(model, FunctionModel) else row

    # slices of pointers: views of their memory cost ten times as much
    def step(_: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
        inputs = np.array(u[:nu])
        try:
            new, out = one(np.array(x[:nx]), inputs, dt, np.array(p[:n_p]))
            for i in range(nx):
                ahead[i] = new[i]
            for i in range(ny):
                y[i] = out[i]
        except Exception as error:  # noqa: BLE001  it is the user's code
            if isinstance(error.__cause__, OverflowError):
                return 1
            if not first:
                known = error if isinstance(error, ModelError) else raised(model.simulate, error)
                first.append(at_inputs(known, model.inputs, inputs))
                log.warning("a row of the model is an error: %s", first[0])
            return RAISED
        return 0

    def observe(_: Any, x: Any, y: Any) -> int:
        for i, value in enumerate(model.observe(np.array(x[:nx]), np.array(y[:ny]))):
            x[i] = value
        return 0

    calls = (_STEP(step), _OBSERVE(observe))
    addresses = [ctypes.cast(call, ctypes.c_void_p).value or 0 for call in calls]
    failures = Failures(lambda: "".join(first), first.clear)
    return Kernel(addresses[0], addresses[1], np.zeros(1, dtype=np.int64), (calls, model, failures))


def _size(given: np.ndarray) -> str:
    """How many numbers; in words where that is not one list."""
    other = f"an array of shape {given.shape}" if given.ndim else "a bare number"
    return str(len(given)) if given.ndim == 1 else other
