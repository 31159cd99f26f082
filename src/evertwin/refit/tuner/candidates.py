"""Versions that were tuned or corrected, as candidates: other rows have to prove them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evertwin.anomaly.verdict import explained
from evertwin.fold import Windows
from evertwin.gauges.rows.settled import clearly_worse
from evertwin.models.form import Form, Version
from evertwin.refit.answer_events import event
from evertwin.refit.numbers.recursive_fit import Recursion
from evertwin.refit.numbers.undetermined import known, weakened
from evertwin.refit.tuner.tuner import Tuner
from evertwin.setup.evaluation import scale_of, sizes
from evertwin.trial import admit
from evertwin.tuning import Fit, Problem


@dataclass(frozen=True)
class Candidates(Tuner):
    """Makes candidates of what tuning found.

    >>> Candidates.__name__
    'Candidates'
    """

    def tuned(
        self, version: Version, problem: Problem, fit: Fit, windows: Windows,
        events: list[dict[str, Any]],
    ) -> dict[str, Any] | None:  # fmt: skip
        """The tuned version as a candidate, if something was learned and all is inside bounds."""
        checks = admit(fit.values, *problem.bounds)
        missed = [check.name for check in checks if not check.passed]
        blind = set(fit.verdict) == {"not"}  # an event has said so of each number
        if missed:
            events.append(event("rejected", "", f"outside: {', '.join(missed)}", {}))
        if missed or blind or not fit.converged or not np.any(fit.values != fit.start):
            return None
        if rest := known(fit, version.names):
            other = self.tune(problem.tuning(rest.names))[:2] if rest.names else None
            if other and clearly_worse(fit, other[1]):  # whatever they are, they are not as before
                return self.tuned(version, problem, weakened(fit, rest), windows, events)
            events.append(event("rejected", "", rest.why, {}))
            if other is None:
                return None
            pays = explained(other[1], other[1].noise) >= self.setup.trial.margin
            return self.tuned(version, *other, windows, events) if pays else None
        told = [name for name in fit.moved if name.removesuffix(" (weak)") in version.names]
        reason = f"tuned {', '.join(told)}"
        events.append(event("tuned", "", reason, fit.to_dict(timing=False)))
        # also what a term was chosen with, which no fit tunes; without recordings' own starts
        rows = zip(problem.model.parameters.names, fit.p.tolist(), version.p.tolist(), strict=True)
        values = {name: new for name, new, old in rows if new != old or name in fit.names}
        if self.setup.spec.tuning.method == "recursive":
            followed, newest, _ = Recursion.after(self.setup, problem, fit).learned(windows)
            values |= dict(zip(followed, newest.tolist(), strict=True))
        scale = scale_of(*(sizes(self.setup, problem, v) for v in (fit.start, fit.values)))
        return self.candidate(version.form, values, scale, reason, windows)

    def candidate(
        self, form: Form, values: Mapping[str, float], scale: np.ndarray, reason: str,
        windows: Windows,
    ) -> dict[str, Any]:  # fmt: skip
        """As an answer holds it; ``scale``: what counts as 1 in its trial, per output."""
        return {
            "form": form, "values": values, "scale": scale, "reason": reason,
            "watched": self.watched(windows), "told": windows[0].row if windows else 0,
        }  # fmt: skip

    def watched(self, windows: Windows) -> np.ndarray:
        """Range of the watched inputs over the windows, (k, 2)."""
        columns = [self.setup.model.inputs.index(n) for n in self.setup.spec.correction.watch]
        if not columns or not windows:
            return np.zeros((0, 2))
        u = np.concatenate([w.u[:, columns] for w in windows])
        return np.stack([np.nanmin(u, axis=0), np.nanmax(u, axis=0)], axis=1)
