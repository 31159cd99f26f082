"""A form sought by tuning all numbers anew: of a model with states that nothing measures.

Predictions over a horizon begin at measurements. Where a state has none they begin anywhere, and of
one recording there are few of them. So each term with few numbers is tuned together with the
others; what it gains is counted on pieces of the recordings that no number was tuned on but where
that piece begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from evertwin.correction.candidates import propose
from evertwin.correction.describe import describe
from evertwin.correction.evidence import asked_of
from evertwin.correction.stack import stack_of
from evertwin.fold import Block, take
from evertwin.models.form import Form
from evertwin.models.terms.contract import SHAPED, Candidate, GridTerm
from evertwin.models.terms.registry import kind
from evertwin.models.terms.rows import Rows
from evertwin.refit.recordings.formed import Formed
from evertwin.refit.work import Work
from evertwin.setup.setup import Setup
from evertwin.signals.sizes import rms
from evertwin.tuning import Problem
from evertwin.tuning.form.unseen import on
from evertwin.tuning.posing.recordings import beginning
from evertwin.tuning.search.minima import lowest
from evertwin.tuning.search.nonlinear import least_squares
from evertwin.types import Bools, Float64, PerOutput, Vector

PIECES, FOLDS = 6, 3
"""Of each recording; pieces that are left out together lie apart."""
MOST = 3
"""Terms."""
GAIN = 0.05
"""Least relative fall of the residual, on what was tuned on and on what was not; of the latter in
most folds, too."""
EVALUATIONS, TOLERANCE = 40, 1e-5
"""Of a search that only compares."""
TRIED = 2
"""Of many starts of a term only these many, the best as they stand, are searched from."""


class _Option(NamedTuple):
    """A form with its numbers, roughly tuned."""

    form: Form
    start: Mapping[str, float]
    """The model's numbers by name."""
    left: PerOutput
    """Rms residual."""
    unseen: Float64[np.ndarray, "folds ny"]
    """That of each fold that was left out."""


def few(kinds: Sequence[str]) -> tuple[str, ...]:
    """The kinds with few numbers: those that are sought so.

    >>> few(("law", "table"))
    ('law',)
    """
    return tuple(name for name in kinds if not isinstance(kind(name), GridTerm))


def sought(setup: Setup, work: Work, without: Formed, horizon: float) -> Formed:
    """The form with the terms that pay, one after another; without one, what was tried."""
    rule, windows = setup.spec.correction, without.problem.windows
    span = max(float(w.t[-1] - w.t[0]) * 1e-9 for w in windows)
    rows = Rows(setup.model, windows, rule.channels, min(horizon, span), rule.quantum)
    candidates = [c for c in propose(rows, few(rule.terms)) if c.tier <= SHAPED]
    asked = asked_of(setup.model, rule.outputs)
    formed, first = without, _now(without)
    now, tried = first, dict[str, float]()
    for _ in range(MOST):
        there = {(t.kind, t.channel, t.source) for t in formed.form.terms}
        rest = [c for c in candidates if c.key[:3] not in there]
        options = [_with(setup, work, (formed, now), candidate) for candidate in rest]
        gains = [_gain(now, option, asked) for option in options]
        tried = dict(zip(map(_label, rest), gains, strict=True)) | tried
        best = options[int(np.argmax(gains))] if gains else now
        if not gains or max(gains) < GAIN:
            break
        again = Formed.of(work, lowest(formed.posed(setup, work, best.form, best.start)), best.form)
        if not again.fit.converged:
            break
        formed, now = again, best
    pairs = zip(rms(first.unseen), rms(now.unseen), strict=True)
    left = without.rms(formed)
    search = {
        "horizon": horizon, "tried": tried, "before": 1.0,
        "after": float(np.mean([b / a for a, b in pairs if a > 0.0])),
        "describes": list(describe(stack_of(setup.model, formed.form, formed.fit.p))),
        "judged": "rms on pieces that its numbers were not tuned on, relative to that without",
        "terms": [{"kind": t.kind, "channel": t.channel} for t in formed.form.terms],
        "tuned": [{"output": o, "without": a, "with": b} for o, a, b in left],
    }  # fmt: skip
    return replace(formed, search=search)


