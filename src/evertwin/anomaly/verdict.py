"""Normal or abnormal? Tested, not guessed.

A deviation was suspected, and the window was tuned. The answer is read from what is left:

* the tuned residual is independent of the inputs, output by output and along what each input does
  to all of them: the parameters had moved, *normal*;
* it still depends on the inputs, or tuning had to leave the bounds: the form is wrong, *abnormal*.

Dependence is tested on each input and on its change since the prediction began (a missing lag shows
there), with as many effective rows as the residual's memory leaves. What a command leaves that acts
up to a row sooner or later than its row says is no dependence. With enough rows any model
fails such a test, so size counts too: the part of the *first* deviation that inputs still explain,
share of the tuned residual times what tuning left, has to reach ``part``. Of an output that was
within what is asked it is the part of that: what is as true as it has to be is of no wrong form.

Competing refits name the cause: each tunes its own parameters on the same window, and the one that
explains the larger share of the deviation is the cause, if it explains enough and leads clearly.
What counts as a parameter is the twin file's choice: a cause whose parameters are not editable is
*abnormal*, however well it fits.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> from evertwin.tuning import Problem, solve
>>> gain = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(v="m/s"),
...     Layout.of(speed="m/s"), parameters=Parameters.of(gain=(1.0, "1")))
>>> rng = np.random.default_rng(0)
>>> v = rng.uniform(0, 0.2, (400, 1))
>>> def judged(speed):
...     noisy = speed + rng.normal(0, 0.002, (400, 1))
...     problem = Problem(gain, (make_block(t=np.arange(400), u=v, y=noisy),))
...     return branch(solve(problem), problem).kind
>>> judged(1.1 * v), judged(np.where(v < 0.06, 0.0, v))
('normal', 'abnormal')
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.anomaly.along import along, effects, late, timed
from evertwin.fold import plain
from evertwin.models.kernels.kernel import CONTINUE
from evertwin.signals.sizes import rms_of
from evertwin.tuning import Dependence, Fit, Problem
from evertwin.tuning.residuals.autocorrelation import Correlation
from evertwin.tuning.residuals.classes import Classes
from evertwin.tuning.residuals.statistics import depends
from evertwin.types import Float64, Inputs, Json, Outputs, PerOutput


@dataclass(frozen=True)
class Rule:
    """When a residual still depends on an input, and when a cause has a name.

    >>> Rule().part
    0.05
    """

    chance: float = 0.01
    """Largest probability that the dependence is chance."""
    part: float = 0.05
    """Least part of the first deviation that an input still explains after tuning."""
    enough: float = 0.5
    """Share of the deviation that a cause has to explain."""
    lead: float = 0.1
    """Share by which it has to lead."""


@dataclass(frozen=True)
class Verdict:
    """Normal or abnormal, with its cause and evidence.

    >>> Verdict("normal", "friction", "friction explains 91 % of the deviation").kind
    'normal'
    """

    kind: str
    """normal: the parameters had moved. abnormal: the form is wrong. noise: neither can be told,
    since what is measured scatters by more than is asked."""
    cause: str
    """Name of the refit that explains the deviation; empty where none does."""
    reason: str
    shares: Mapping[str, float] = field(default_factory=dict)
    """Share of the deviation that each refit explains."""
    evidence: Mapping[str, Json] = field(default_factory=dict)
    alone: bool = False
    """Abnormal, and no other form may be tried: tuned numbers are all there is."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", plain(self.evidence))


def branch(
    fit: Fit,
    problem: Problem,
    refits: Mapping[str, Fit] | None = None,
    editable: frozenset[str] | None = None,
    rule: Rule | None = None,
    asked: PerOutput | None = None,
) -> Verdict:
    """The verdict on a tuned window.

    Args:
        fit: the tuning of what may be tuned.
        problem: what it was tuned on.
        refits: cause → tuning of that cause's parameters on the same window, from the same start.
        editable: names of the parameters that may be tuned; default: those of the problem.
        rule: limits of the tests.
        asked: rms residual that is allowed, (ny,); None: any dependence counts, however small.
    """
    rule = rule or Rule()
    allowed = frozenset(problem.names) if editable is None else editable
    shares = {name: explained(refit, fit.noise) for name, refit in (refits or {}).items()}
    cause = _cause(shares, rule)
    left = 1.0 - explained(fit, fit.noise)
    before = np.fmax([r.rms_before for r in fit.residuals], 0.0 if asked is None else asked)
    worst, part, sooner = _dependence(fit, problem, rule, before)
    evidence: dict[str, Any] = {
        "explained": 1.0 - left, "shares": shares, "dependence": worst and worst._asdict(),
        "part": part, "white": {r.output: r.whiteness for r in fit.residuals},
        "at_bound": fit.at_bound, "converged": fit.converged, "sooner": sooner,
    }  # fmt: skip

    def verdict(kind: str, reason: str) -> Verdict:
        return Verdict(kind, cause, reason, shares, evidence)

    if cause:
        named = f"{cause} explains {100 * shares[cause]:.0f} % of the deviation"
        foreign = [name for name in (refits or {})[cause].names if name not in allowed]
        if foreign:
            return verdict("abnormal", f"{named}, and {', '.join(foreign)} may not be tuned")
    if not fit.converged:
        return verdict("abnormal", f"tuning found no parameters: {fit.message}")
    if fit.at_bound:
        return verdict("abnormal", f"tuning drives {', '.join(fit.at_bound)} to a bound")
    if worst is not None:
        return verdict(
            "abnormal",
            f"after tuning {worst.output} still depends on {worst.input}: it explains "
            f"{100 * worst.share:.0f} % of what is left, {100 * part:.0f} % of the deviation",
        )
    if cause:
        return verdict("normal", named)
    return verdict(
        "normal",
        f"tuning explains {100 * (1.0 - left):.0f} % of the deviation, and no input explains "
        f"what is left{'' if sooner is None else ', beyond when within a row it acts'}",
    )


