"""A model with correction terms on top: still a model.

Terms change the inputs, in order, before the inner model sees them: what was commanded becomes what
the machine effectively does. Tables (Müller, Jazdi, Weyrich, "Self-improving Models for the
Intelligent Digital Twin", table 1 and figure 4), continuous laws, couplings to another channel,
surfaces over two channels; a lag delays and smooths; an extra state exchanges with one of the
model's own states. The terms' numbers are parameters behind the inner ones, their memory is state
behind the inner one, so that promoting a correction replaces arrays and a shadow is a second state.

>>> import numpy as np
>>> from evertwin.models.functions.function import FunctionModel
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

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from evertwin.models.batch import grouped, rolled
from evertwin.models.compiled import Compiled
from evertwin.models.contract import Model
from evertwin.models.corrected.variants import in_variant
from evertwin.models.form import Form, Term
from evertwin.models.functions.function import kernel_of
from evertwin.models.kernels.kernel import Kernel, Layer, Restart
from evertwin.models.kernels.rollout import roll, sized
from evertwin.models.one_line import one_line
from evertwin.models.parameters import Parameter, Parameters
from evertwin.models.terms import kernel as kernels
from evertwin.models.terms.contract import CorrectionTerm, Place
from evertwin.models.terms.registry import kind
from evertwin.signals.channels import Channel, Layout
from evertwin.types import (
    Float64,
    Inputs,
    Int64,
    Intervals,
    OutputRuns,
    ParameterVector,
    ParameterVectors,
    Rollout,
    StateVector,
    StateVectors,
)

__all__ = ["Corrected", "Owner", "Term", "build", "effective_inputs"]


class Owner(NamedTuple):
    """Whose number a parameter is.

    >>> Owner._fields
    ('term', 'kind', 'local')
    """

    term: Term
    kind: CorrectionTerm
    local: str
    """The parameter's name without that of the term."""


class Part(NamedTuple):
    """A term in its place in a stack.

    >>> Part._fields
    ('term', 'kind', 'local', 'names', 'memory')
    """

    term: Term
    kind: CorrectionTerm
    local: tuple[Parameter, ...]
    """Its parameters, by the names that the kind gives them."""
    names: tuple[str, ...]
    """Their full names."""
    memory: tuple[Channel, ...]
    """The states that it adds."""


