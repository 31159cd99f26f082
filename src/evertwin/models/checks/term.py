"""The laws of a kind of correction term, as a public checker.

>>> from evertwin.models.terms.registry import kind
>>> check_term(kind("law"))
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from inspect import unwrap
from typing import Any

import numpy as np

from evertwin.errors import LawBroken
from evertwin.fold import Block, make_block
from evertwin.models.checks.model import check_model
from evertwin.models.configured import configured
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.functions.function import FunctionModel
from evertwin.models.terms import kernel
from evertwin.models.terms.contract import Candidate, CorrectionTerm, GridTerm
from evertwin.models.terms.rows import Rows
from evertwin.signals.channels import Layout
from evertwin.types import ParameterVector

ROWS = 240


def check_term(own: CorrectionTerm) -> None:
    """Checks the laws of a kind on what it proposes for a base with two inputs and a pose.

    Laws: *proposal* (something is proposed; starts lie within bounds; one start, bound and size for
    every parameter); *neutral* (with the parameters as they are proposed to a model, nothing
    changes); *model* (with the start values the corrected model keeps the laws of `check_model`);
    *compiled* (its functions agree with Python's to 1e-12); *sentence* (one line, with and without
    intervals); *grid* (nodes and priors fit the parameters).

    Raises:
        LawBroken: names the law and the figures.
        UsageError: a function cannot be compiled.
    """
    rows = Rows(_base(), (_recording(),), ("v", "w", "x"), 5.0)
    candidates = list(own.propose(rows))
    if not candidates:
        raise LawBroken(f"proposal: {own.kind!r} proposes nothing for {rows.chosen} or 'x'")
    for candidate in candidates:
        model = Corrected(rows.model, (candidate.term,), (own,))
        _proposal(candidate, model)
        _neutral(candidate, model)
        values = np.concatenate([rows.model.parameters.values, candidate.starts[-1]])
        tuned = configured(model, parameters=model.parameters.with_values(values))
        check_model(tuned, rows.windows[0].u[:40], np.full(40, 0.05))
        _compiled(model, values, rows.windows[0])
        _sentence(candidate, own, model)
        if isinstance(own, GridTerm):
            _grid(candidate, own, rows)


def _base() -> FunctionModel:
    pose = Layout.of(x="m", y="m", heading="rad")
    return FunctionModel(_moved, Layout.of(v="m/s", w="rad/s"), pose, pose)


def _moved(x: Any, u: Any, dt: float, p: Any) -> Any:
    way = dt * u[0]
    ahead = [x[0] + way * math.cos(x[2]), x[1] + way * math.sin(x[2]), x[2] + dt * u[1]]
    return ahead, ahead


def _recording() -> Block:
    """Commands that are held for a while, both ways and zero."""
    rng = np.random.default_rng(0)
    pick = rng.choice(np.linspace(-0.2, 0.2, 9), (ROWS // 8, 2)) * (1.0, 3.0)
    u, dt = np.repeat(pick, 8, axis=0), np.full(ROWS, 0.1)
    y = _base().simulate(np.zeros(3), u, dt, np.zeros(0))[1]
    return make_block(t=np.arange(ROWS) * 10**8, u=u, y=y)


def _proposal(candidate: Candidate, model: Corrected) -> None:
    count = len(model.names_of(0))
    sizes = {len(x) for x in (*candidate.starts, candidate.low, candidate.high, candidate.typical)}
    if sizes != {count}:
        raise LawBroken(
            f"proposal: {candidate.term} has {count} parameters, starts, bounds and sizes have "
            f"{sorted(sizes)}"
        )
    for start in candidate.starts:
        inside = zip(candidate.low, start, candidate.high, strict=True)
        if not all(low <= value <= high for low, value, high in inside):
            raise LawBroken(f"proposal: the start {start} of {candidate.term} is out of bounds")
    if not min(candidate.typical) > 0.0:
        raise LawBroken(f"proposal: {candidate.term} has sizes of change that are not above 0")


def _neutral(candidate: Candidate, model: Corrected) -> None:
    p = model.parameters.values
    # a table of nearest levels is neutral on its levels alone
    u = np.array([*(candidate.term.levels or (-0.1, 0.2)), 0.0])
    u = np.stack([u, np.resize(candidate.term.levels2 or (0.0, 0.3), len(u))], axis=1)
    dt = np.full(len(u), 0.1)
    bare = model.model.simulate(np.zeros(3), u, dt, np.zeros(0))[1]
    off = float(np.abs(model.simulate(model.initial(p), u, dt, p)[1] - bare).max())
    if not off <= 1e-9:
        raise LawBroken(f"neutral: {candidate.term} at {p.tolist()} changes outputs by {off:.3g}")


def _compiled(model: Corrected, p: ParameterVector, block: Block) -> None:
    functions, record = model._kinds[0].functions, model.plan[kernel.HEADER :]
    place, grids = record[kernel.PLACE : kernel.RECORD], record[kernel.RECORD :].view(np.float64)
    if functions.before is None:
        return
    x, dt = model.initial(p), np.full(len(block.t), 0.1)
    found = kernel.effective_run(
        model.plan, x, block.u, dt, p, np.zeros(len(block.t), dtype=np.uint8)
    )
    expected, memory = block.u.copy(), x[len(model.model.states) :].copy()
    for row, interval in zip(expected, dt.tolist(), strict=True):
        unwrap(functions.before)(place, grids, row, interval, p, memory)
    off = float(np.abs(found - expected).max())
    if not off <= 1e-12:
        raise LawBroken(f"compiled: {model.terms[0]} gives inputs that differ by {off:.3g}")


def _sentence(candidate: Candidate, own: CorrectionTerm, model: Corrected) -> None:
    values, unit = candidate.starts[-1], own.unit(candidate.term, model.model)
    ends = {n: (v - 1.0, v + 1.0) for n, v in zip(model.local_names_of(0), values, strict=True)}
    for intervals in ({}, ends):
        said = own.say(candidate.term, values, unit, intervals)
        if not said.strip() or "\n" in said:
            raise LawBroken(f"sentence: {candidate.term}: expected one line, got {said!r}")


def _grid(candidate: Candidate, own: GridTerm, rows: Rows) -> None:
    term, u = candidate.term, rows.windows[0].u
    columns: Sequence[str] = rows.model.inputs.names
    other = u[:, columns.index(term.source)] if term.source else None
    reached = own.reached(term, u[:, columns.index(term.channel)], other)
    count = len(candidate.low)
    if reached.shape != (len(u), count) or not reached.any():
        raise LawBroken(f"grid: reached has shape {reached.shape}, expected {(len(u), count)}")
    for prior in own.priors(term):
        if len(prior.modes) != count:
            raise LawBroken(
                f"grid: the prior {prior.name!r} has {len(prior.modes)} rows, expected {count}"
            )
