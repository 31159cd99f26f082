"""What a correction term is: one object for each kind, which says all that is kind-specific.

A `Term` of a form is data: its kind, the channel that it changes, a second channel where it has
one, a variant, grids. The kind of that name, a `CorrectionTerm`, says the rest: its parameters with
bounds and neutral values, its memory, what the data proposes, the arithmetic, the sentence. Nothing
else asks what kind a term is, so that a kind of another package (entry point ``evertwin.terms``) is
searched, stacked, told and given intervals like the others.

The arithmetic is up to three plain functions, compiled by Numba when a model is built:

    before(at, grid, u, dt, p, x)       the inputs ``u`` of a row change in place, and so does the
                                        term's own memory ``x``
    after(at, dt, p, x, ahead, y)       behind the inner model's step from the states ``x`` to
                                        ``ahead``, which may change with the outputs ``y``
    adopted(at, before, x)              a measurement was adopted: states before, and now

``at`` leads to a `Place` (`evertwin.models.terms.kernel.placed`), ``grid`` holds the term's levels,
``p`` its own parameters. They return 0; anything else makes the row an error.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import UsageError
from evertwin.models.contract import Model
from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.rows import Rows
from evertwin.signals.channels import Channel
from evertwin.types import Bool, Float64, ParameterVector, StateVector, Vector

SIMPLE, SHAPED, MIXED, FREE = 1, 2, 3, 4
"""Tiers: few numbers of one input or of one and another; a state of its own; what multiplies two
inputs; a table or a surface. Climbed in this order."""
Intervals: TypeAlias = Mapping[str, tuple[float, float]]
"""95 % intervals by the local name of a parameter."""


class Place(NamedTuple):
    """What a kernel knows of its term.

    >>> Place(0, 2, -1, 5, 0, 0, 0, 3).channel
    2
    """

    variant: int
    """Index into the kind's variants."""
    channel: int
    """Of the inputs (of the states, where the kind couples to one); −1: all inputs."""
    source: int
    """Second input; −1: none."""
    memory: int
    """The first of the term's own states."""
    size: int
    """Numbers in the first grid."""
    size2: int
    """Numbers in the second grid, which follows."""
    extra: int
    """`CorrectionTerm.extra`."""
    inputs: int
    """How many inputs there are."""


@dataclass(frozen=True)
class Functions:
    """The arithmetic of a kind. See the module.

    >>> Functions(before=len).after is None
    True
    """

    before: Callable[..., int] | None = None
    after: Callable[..., int] | None = None
    adopted: Callable[..., int] | None = None


@dataclass(frozen=True)
class Candidate:
    """A term and where its fit starts.

    >>> Candidate(Term("lag", "*"), SIMPLE, ((0.1, 0.2),), (0, 0), (1, 1), (0.05, 0.05)).key
    ('lag', '*', '', '')
    """

    term: Term
    tier: int
    starts: tuple[tuple[float, ...], ...]
    """Start values of the term's parameters, in order."""
    low: tuple[float, ...]
    high: tuple[float, ...]
    typical: tuple[float, ...]
    """Size of a considerable change, per parameter."""
    fixed: tuple[int, ...] = ()
    """Parameters that stay at their start value: the fit cannot slide them."""
    replaces: tuple[str, ...] = ()
    """Kinds on its channel whose place it may take."""

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Kind, channels and shape: what is tried once per round."""
        return self.term.kind, self.term.channel, self.term.source, self.term.variant


class Prior(NamedTuple):
    """What is believed of a grid's numbers before: numbers = modes @ z, z of unit variance.

    >>> Prior(np.eye(2), (1e-6,), 0.0, 0, "levels apart").rank
    0
    """

    modes: Float64[np.ndarray, "n k"]
    noises: tuple[float, ...]
    """Variances of a residual that are tried, in units of the prior's mean variance."""
    length: float
    rank: int
    """0: as symmetric as can be; more: less."""
    name: str


