"""Tuning in the stream, for models that are linear in what is tuned: predict first, then learn.

A fit on other data is the prior; from there each test, or the live stream, is predicted for a short
while and then learned, with a memory that forgets towards the prior. Friction that changes from day
to day, and within one, is followed; a prediction never knows the rows that it predicts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evertwin.errors import ConfigError
from evertwin.fold import Block
from evertwin.models import LinearModel, Parameters
from evertwin.setup.evaluation import Prediction
from evertwin.setup.setup import NOT_LINEAR, Setup, matching
from evertwin.sync.horizon.horizon import residuals
from evertwin.tuning import Fit, Problem, Recursive
from evertwin.types import Vector


@dataclass(frozen=True)
class Recursion:
    """Recursive tuning from a fit. Built by `Recursion.after`.

    >>> Recursion.__name__
    'Recursion'
    """

    setup: Setup
    stage: Recursive

    @classmethod
    def after(cls, setup: Setup, problem: Problem, fit: Fit) -> Recursion:
        """Starts from ``fit``: its values are the prior, its residual the noise.

        Raises:
            ConfigError: the model is not linear in what is to be followed.
        """
        rule, model = setup.spec.tuning, problem.model
        if not problem.linear or not isinstance(model, LinearModel):
            raise ConfigError(NOT_LINEAR)
        wears = tuple(name for name in problem.names if name not in setup.once) or problem.names
        followed = matching(problem.names, rule.follow, "tuned parameter") or wears
        prior = _prior(model.parameters.with_values(fit.p), followed, rule.spread)
        raw = replace(problem, filter=None)
        left = np.square(raw.residuals(fit.values))
        rows = np.count_nonzero(np.isfinite(left), axis=0)
        # of an output of which no row told, nothing is learned: how far to trust it is not known
        mean = np.where(rows > 0, np.nansum(left, axis=0), np.inf) / np.maximum(rows, 1)
        scale = rule.caution * np.sqrt(mean)
        every = max(1, round(rule.learn * (setup.spec.clock.rate or 1.0)))
        return cls(
            setup,
            Recursive(
                model, followed, tuple(scale.tolist()), rule.memory, every, prior, setup.gates
            ),
        )

    def predict(self, window: Block) -> Prediction:
        """The window, each stretch predicted before it is learned."""
        _, out = self.stage.step(self.stage.init(), window)
        y = out.rows.y
        residual = residuals(self.stage.model, window, y)
        measured = np.where(np.isnan(residual), np.nan, window.y)
        smooth = self.setup.smooth_window
        if smooth is not None:
            residual, measured, y = smooth(residual), smooth(measured), smooth(y)
        return Prediction(window, measured, y, residual, self.setup.moving(window.u))

    def learned(self, windows: tuple[Block, ...]) -> tuple[tuple[str, ...], Vector, Vector]:
        """Names, values and standard deviations after all windows."""
        state = self.stage.init()
        for window in windows:
            state, _ = self.stage.step(state, window)
        values, sigma = self.stage.estimate(state)
        return self.stage.names, values, sigma


def _prior(parameters: Parameters, followed: tuple[str, ...], spread: float) -> Parameters:
    """A spread relative to each value; a small one relative to the largest of the same unit."""
    sizes: dict[str, float] = {}
    for name in followed:
        item = parameters[name]
        sizes[item.unit] = max(sizes.get(item.unit, 0.0), abs(item.value))
    items = []
    for item in parameters:
        if item.name in followed:
            sigma = spread * (abs(item.value) + 0.2 * sizes[item.unit])
            items.append(replace(item, sigma=max(sigma, 1e-12)))
        else:
            items.append(item)
    return Parameters(tuple(items))
