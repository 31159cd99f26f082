"""What each kind of correction term adds to a model: parameters and memory.

Names are ``kind.channel.name``, with the second channel where there is one (``coupling.v.w.slip``)
and a number from the second term of the same kind on (``law.v#2.gain``).

>>> from evertwin.models.function import FunctionModel
>>> base = FunctionModel(lambda x, u, dt, p: ([], [u[0]]), Layout.of(v="m/s"), Layout.of(x="m"))
>>> [(p.name, p.unit) for p in term_parameters(Term("lag", "*"), base)]
[('lag.delay', 's'), ('lag.tau', 's')]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from evertwin.errors import UsageError
from evertwin.models.contract import Model
from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.signals.channels import Channel, Layout
from evertwin.signals.units import si_unit

__all__ = ["CAPACITY", "VARIANTS", "check_term", "memory", "term_parameters"]

VARIANTS: dict[str, tuple[str, ...]] = {
    "table": ("", "linear"),
    "law": ("", "dead zone", "clamp"),
    "lag": ("", "delay"),
    "coupling": ("proportional", "magnitude", "grip"),
    "surface": ("",),
    "state": ("",),
}
"""Shapes of each kind. ``table``: nearest level or interpolated. ``lag``: delay and first order, or
delay alone. ``coupling``: u − k·s; |u| − k·|s|; the limit of |u| falls with |s|."""

CAPACITY = 16
"""Changes of the input that a lag remembers; ``levels=(64,)`` says otherwise."""

FREE = 1e9
"""A cap that never acts."""


def check_term(term: Term, model: Model) -> None:
    """Does the term fit the model?

    Raises:
        UsageError: unknown variant or channel, missing source, or a grid that does not rise.
    """
    if term.variant not in VARIANTS[term.kind]:
        raise UsageError(
            f"{term.kind}: expected a variant of {VARIANTS[term.kind]}, got {term.variant!r}"
        )
    if term.kind == "state":
        model.states.index(term.channel)
    elif not (term.kind == "lag" and term.channel == "*"):
        model.inputs.index(term.channel)
    if term.kind in ("coupling", "surface"):
        model.inputs.index(term.source)
    elif term.source:
        raise UsageError(f"{term.kind}: expected no second channel, got {term.source!r}")
    grids = {"table": (term.levels,), "surface": (term.levels, term.levels2)}.get(term.kind, ())
    for grid in grids:
        if len(grid) < 2 or any(b <= a for a, b in pairwise(grid)):
            raise UsageError(
                f"{term.kind} on {term.channel}: expected at least 2 rising levels, got {grid}"
            )


def memory(term: Term, number: int, model: Model) -> Sequence[Channel]:
    """The states that the term adds."""
    if term.kind == "state":
        unit = model.states.channels[model.states.index(term.channel)].unit
        names = [(f"state{number}.begun", "1"), (f"state{number}.difference", unit)]
        return [Channel(name, unit) for name, unit in names]
    if term.kind != "lag":
        return []
    layout = model.inputs if term.channel == "*" else model.inputs.select([term.channel])
    capacity = int(term.levels[0]) if term.levels else CAPACITY
    stem = f"lag{number}"
    found = [Channel(f"{stem}.begun", "1")]
    found += [Channel(f"{stem}.{c.name}", c.unit) for c in layout]
    found += [Channel(f"{stem}.duration.{k}", "s") for k in range(capacity)]
    found += [Channel(f"{stem}.{c.name}.{k}", c.unit) for k in range(capacity) for c in layout]
    return found


def term_parameters(term: Term, model: Model, number: int = 1) -> tuple[Parameter, ...]:
    """The term's parameters, with the values that change nothing.

    Args:
        number: counts terms of equal kind and channels, from 1.
    """
    again = f"#{number}" if number > 1 else ""
    channel = "" if term.channel == "*" else f".{term.channel}"
    stem = f"{term.kind}{channel}" + (f".{term.source}" if term.source else "") + again
    layout: Layout = model.states if term.kind == "state" else model.inputs
    unit = "1" if term.channel == "*" else layout.channels[layout.index(term.channel)].unit
    source = model.inputs.channels[model.inputs.index(term.source)].unit if term.source else "1"
    return tuple(replace(p, name=f"{stem}.{p.name}") for p in _parameters(term, unit, source))


def _parameters(term: Term, unit: str, source: str) -> list[Parameter]:
    if term.kind == "table":
        return [Parameter(str(k), level, unit) for k, level in enumerate(term.levels)]
    if term.kind == "surface":
        places = ((i, j) for i in range(len(term.levels)) for j in range(len(term.levels2)))
        return [Parameter(f"{i}.{j}", 0.0, unit) for i, j in places]
    if term.kind == "law":
        # no slope leads to the end of a dead zone
        slides = term.variant != "dead zone"
        threshold = Parameter("threshold", 0.0, unit, low=0.0, editable=slides)
        start = [threshold] if term.variant else []
        gain = [Parameter("gain", 1.0, "1", low=0.0), Parameter("offset", 0.0, unit)]
        return [*start, *gain, Parameter("cap", FREE, unit, low=0.0)]
    if term.kind == "lag":
        tau = [] if term.variant else [Parameter("tau", 0.0, "s", low=0.0)]
        # with a time constant beside it the delay is found once, and not tuned any more
        return [Parameter("delay", 0.0, "s", low=0.0, editable=not tau), *tau]
    if term.kind == "state":
        rates = [Parameter(name, 0.0, "1/s", low=0.0) for name in ("loss", "gain")]
        return [*rates, Parameter("start", 0.0, unit)]
    if term.variant != "grip":
        return [Parameter("slip", 0.0, si_unit(f"({unit})/({source})"))]
    inverse = si_unit(f"1/({unit})")
    return [
        Parameter("gain", 1.0, "1", low=0.0),
        Parameter("inverse_cap", 0.0, inverse, low=0.0, editable=False),
        Parameter("inverse_grip", 0.0, si_unit(f"1/({unit})/({source})"), low=0.0),
    ]