def _label(candidate: Candidate) -> str:
    return " ".join(filter(None, candidate.key))


def _now(formed: Formed) -> _Option:
    problem, values = formed.problem, formed.fit.values
    left = _left(problem, values)
    return _Option(formed.form, {}, left, _unseen(replace(problem, scale=left), values))


def _with(
    setup: Setup, work: Work, before: tuple[Formed, _Option], candidate: Candidate
) -> _Option:
    """One term more: of its starts the one that leaves least."""
    formed, now = before
    stack, options = stack_of(setup.model, formed.form, formed.fit.p), []
    for values in candidate.starts:
        more = stack.plus(candidate.term, values)
        form = Form(tuple(part.term for part in more.parts), formed.form.variant)
        start = dict(zip(more.model.parameters.names, more.p.tolist(), strict=True))
        problem = formed.posed(setup, work, form, start)
        rough = replace(problem.settings, evaluations=EVALUATIONS, tolerance=TOLERANCE)
        options.append((form, replace(problem, scale=now.left, settings=rough)))
    if len(options) > TRIED:
        options = sorted(options, key=lambda o: _share(now.left, _left(o[1], o[1].start)))[:TRIED]
    found = []
    for form, problem in options:
        best = least_squares(problem, problem.settings).values
        found.append((_share(now.left, _left(problem, best)), form, problem, best))
    share, form, problem, best = min(found, key=lambda one: one[0])
    names, p = problem.model.parameters.names, problem.full(best)
    start = dict(zip(names, p[: len(names)].tolist(), strict=True))
    # what does not pay on what it is tuned on does not pay elsewhere
    unseen = _unseen(problem, best) if share < 1.0 - GAIN else np.full_like(now.unseen, np.inf)
    return _Option(form, start, _left(problem, best), unseen)


def _share(before: PerOutput, after: PerOutput) -> float:
    share = after[before > 0.0] / before[before > 0.0]
    return float(np.mean(np.where(np.isfinite(share), share, np.inf))) if len(share) else 1.0


def _gain(now: _Option, option: _Option, asked: Bools) -> float:
    """Relative fall of the residual of what was left out, mean over the outputs that are asked
    about; none where it does not fall in most folds."""
    asked = asked & (now.unseen > 0.0).all(axis=0) & np.isfinite(now.unseen).all(axis=0)
    share = option.unseen[:, asked] / now.unseen[:, asked]
    if not share.size or np.median(share.mean(axis=1)) >= 1.0:
        return 0.0
    return float(1.0 - np.mean(rms(option.unseen)[asked] / rms(now.unseen)[asked]))


def _left(problem: Problem, values: Vector) -> PerOutput:
    return rms(np.where(problem.rows.used, problem.residuals(values), np.nan))


def _unseen(problem: Problem, values: Vector) -> Float64[np.ndarray, "folds ny"]:
    """Rms residual of each fold, with the numbers of the others; infinite where it ran away."""
    pieces = [piece for window in problem.windows for piece in _pieces(window)]
    model, p = problem.model, problem.full(values)[: len(problem.model.parameters)]
    found = []
    for fold in range(FOLDS):
        own = tuple(piece for k, piece in enumerate(pieces) if k % FOLDS == fold)
        others = tuple(piece for k, piece in enumerate(pieces) if k % FOLDS != fold)
        seen = replace(on(problem, others), prior=model.parameters.with_values(p))
        told = seen.full(least_squares(seen, seen.settings).values)[: len(p)]
        unseen = replace(on(problem, own), prior=model.parameters.with_values(told))
        unseen = unseen.tuning(beginning(model, unseen.names))
        found.append(_left(unseen, least_squares(unseen, unseen.settings).values))
    return np.where(np.isfinite(found), found, np.inf)


def _pieces(window: Block) -> list[Block]:
    edges = np.linspace(0, len(window.t), PIECES + 1).astype(int).tolist()
    return [take(window, a, b) for a, b in pairwise(edges)]
