"""Which parameters to tune: those that drift, that matter, and that the signals can tell.

A parameter has to pass four questions, in this order, and each answer is kept with its figures:

1. does it **change with time**? What no wear effect of the file changes is a constant: it is set
   once, from data sheets;
2. can it be **seen**: does any signal depend on it, and is its component more than a black box?
3. does it **matter**: is its Sobol share of any output above the limit? The ranges lie around the
   values that a first fit finds, so that a start far off does not decide;
4. can it be **told** from the others by these rows? Of those that cannot be told apart the one with
   the smallest share goes first.

The engineer's override goes before all of them.

>>> from evertwin.engineering.parts import ParameterPart
>>> constant = Question("J1", "motor 1", 0.0, "white", ParameterPart(1e-4), ())
>>> first_answer(constant).reason
'constant: no wear effect of motor 1 changes it'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from evertwin.engineering.breakdown import Breakdown
from evertwin.engineering.level import LevelChoice
from evertwin.engineering.mapping import Link, Signal
from evertwin.engineering.parts import ParameterPart
from evertwin.engineering.sensitivity import Sobol, sobol
from evertwin.tuning import Fit, Problem, solve
from evertwin.types import Vector


class Question(NamedTuple):
    """A parameter and what is known of it before any sample is drawn.

    >>> Question("Fc1", "gearbox 1", 0.3, "grey", ParameterPart(1.0), ()).drift
    0.3
    """

    name: str
    """Its name in the model."""
    component: str
    drift: float
    """Expected relative change within a year."""
    level: str
    """Depth of its component's model."""
    said: ParameterPart
    signals: tuple[Signal, ...]
    """Signals that see it."""


@dataclass(frozen=True)
class Choice:
    """One parameter's answer.

    >>> Choice("J1", "motor 1", False, "constant", "constant: …").share is None
    True
    """

    name: str
    component: str
    editable: bool
    verdict: str
    """tuned, constant, unseen, black, negligible, indistinct, or overridden."""
    reason: str
    share: float | None = None
    """Largest Sobol share over the outputs; None: not asked."""
    share_half: float = 0.0
    """Half width of its 95 % interval."""
    output: str = ""
    """Where it is largest."""
    effect: float | None = None
    """Standard deviation that it makes there, relative to the output's rms."""
    sigma: float | None = None
    """Standard deviation of its estimate from these rows, in its unit."""
    value: float | None = None
    """What the first fit finds."""


@dataclass(frozen=True)
class Chosen:
    """The editable set and how it came about.

    >>> Chosen((), None, None).editable
    ()
    """

    choices: tuple[Choice, ...]
    sobol: Sobol | None
    """Over the parameters that came to the third question."""
    fit: Fit | None
    """Of the editable set; None: it is empty."""

    @property
    def editable(self) -> tuple[str, ...]:
        """Names of the parameters to tune."""
        return tuple(one.name for one in self.choices if one.editable)


def questions(
    breakdown: Breakdown, levels: Mapping[str, LevelChoice], found: Sequence[Link]
) -> tuple[Question, ...]:
    """Every parameter of the study's components, also those inside black boxes."""
    seen = {link.parameter: link.signals for link in found}
    return tuple(
        Question(one.name, one.component.name, one.drift, levels[one.component.name].level,
                 one.said, seen.get(one.name, ()))
        for one in breakdown.stated
    )  # fmt: skip


def first_answer(asked: Question) -> Choice | None:
    """The answer of the first two questions; None: it passed both."""
    override = asked.said.override
    if override is not None and override.editable is not None:
        reason = f"overridden: {override.reason}"
        return Choice(asked.name, asked.component, override.editable, "overridden", reason)
    if asked.drift == 0.0:
        reason = f"constant: no wear effect of {asked.component} changes it"
        return Choice(asked.name, asked.component, False, "constant", reason)
    if asked.level == "black":
        reason = f"{asked.component} is a black box: its inner parameters are not tuned"
        return Choice(asked.name, asked.component, False, "black", reason)
    if not asked.signals:
        reason = "cannot be observed: no measured signal depends on it in these rows"
        return Choice(asked.name, asked.component, False, "unseen", reason)
    return None