@dataclass(frozen=True)
class Corrected:
    """A Model with terms on top of its inputs. See the module for an example.

    Parameters are called ``kind.channel.name``, with the second channel where there is one
    (``coupling.v.w.slip``) and a number from the second term of the same kind on
    (``law.v#2.gain``).

    Raises:
        UsageError: a term names a channel that the model has not, or its grid does not rise.
    """

    __repr__ = one_line

    model: Model
    terms: tuple[Term, ...]
    own: tuple[CorrectionTerm, ...] = field(default=(), compare=False, repr=False)
    """Kinds of the terms, where they need not be registered."""

    @property
    def inputs(self) -> Layout:
        return self.model.inputs

    @property
    def outputs(self) -> Layout:
        return self.model.outputs

    @cached_property
    def inner(self) -> Kernel:
        """The kernel of the model inside."""
        return kernel_of(self.model)

    def kernel(self) -> Kernel:
        """Addresses for the fused loop; the context points to the inner kernel."""
        own = self.compiled.kernel()
        layer = Layer(kernels.__name__, own.context, tuple(term.kind for term in self.terms))
        return own.over(self.inner, layer, (self.compiled,))

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        sized(x, self.states, p, self.parameters)
        return roll(self.kernel(), x, u, dt, p, Restart.never(len(u), len(self.outputs)))

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        return self.compiled.observe(x, y)

    def __post_init__(self) -> None:
        for term, own in zip(self.terms, self._kinds, strict=True):
            own.check(term, self.model)

    @cached_property
    def _kinds(self) -> tuple[CorrectionTerm, ...]:
        return self.own or tuple(kind(term.kind) for term in self.terms)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Every term with its parameters and its memory, in order."""
        seen: Counter[str] = Counter()
        inputs, found = self.model.inputs, []
        for number, (term, own) in enumerate(zip(self.terms, self._kinds, strict=True)):
            source = inputs.units[inputs.index(term.source)] if term.source else "1"
            local = tuple(own.parameters(term, own.unit(term, self.model), source))
            stem = ".".join(x for x in (term.kind, term.channel, term.source) if x not in ("", "*"))
            seen[stem] += 1
            again = f"#{seen[stem]}" if seen[stem] > 1 else ""
            names = tuple(f"{stem}{again}.{p.name}" for p in local)
            found.append(Part(term, own, local, names, tuple(own.memory(term, number, self.model))))
        return tuple(found)

    @cached_property
    def states(self) -> Layout:
        return self.model.states + Layout(tuple(c for part in self.parts for c in part.memory))

    @cached_property
    def parameters(self) -> Parameters:
        named = (pair for part in self.parts for pair in zip(part.local, part.names, strict=True))
        return self.model.parameters + Parameters(tuple(replace(p, name=n) for p, n in named))

    @cached_property
    def initials(self) -> tuple[str, ...]:
        """Parameters that are an unmeasured state at the start of a recording."""
        inner: tuple[str, ...] = getattr(self.model, "initials", ())
        owned = (
            (name, local.name in part.kind.initials)
            for part in self.parts
            for local, name in zip(part.local, part.names, strict=True)
        )
        return (*inner, *(name for name, starts in owned if starts))

    def names_of(self, number: int) -> tuple[str, ...]:
        """Names of the parameters of term ``number``."""
        return self.parts[number].names

    def local_names_of(self, number: int) -> tuple[str, ...]:
        """The same as the kind calls them."""
        return tuple(item.name for item in self.parts[number].local)

    def owner(self, name: str) -> Owner | None:
        """Whose number a parameter is; None: the inner model's.

        >>> from evertwin.machines.mobile import Robot1D
        >>> own = Corrected(Robot1D(), (Term("law", "v"),)).owner("law.v.cap")
        >>> own.kind.kind, own.local
        ('law', 'cap')
        """
        for part in self.parts:
            if name in part.names:
                return Owner(part.term, part.kind, part.local[part.names.index(name)].name)
        return None

    def on_grid(self, name: str) -> bool:
        """Is a parameter a node of a grid?"""
        own = self.owner(name)
        return own is not None and own.kind.linear

    def initial(self, p: ParameterVector) -> StateVector:
        inner = len(self.model.parameters)
        x, q = [self.model.initial(p[:inner])], inner
        for part in self.parts:
            x.append(part.kind.start(p[q : q + len(part.local)], len(part.memory)))
            q += len(part.local)
        return np.concatenate(x)

    @cached_property
    def compiled(self) -> Compiled:
        """The kernel; its context holds the plan and points to the inner kernel."""
        return Compiled(
            self.inputs, self.outputs, self.states, self.parameters, kernels.step,
            kernels.adopt, tuple(self.plan.tolist()),
        )  # fmt: skip

    @cached_property
    def plan(self) -> Int64[np.ndarray, " k"]:
        """The terms as integers; see `evertwin.models.terms.kernel`."""
        model, inner = self.model, self.inner
        records = list(self._records())
        head = [
            kernels.HEADER + sum(map(len, records)), int(inner.step), int(inner.observe),
            int(inner.context.ctypes.data), len(model.inputs), len(model.states), len(self.states),
            len(self.parameters), len(model.outputs), len(self.terms),
        ]  # fmt: skip
        plan = np.concatenate([np.array(head, dtype=np.int64), *records])
        kernels.address(plan, self._kinds)
        return plan

    def _records(self) -> Iterator[Int64[np.ndarray, " k"]]:
        """One record a term, without the addresses of its functions."""
        model = self.model
        q, b = len(model.parameters), len(model.states)
        for term, own, local, _, memory in self.parts:
            grids = np.array(term.levels + term.levels2, dtype=np.float64).view(np.int64)
            place = Place(
                own.variants.index(term.variant), own.channel(term, model),
                model.inputs.index(term.source) if term.source else -1, b, len(term.levels),
                len(term.levels2), own.extra(term, model), len(model.inputs),
            )  # fmt: skip
            head = [kernels.RECORD + len(grids), 0, 0, 0, q, *place]
            yield np.concatenate([np.array(head, dtype=np.int64), grids])
            q += len(local)
            b += len(memory)

    def simulate_batch(
        self, x: StateVectors, u: Inputs, dt: Intervals, p: ParameterVectors,
        restart: Restart | None = None,
    ) -> OutputRuns:  # fmt: skip
        """Outputs under each row of ``p``; see `evertwin.models.BatchModel`.

        The inner model's own batch runs whole stretches under the effective inputs, where it has
        one. (A term that acts behind the inner model's step needs it row by row.)
        """
        restart = restart or Restart.never(len(u), len(self.outputs))
        model = self.model
        behind = any(own.functions.after is not None for own in self._kinds)
        if behind or not hasattr(model, "simulate_batch"):
            return rolled(self.kernel(), x, (u, dt, restart), p)
        nx, n_p = len(model.states), len(model.parameters)
        u = np.ascontiguousarray(u)

        def work(of: list[int]) -> Any:
            first = np.ascontiguousarray(x[of[0]]), np.ascontiguousarray(p[of[0]])
            given = kernels.effective_run(self.plan, first[0], u, dt, first[1], restart.code)
            return model.simulate_batch(x[of, :nx], given, dt, p[of, :n_p], restart)

        return grouped(np.concatenate([x[:, nx:], p[:, n_p:]], axis=1), work)


def effective_inputs(model: Model, u: Inputs, p: ParameterVector) -> Inputs:
    """What terms without memory make of the inputs, row by row, (n, nu); others are left out.

    >>> from evertwin.models.functions.function import FunctionModel
    >>> base = FunctionModel(lambda x, u, dt, p: ([], [u[0]]), Layout.of(v="m/s"), Layout.of(y="m"))
    >>> half = Corrected(base, (Term("table", "v", variant="linear", levels=(0.0, 1.0)),))
    >>> effective_inputs(half, np.array([[0.5]]), np.array([0.0, 0.5])).tolist()
    [[0.25]]
    """
    out = np.array(u, dtype=np.float64)
    if isinstance(model, Corrected):
        still = [k for k, own in enumerate(model._kinds) if own.rank == 0]
        fixed = Corrected(model.model, tuple(model.terms[k] for k in still))
        kept = [i for k in still for i in model.parameters.indices(model.names_of(k)).tolist()]
        values = np.concatenate([p[: len(model.model.parameters)], p[kept]])
        kernels.effective_rows(fixed.plan, out, values)
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
    return Corrected(model, form.terms)
