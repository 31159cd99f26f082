"""A fit and the form that it is of, and a form whose numbers are all tuned together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evertwin.models.corrected.corrected import build
from evertwin.models.form import Form
from evertwin.refit.work import Work
from evertwin.refit.workers import formed as formed_far
from evertwin.setup.setup import Setup
from evertwin.tuning import Fit, Problem, own_names
from evertwin.tuning.posing.hidden_starts import own_starts


@dataclass(frozen=True)
class Formed:
    """A fit and the form that it is of.

    >>> Formed.__name__
    'Formed'
    """

    problem: Problem
    fit: Fit
    form: Form
    search: Mapping[str, Any] = field(default_factory=dict)
    """Held-out deviations before and after, and what was tried; empty without a search."""

    def posed(self, setup: Setup, work: Work, form: Form, start: Mapping[str, float]) -> Problem:
        """Another form on the same rows, all its numbers to be tuned from ``start``."""
        model, count = build(setup.model, form), len(self.problem.windows)
        settings = self.problem.settings
        names = (*own_names(model, work.tunable(model), count), *own_starts(model, count))
        return replace(
            self.problem, model=model, editable=names, prior=model.parameters.with_values(start),
            settings=replace(settings, begin=(), far=formed_far(settings.far, setup.spec, form)),
        )  # fmt: skip

    @classmethod
    def of(
        cls, work: Work, problem: Problem, form: Form, search: Mapping[str, Any] | None = None
    ) -> Formed:
        """A problem of a form, tuned."""
        problem, fit, _ = work.tune(problem)
        return cls(problem, fit, form, search or {})

    def rms(self, other: Formed) -> list[tuple[str, float, float]]:
        """(output, rms residual of this fit, of the other)."""
        return [
            (a.output, a.rms_after, b.rms_after)
            for a, b in zip(self.fit.residuals, other.fit.residuals, strict=True)
            if np.isfinite(a.rms_after) and np.isfinite(b.rms_after)
        ]

    def left(self, other: Formed, outputs: Sequence[str]) -> float:
        """What the other leaves of the rms residual, mean over the outputs; none: over all."""
        pairs = self.rms(other)
        asked = outputs or [output for output, _, _ in pairs]
        return float(np.mean([b / a for output, a, b in pairs if a > 0 and output in asked]))