def choose(problem: Problem, asked: Sequence[Question], negligible: float, seed: int = 1) -> Chosen:
    """The editable set, with a reason for every parameter.

    Args:
        problem: on all parameters of ``asked``; its rows are those that tuning will see.
        asked: see `questions`.
        negligible: Sobol share below which a parameter does not matter.
        seed: of the samples.
    """
    answers = {one.name: first_answer(one) for one in asked}
    candidates = tuple(name for name, answer in answers.items() if answer is None)
    shares: Sobol | None = None
    matter: tuple[str, ...] = ()
    if candidates:
        centred = _centred(replace(problem, editable=candidates))
        shares = sobol(centred, spans_of(centred, asked), seed)
        matter = tuple(
            name
            for k, name in enumerate(candidates)
            if float(shares.share[:, k].max()) >= negligible
        )
    forced = tuple(n for n, answer in answers.items() if answer is not None and answer.editable)
    fit, indistinct = _told(problem, matter, forced, shares)
    out = []
    for one in asked:
        known = answers[one.name]
        if known is None:
            known = _answer(one, shares, negligible, indistinct)
        out.append(_with_fit(known, fit))
    return Chosen(tuple(out), shares, fit)


def spans_of(problem: Problem, asked: Sequence[Question]) -> Vector:
    """Half range of each tuned parameter: its ``uncertain`` share of its value."""
    shares = {one.name: one.said.uncertain for one in asked}
    sizes = np.where(problem.start != 0.0, np.abs(problem.start), problem.sizes)
    return np.array([shares[name] for name in problem.names]) * sizes


def _centred(problem: Problem) -> Problem:
    """Around what a first fit can tell; initial values where it cannot."""
    fit = solve(problem)
    told = {
        name: float(value)
        for name, value, verdict in zip(fit.names, fit.values, fit.verdict, strict=True)
        if verdict == "identifiable"
    }
    return replace(problem, prior=problem.parameters.with_values(told))


def _told(
    problem: Problem, matter: tuple[str, ...], forced: tuple[str, ...], shares: Sobol | None
) -> tuple[Fit | None, dict[str, str]]:
    """The fit of what can be told, and why the others cannot be."""
    left, indistinct = [*matter, *forced], dict[str, str]()
    largest = _largest(shares)
    while left:
        fit = solve(replace(problem, editable=tuple(left)))
        unclear = {
            name: reason
            for name, reason, verdict in zip(fit.names, fit.reasons, fit.verdict, strict=True)
            if verdict == "not" and name not in forced
        }
        if not unclear:
            return fit, indistinct
        weakest = min(unclear, key=lambda name: largest.get(name, 0.0))
        indistinct[weakest] = unclear[weakest]
        left.remove(weakest)
    return None, indistinct


def _largest(shares: Sobol | None) -> dict[str, float]:
    if shares is None:
        return {}
    return dict(zip(shares.names, shares.share.max(axis=0).tolist(), strict=True))


def _answer(
    one: Question, shares: Sobol | None, negligible: float, indistinct: Mapping[str, str]
) -> Choice:
    assert shares is not None
    k = shares.names.index(one.name)
    o = int(shares.share[:, k].argmax())
    share, half = float(shares.share[o, k]), float(shares.half[o, k])
    effect, output = float(shares.effect[o, k]), shares.outputs[o]
    figures = f"Sobol share {share:.3f} of {output}"
    if share < negligible:
        told = f"negligible: {figures}, the largest of all outputs, is below {negligible:g}"
        verdict, editable = "negligible", False
    elif one.name in indistinct:
        told = f"{figures}, but not identifiable: {indistinct[one.name]}"
        verdict, editable = "indistinct", False
    else:
        seen = "directly" if one.signals[0].how == "direct" else "through physics"
        told = f"drifts by {one.drift:.0%} a year, {figures}, seen {seen} by " + ", ".join(
            s.signal for s in one.signals[:3]
        )
        verdict, editable = "tuned", True
    return Choice(one.name, one.component, editable, verdict, told, share, half, output, effect)


def _with_fit(choice: Choice, fit: Fit | None) -> Choice:
    if fit is None or choice.name not in fit.names:
        return choice
    k = fit.names.index(choice.name)
    sigma, weak = float(fit.sigma[k]), fit.verdict[k] == "weak"
    more = f"; weakly determined by these rows: {fit.reasons[k]}" if weak else ""
    return replace(choice, sigma=sigma, value=float(fit.values[k]), reason=choice.reason + more)
