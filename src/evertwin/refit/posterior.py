"""What is known of a correction's numbers: an interval and a verdict for each, as learned.

Numbers with a slope have the interval of a fit; numbers whose cost has steps, nodes of a grid and
what a fit calls undetermined have that of `evertwin.correction.intervals`.
"""

from __future__ import annotations

import time
from typing import Any

from evertwin.correction.describe import describe
from evertwin.correction.evidence import gather
from evertwin.correction.improve import Proposal
from evertwin.correction.intervals import parameters, profiled, scattered
from evertwin.correction.stack import stack_of
from evertwin.fold import Block, plain
from evertwin.models import Model
from evertwin.models.corrected import Corrected
from evertwin.setup.setup import Setup
from evertwin.tuning import Problem
from evertwin.tuning.assemble import Outcome, assemble


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
    told: dict[str, Any] = content.setdefault("parameters", {})
    asked = tuple(
        name
        for name in few
        if kinds[name][1] in kinds[name][0].steps
        or name not in told
        or told[name]["verdict"] == "not"
    )
    seen = gather(setup.model, windows, setup.horizon, proposal.scale, proposal.p[: len(base)])
    found = profiled(model, proposal.p, asked, few, seen)
    found |= scattered(model, proposal.p, nodes, seen)
    shown: Any = plain(parameters(found, model, proposal.p))
    every = told | shown
    ends = {name: tuple(item["interval95"]) for name, item in every.items() if name in names}
    closed = {name: both for name, both in ends.items() if None not in both}
    said = describe(stack_of(setup.model, proposal.form, proposal.p), closed)
    return content | {"parameters": every, "describes": list(said)}


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
