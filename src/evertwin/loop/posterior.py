"""What is known of a correction's numbers: an interval and a verdict for each, as learned.

Numbers with a slope have the interval of a fit; thresholds, delays, nodes of tables and surfaces,
and what a fit calls undetermined have that of `evertwin.correction.intervals`.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from evertwin.correction.evidence import gather
from evertwin.correction.improve import Proposal
from evertwin.correction.intervals import parameters, profiled, scattered
from evertwin.fold import Block, plain
from evertwin.loop.setup import Setup
from evertwin.models import Model
from evertwin.tuning import Problem
from evertwin.tuning.assemble import Outcome, assemble

__all__ = ["posterior"]

NODES = ("table.", "surface.")
STEPS = (".threshold", ".delay")
"""Numbers whose cost has steps."""


def posterior(
    setup: Setup, model: Model, proposal: Proposal, windows: tuple[Block, ...]
) -> dict[str, Any] | None:
    """The numbers as a fit tells them; None where the terms have none.

    Args:
        model: of the proposal's form.
    """
    base = setup.model.parameters.names
    names = tuple(name for name in proposal.names if name not in base)
    if not names:
        return None
    nodes = tuple(name for name in names if name.startswith(NODES))
    few = tuple(name for name in names if name not in nodes)
    content = _fitted(setup, model, proposal, windows, few)
    told: dict[str, Any] = content.setdefault("parameters", {})
    asked = tuple(
        name
        for name in few
        if name.endswith(STEPS) or name not in told or told[name]["verdict"] == "not"
    )
    seen = gather(setup.model, windows, setup.horizon, proposal.scale, proposal.p[: len(base)])
    found = profiled(model, proposal.p, asked, few, seen)
    found |= scattered(model, proposal.p, nodes, seen)
    shown: Any = plain(parameters(found, model, proposal.p))
    return content | {"parameters": told | shown}


def _fitted(
    setup: Setup, model: Model, proposal: Proposal, windows: tuple[Block, ...],
    few: tuple[str, ...],
) -> dict[str, Any]:  # fmt: skip
    """Intervals of the numbers with a slope, without fitting anything anew."""
    names = tuple(name for name in few if not name.endswith(".threshold"))
    if not names:
        return {}
    values = model.parameters.with_values(proposal.p)
    problem = Problem(model, windows, names, setup.horizon, None, None, values)
    outcome = Outcome(problem.start, 0, 1, True, "as the correction was learned")
    j = problem.jacobian(problem.start)
    if not np.isfinite(j[problem.rows.used]).all():
        return {}
    fit = assemble(problem, outcome, problem.start, j, time.perf_counter())
    return dict(fit.to_dict(timing=False))
