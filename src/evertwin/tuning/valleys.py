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

from evertwin.tuning.closed import dense
from evertwin.tuning.identifiability import NULL
from evertwin.tuning.problem import Problem
from evertwin.tuning.sensitivity import Sensitivity, Spectrum
from evertwin.types import PerOutput, Vector

REACH = 0.3
"""How far a valley is walked, in natural sizes of the number that changes most."""
NOTHING = 4.0
"""Change of the weighted sum of squares that no row would notice."""


def bends(problem: Problem, values: Vector, acting: Sensitivity, sigma: PerOutput) -> Vector:
    """Standard deviation that the bends of the valleys add to each parameter, (k,).

    Args:
        values: where the search ended, (k,).
        acting: sensitivity there.
        sigma: noise of each output, (ny,).
    """
    information, found = acting.information(sigma), np.zeros(len(values))
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
            left = np.where(acting.used & np.isfinite(r), r, 0.0) / sigma / sigma
            change = end - values + inverse @ np.einsum("iok,io->k", columns, left)
            # a bend grows with the square of the way, and a valley may go on for a size
            found = np.maximum(found, np.abs(change) / (2.0 * REACH**2))
    return found


def valley(names: Sequence[str], verdicts: Sequence[str], moved: np.ndarray) -> str:
    """Says which values are some of many that fit alike; empty where what is not told stayed."""
    rows = zip(names, verdicts, moved.tolist(), strict=True)
    open_ = ", ".join(name for name, verdict, new in rows if new and verdict == "not")
    return f"; a valley: other values of {open_} fit as well" if open_ else ""
