"""A fit that may change the form: terms that pay on held-out parts, then all numbers together.

Terms are sought on top of the version as it is, since numbers that were tuned for a form without
the term have already bent to make up for it, and on top of the tuned one, since a guess may be far
off. Then everything is tuned together; a term stays only if the tuned form leaves less than the
tuned version without it. Where states are not measured, `evertwin.refit.recordings.whole_fits`
seeks instead.
Parameters that a model calls its ``initials`` are the state before a recording that nothing
measures: they belong to the recording, so each one gets its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from evertwin.correction.candidates import propose
from evertwin.correction.describe import describe
from evertwin.correction.search.improve import Proposal, Selection, improve
from evertwin.correction.search.own_numbers import few_numbers
from evertwin.correction.stack import stack_of
from evertwin.errors import ConfigError, DataError
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.form import Version
from evertwin.models.terms.rows import Rows
from evertwin.refit.recordings.formed import Formed
from evertwin.refit.recordings.whole_fits import few, sought
from evertwin.refit.work import Work
from evertwin.setup.setup import Setup
from evertwin.tuning import Fit, Problem, initials, solve
from evertwin.tuning.posing.hidden_starts import own_starts
from evertwin.types import ParameterVector, Vector

GAIN = 0.05
"""Least relative fall of the tuned residual that the terms must bring."""
LEAST = 10
"""Fewest predictions that terms are sought on: no more will come, as they do beside a machine."""


class Started(NamedTuple):
    """What a recording begins with that nothing measures.

    >>> Started._fields
    ('names', 'values', 'p')
    """

    names: tuple[str, ...]
    values: Vector
    p: ParameterVector
    """The model's parameters with it."""

    @classmethod
    def of(cls, fit: Fit) -> Started:
        """Of recordings that were tuned on."""
        return cls(fit.names, fit.values, fit.p)

    @property
    def fitted(self) -> tuple[tuple[str, ...], Vector]:
        """Names and values, as of a fit."""
        return self.names, self.values


def check_initials(setup: Setup, model: Model, tasks: tuple[Block, ...]) -> None:
    """Refuses what would share one start where each needs its own.

    Raises:
        DataError: several recordings to learn the form from.
        ConfigError: windows inside a recording.
    """
    names, rule = ", ".join(initials(model)), setup.spec.correction
    if names and len(tasks) > 1 and rule.in_fit and rule.terms:
        raise DataError(
            f"fit: expected one recording to learn a form from ([correction] in_fit), got "
            f"{len(tasks)}: {names} are the state before a recording, so each would need its own"
        )
    if names and setup.spec.tuning.cut is not None:
        raise ConfigError(
            f"[tuning.cut]: expected none for a model with a start of its own per recording "
            f"({names}): windows inside a recording would need their own"
        )


def with_terms(setup: Setup, work: Work, version: Version, problem: Problem) -> Formed:
    """The tuned problem; with ``[correction] in_fit`` the tuned problem of the form that pays."""
    rule = setup.spec.correction
    problem, fit, _ = work.tune(problem)
    without = Formed(problem, fit, version.form)
    if not (rule.in_fit and rule.terms):
        return without
    horizon = setup.horizon if rule.horizon is None else rule.horizon
    kinds = rule.terms
    if own_starts(setup.model, len(problem.windows)):
        formed, rest = sought(setup, work, without, horizon), set(few(kinds))
        kinds = tuple(name for name in kinds if name not in rest)
        if formed.form != version.form or not kinds:
            return formed
    proposals = _proposals(setup, version, without, kinds, horizon)
    found = [one for one in proposals if one.found]
    if not found:
        return replace(without, search=_search(proposals[0], horizon))
    tried = [one for proposal in found for one in _tried(setup, work, without, proposal, horizon)]
    # costs are in units of each fit's own noise: all alike, however much is left
    share = [without.left(one, rule.outputs) for one in tried]
    best = min(range(len(tried)), key=lambda k: (not tried[k].fit.converged, share[k]))
    formed = tried[best]
    left = [{"output": o, "without": a, "with": b} for o, a, b in without.rms(formed)]
    said = describe(stack_of(setup.model, formed.form, formed.fit.p))
    formed = replace(formed, search={**formed.search, "describes": list(said), "tuned": left})
    if not formed.fit.converged or share[best] > 1.0 - GAIN:
        return replace(without, search=formed.search)
    return formed


