"""A stack of terms with their numbers, on top of a base model: data that grows and shrinks.

Terms that depend on the row alone come first, in the order in which they were found; memory, such
as a lag's, smooths what they make of the command; extra states come last.

>>> from evertwin.machines.mobile import Robot1D
>>> stack = Stack(Robot1D(), (1.0,)).plus(Term("lag", "*"), (0.0, 0.1)).plus(
...     Term("law", "v"), (0.9, 0.0, 1.0))
>>> [part.term.kind for part in stack.parts], stack.p.tolist()
(['law', 'lag'], [1.0, 0.9, 0.0, 1.0, 0.0, 0.1])
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evertwin.models import Model
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.corrected.variants import in_variant
from evertwin.models.form import Form, Term
from evertwin.models.terms.contract import CorrectionTerm
from evertwin.models.terms.registry import kind
from evertwin.types import ParameterVector


@dataclass(frozen=True)
class Part:
    """One term with its numbers and their bounds.

    >>> Part(Term("lag", "*"), (0.0, 0.1)).few
    True
    """

    term: Term
    values: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    typical: tuple[float, ...] = ()
    fixed: tuple[int, ...] = ()

    @property
    def kind(self) -> CorrectionTerm:
        """The kind of its term."""
        return kind(self.term.kind)

    @property
    def few(self) -> bool:
        """Has it few numbers, that are refitted together with others?"""
        return not self.kind.linear


def bounded(part: Part) -> Part:
    """The part with bounds, wide ones where it came without.

    >>> bounded(Part(Term("table", "v", levels=(0.0, 2.0)), (0.0, 2.0))).typical
    (0.1, 0.1)
    """
    if part.low:
        return part
    n, size = len(part.values), max((abs(v) for v in part.term.levels), default=1.0)
    return replace(part, low=(-np.inf,) * n, high=(np.inf,) * n, typical=(0.05 * size,) * n)


@dataclass(frozen=True)
class Stack:
    """A base model with terms. See the module for an example."""

    base: Model
    inner: tuple[float, ...]
    """Parameter values of the base model."""
    parts: tuple[Part, ...] = ()
    tuned: tuple[tuple[int, float, float, float], ...] = ()
    """Numbers of the base model that are fitted beside every term: place, bounds, size of a
    considerable change."""

    @cached_property
    def model(self) -> Model:
        """The corrected model."""
        terms = tuple(part.term for part in self.parts)
        return Corrected(self.base, terms) if terms else self.base

    @property
    def p(self) -> ParameterVector:
        """Parameters of `model`, in order: an array of the caller's own."""
        values = [v for part in self.parts for v in part.values]
        return np.array([*self.inner, *values], dtype=np.float64)

    def first(self, part: int) -> int:
        """Where the numbers of part ``part`` begin in `p`."""
        return len(self.inner) + sum(len(other.values) for other in self.parts[:part])

    def plus(self, term: Term, values: tuple[float, ...]) -> Stack:
        """With one more term, in its place."""
        return self.with_part(Part(term, values))[0]

    def with_part(self, part: Part) -> tuple[Stack, int]:
        """With one more part, and where it went."""
        at = sum(other.kind.rank <= part.kind.rank for other in self.parts)
        parts = (*self.parts[:at], part, *self.parts[at:])
        return replace(self, parts=parts), at

    def without(self, part: int) -> Stack:
        """Without one part."""
        return replace(self, parts=self.parts[:part] + self.parts[part + 1 :])

    def with_p(self, p: ParameterVector) -> Stack:
        """The same terms with other numbers."""
        parts, at = [], len(self.inner)
        for part in self.parts:
            stop = at + len(part.values)
            parts.append(replace(part, values=tuple(float(v) for v in p[at:stop])))
            at = stop
        inner = tuple(float(v) for v in p[: len(self.inner)])
        return replace(self, inner=inner, parts=tuple(parts))


def stack_of(model: Model, form: Form, p: ParameterVector | None = None) -> Stack:
    """The form as a stack. Terms of a form come without bounds: they are not refitted."""
    base = in_variant(model, dict(form.variant)) if form.variant else model
    corrected = Corrected(base, form.terms)
    values = corrected.parameters.values if p is None else p
    at = len(base.parameters)
    parts = []
    for number, term in enumerate(form.terms):
        size = len(corrected.names_of(number))
        parts.append(Part(term, tuple(float(v) for v in values[at : at + size])))
        at += size
    return Stack(base, tuple(float(v) for v in values[: len(base.parameters)]), tuple(parts))
