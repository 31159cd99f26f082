"""Valleys: directions along which other values of a model with a state fit as well.

A valley is straight only near the values that were found. Of a shaft whose two inertias are told
only by their sum, the stiffness that fits is largest where they are equal: there no small step
tells that it hangs on them, and its interval would be narrow about a wrong number. So each valley
is walked a part of the numbers' size, and what the others have to change to fit again is counted.

>>> valley(("a", "b"), ("not", "identifiable"), np.array([True, True]))
'; a valley: other values of a fit as well'
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evertwin.signals.spoken import MOST, number
from evertwin.tuning.intervals.identifiability import NULL
from evertwin.tuning.linear.closed import dense
from evertwin.tuning.linear.sensitivity import Sensitivity, Spectrum
from evertwin.tuning.posing.problem import Problem
from evertwin.types import Outputs, PerOutput, Vector

REACH = 0.3
"""How far a valley is walked, in natural sizes of the number that changes most."""
NOTHING = 4.0
"""Change of the weighted sum of squares that no row would notice."""


def bends(
    problem: Problem, values: Vector, acting: Sensitivity, sigma: PerOutput
) -> tuple[Vector, str]:
    """Standard deviation that the bends of the valleys add to each parameter, (k,), and where
    beside the values the simulation diverges: no valley leads there.

    Args:
        values: where the search ended, (k,).
        acting: sensitivity there.
        sigma: noise of each output, (ny,).
    """
    information, found, edge = acting.information(sigma), np.zeros(len(values)), ""
    length, squares, vectors = Spectrum.of(information)
    # what starts at zero has no size of its own
    sizes = np.where(problem.start != 0.0, problem.sizes, np.inf)
    length = np.where(length > 0.0, length, np.inf)
    told = squares > NULL**2
    inverse = (vectors[:, told] / squares[told]) @ vectors[:, told].T / np.outer(length, length)
    columns = np.where(acting.used[:, :, None], dense(acting.columns, acting.at, len(values)), 0.0)
    for vector in vectors.T:
        step = vector / length
        step *= REACH / max(float(np.max(np.abs(step) / sizes)), 1e-300)
        if not 0.0 <= step @ information @ step < NOTHING:
            continue
        ends = [np.clip(values + sign * step, *problem.bounds) for sign in (-1.0, 1.0)]
        for end, r in zip(ends, problem.residuals_of(ends), strict=True):
            if lost := _diverged(problem, r):
                edge = edge or lost.format(_named(problem, end, np.abs(end - values) / sizes))
                continue
            left = np.where(acting.used & np.isfinite(r), r, 0.0) / sigma / sigma
            change = end - values + inverse @ np.einsum("iok,io->k", columns, left)
            # a bend grows with the square of the way, and a valley may go on for a size
            found = np.maximum(found, np.abs(change) / (2.0 * REACH**2))
    return found, edge


def _diverged(problem: Problem, r: Outputs) -> str:
    """Where a simulation runs away, if it does; {} stands for with which value."""
    used = problem.rows.used
    size = np.max(np.abs(np.where(used, problem.rows.y, 0.0)), axis=0, initial=0.0)
    lost = used & ~(np.abs(r) < MOST * np.where(size > 0.0, size, 1.0))
    if not lost.any():
        return ""
    row, output = (int(i) for i in np.argwhere(lost)[0])
    name = problem.model.outputs.names[output]
    return (
        f"; with {{}} the simulation runs away ({name}, row {row}): take shorter steps inside the "
        "model, or a bound"
    )


def _named(problem: Problem, values: Vector, moved: Vector) -> str:
    """The value that moved most of its size."""
    j = int(np.argmax(moved))
    unit = problem.parameters.items[problem.places[j]].unit
    return f"{problem.names[j]} = {number(values[j], '' if unit == '1' else unit, 3)}"


def valley(names: Sequence[str], verdicts: Sequence[str], moved: np.ndarray) -> str:
    """Says which values are some of many that fit alike; empty where what is not told stayed."""
    rows = zip(names, verdicts, moved.tolist(), strict=True)
    open_ = ", ".join(name for name, verdict, new in rows if new and verdict == "not")
    return f"; a valley: other values of {open_} fit as well" if open_ else ""
