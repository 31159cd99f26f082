"""How much a measurement scatters by itself, from a residual that goes row by row.

What nothing can foretell is no error of a model: where it alone makes the deviation, the answer is
that less cannot be reached.

>>> rng = np.random.default_rng(0)
>>> drift = np.cumsum(rng.normal(0.0, 0.01, 2000))
>>> round(scatter([np.diff(drift + rng.normal(0.0, 1.0, 2000), 2)], static=False), 1)
1.0
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block
from evertwin.gauges.changes.change import likely, split
from evertwin.gauges.rows.foretold import Past, clipped
from evertwin.gauges.rows.unlike import changes
from evertwin.models import Model
from evertwin.models.kernels.kernel import CONTINUE
from evertwin.rows.alignment import apart
from evertwin.rows.ring import called
from evertwin.setup.evaluation import off_after
from evertwin.setup.setup import Setup
from evertwin.tuning import Fit, Problem
from evertwin.types import Bools, Int64, Outputs, ParameterVector, PerOutput, Vector

ROWS = 30
"""Steps below which a scatter cannot be told."""
NEW = 4
"""So many times that of rows since a measurement scatters more."""
COARSE = 0.9
"""Share of a sensor's rows up to which it changes if it is coarse."""
LITTLE = 0.1
"""Share of a residual that may be foretold for it to be called noise."""
GROWS = 1.5
"""Times that a mean square grows at a row, from which on something happened there."""
PIECES = 4
"""Of so many rows as a deviation is judged on, from which on their spread can be told."""
MORE, CHANCE = 1.25, 3.0
"""How many times what noise makes a mean square may be for nothing else to be said of it: so many,
or what few predictions leave to chance, in standard deviations of a mean square."""


def noise(setup: Setup, model: Model, p: ParameterVector, windows: Iterable[Block]) -> Vector:
    """Standard deviation of each output's measurement, (ny,); NaN where it cannot be told."""
    found = [changes(model, p, window, 1e-9) for window in windows]
    out = []
    for k in range(len(model.outputs)):
        off = [(change.measured - change.predicted)[:, k] for change in found]
        steps = [np.diff(r[np.isfinite(r)]) for r in off]
        level = scatter(steps, static=not setup.adopts[k])
        y = [np.diff(change.measured[np.isfinite(change.measured[:, k]), k]) for change in found]
        if setup.static:
            level = min(level, scatter(y, static=True))
        out.append(max(level, rounding(y)))
    return np.array(out)


def rounding(steps: Sequence[np.ndarray]) -> float:
    """What a coarse sensor's rounding scatters by, from the differences of neighbouring rows: most
    are nothing, and the smallest of the others is its step.

    >>> round(rounding([np.array([0.0, 0.0, 0.1, 0.0, -0.1])]), 3)
    0.029
    """
    whole = np.abs(np.concatenate([np.zeros(1), *steps]))
    moved = whole[whole > 1e-9 * whole.max()]
    coarse = len(moved) and len(moved) < COARSE * len(whole)
    return float(moved.min() / math.sqrt(12.0)) if coarse else 0.0


def scatter(steps: Sequence[np.ndarray], *, static: bool) -> float:
    """Noise from differences of neighbouring residuals, outliers clipped.

    Args:
        steps: the differences, a series a recording.
        static: no state takes the output over: each row is a prediction of its own, so that a
            difference holds its noise twice; else it is one of a change, which holds that of the
            row before, too.
    """
    whole = np.concatenate(steps)
    if len(whole) < ROWS:
        return math.nan
    spread = float(np.median(np.abs(whole))) / 0.6745
    if static:
        return spread / math.sqrt(2)
    # n(i+1) − 2·n(i) + n(i−1): from row to row its covariance is −4·σ², and drifts cancel
    clipped = [np.clip(d, -5 * spread, 5 * spread) for d in steps]
    pairs = sum(max(len(d) - 1, 0) for d in clipped)
    total = sum(float((d[1:] * d[:-1]).sum()) for d in clipped)
    return math.sqrt(max(-total / max(pairs, 1) / 4, 0.0))


def floor(setup: Setup, level: Vector, windows: Sequence[Block]) -> Vector:
    """What noise alone makes of each output's deviation, as the requirement has it, (ny,)."""
    rule, rate = setup.spec.filter, setup.spec.clock.rate
    passed = 1.0 if rule is None or rate is None else math.sqrt(min(1.0, 2 * rule.cutoff / rate))
    found = passed * level * np.where(setup.adopts, math.sqrt(2), 1.0)
    size = setup.sizes(np.concatenate([np.where(setup.moving(w.u), w.y, np.nan) for w in windows]))
    return np.asarray(np.divide(found, size, out=np.zeros_like(found), where=size > 0.0))


class Buried(NamedTuple):
    """Why tuning cannot reach what is asked: noise alone makes more.

    >>> Buried("", np.array([0.2])).level.tolist()
    [0.2]
    """

    reason: str
    """Empty where it is so of some of the outputs that are off by more than what is asked."""
    level: PerOutput
    """Rms that it makes of each output's residual at most; 0: less than what is asked."""