def _proposals(
    setup: Setup, version: Version, without: Formed, kinds: tuple[str, ...], horizon: float
) -> list[Proposal]:
    """What pays beside the model's few numbers, from those it has and from the tuned ones: both may
    be far off, a guess and what has bent to make up for the form. Else what pays on them as they
    are."""
    rule = setup.spec.correction
    settings = Selection(
        kinds, rule.channels, quantum=rule.quantum, outputs=rule.outputs, least=LEAST
    )
    rows = setup.model, version.form, without.problem.windows, horizon
    tuned, found = without.fit.p[: len(version.p)], []
    if few_numbers(setup.editable):
        beside = replace(settings, numbers=setup.editable, beside=True)
        found = [improve(*rows, beside, p) for p in (version.p, tuned)]
    if any(one.found for one in found):
        return found
    return [improve(*rows, settings, p) for p in (version.p, tuned)]


def _search(proposal: Proposal, horizon: float) -> dict[str, Any]:
    """The figures of one, for an event."""
    judged = (
        f"held-out deviation over {horizon:g} s, relative to the residual of the model as "
        "configured"
    )
    said = list(proposal.describes)
    return {"horizon": horizon, "describes": said, "judged": judged, **proposal.evidence()}


def _tried(
    setup: Setup, work: Work, without: Formed, proposal: Proposal, horizon: float
) -> list[Formed]:
    """All numbers of a form that pays, tuned together from several starts."""
    problem, search = without.problem, _search(proposal, horizon)
    known = dict(zip(problem.model.parameters.names, without.fit.p.tolist(), strict=True))
    proposed, *general = _starts(setup, problem, proposal, horizon)
    starts = (proposed, *({**start, **known} for start in (proposed, *general)))
    problems = [without.posed(setup, work, proposal.form, start) for start in starts]
    return [Formed.of(work, one, proposal.form, search) for one in problems]


def _starts(
    setup: Setup, problem: Problem, proposal: Proposal, horizon: float
) -> list[dict[str, float]]:
    """Where the search over all numbers begins: with what was proposed, off its bounds, and with
    the general starts of each term."""
    rule = setup.spec.correction
    span = max(float(w.t[-1] - w.t[0]) * 1e-9 for w in problem.windows)
    rows = Rows(setup.model, problem.windows, rule.channels, min(horizon, span), rule.quantum)
    general = {candidate.key: candidate for candidate in propose(rows, rule.terms)}
    values = dict(zip(proposal.names, proposal.p.tolist(), strict=True))
    corrected, found = Corrected(setup.model, proposal.form.terms), list[dict[str, float]]()
    for number, term in enumerate(proposal.form.terms):
        candidate = general.get((term.kind, term.channel, term.source, term.variant))
        names = corrected.names_of(number)
        if candidate is None or len(candidate.low) != len(names):
            continue
        # what no fit tunes stays as it was found
        free = [corrected.parameters[name].editable for name in names]
        columns = zip(names, free, candidate.low, candidate.typical, strict=True)
        for name, low, size in ((n, low, size) for n, tuned, low, size in columns if tuned):
            values[name] = max(values[name], low + 0.01 * size)
        starts = (zip(names, free, start, strict=True) for start in candidate.starts)
        found += [{name: value for name, on, value in start if on} for start in starts]
    return [values, *(values | start for start in found)]


def own_start(setup: Setup, model: Model, p: ParameterVector, window: Block) -> Started:
    """The unmeasured start that fits this recording best, and the parameters with it."""
    names = (*initials(model), *own_starts(model, 1))
    if not names:
        return Started((), np.zeros(0), p)
    prior = model.parameters.with_values(p)
    fit = solve(Problem(model, (window,), names, setup.horizon, prior=prior))
    return Started.of(fit)
