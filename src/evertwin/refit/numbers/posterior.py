"""What is known of a correction's numbers: an interval and a verdict for each, as learned.

Numbers with a slope have the interval of a fit; numbers whose cost has steps, nodes of a grid and
what a fit calls undetermined have that of `evertwin.correction.numbers.intervals`.
"""

from __future__ import annotations

import time
from typing import Any

from evertwin.correction.describe import describe
from evertwin.correction.evidence import gather
from evertwin.correction.numbers.intervals import parameters, profiled, scattered
from evertwin.correction.search.improve import Proposal
from evertwin.correction.stack import stack_of
from evertwin.fold import Block, plain
from evertwin.models import Model
from evertwin.models.corrected.corrected import Corrected
from evertwin.setup.setup import Setup
from evertwin.tuning import Fit, Problem
from evertwin.tuning.intervals.assemble import Outcome, assemble


def posterior(
    setup: Setup, model: Model, proposal: Proposal, windows: tuple[Block, ...],
    tuned: tuple[str, ...] = (),
) -> dict[str, Any] | None:  # fmt: skip
    """The numbers as a fit tells them; None where the terms have none.

    Args:
        setup: of the twin.
        model: of the proposal's form.
        proposal: what was learned.
        windows: on these rows.
        tuned: numbers of the base model that were tuned as well.
    """
    base = setup.model.parameters.names
    names = tuple(n for n in proposal.names if n not in base and n not in proposal.taken)
    if not names:
        return None
    assert isinstance(model, Corrected)
    owners = {name: model.owner(name) for name in names}
    kinds = {name: (own.kind, own.local) for name, own in owners.items() if own is not None}
    nodes = tuple(name for name, (kind, _) in kinds.items() if kind.linear)
    few = tuple(name for name in names if name not in nodes)
    slopes = tuple(name for name in few if kinds[name][1] not in kinds[name][0].slopeless)
    content = _fitted(setup, model, proposal, windows, (*tuned, *slopes))
    live = dict(zip(proposal.names, proposal.p.tolist(), strict=True))
    found = content.setdefault("parameters", {}).items()
    sloped = {name: _about(live[name], item) for name, item in found}
    asked = tuple(
        name
        for name in few
        if kinds[name][1] in kinds[name][0].steps
        or name not in sloped
        or sloped[name]["verdict"] == "not"
    )
    seen = gather(setup.model, windows, setup.horizon, proposal.scale, proposal.p[: len(base)])
    known = profiled(model, proposal.p, asked, few, seen)
    known |= scattered(model, proposal.p, nodes, seen)
    shown: Any = plain(parameters(known, model, proposal.p))
    every = sloped | shown
    ends = {name: tuple(item["interval95"]) for name, item in every.items() if name in names}
    closed = {name: both for name, both in ends.items() if None not in both}
    said = describe(stack_of(setup.model, proposal.form, proposal.p), closed)
    return content | {"parameters": every, "describes": list(said)}


def told_of(
    moved: tuple[str, ...], alone: Fit | None, beside: dict[str, Any] | None
) -> tuple[str, ...]:
    """Numbers that moved, and which of them are hardly known: by tuning alone, or beside the terms.

    >>> told_of(("a", "b"), None, {"parameters": {"b": {"verdict": "not"}}})
    ('a', 'b (weak)')
    """
    known = {} if beside is None else beside["parameters"]
    weak = {name for name, one in known.items() if one["verdict"] != "identifiable"}
    weak |= (
        {name.removesuffix(" (weak)") for name in alone.moved if "(" in name} if alone else set()
    )
    return tuple(f"{name} (weak)" if name in weak else name for name in moved)


def sentences(setup: Setup, proposal: Proposal, fit: dict[str, Any] | None) -> tuple[str, ...]:
    """What was learned in plain words, with the intervals that `posterior` found."""
    if fit is None:
        return proposal.describes
    bare = describe(stack_of(setup.model, proposal.form, proposal.p))
    known = dict(zip(bare, fit["describes"], strict=True))
    return tuple(known.get(one, one) for one in proposal.describes)


def _about(value: float, item: dict[str, Any]) -> dict[str, Any]:
    """A number's interval about the value that goes live: where the rows do not tell another one, a
    fit moves it a little once that one is put back, and both are within."""
    moved = value - item["value"]
    low, high = item["interval95"]
    ends = [
        None if low is None else low + min(moved, 0.0),
        None if high is None else high + max(moved, 0.0),
    ]
    return item | {"value": value, "interval95": ends}


def _fitted(
    setup: Setup, model: Model, proposal: Proposal, windows: tuple[Block, ...],
    names: tuple[str, ...],
) -> dict[str, Any]:  # fmt: skip
    """Intervals of the numbers with a slope, without fitting anything anew."""
    if not names:
        return {}
    values = model.parameters.with_values(proposal.p)
    problem = Problem(model, windows, names, setup.horizon, None, None, values)
    outcome = Outcome(problem.start, 0, 1, True, "as the correction was learned")
    acting = problem.sensitivity(problem.start)
    if not acting.finite:
        return {}
    fit = assemble(problem, outcome, acting, time.perf_counter())
    return dict(fit.to_dict(timing=False))