def buried(setup: Setup, problem: Problem, fit: Fit, share: float) -> Buried | None:
    """What noise makes of the deviation; None where it is not noise that makes it, of any output.

    Args:
        share: of what is left, what an input explains.
    """
    off = off_after(setup, problem, fit)
    beyond = np.flatnonzero(setup.watched & (off > setup.requirement))
    if not len(beyond):
        return None
    level = noise(setup, problem.model, fit.p, problem.windows)
    least = floor(setup, level, problem.windows)
    alone = _alone(setup, problem, off, least)
    k = int(beyond[np.argmax(least[beyond])])
    whose = f"the noise of {problem.model.outputs.names[k]}'s measurement"
    cure = "allow more, or measure better"
    if not alone[beyond].all():
        if risen := _risen(setup, problem, fit, beyond):
            return risen
        if not setup.static or share > LITTLE or _foretold(setup, problem, fit, beyond) > LITTLE:
            some = beyond[alone[beyond]]
            return Buried("", _levels(setup, problem, fit, some, 0)) if len(some) else None
        k, least = int(beyond[np.argmax(off[beyond])]), off
        whose = f"noise of what {problem.model.outputs.names[k]} is predicted from"
        cure = "allow more, smooth it ([filter]), or measure better"
    told = setup.shown(k, min(least[k], off[k]))
    return Buried(
        f"{whose} alone makes {told} of it, which no model can foretell: {cure}",
        _levels(setup, problem, fit, beyond, 0),
    )


def _alone(
    setup: Setup, problem: Problem, off: PerOutput, least: PerOutput, place: int = 0
) -> Bools:
    """Outputs of which noise alone makes what is off, from a row on, and more than is asked."""
    predictions = int((problem.restart.code[place:] != CONTINUE).sum())
    more = max(MORE, 1.0 + CHANCE * math.sqrt(2.0 / max(predictions, 1)))
    return np.asarray((least > setup.requirement) & (off**2 <= more * least**2))


def _risen(
    setup: Setup, problem: Problem, fit: Fit, beyond: Int64[np.ndarray, " k"]
) -> Buried | None:
    """Noise that came with the rows from which on more is left: a measurement got worse."""
    rows, left = problem.rows, problem.residuals(fit.values)
    left = np.where(rows.moving, left, np.nan)
    place = likely(left[:, beyond])
    windows = split(problem.windows, place)[1]
    if not place or setup.relative or sum(len(w.t) for w in windows) < NEW * ROWS:
        return None
    level = noise(setup, problem.model, fit.p, windows)
    least, off = floor(setup, level, windows), np.sqrt(np.nanmean(np.square(left[place:]), axis=0))
    worse = beyond[off[beyond] > setup.requirement]
    if not len(worse) or not _alone(setup, problem, off, least, place)[worse].all():
        return None
    k = int(worse[np.argmax(least[worse])])
    told, since = setup.shown(k, min(least[k], off[k])), called(windows[0].row)
    return Buried(
        f"from {since} on the noise of {problem.model.outputs.names[k]}'s measurement alone makes "
        f"{told} of it, more than before, which no model can foretell: look at its sensor, allow "
        "more, or measure better", _levels(setup, problem, fit, worse, place),
    )  # fmt: skip


def _levels(
    setup: Setup, problem: Problem, fit: Fit, noisy: Int64[np.ndarray, " k"], place: int
) -> PerOutput:  # fmt: skip
    """Rms that what is left of each noisy output comes to by chance, from a row on; else 0."""
    count = len(problem.model.outputs)
    return np.array([_most(setup, problem, fit, k, place) if k in noisy else 0.0
                     for k in range(count)])  # fmt: skip


def _most(setup: Setup, problem: Problem, fit: Fit, k: int, place: int) -> float:
    """Rms that what is left of an output comes to by chance, on so many rows as it is judged on."""
    rows, left = problem.rows, problem.residuals(fit.values)[:, k].copy()
    left[:place] = np.nan
    squares = np.square(left[rows.moving[:, k] & np.isfinite(left)])
    pieces = len(squares) // setup.enough
    mean, spread = float(squares.mean()), 0.0
    if pieces >= PIECES:
        parts = squares[: pieces * setup.enough].reshape(pieces, -1).mean(axis=1)
        spread = CHANCE * float(parts.std(ddof=1))
    return math.sqrt(max(mean + spread, MORE**2 * mean))


def _foretold(setup: Setup, problem: Problem, fit: Fit, outputs: np.ndarray) -> float:
    """The largest share of what is left of these outputs that could have been foretold."""
    rows, left = problem.rows, problem.residuals(fit.values)
    left = np.where(rows.moving, left, np.nan)
    bulk = np.stack([clipped(left[:, k]) for k in outputs], axis=1)
    if (place := likely(bulk)) and _grows(bulk, place):
        return 1.0
    window = np.repeat(np.arange(len(problem.windows)), [len(w.t) for w in problem.windows])
    past = Past(rows.u, window, apart(setup.spec))
    return max(past.share(left[:, k]) for k in outputs)


def _grows(left: Outputs, place: int) -> bool:
    """Is more left from a row on? Noise begins nowhere."""
    before, after = (np.nanmean(np.square(part)) for part in (left[:place], left[place:]))
    return bool(after > GROWS * before)
