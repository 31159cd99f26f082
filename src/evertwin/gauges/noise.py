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

import numpy as np

from evertwin.fold import Block
from evertwin.gauges.unlike import changes
from evertwin.models import Model
from evertwin.models.kernel import CONTINUE
from evertwin.setup.evaluation import off_after
from evertwin.setup.setup import Setup
from evertwin.tuning import Fit, Problem
from evertwin.types import ParameterVector, Vector

ROWS = 30
"""Steps below which a scatter cannot be told."""
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
        if setup.static:
            y = [change.measured[:, k] for change in found]
            level = min(level, scatter([np.diff(one[np.isfinite(one)]) for one in y], static=True))
        out.append(level)
    return np.array(out)


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


def buried(setup: Setup, problem: Problem, fit: Fit) -> str:
    """Why tuning cannot reach what is asked: the measurement scatters by more; else nothing."""
    off = off_after(setup, problem, fit)
    beyond = np.flatnonzero(setup.watched & (off > setup.requirement))
    if not len(beyond):
        return ""
    level = noise(setup, problem.model, fit.p, problem.windows)
    least = floor(setup, level, problem.windows)
    predictions = int((problem.restart.code != CONTINUE).sum())
    more = max(MORE, 1.0 + CHANCE * math.sqrt(2.0 / max(predictions, 1)))
    alone = (least > setup.requirement) & (off**2 <= more * least**2)
    if not alone[beyond].all():
        return ""
    k = int(beyond[np.argmax(least[beyond])])
    share = setup.shown(k, min(least[k], off[k]))
    return (
        f"the noise of {problem.model.outputs.names[k]}'s measurement alone makes "
        f"{share} of it, which no model can foretell: allow more, or measure better"
    )