def explained(fit: Fit, noise: np.ndarray) -> float:
    """Share of the sum of squares that a fit takes away, outputs weighted by their ``noise``."""
    rows = np.array([r.rows for r in fit.residuals], dtype=np.float64)
    rms = np.array([(r.rms_before, r.rms_after) for r in fit.residuals]).T
    if np.isinf(rms).any():  # what ran away and does so no more is explained altogether
        return float(not np.isinf(rms[1]).any())
    # the noise of exact data is no number to divide by: beside the rounding of what it weighs
    noise = np.maximum(noise, np.finfo(np.float64).eps * np.fmax(*rms))
    before, after = np.nansum(rows * (rms / np.where(noise > 0, noise, 1.0)) ** 2, axis=1)
    return 1.0 - float(after) / float(before) if before > 0 else 0.0


def _cause(shares: Mapping[str, float], rule: Rule) -> str:
    """The refit that explains enough and leads clearly; empty if there is none."""
    ranked = sorted(shares, key=lambda name: -shares[name])
    if not ranked or shares[ranked[0]] < rule.enough:
        return ""
    if len(ranked) > 1 and shares[ranked[0]] - shares[ranked[1]] < rule.lead:
        return ""
    return ranked[0]


def _dependence(
    fit: Fit, problem: Problem, rule: Rule, first: PerOutput
) -> tuple[Dependence | None, float, Float64[np.ndarray, " nu"] | None]:
    """The dependence that weighs most, None if none counts; its part of the deviation; and the rows
    by which inputs act sooner, where all there is of it is that."""
    found = _weightiest(problem.residuals(fit.values), fit, problem, rule, first)
    if found[0] is None:
        return *found, None
    if not len(problem.model.states):
        left = late(problem.residuals(fit.values), problem.predict(fit.values), problem.rows.dt > 0)
        again = _weightiest(left, fit, problem, rule, first)
        return *(again if again[0] is None else found), None
    left, sooner = timed(problem, fit.values, fit.noise)
    found = _weightiest(left, fit, problem, rule, first)
    return *found, sooner if found[0] is None else None


def _weightiest(
    left: Outputs, fit: Fit, problem: Problem, rule: Rule, first: PerOutput
) -> tuple[Dependence | None, float]:
    """The same of residuals after tuning; ``first``: what each output's are a part of."""
    rows, model = problem.rows, problem.model
    names, outputs = model.inputs.names, model.outputs.names
    before = dict(zip(outputs, first.tolist(), strict=True))
    after = {name: rms_of(column, 0.0) for name, column in zip(outputs, left.T, strict=True)}
    if len(outputs) > 1 and len(model.states):
        start, told = problem.residuals(problem.start), [*left.T]
        for name, effect in zip(names, effects(problem, fit.values), strict=True):
            now, was = (along(effect, r, fit.noise) for r in (left, start))
            told.append(now)
            outputs = (*outputs, f"the effect of {name}")
            before[outputs[-1]], after[outputs[-1]] = rms_of(was, 0.0), rms_of(now, 0.0)
        left = np.stack(told, axis=1)
    found = depends(
        Correlation.of(left),
        rows.classes.beside(Classes.of(_change(rows.u, problem.restart.code))),
        outputs,
        (*names, *(f"change of {name}" for name in names)),
    )
    worst, most = None, 0.0
    for one in found:
        if not (one.p <= rule.chance and before[one.output] > 0):
            continue
        part = one.share * (after[one.output] / before[one.output]) ** 2
        if part >= max(rule.part, most):
            worst, most = one, part
    return worst, most


def _change(u: Inputs, code: np.ndarray) -> Inputs:
    """Inputs less those where the prediction began; less those of the row before if static."""
    if (code == CONTINUE).all():
        return np.diff(u, axis=0, prepend=u[:1])
    began = np.maximum.accumulate(np.where(code != CONTINUE, np.arange(len(code)), 0))
    return np.asarray(u - u[began])
