"""What of a version is tuned, on which rows, and how."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from evertwin.anomaly.verdict import Verdict
from evertwin.errors import DataError, ModelError, TooNew
from evertwin.fold import Windows
from evertwin.gauges.changes.change import changed, split
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.gauges.rows.settled import settled
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.batch import is_native
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.form import Version
from evertwin.refit.answer_events import changed_since, event, not_told
from evertwin.refit.numbers.physical import physically
from evertwin.refit.rows.newest import after
from evertwin.refit.rows.standing_joints import without_standing
from evertwin.refit.tuner.judgement import NEARLY_ALL
from evertwin.setup.evaluation import left
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from evertwin.signals.sizes import rms
from evertwin.tuning import Fit, Iteration, Problem, Schedule, Settings, own_names
from evertwin.tuning.form.step_length import stepped
from evertwin.tuning.intervals.curvature import unbent
from evertwin.tuning.posing.hidden_starts import kept_near, own_starts
from evertwin.tuning.posing.recordings import initials
from evertwin.tuning.search.minima import lowest
from evertwin.types import Vector

FIRST = (1.0, 0.5, 0.25, 0.125)
"""Shares of a window, its first rows, on which a version may have held."""
ENOUGH = 10
"""Rows a parameter behind a change that a fit needs."""
LEAST = 30
"""Rows that tell where a state began."""


@dataclass(frozen=True)
class Tuner:
    """Tunes versions as the twin file says.

    >>> Tuner.__name__
    'Tuner'
    """

    setup: Setup
    versions: Versions
    """The models of forms are asked of it."""
    known: Windows = ()
    """Rows around those that are tuned on: what these begin with."""

    def problem(self, version: Version, windows: Windows, names: tuple[str, ...]) -> Problem:
        """The tuning problem of a version on a window."""
        model, count = self.versions.model_of(version.form), len(windows)
        model = kept_near(model, version.p, windows, self.setup.horizon)
        if self.setup.spec.moving is not None and self.setup.spec.moving.tune:
            names = without_standing(model, names, windows)
        tuned = (*own_names(model, names, count), *own_starts(model, count))
        return Problem(
            model, windows, tuned, self.setup.horizon, None,
            self.setup.smooth_window,
            model.parameters.with_values(version.p), self.setup.spec.tuning.loss,
            self.setup.moving if self.setup.spec.moving is not None else None,
            self.setup.spec.moving is not None and self.setup.spec.moving.tune,
            Settings(starts=self.setup.spec.tuning.starts, lenient=True), self.known,
        )  # fmt: skip

    def posed(self, task: Task, windows: Windows, names: tuple[str, ...]) -> Problem:
        """The same of a task's version. The numbers of one that never held may be far off: where
        what is asked for is not reached from there they are sought elsewhere, ever less often; by
        machine code alone, as anything else would answer late."""
        problem, tunings = self.problem(task.version, windows, names), task.tunings
        if task.held or tunings & (tunings - 1) or problem.linear:
            return problem
        return lowest(problem, self.holds) if is_native(problem.batch.kernel) else problem

    def begun(self, version: Version, windows: Windows) -> Version:
        """A version that held, with where states that nothing measures began in the first of these
        windows, by as many of its rows as it holds on: what it says of that is of other rows."""
        names = tuple(n for n in self.editable(version) if n in initials(self.setup.model))
        count = sum(len(block.t) for block in windows)
        first = min(len(windows[0].t) if windows else 0, count - self.setup.enough)
        for rows in (round(part * first) for part in FIRST if names):
            if rows < LEAST:
                break
            early = split(windows, rows)[0]
            try:
                problem, fit, _ = self.tune(self.problem(version, early, names))
            except (DataError, ModelError):  # they tell nothing of it
                break
            if self.holds(problem, fit.values):
                found = dict(zip(fit.names, fit.values.tolist(), strict=True))
                own = zip(version.names, version.values, strict=True)
                return replace(version, values=tuple(found.get(name, old) for name, old in own))
        return version

    def now(
        self, task: Task, live: Version, names: tuple[str, ...]
    ) -> tuple[Windows, list[dict[str, Any]]]:
        """The rows of the machine as it is now, and what is said of those before, which a version
        followed: the live one, or one on trial, where that does as the live one never did; a live
        one that did as the one before it never did need not have held yet.

        Raises:
            TooNew: there are not enough of them yet.
        """
        windows = task.windows
        version, worse = (task.rival, live) if task.rival else (live, task.replaced)
        version, worse = (live, None) if task.held else (version, worse)
        if version.form != live.form or not (task.held or worse):
            return windows, []
        near = after(windows, task.rose - self.setup.enough) if task.rose else windows
        place = changed(near, lambda rows: self.problem(version, rows, names))
        old, new = split(near, place)
        if not place or new[0].row < task.rose:
            return windows, []
        if worse is not None and not self.follows(version, worse, old):
            return windows, []
        if not task.held and self._reaches(version, windows, names):
            return windows, []
        rows = sum(len(block.t) for block in new)
        if rows < ENOUGH * len(names):
            raise TooNew(f"the machine has changed, {rows} rows ago", new[0].row)
        return new, [changed_since(new, task.held)]

    def _reaches(self, version: Version, windows: Windows, names: tuple[str, ...]) -> bool:
        """Is what one fit leaves on all rows within what is asked? Numbers that few rows told need
        no change of the machine to be wrong on others."""
        posed, fit, _ = self.tune(self.problem(version, windows, names))
        return fit.converged and self.holds(posed, fit.values)

    def follows(self, version: Version, worse: Version, rows: Windows) -> bool:
        """Does a version take away nearly all of another one's deviation?"""
        share = self.left(version, rows) / self.left(worse, rows)
        return bool((share**2 <= 1.0 - NEARLY_ALL).all())

    def left(self, version: Version, windows: Windows) -> Vector:
        """What a version is off by."""
        model = self.versions.model_of(version.form)
        return left(self.setup, model, version.p, windows, self.known)

    def holds(self, problem: Problem, values: Vector, slack: float = 1.0) -> bool:
        """Is what is watched within so many times the requirement?"""
        on = self.setup.watched
        off = rms(np.where(problem.rows.used, problem.residuals(values), np.nan)[:, on])
        limit = slack * self.setup.requirement * self.setup.sizes(problem.rows.y)[on]
        return bool((off <= limit).all())

    def editable(self, version: Version) -> tuple[str, ...]:
        """What may be tuned of a version: the base model's share and the terms' own numbers."""
        return self.tunable(self.versions.model_of(version.form))

    def tunable(self, model: Model) -> tuple[str, ...]:
        """The same of any form of the base model."""
        base = self.setup.model.parameters.names
        own = tuple(n for n in model.parameters.editable if n not in base)
        few = tuple(n for n in own if isinstance(model, Corrected) and not model.on_grid(n))
        return tuple(n for n in self.setup.editable if n in model.parameters.names) + few

    def sure(
        self, problem: Problem, fit: Fit, verdict: Verdict, alike: str
    ) -> tuple[Fit, list[dict[str, Any]]]:
        """The fit with intervals that hold all the same; events: what it does not tell, and the
        verdict, with what looks ``alike``."""
        fit, said = unbent(problem, stepped(problem, fit)), verdict.reason + alike
        told = event(verdict.kind, verdict.cause, said, verdict.evidence)
        return fit, [*not_told(problem, fit), told]

    def rows(self, task: Task, problem: Problem, fit: Fit) -> Rows:
        """What hypotheses about a gauge are tested on, once ``problem`` is tuned."""
        pose = partial(self.problem, task.version, names=self.editable(task.version))

        def tune(one: Problem) -> Fit:
            return self.tune(replace(one, settings=replace(one.settings, quick=True)))[1]

        return Rows(
            self.setup,
            pose,
            task.windows,
            problem,
            fit,
            tune,
            earlier=task.earlier,
            seen=task.seen,
            stayed=task.stayed,
        )

    def turn(self, task: Task) -> tuple[str, ...]:
        """All parameters, or by schedule those whose turn it is; what is tuned once only before
        anything has held."""
        names, once = self.editable(task.version), self.setup.once if task.commissioned else ()
        if task.scheduled:
            weights = self.setup.weights
            names = Schedule({n: weights.get(n, 1.0) for n in names}).due(task.tunings)
        return tuple(n for n in names if n not in once)

    def tune(self, problem: Problem) -> tuple[Problem, Fit, dict[str, Any]]:
        """What was tuned, and the fit, its friction held to what resists; where it went by rounds,
        these and the single-axis simulations they took."""
        fit, rounds = physically(problem, self._tune)
        return problem if fit.names == problem.names else problem.tuning(fit.names), fit, rounds

    def _tune(self, problem: Problem) -> tuple[Fit, dict[str, Any]]:
        rule = self.setup.spec.tuning
        if rule.method != "iteration":
            return settled(problem), {}
        limit = self.setup.requirement if np.isfinite(self.setup.requirement) else 0.05
        done = Iteration(limit=limit, relaxation=rule.relaxation).run(problem)
        return done.fit, {
            "rounds": done.rounds, "names": done.fit.names, "simulations": done.simulations,
        }  # fmt: skip
