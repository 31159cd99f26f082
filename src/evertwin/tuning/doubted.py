"""What is not called identifiable, however narrow its interval."""

from __future__ import annotations

from collections.abc import Sequence

from evertwin.models import Model
from evertwin.signals.spoken import times
from evertwin.tuning.identifiability import WEAK, within
from evertwin.tuning.problem import Problem
from evertwin.types import Vector

FAR = 2.0
"""Times its size by which an output is off where the model goes astray."""


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


def doubted(
    problem: Problem, values: Vector, half: Vector, judged: tuple[Sequence[str], Sequence[str]],
    astray: str,
) -> tuple[tuple[str, ...], tuple[str, ...]]:  # fmt: skip
    """Not called identifiable: what is not told from zero, or resists and was fitted below it, and
    nothing of a model that goes ``astray``."""
    words, why = map(list, judged)
    for k, (value, place) in enumerate(zip(values.tolist(), problem.places.tolist(), strict=True)):
        if words[k] != "identifiable":
            continue
        if astray:
            words[k], why[k] = "weak", astray
        elif half[k] >= abs(value):
            words[k] = "weak"
            why[k] = f"not told from zero: {value - half[k]:.3g} to {value + half[k]:.3g}"
        elif len(problem.model.states) and half[k] > WEAK * abs(value):
            words[k] = "weak"  # a start that was far too large is no measure of it
            why[k] = f"its 95 % interval is {within(half[k] / abs(value), 'value')}"
        elif value < 0 and problem.parameters.items[place].resists:
            words[k] = "weak"
            why[k] = "negative, so it would drive: the rows or the form mislead it"
    return tuple(words), tuple(why)
