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
    first = {one.name: first_answer(one) for one in asked}
    left = tuple(one for one in asked if first[one.name] is None)
    shares: Sobol | None = None
    answers = {name: answer for name, answer in first.items() if answer is not None}
    if left:
        centred = _centred(replace(problem, editable=tuple(one.name for one in left)))
        shares = sobol(centred, spans_of(centred, asked), seed)
        for k, one in enumerate(left):
            answers[one.name] = _by_share(one, shares, k, negligible)
    fit = _told(problem, answers)
    return Chosen(tuple(_with_fit(answers[one.name], fit) for one in asked), shares, fit)


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


def _told(problem: Problem, answers: dict[str, Choice]) -> Fit | None:
    """The fit of what can be told; what cannot be has that as its answer from then on."""
    while tuned := [one for one in answers.values() if one.editable]:
        tuned.sort(key=lambda one: one.verdict == "overridden")
        fit = solve(replace(problem, editable=tuple(one.name for one in tuned)))
        unclear = {
            name: reason
            for name, reason, verdict in zip(fit.names, fit.reasons, fit.verdict, strict=True)
            if verdict == "not" and answers[name].share is not None
        }
        if not unclear:
            return fit
        weakest = min((answers[name] for name in unclear), key=lambda one: one.share or 0.0)
        told = f"{_figures(weakest)}, but not identifiable: {unclear[weakest.name]}"
        answers[weakest.name] = replace(weakest, editable=False, verdict="indistinct", reason=told)
    return None


def _by_share(one: Question, shares: Sobol, k: int, negligible: float) -> Choice:
    """The answer of the third question, for parameter ``k`` of the analysis."""
    o = int(shares.share[:, k].argmax())
    share, half, effect = (float(v[o, k]) for v in (shares.share, shares.half, shares.effect))
    found = Choice(
        one.name, one.component, True, "tuned", "", share, half, shares.outputs[o], effect
    )
    if share < negligible:
        told = f"negligible: {_figures(found)}, the largest of all outputs, is below {negligible:g}"
        return replace(found, editable=False, verdict="negligible", reason=told)
    seen = "directly" if one.signals[0].how == "direct" else "through physics"
    signals = ", ".join(s.signal for s in one.signals[:3])
    told = f"drifts by {one.drift:.0%} a year, {_figures(found)}, seen {seen} by {signals}"
    return replace(found, reason=told)


def _figures(one: Choice) -> str:
    return f"Sobol share {one.share:.3f} of {one.output}"


def _with_fit(choice: Choice, fit: Fit | None) -> Choice:
    if fit is None or choice.name not in fit.names:
        return choice
    k = fit.names.index(choice.name)
    sigma, weak = float(fit.sigma[k]), fit.verdict[k] == "weak"
    more = f"; weakly determined by these rows: {fit.reasons[k]}" if weak else ""
    return replace(choice, sigma=sigma, value=float(fit.values[k]), reason=choice.reason + more)