class CorrectionTerm(ABC):
    """A kind of correction term. See the module; `evertwin.models.checks.term` tests its laws.

    >>> from evertwin.models.terms.registry import kind
    >>> kind("law").variants
    ('', 'dead zone', 'clamp')
    """

    kind: ClassVar[str]
    functions: ClassVar[Functions]
    variants: ClassVar[tuple[str, ...]] = ("",)
    """Shapes, where it has several."""
    pairs: ClassVar[bool] = False
    """Does it read a second channel?"""
    rank: ClassVar[int] = 0
    """Place in a stack: 0 for what depends on the row alone, 1 for what remembers it, 2 for a
    rate limit, 3 for a lag behind it, 4 for what comes of the states."""
    linear: ClassVar[bool] = False
    """Does the effective input depend linearly on the parameters? Then it is a `GridTerm`."""
    steps: ClassVar[tuple[str, ...]] = ()
    """Parameters whose cost has steps: their interval is that of its profile."""
    slopeless: ClassVar[tuple[str, ...]] = ()
    """Parameters that no slope of the cost leads to."""
    plain: ClassVar[str] = ""
    """Kind that it comes down to where numbers of it are equal."""
    initials: ClassVar[tuple[str, ...]] = ()
    """Parameters that are an unmeasured state before a recording: each recording has its own."""

    gain: ClassVar[str] = ""
    """Parameter that what comes out is a multiple of; empty: none is."""
    alike: ClassVar[str] = ""
    """What would look the same, where it acts on all inputs."""

    # ------------------------------------------------------------------ as part of a model

    @abstractmethod
    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        """The term's numbers, by local names, with the values that change nothing.

        Args:
            unit: of its channel; ``source``: of the second one.
        """

    def check(self, term: Term, model: Model) -> None:
        """Does the term fit the model?

        Raises:
            UsageError: unknown variant or channel, a second channel too many, a wrong grid.
        """
        if term.variant not in self.variants:
            raise UsageError(
                f"{self.kind}: expected a variant of {self.variants}, got {term.variant!r}"
            )
        self.channel(term, model)
        if self.pairs:
            model.inputs.index(term.source)
        elif term.source:
            raise UsageError(f"{self.kind}: expected no second channel, got {term.source!r}")

    def channel(self, term: Term, model: Model) -> int:
        """Where its channel lies."""
        return model.inputs.index(term.channel)

    def unit(self, term: Term, model: Model) -> str:
        """Unit of its channel."""
        return model.inputs.units[self.channel(term, model)]

    def memory(self, term: Term, number: int, model: Model) -> Sequence[Channel]:
        """The states that the term adds; ``number``: its place in the stack."""
        return ()

    def start(self, p: ParameterVector, size: int) -> StateVector:
        """Its memory before the first row, (size,); ``p``: its own parameters."""
        return np.zeros(size)

    def extra(self, term: Term, model: Model) -> int:
        """One more integer for its kernel."""
        return 0

    # ------------------------------------------------------------------ as part of a search

    @abstractmethod
    def propose(self, rows: Rows) -> Iterator[Candidate]:
        """What the data makes worth trying, simplest first."""

    def by_channel(self, name: str) -> bool:
        """Is this number of the size of its channel? Else it is of the size of its value."""
        return False

    def behind_gain(self, term: Term, values: tuple[float, ...]) -> tuple[float, ...]:
        """Its numbers with a `gain` of 1 that make as much of a command once what comes out is
        multiplied by the gain that they had; as they are where there is none."""
        return values

    @abstractmethod
    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        """One sentence: what the machine does with its commands; quantities in SI.

        Args:
            unit: of its channel.
            intervals: what is known of its numbers; empty while nothing is.
        """


class GridTerm(CorrectionTerm):
    """A kind whose numbers are the nodes of a grid: solved at once, under a prior.

    >>> from evertwin.models.terms.registry import kind
    >>> isinstance(kind("table"), GridTerm)
    True
    """

    linear = True
    rescored: ClassVar[bool] = True
    """Is it few numbers, so that they are scored as if they had not seen what they are scored on
    whenever the stack changes?"""

    @abstractmethod
    def reached(
        self, term: Term, u: Vector, source: Vector | None
    ) -> Bool[np.ndarray, "n numbers"]:
        """Which numbers act on which rows; ``u``: the channel as the term sees it."""

    @abstractmethod
    def priors(self, term: Term) -> Iterator[Prior]:
        """What may be believed of its numbers; the best one on held-out rows is taken."""

    def by_channel(self, name: str) -> bool:
        """Every node is."""
        return True


def rising(kind: str, channel: str, grid: Sequence[float]) -> None:
    """Refuses a grid that does not rise.

    Raises:
        UsageError: fewer than two levels, or they do not rise.
    """
    if len(grid) < 2 or any(b <= a for a, b in pairwise(grid)):
        raise UsageError(f"{kind} on {channel}: expected at least 2 rising levels, got {grid}")


def told(name: str, value: float, unit: str, intervals: Intervals, style: str = ".3g") -> str:
    """A number with its unit, and with its interval where one is known.

    >>> told("cap", 0.16, "m/s", {}), told("cap", 0.16, "m/s", {"cap": (0.15, 0.17)})
    ('0.16 m/s', '0.16 (0.15 to 0.17) m/s')
    >>> told("cap", 0.16, "1", {})
    '0.16'
    """
    between = ""
    if name in intervals:
        low, high = intervals[name]
        between = f" ({low:{style}} to {high:{style}})"
    name = "" if unit in ("", "1") else f" {unit}"
    return f"{value:{style}}{between}{name}"


def nothing(name: str, intervals: Intervals) -> bool:
    """May this number as well be nothing?

    >>> nothing("delay", {"delay": (0.0, 0.02)}), nothing("delay", {})
    (True, False)
    """
    low, high = intervals.get(name, (1.0, 1.0))
    return low <= 0.0 <= high
