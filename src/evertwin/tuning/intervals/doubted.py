"""What is not called identifiable, however narrow its interval."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evertwin.models import Model
from evertwin.signals.spoken import times
from evertwin.tuning.intervals.followed import missed
from evertwin.tuning.intervals.identifiability import WEAK, within
from evertwin.tuning.linear.sensitivity import Sensitivity
from evertwin.tuning.posing.problem import Problem
from evertwin.types import PerOutput, Vector

FAR = 2.0
"""Times its size by which an output is off where the model goes astray."""
MISSED = 0.7
"""Share of what an output does from which on it is not followed: half of its variance."""
WORSE = "more is left than if it stayed where it is"
FEW = "no more values than numbers: none is left that tells what they err by"


def strays(model: Model, relative: Sequence[float]) -> str:
    """Why nothing can be told by a model that follows no output at all; else empty."""
    known = [one for one in zip(relative, model.outputs.names, strict=True) if one[0] == one[0]]
    off, name = min(known, default=(0.0, ""))
    if off <= FAR or not len(model.states):
        return ""
    return (
        f"the model goes astray: {name} is off by {times(off)}, so shorter predictions "
        "are needed, or a measurement of what runs away"
    )


def misled(
    problem: Problem, values: Vector, acting: Sensitivity, rows: PerOutput, astray: str
) -> tuple[str, ...]:
    """Why the rows mislead about each parameter, (k,); empty texts where nothing says so: the model
    goes ``astray``, does not follow an output that it acts on, or no value is left beyond those
    that the numbers take.

    Args:
        values: of the tuned parameters, (k,).
        rows: of each output that count, (ny,).
    """
    names, why = problem.model.outputs.names, [astray] * len(values)
    if len(problem.model.states) and not astray:
        for share, name, acts in zip(missed(problem, values), names, acting.acts, strict=True):
            if share > MISSED:
                much = f"{100 * share:.0f} % of what it does is left" if share < 1.0 else WORSE
                said = f"{name} is not followed: {much}, and is no noise"
                why = [said if on else one for one, on in zip(why, acts.tolist(), strict=True)]
    spare = beyond(problem, acting, rows) < 1.0
    return tuple(FEW if few else one for one, few in zip(why, spare.tolist(), strict=True))


def beyond(problem: Problem, acting: Sensitivity, rows: PerOutput) -> Vector:
    """How many values more than numbers the outputs have that each parameter acts on, (k,);
    infinite where the noise is given."""
    if problem.scale is not None:
        return np.full(acting.acts.shape[1], np.inf)
    acts = acting.acts.astype(np.float64)
    return np.asarray(rows @ acts - np.count_nonzero(acts.T @ acts, axis=1))


def doubted(
    problem: Problem, values: Vector, half: Vector, judged: tuple[Sequence[str], Sequence[str]],
    why: Sequence[str],
) -> tuple[tuple[str, ...], tuple[str, ...]]:  # fmt: skip
    """Not called identifiable: what is not told from zero, or resists and was fitted below it, is
    on a bound, so that it is one only because of that, or of which rows mislead (``why``)."""
    words, reasons = map(list, judged)
    for k, (value, place) in enumerate(zip(values.tolist(), problem.places.tolist(), strict=True)):
        if words[k] != "identifiable":
            continue
        if why[k]:
            words[k], reasons[k] = "weak", why[k]
        elif half[k] >= abs(value):
            words[k] = "weak"
            reasons[k] = f"not told from zero: {value - half[k]:.3g} to {value + half[k]:.3g}"
        elif len(problem.model.states) and half[k] > WEAK * abs(value):
            words[k] = "weak"  # a start that was far too large is no measure of it
            reasons[k] = f"its 95 % interval is {within(half[k] / abs(value), 'value')}"
        elif value < 0 and problem.parameters.items[place].resists:
            words[k] = "weak"
            reasons[k] = "negative, so it would drive: the rows or the form mislead it"
    return tuple(words), tuple(reasons)


def on_bounds(
    problem: Problem, values: Vector, hit: Sequence[str], judged: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(verdicts, what is said of a number that ended on its bound): at least, or at most that."""
    words, said = list(judged), [""] * len(judged)
    ends = zip(problem.names, values.tolist(), *problem.bounds, strict=True)
    for k, (name, value, low, high) in enumerate(ends):
        if name in hit:
            words[k] = "weak" if words[k] == "identifiable" else words[k]
            most = abs(value - low) < abs(value - high)
            said[k] = f"ended on its bound: at {'most' if most else 'least'} {value:.3g}"
    return tuple(words), tuple(said)
