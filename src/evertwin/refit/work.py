"""Slow work: what a request asks for, computed from a window of rows. Pure, so replay is exact.

``state`` and ``refine``: what came or went as a named, reversible state. ``fit``: tune what may be
tuned, then ask whether the parameters had moved (normal) or the form is wrong (abnormal).
``retell``: tell anew, by more rows, what few had told.
``correct``: search for terms that make up for the form. Each may end in a candidate, which then has
to prove itself on data that this work has not seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from evertwin.anomaly.verdict import Verdict, explained
from evertwin.config.spec import TwinSpec
from evertwin.errors import DataError, ModelError, TooFew, TooNew, UsageError
from evertwin.fold import Windows, plain
from evertwin.gauges.changes.change import suddenly
from evertwin.gauges.frozen.silent import silent
from evertwin.gauges.frozen.stuck import stuck
from evertwin.gauges.gauge import at_once
from evertwin.gauges.refuted import refuted
from evertwin.gauges.units.misread import misread
from evertwin.ledger.versions import Versions
from evertwin.machines.friction.resisting import not_physical
from evertwin.models.form import Version
from evertwin.models.terms.registry import kind
from evertwin.refit.answer_events import against, event, goes_on, of_a_sensor, undone
from evertwin.refit.answers.correcting import sought
from evertwin.refit.answers.loose_thresholds import known_badly
from evertwin.refit.answers.named_cause import named_first
from evertwin.refit.answers.recovered import recovered
from evertwin.refit.answers.states import States, amount
from evertwin.refit.answers.told_anew import retold
from evertwin.refit.numbers.fewest import fewest
from evertwin.refit.numbers.physical import embodied, passive
from evertwin.refit.numbers.posterior import posterior, sentences, told_of
from evertwin.refit.numbers.simplest import law_now
from evertwin.refit.rows.newest import after, newer, newest
from evertwin.refit.rows.one_form import made, plainer
from evertwin.refit.tuner.candidates import Candidates
from evertwin.refit.tuner.channels import (
    Asked,
    caveats,
    of_a_bias,
    of_a_channel,
    of_late_scans,
    of_what_is_read,
)
from evertwin.refit.tuner.judgement import judged, numbers_first, of_the_form
from evertwin.refit.tuner.tuner import ENOUGH
from evertwin.refit.workers import setup_of
from evertwin.setup.at_rest import at_rest
from evertwin.setup.evaluation import left, sizes
from evertwin.setup.false_start import rightly_begun
from evertwin.setup.friction_law import acting
from evertwin.setup.task import Task
from evertwin.tuning import Fit, Problem
from evertwin.tuning.posing.before import later
from evertwin.tuning.posing.hidden_starts import own_starts
from evertwin.tuning.posing.recordings import beginning
from evertwin.types import Json

MUCH = 0.3
"""Explained share below which a suspicion waits for more rows, and by which a candidate has to
surpass one that is on trial."""
HALF = 0.5
"""Part of the deviation that tuning explains at least where the form is wrong and tuned numbers are
tried all the same; and that a state which came or went takes away on unseen rows."""


def work_of(spec: TwinSpec, rate: float | None) -> Work:
    """The work of a twin file on rows of this rate, as `Work` travels to another process."""
    setup = setup_of(spec).at(rate)
    return Work(setup, Versions(setup.model))


@dataclass(frozen=True)
class Work(Candidates):
    """Answers to requests. It travels as its twin file: models never do.

    >>> Work.__name__
    'Work'
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return work_of, (self.setup.spec, self.setup.measured_rate)

    @np.errstate(all="ignore")  # numbers are tried at which a model has no value
    def content(self, task: Task) -> dict[str, Json]:
        """What the answer says, in plain values; what cannot be done is an event in it."""
        model, p = self.versions.model_of(task.version.form), task.version.p
        known, horizon = (*task.earlier, *task.windows), self.setup.horizon
        if self.known != known:
            return replace(self, known=known).content(task)
        begun = (at_rest(self.setup, rightly_begun(self.setup, w)) for w in task.windows)
        task = task._replace(windows=tuple(begun))
        try:
            if task.windows and not own_starts(model, len(task.windows)):
                rows = later(model, p, horizon, (known, task.windows))
                task = task._replace(windows=rows)
            if task.kind in ("correct", "retell"):
                content = self.correct(task) if task.kind == "correct" else retold(self, task)
            else:
                task, content = self._stated(task)
                content = content or (self.fit(task) if task.kind == "fit" else {})
            self._refuse(task, content)
            caveats(task, content)
            of_late_scans(self, task, content)
            if task.held and "fit" in content:
                content["against"] = against(content)
            if task.rival is not None and not (content.get("candidate") or {}).get("brief"):
                content = self._surpassing(task, task.rival, content)
            if task.kind == "fit" and task.doubt.channel:
                content["cleared"] = self._cleared(task)
        except TooFew as error:
            # not a verdict on anything: more rows come
            content = {"events": [], "waits": str(error)}
            if isinstance(error, TooNew):
                content["changed"] = error.row
        except (DataError, ModelError, UsageError) as error:
            content = undone(task.kind, error)
        return plain(content)  # type: ignore[return-value]

    def _cleared(self, task: Task) -> str:
        """The channel in doubt, if the newest rows tell that it is read rightly."""
        pose = partial(self.problem, task.version, names=self.editable(task.version))
        refutes = refuted(self.setup, pose, (task.earlier, task.windows), task.doubt)
        return task.doubt.channel if refutes else ""

    def _refuse(self, task: Task, content: dict[str, Any]) -> None:
        """A candidate that is not physical on its rows is none, and an event says why."""
        found = content.get("candidate")
        if found is None:
            return
        own = dict(zip(task.version.names, task.version.values, strict=True))
        followed = {name: own[name] for name in self.setup.followed if name in own}
        found["values"] = followed | found["values"]
        model, p = made(self.versions, task.version, found)
        wrong = not_physical(model, p, task.windows) or passive(model, p, own)
        if wrong:
            content["candidate"] = None
            said, evidence = f"not physical: {wrong}", {"values": found["values"]}
            content["events"].append(event("rejected", "", said, evidence))

    def _surpassing(self, task: Task, rival: Version, content: dict[str, Any]) -> dict[str, Any]:
        """Of an answer: what a fit found and what to do next, or a candidate that is better than
        the rival; much better than one whose trial goes well, for that would be lost."""
        if "sensor" in content:
            return content
        if (found := content.get("candidate")) is not None:
            unseen = after(task.windows, max(rival.row, content.get("since", rival.row)))
            own = unseen if "since" in content else after(task.windows, found.get("told", 0))
            gain = MUCH if self._pays(task, rival, unseen) else self.setup.trial.margin
            if rows := newer(unseen, self.setup.enough) or own:  # none: nothing is newer than it
                new = left(self.setup, *made(self.versions, task.version, found), rows, self.known)
                if np.nanmean(new / self.left(rival, rows)) <= 1.0 - gain:
                    return content
        keys = ("next", "lacking", "since", *(("fit", "against") if task.kind == "fit" else ()))
        said = [one for one in content.get("events", ()) if one["kind"] == "changed"]
        return {k: content[k] for k in keys if k in content} | {"events": said}

    def _pays(self, task: Task, rival: Version, unseen: Windows) -> bool:
        """Is the rival better than the live version on the rows that came after it?"""
        live = task.version
        share = self.left(rival, unseen) / self.left(live, unseen) if unseen else np.zeros(0)
        known = share[np.isfinite(share)]
        return bool(len(known)) and bool(known.mean() <= 1.0 - self.setup.trial.margin)

    # ------------------------------------------------------------------ tuning

    def _stated(self, task: Task) -> tuple[Task, dict[str, Any]]:
        """A candidate that has a state more, or less, or told better, and the task on the rows that
        say so; nothing: there is none."""
        setup, version = self.setup, task.version
        if not setup.spec.tuning.states or not task.windows:
            return task, {}
        states = States(setup, version, lambda names, rows: self.problem(version, rows, names),
                        task.commissioned)  # fmt: skip
        live = [name for name in setup.spec.tuning.states if amount(setup, name, version)]
        if task.kind == "refine":
            found = states.known(live[0], task.windows) if live else None
        else:
            found = states.find(task.windows)
        if found is None:
            return task, {}
        scale = sizes(self.setup, found.problem, found.fit.values)
        reason, windows = f"{found.name}: {found.said}", found.problem.windows
        candidate = self.candidate(version.form, found.values, scale, reason, windows)
        candidate |= {"brief": 0.0 if task.kind == "refine" else HALF, "begins": found.row}
        content = {"events": [], "fit": found.fit.to_dict(timing=False), "candidate": candidate}
        return task._replace(windows=windows), content

    def fit(self, task: Task) -> dict[str, Any]:
        """Tunes, and judges what the residual of the tuned model still says."""
        version, windows, commissioned = task.version, task.windows, task.commissioned
        if not (names := self.turn(task)):  # a turn that is nobody's has passed, too
            passed = {"events": [], "tuned": True}
            return passed if task.scheduled else passed | {"next": self._next()}
        version = self.begun(version, windows) if task.held else version
        task = task._replace(version=version)
        if was := recovered(self, task) or known_badly(self, task):
            return was
        windows, events = self.now(task, version, names)
        since = {"since": windows[0].row} if windows is not task.windows else {}
        model = self.versions.model_of(version.form)
        rows = self.setup, model, version.p, windows
        other, few = at_once(rows, task.windows) if commissioned else (None, None)
        if other:
            return of_a_sensor(other, *events) | since
        posed = self.posed(task, windows, names)
        if few is None and (named := named_first(self, task, posed, events)):
            return named | since
        problem, chosen = law_now(self.setup, posed, self.tune if commissioned else None)
        problem, fit, rounds = embodied(problem, self.tune)
        tuned = problem, fit
        if commissioned and not rounds:
            own = tuple(n for n in problem.names if n in model.parameters.names)
            problem, fit = newest(*tuned, partial(self.problem, version, names=own), self.tune)
        rest = set(self.editable(version)) - {*names, *(self.setup.once if commissioned else ())}
        verdict = judged(self.setup, problem, fit, rest, rounds=bool(rounds))
        reached = verdict.kind != "abnormal" and self.holds(problem, fit.values)
        new = not (commissioned or verdict.alone or reached)
        if new and (other := of_what_is_read(*rows, fit.p)):
            return of_a_sensor(other, *events) | since
        much = verdict.kind == "abnormal" or explained(fit, fit.noise) >= MUCH
        other, alike = of_a_channel(self, task, tuned, names, told=much)
        if other:  # the rows before it go on to tell how it was
            return of_a_sensor(other, *(events if other.channel else ()))
        if few is not None:
            raise few
        events += [goes_on(problem.windows)] if fit is not tuned[1] else []
        if commissioned and not rounds:
            problem, fit = fewest(self.setup, problem, fit, self.tune)
            alike = alike or of_a_bias(self.setup, problem, fit)
        fit, said = self.sure(problem, fit, verdict, alike)
        events += said
        part = explained(fit, fit.noise)
        if task.waits and (verdict.kind == "normal" or verdict.alone) and part < MUCH:
            raise TooFew(f"tuning explains {100 * part:.0f} % of the deviation so far")
        content: dict[str, Any] = {
            "events": events, "fit": fit.to_dict(timing=False), "tuned": True, **rounds,
            "noise": verdict.evidence.get("noise"),
        }  # fmt: skip
        helps = verdict.kind != "abnormal" or verdict.alone or self._helps(verdict, fit)
        first = helps and numbers_first(self.setup, problem, task, verdict, part)
        if verdict.kind == "abnormal" and self._next() and not first:
            content["candidate"] = self._named(verdict, version, problem, events)
            content |= {} if content["candidate"] else {"next": self._next()}
        elif helps and part >= self.setup.trial.margin:  # less would not be worth a switch
            found = self.tuned(version, problem, fit, problem.windows, events)
            more = acting(chosen, problem, fit).said + alike
            content["candidate"] = found and found | {"reason": found["reason"] + more}
        return content if of_the_form(task, verdict) else content | since

    def _named(
        self, verdict: Verdict, version: Version, problem: Problem, events: list[dict[str, Any]]
    ) -> dict[str, Any] | None:
        """The cause that has a name decides what is tuned; what is left then is corrected."""
        names = tuple(n for n in self.setup.causes.get(verdict.cause, ()) if n in problem.names)
        if not names:
            return None
        own = beginning(problem.model, problem.names)
        problem, fit, _ = self.tune(problem.tuning((*names, *own)))
        return self.tuned(version, problem, fit, problem.windows, events)

    def _helps(self, verdict: Verdict, fit: Fit) -> bool:
        """The form is wrong, and none may be learned: is tuning the better half all the same?

        Not where another cause has a name: tuning would hide a load in friction.
        """
        return not verdict.cause and not fit.at_bound and explained(fit, fit.noise) >= HALF

    # ------------------------------------------------------------------ correction

    def _next(self) -> str | None:
        """The form of a static map has ladders of its own."""
        return "correct" if self.setup.spec.correction.terms and not self.setup.static else None

    def correct(self, task: Task) -> dict[str, Any]:
        """Searches for terms on top of the version's form: of one that held, on the rows since it
        suddenly did not, if that pays; a form for both machines is one for neither."""
        windows, names = task.windows, self.editable(task.version)
        version = self.begun(task.version, windows) if task.held else task.version
        task = task._replace(version=version)
        if task.commissioned:
            model = self.versions.model_of(version.form)
            posed = self.problem(version, windows, names)
            rows = self.rows(task, *self.tune(posed)[:2]) if len(model.parameters) else None
            other = stuck(rows) if rows else None
            other = other or misread(self.setup, model, version.p, windows)
            other = other or (silent(rows) if rows and names else None)
            if other:
                return of_a_sensor(other)
        if task.held and names and not task.rose:
            new = suddenly(windows, lambda rows: self.problem(version, rows, names))
            if sum(len(block.t) for block in new) >= ENOUGH * len(names):
                found = self._tuned_alone(version, new)
                asked = of_a_channel(self, task, found, names, told=True) if found else Asked()
                if asked.change:
                    return of_a_sensor(asked.change)
                content = self._corrected(version, new, found, asked.alike)
                if content["candidate"]:
                    whole = self._tuned_alone(version, windows)
                    both = content, self._corrected(version, windows, whole)
                    parts = after(windows, 0, new[0].row), new, self.known
                    return plainer(self.setup, self.versions, version, parts, both)
        return self._corrected(version, windows, self._tuned_alone(version, windows))

    def _corrected(
        self, version: Version, windows: Windows, found: tuple[Problem, Fit] | None,
        alike: str = "",
    ) -> dict[str, Any]:  # fmt: skip
        """``found``: what tuning alone finds; ``alike``: what would look the same as that."""
        starts = [version]
        if found:  # what numbers of the model explain no term has to
            starts.insert(0, replace(version, values=tuple(found[1].p.tolist())))
        proposal = sought(self.setup, self.versions, starts, windows)
        evidence = proposal.evidence()
        if not proposal.found:
            events = [event("rejected", "", "no correction pays on unseen rows", evidence)]
            tuned = found and self.tuned(version, *found, windows, events)
            if tuned:
                tuned["reason"] += alike
            return {"events": events, "candidate": tuned}
        values = dict(zip(proposal.names, proposal.p.tolist(), strict=True))
        old = dict(zip(version.names, version.p.tolist(), strict=True))
        names = self.setup.model.parameters.names
        moved = tuple(n for n in names if values.get(n) != old.get(n))
        same = {kind(gain.term.kind).alike for gain in proposal.gains if gain.term.channel == "*"}
        model = self.versions.model_of(proposal.form)
        fit = posterior(self.setup, model, proposal, windows, moved)
        told = told_of(moved, found and found[1], fit)
        first = (f"tuned {', '.join(told)}",) if moved else ()
        said = sentences(self.setup, proposal, fit)
        reason = "; ".join((*first, *said, *sorted(same - {""})))
        return {
            "events": [event("corrected", "", reason, evidence)],
            "lacking": len(proposal.unseen),
            "fit": fit,
            "candidate": self.candidate(proposal.form, values, proposal.scale, reason, windows),
        }

    def _tuned_alone(self, version: Version, windows: Windows) -> tuple[Problem, Fit] | None:
        """What tuning finds, where that is worth a switch; of a table, which takes a gain as well,
        where it explains half of the deviation."""
        names = self.editable(version)
        if not names:
            return None
        problem, fit, _ = self.tune(self.problem(version, windows, names))
        least = HALF if self.setup.spec.correction.translated else self.setup.trial.margin
        return (problem, fit) if explained(fit, fit.noise) >= least else None
