"""A model with correction terms on top: still a model.

Terms change the inputs, in order, before the inner model sees them: what was commanded becomes what
the machine effectively does. Tables (Müller, Jazdi, Weyrich, "Self-improving Models for the
Intelligent Digital Twin", table 1 and figure 4), continuous laws, couplings to another channel,
surfaces over two channels; a lag delays and smooths; an extra state exchanges with one of the
model's own states. The terms' numbers are parameters behind the inner ones, their memory is state
behind the inner one, so that promoting a correction replaces arrays and a shadow is a second state.

>>> import numpy as np
>>> from evertwin.models.function import FunctionModel
>>> from evertwin.signals import Layout
>>> robot = FunctionModel(lambda x, u, dt, p: ([x[0] + u[0] * dt],) * 2,
...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
>>> slow = Corrected(robot, (Term("law", "v", variant="dead zone"),))
>>> slow.parameters.names
('law.v.threshold', 'law.v.gain', 'law.v.offset', 'law.v.cap')
>>> p = slow.parameters.with_values({"law.v.threshold": 0.06, "law.v.cap": 0.16}).values
>>> u = np.array([[0.05], [0.10], [0.20]])
>>> slow.simulate(np.zeros(1), u, np.ones(3), p)[1].ravel().round(3).tolist()
[0.0, 0.1, 0.26]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evertwin.errors import UsageError
from evertwin.models import term_kernels as kernels
from evertwin.models.batch import grouped, rolled
from evertwin.models.compiled import Compiled
from evertwin.models.contract import BatchModel, Model
from evertwin.models.form import Form, Term
from evertwin.models.kernel import Restart
from evertwin.models.parameters import Parameter, Parameters
from evertwin.models.term_parameters import (
    CAPACITY,
    VARIANTS,
    check_term,
    memory,
    term_parameters,
)
from evertwin.models.variants import in_variant
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
)

__all__ = ["Corrected", "Term", "build", "effective_inputs"]

_CODES = {
    "table": kernels.TABLE,
    "law": kernels.LAW,
    "lag": kernels.LAG,
    "coupling": kernels.COUPLING,
    "surface": kernels.SURFACE,
    "state": kernels.STATE,
}


@dataclass(frozen=True)
class Corrected(Wrapper):
    """A Model with terms on top of its inputs. See the module for an example.

    Raises:
        UsageError: a term names a channel that the model has not, or its grid does not rise.
    """

    around = kernels.__name__
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        for term in self.terms:
            check_term(term, self.model)

    @cached_property
    def states(self) -> Layout:
        added: list[Channel] = []
        for number, term in enumerate(self.terms):
            added += memory(term, number, self.model)
        return self.model.states + Layout(tuple(added))

    @cached_property
    def parameters(self) -> Parameters:
        return self.model.parameters + Parameters(
            tuple(item for items in self._parameters for item in items)
        )

    @cached_property
    def _parameters(self) -> tuple[tuple[Parameter, ...], ...]:
        names: dict[str, int] = {}
        found = []
        for term in self.terms:
            items = term_parameters(term, self.model)
            stem = items[0].name.rsplit(".", 1)[0]
            names[stem] = names.get(stem, 0) + 1
            found.append(term_parameters(term, self.model, names[stem]))
        return tuple(found)

    @property
    def initials(self) -> tuple[str, ...]:
        """Parameters that are an unmeasured state at the start of a recording."""
        inner: tuple[str, ...] = getattr(self.model, "initials", ())
        added = [self.names_of(k)[2] for k, term in enumerate(self.terms) if term.kind == "state"]
        return (*inner, *added)

    def names_of(self, number: int) -> tuple[str, ...]:
        """Names of the parameters of term ``number``."""
        return tuple(item.name for item in self._parameters[number])

    def initial(self, p: ParameterVector) -> StateVector:
        inner = len(self.model.parameters)
        x = np.concatenate(
            [self.model.initial(p[:inner]), np.zeros(len(self.states) - len(self.model.states))]
        )
        q, b = inner, len(self.model.states)
        for number, term in enumerate(self.terms):
            if term.kind == "state":
                x[b + 1] = p[q + 2]
            q += len(self._parameters[number])
            b += len(memory(term, number, self.model))
        return x

    @cached_property
    def compiled(self) -> Compiled:
        """The kernel; its context holds the plan and points to the inner kernel."""
        return Compiled(
            self.inputs, self.outputs, self.states, self.parameters, kernels.step.address,
            kernels.adopt.address, tuple(self._plan),
        )  # fmt: skip

    @cached_property
    def _plan(self) -> list[int]:
        """The terms as integers; see `evertwin.models.term_kernels`."""
        model, inner = self.model, self.inner
        plan = [
            0, inner.step, inner.observe, int(inner.context.ctypes.data), len(model.inputs),
            len(model.states), len(self.states), len(self.parameters), len(model.outputs),
            len(self.terms),
        ]  # fmt: skip
        q, b = len(model.parameters), len(model.states)
        for number, term in enumerate(self.terms):
            grids = np.array(term.levels + term.levels2, dtype=np.float64).view(np.int64).tolist()
            kind, n1 = _CODES[term.kind], len(term.levels)
            variant = VARIANTS[term.kind].index(term.variant)
            if term.kind == "lag":
                grids, n1 = [], 0
            plan += [
                kernels.RECORD + len(grids), kind, variant, self._channel(term),
                model.inputs.index(term.source) if term.source else -1, q, b, n1,
                len(term.levels2), self._extra(term), *grids,
            ]  # fmt: skip
            q += len(self._parameters[number])
            b += len(memory(term, number, model))
        plan[0] = len(plan)
        return plan

    def _channel(self, term: Term) -> int:
        if term.kind == "state":
            return self.model.states.index(term.channel)
        return -1 if term.channel == "*" else self.model.inputs.index(term.channel)

    def _extra(self, term: Term) -> int:
        """A lag's capacity; the output that shows an extra state's partner."""
        if term.kind == "lag":
            return int(term.levels[0]) if term.levels else CAPACITY
        names = self.model.outputs.names
        return names.index(term.channel) if term.kind == "state" and term.channel in names else -1

    def simulate_batch(
        self, x: StateVectors, u: Inputs, dt: Intervals, p: ParameterVectors,
        restart: Restart | None = None,
    ) -> OutputRuns:  # fmt: skip
        """Outputs under each row of ``p``; see `evertwin.models.BatchModel`.

        The inner model's own batch runs whole stretches under the effective inputs, where it has
        one. (An extra state needs the inner model's state in every row: it goes row by row.)
        """
        restart = restart or Restart.never(len(u), len(self.outputs))
        model = self.model
        if not isinstance(model, BatchModel) or any(t.kind == "state" for t in self.terms):
            return rolled(self.kernel(), x, (u, dt, restart), p)
        nx, n_p = len(model.states), len(model.parameters)
        plan = np.array(self._plan, dtype=np.int64)
        u = np.ascontiguousarray(u)

        def work(of: list[int]) -> Any:
            first = np.ascontiguousarray(x[of[0]]), np.ascontiguousarray(p[of[0]])
            given = kernels.effective_run(plan, first[0], u, dt, first[1], restart.code)
            return model.simulate_batch(x[of, :nx], given, dt, p[of, :n_p], restart)

        return grouped(np.concatenate([x[:, nx:], p[:, n_p:]], axis=1), work)


def effective_inputs(model: Model, u: Inputs, p: ParameterVector) -> Inputs:
    """What static terms make of the inputs, row by row, (n, nu); a lag's memory is left out.

    >>> from evertwin.models.function import FunctionModel
    >>> base = FunctionModel(lambda x, u, dt, p: ([], [u[0]]), Layout.of(v="m/s"), Layout.of(y="m"))
    >>> half = Corrected(base, (Term("table", "v", variant="linear", levels=(0.0, 1.0)),))
    >>> effective_inputs(half, np.array([[0.5]]), np.array([0.0, 0.5])).tolist()
    [[0.25]]
    """
    out = np.array(u, dtype=np.float64)
    if isinstance(model, Corrected):
        fixed = Corrected(
            model.model, tuple(t for t in model.terms if t.kind not in ("lag", "state"))
        )
        kept = [
            i for k, t in enumerate(model.terms) if t.kind not in ("lag", "state")
            for i in model.parameters.indices(model.names_of(k)).tolist()
        ]  # fmt: skip
        values = np.concatenate([p[: len(model.model.parameters)], p[kept]])
        kernels.effective_rows(np.array(fixed._plan, dtype=np.int64), out, values)
    return out


def build(model: Model, form: Form) -> Model:
    """The base model in the form's variant, with the form's terms on top.

    Raises:
        UsageError: the model has no such variant, or a term does not fit it.
    """
    if form.variant:
        model = in_variant(model, dict(form.variant))
    if not form.terms:
        return model
    states = [number for number, term in enumerate(form.terms) if term.kind == "state"]
    if states and not model.states.names:
        raise UsageError("form: expected a model with states for an extra state, got a static map")
    return Corrected(model, form.terms)
