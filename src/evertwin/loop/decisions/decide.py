"""At a beat: what to do about what was seen. The only place where versions change.

    watch ──suspected──▶ fit ──normal──▶ trial ──better──▶ live, in probation ──kept──▶ watch
                          └─abnormal─▶ correct ─┘   └─not better─▶ watch   └─worse─▶ rolled back

Every branch is an event with its evidence. Nothing here knows what kind of machine it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evertwin.fold import Answer, Event, Request
from evertwin.loop.decisions import succession
from evertwin.loop.decisions.as_recorded import taken_as_recorded
from evertwin.loop.decisions.contradictions import told
from evertwin.loop.decisions.crossing import outside
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.disturbances import disturbed, unlearn
from evertwin.loop.decisions.follow import EMPTY, Follow
from evertwin.loop.decisions.former import KNOWN, known_again, tell_alternates, without_newest
from evertwin.loop.decisions.going_live import goes_live, recovered, retells, switched, told_anew
from evertwin.loop.decisions.heeding import heed
from evertwin.loop.decisions.in_stream import tell_followed
from evertwin.loop.decisions.looking import adopted, in_vain, looks, nothing_came, returned
from evertwin.loop.decisions.outdone import outdone
from evertwin.loop.decisions.requirement import deviates, foreseen, heard, rises, unexplained
from evertwin.loop.decisions.unanswered import unanswered
from evertwin.models.form import Form
from evertwin.refit.answers.states import tried
from evertwin.rows.ring import refuse
from evertwin.setup.scores import judged_anew, mark
from evertwin.setup.twin_state import PROBATION, TRIAL, WATCH, TwinState

FEW, LONG = 5, 10
"""Segments that a challenger of a long trial predicts at least before a better one is sought; a
trial is long that takes more than so many times the least time of any."""


@dataclass(frozen=True)
class Decide:
    """The decisions of a twin.

    >>> Decide.__name__
    'Decide'
    """

    follow: Follow

    def step(
        self, state: TwinState, answer: Answer | None, task_end: bool
    ) -> tuple[TwinState, list[Event], list[Request]]:
        """The decisions of one beat, in a fixed order. Consumes ``state``."""
        decision = Decision(state, [], [])
        unlearn(decision, self.follow.setup)
        contradicted = told(decision, self.follow.setup)
        contradicted |= unanswered(decision, self.follow.setup, self.follow.versions)
        veto = disturbed(decision, self.follow.setup, self.follow.versions) or contradicted
        decision.state = self.follow.renew(decision.state, back=veto)
        stage = self.follow.following(decision.state.live.version)
        if stage is not None:
            tell_followed(decision, stage, task_end=task_end)
            decision.state = self.follow.loosened(decision.state) if task_end else decision.state
        doubted = self.follow.setup.kinematics.doubted(decision.state.kinematics) >= 0
        if answer is not None and doubted:
            decision.remember(open=0)  # it may be of rows that contradict each other
        elif answer is not None:
            self._answered(decision, answer)
        if decision.state.agenda.phase == TRIAL:
            self._judge_trial(decision)
        elif decision.state.agenda.phase == PROBATION:
            self._judge_probation(decision)
        if not veto:
            recovered(decision, self.follow)
            outdone(decision, self.follow)
            taken_as_recorded(decision, self.follow)
        if not veto:
            self._cross(decision)
            self._watch(decision, task_end)
        elif not contradicted:  # of rows that contradict each other nothing is asked
            self._look(decision, looks(self.follow.setup, decision.state, lasts=True))
        return decision.state, decision.events, decision.requests

    def quiet(self, state: TwinState) -> bool:
        """Is nothing going on but watching, so that a beat decides only what rows bring up?"""
        agenda, setup = state.agenda, self.follow.setup
        # a window within what is asked is told by a beat: it held, and what was told is over
        holds = (agenda.held and not agenda.told) or not np.isfinite(setup.requirement)
        idle = agenda.phase == WATCH and not (agenda.open or agenda.retrain or agenda.again)
        idle = idle and holds and agenda.retell <= 0
        idle = idle and not setup.spec.tuning.states and state.stream == ()
        calm = not setup.external.on(state.external) and not state.still.said.any()
        calm = calm and setup.kinematics.since(state.kinematics) < 0 and not state.live.track.scaled
        return idle and calm and setup.detect.quiet(state.detect) and self.follow.here(state)

    def watches(self, state: TwinState) -> bool:
        """Was the live correction learned for a range of other inputs?"""
        return len(state.watched) > 0 and bool(self.follow.versions[state.live.version].form.terms)

    def order(self, state: TwinState, said: Event) -> tuple[TwinState, tuple[Event, ...]]:
        """What an operator said takes effect; the log has it already. Consumes ``state``.

        Of a switch what was on trial ends; an open request is not answered any more. Of a label
        an event says what it changed.
        """
        if said.kind == "labelled":
            return heed(self.follow, state, said)
        return self._switched_by(state, said), ()

    def _switched_by(self, state: TwinState, said: Event) -> TwinState:
        number: Any = said.evidence["version"]
        state = state._replace(agenda=state.agenda._replace(pinned=bool(
            said.evidence.get("pinned", state.agenda.pinned))))  # fmt: skip
        if number == state.live.version:
            return state
        first = state.live if state.first.version < 0 else state.first
        state = state._replace(other=self.follow.beside(state.live, number))
        state = goes_live(self.follow, state, number, EMPTY, first)
        agenda = state.agenda._replace(
            phase=WATCH, again=0, doubt="", accused="",
            versions=max(state.agenda.versions, number + 1),
        )  # fmt: skip
        return state._replace(agenda=agenda)

    # ------------------------------------------------------------------ is the twin still true?

    def _watch(self, decision: Decision, task_end: bool) -> None:
        state, setup = decision.state, self.follow.setup
        about = looks(setup, state)
        mark(tuple(state.scores.watch), state.scores.seen, state.scores.past, setup.enough)
        reason, signal, evidence = deviates(setup, state, task_end)
        alarm, state = heard(setup, state, whole=reason is not None)
        decision.state = state
        state = rises(decision, setup, whole=reason is not None)
        if reason is not None:
            scores = judged_anew(decision.state.scores, held=not reason)
            decision.state = decision.state._replace(scores=scores)
            decision.remember(look=0, pace=0)
        detect, failed = setup.detect.beat(decision.state.detect, task_end)
        decision.state = decision.state._replace(detect=detect)
        if failed[0]:
            decision.say("not_calibrated", "", failed[0], {"rows": failed[1]})
        agenda, again, last = state.agenda, state.agenda.again, False
        if not agenda.open:  # open work goes by what was known when it was asked for
            # after as long as a deviation is judged on, what rows tell has to do
            last = 0 < again <= state.row - min(setup.window("fit"), setup.enough)
            last = last and state.row >= agenda.hold  # it is asked for now, or at a later beat
            again = 0 if last or reason == "" else again
            held = reason == ""
            if held and agenda.doubt and succession.driven(setup, decision.state.ring):
                why = f"over {setup.enough} rows the live version is as near as it was"
                succession.clears(decision, why)
            # what was learned before a change fits again: the change is over, and so are its rows
            learned = self.follow.versions[state.live.version].row
            past = held and agenda.told and learned < agenda.since
            since = state.row - int(state.scores.seen[0]) if past else agenda.since
            decision.remember(
                again=again, held=agenda.held or held, commissioned=agenda.commissioned or held,
                since=since,
            )  # fmt: skip
        every = state.elapsed - agenda.fitted >= setup.schedule
        due = every or again > 0 or last
        if reason or alarm.kind or due or retells(state):
            succession.makes_room(setup, decision)
        free = self._free(decision.state, bool(reason or alarm.kind or state.agenda.risen), every)
        early = reason or ""
        if reason is None and not alarm.kind:
            early, signal, evidence = foreseen(setup, state)
            decision.remember(told=state.agenda.told or bool(early))
        if early and not state.agenda.told:
            decision.say("suspected", signal, early, evidence)
        elif alarm.kind and not state.agenda.told:
            decision.say(alarm.kind, alarm.signal, alarm.reason, alarm.evidence)
        if reason is not None:
            decision.remember(told=bool(reason))
        reason = reason or (alarm.reason if setup.decides else "")  # told of, and no more
        if (reason or due) and free:
            trial = decision.state.agenda.phase == TRIAL
            again = 0 if trial else again or (state.row if reason and not last else 0)
            decision.remember(fitted=state.elapsed, again=again)
            self._ask(decision, "fit", {"reason": reason or "scheduled"})
        elif about:
            self._look(decision, about)
        elif retells(decision.state) and self._free(decision.state):
            self._ask(decision, "retell", {})
        elif self._learns_on(decision.state):
            self._ask(decision, "correct", {"reason": "levels are missing"}, state.live.version)

    def _look(self, decision: Decision, about: str) -> None:
        """Asks about states, which may be what seems to act from outside."""
        if about:
            again = decision.state.agenda.refine
            decision.remember(refine=0 if about == "refine" else again)
            self._ask(decision, about, {})

    def _learns_on(self, state: TwinState) -> bool:
        """Is it time to see whether the live correction lacks levels that have come since?"""
        live, setup, agenda = state.live.version, self.follow.setup, state.agenda
        enough = state.row >= agenda.stop + setup.rows(setup.spec.correction.window)
        terms = self.follow.versions[live].form.terms
        return agenda.lacking > 0 and enough and bool(terms) and self._free(state)

    def _cross(self, decision: Decision) -> None:
        """A correction learned for one range of another input is learned anew outside it."""
        state, setup = decision.state, self.follow.setup
        names = setup.spec.correction.watch
        if self.watches(state):
            last = (state.ring.end - 1) % setup.ring.capacity
            now = state.ring.u[last, [setup.model.inputs.index(name) for name in names]]
            left = outside(now, state.watched)
            if left.any():
                name = names[int(np.argmax(left))]
                reason = f"{name} left the range that the correction was learned for"
                evidence = {"now": now, "range": state.watched}
                decision.say("training_restarted", name, reason, evidence)
                decision.state = state._replace(watched=np.zeros((0, 2)))
                retrain = state.row + setup.enough
                decision.remember(since=state.row, retrain=retrain)
        agenda = decision.state.agenda
        if agenda.retrain and state.row >= agenda.retrain and self._free(decision.state):
            decision.remember(retrain=0)
            self._ask(decision, "correct", {"reason": "new training sequence"})

    def _free(self, state: TwinState, deviates: bool = False, due: bool = False) -> bool:
        """May a candidate be sought? Whatever goes on if a fit is due; if the live version deviates
        in probation too, and beside one on trial if that is long, or the machine changed since."""
        agenda = state.agenda
        if agenda.open or agenda.pinned or state.row < agenda.hold:
            return False
        # in probation the machine may have changed, for which the version is not to blame
        if agenda.phase == WATCH or due or not deviates:
            return agenda.phase == WATCH or due
        return agenda.phase == PROBATION or agenda.risen > 0 or not self._fresh(state)

    def _fresh(self, state: TwinState) -> bool:
        """Is a trial neither as long as it has to be, nor a long one, and what is on trial tried on
        as many rows as a deviation is judged on?"""
        setup, gate, segments = self.follow.setup, self.follow.setup.trial, state.trial.tally[1]
        rows = state.row - self.follow.versions[state.other.version].row
        few = rows < setup.enough or segments < FEW
        short = gate.least * gate.horizon <= LONG * gate.duration
        return bool(segments < gate.least and (few or short))

    def _ask(
        self, decision: Decision, kind: str, detail: Mapping[str, Any], rival: int = 0
    ) -> None:
        state, setup = decision.state, self.follow.setup
        number = state.agenda.asked + 1
        scheduled = detail.get("reason") == "scheduled"
        size = setup.rows(setup.spec.tuning.window) if scheduled else setup.window(kind)
        first = max(state.agenda.since, state.row - size, state.ring.first)
        enough = setup.least if scheduled else setup.enough
        if kind == "fit" and state.row >= enough:
            first = max(first, 0)  # it tells of the machine in this run: its history
        window = (first, state.row)
        due = state.row + setup.latency
        request = Request(number, kind, state.live.version, state.row, due, window, dict(detail))
        decision.requests.append(request)
        state.ring.seen[1] = state.ring.seen[0]
        decision.remember(
            retell={"retell": -1, "fit": 0}.get(kind, state.agenda.retell),
            open=number, due=due, start=window[0], stop=window[1], asked=number,
            kind=kind,
            rival=state.other.version if state.agenda.phase == TRIAL else rival,
        )  # fmt: skip

    # ------------------------------------------------------------------ answers to slow work

    def _answered(self, decision: Decision, answer: Answer) -> None:
        agenda = decision.state.agenda
        if answer.id != agenda.open or answer.version != decision.state.live.version:
            return
        setup, on_trial = self.follow.setup, decision.state.other.version
        blamed = succession.to_blame(decision, answer.content)
        content: Any = succession.in_doubt(decision, setup, blamed)
        # what has changed is asked about again, of whatever else the deviation was told
        again = max(agenda.again, int(content.get("changed", 0)))
        waits = again > 0 and ("waits" in content or agenda.kind in ("state", "refine"))
        decision.remember(open=0, again=again if waits else 0)
        candidate = content.get("candidate")
        if candidate and agenda.phase == TRIAL and candidate.get("version") == on_trial:
            return  # that the machine is as it was has been said
        for event in decision.fresh(content):
            decision.say(event["kind"], event["signal"], event["reason"], event["evidence"])
        if content.get("refused"):
            names, *span = content["refused"]
            model, nu = setup.model, len(setup.model.inputs)
            columns = [nu + model.outputs.index(name) for name in names]
            refuse(decision.state.ring, columns, *span)
        if content.get("noise") is not None:
            decision.state.scores.usual.noise[:] = content["noise"]
        if content.get("tuned"):
            decision.remember(tunings=agenda.tunings + 1, cause="")
        if candidate is None or "brief" not in candidate:
            decision.remember(since=max(agenda.since, int(content.get("since", agenda.since))))
        lacking = content.get("lacking")
        if lacking is not None:  # as many as before, and nothing better: no more come
            ends = candidate is None and lacking == agenda.lacking
            decision.remember(lacking=0 if ends else int(lacking))
        if candidate is not None:
            decision.remember(vain=0)
            self._challenge(decision, candidate)
        elif content.get("next") == "correct":
            self._ask(decision, "correct", {})
        elif agenda.kind == "state":
            decision.remember(**in_vain(setup, decision.state))
        elif agenda.kind != "refine":
            decision.remember(**nothing_came(setup, decision.state, content, waits=waits))
        unexplained(decision, setup, content)

    def _challenge(self, decision: Decision, candidate: Mapping[str, Any]) -> None:
        state, follow = decision.state, self.follow
        busy = state.agenda.phase == PROBATION
        if state.agenda.phase == TRIAL and not state.agenda.risen and self._fresh(state):
            busy = follow.versions[state.other.version].row >= state.agenda.since  # of this machine
        if busy and "brief" not in candidate:
            return  # of a scheduled fit the numbers are kept
        begins = succession.opening(follow, state, candidate)
        if begins.said:
            decision.say("superseded", "", begins.said, begins.evidence)
        former = candidate.get("version")
        if former is not None and known_again(state.lives, former):
            candidate = {**candidate, "brief": KNOWN}  # the machine was like it time and again
        version = follow.versions.add(
            Form.from_json(candidate["form"]), candidate["values"], parent=state.live.version,
            reason=begins.reason, row=state.row,
        ) if former is None else follow.versions[former]  # fmt: skip
        # the running segment, which the champion has begun, is no prediction of the challenger's
        scores = state.scores._replace(scale=begins.scale, pair=np.full(3, np.nan))
        watched = np.array(candidate["watched"], dtype=np.float64).reshape(-1, 2)
        decision.state = state._replace(
            other=follow.beside(state.live, version.number), scores=scores,
            trial=begins.trial, watched=watched,
        )  # fmt: skip
        decision.remember(
            phase=TRIAL, tried=begins.tried,
            versions=max(state.agenda.versions, version.number + 1),
            brief=float(candidate.get("brief", -1.0)), begins=int(candidate.get("begins", -1)),
        )  # fmt: skip

    # ------------------------------------------------------------------ trial and probation

    def _judge_trial(self, decision: Decision) -> None:
        state = decision.state
        verdict, evidence = self.follow.setup.trial.verdict(state.trial)
        number, brief = state.other.version, state.agenda.brief
        if brief >= 0.0:
            verdict = tried(self.follow.setup, evidence, brief)
        if verdict == "promote" and not state.agenda.pinned:
            self._promote(decision, evidence)
        elif verdict == "reject":
            reason = f"version {number} is not better on unseen data: {evidence['sentence']}"
            decision.say("rejected", "", reason, {**evidence, "version": number})
            decision.state = decision.state._replace(other=EMPTY)
            setup = self.follow.setup  # of a state: what it is instead is asked at once
            hold = in_vain(setup, state) if brief >= 0.0 else {"hold": state.row + setup.holdoff}
            decision.remember(phase=WATCH, brief=-1.0, **hold)

    def _promote(self, decision: Decision, evidence: Mapping[str, Any]) -> None:
        state, shown = decision.state, evidence["sentence"]
        old, new = state.live, state.other
        if state.agenda.brief >= 0.0:
            shown = shown.partition(", odds of")[0]
        reason = f"version {new.version} replaces {old.version}: {shown}"
        again = int((state.lives[:, 0] == new.version).sum())
        told = switched(self.follow, evidence, new.version) | ({"again": again} if again else {})
        decision.say("promoted", "", reason, told)
        first = old if state.first.version < 0 else state.first
        decision.state = goes_live(self.follow, decision.state, new.version, old, first)
        if state.agenda.brief >= 0.0 and state.agenda.begins >= 0:
            adopted(decision, self.follow.setup, self.follow.versions[new.version])
        else:
            decision.remember(retell=told_anew(self.follow, state))
        decision.remember(phase=PROBATION, brief=-1.0)
        tell_alternates(decision)

    def _judge_probation(self, decision: Decision) -> None:
        state = decision.state
        verdict, evidence = self.follow.setup.probation.verdict(state.trial)
        if verdict == "keep":
            decision.state = state._replace(other=EMPTY)
            decision.remember(phase=WATCH)
        elif verdict == "roll_back":
            old = state.other.version
            reason = f"version {state.live.version} does worse than {old}: {evidence['sentence']}"
            decision.say("rolled_back", "", reason, switched(self.follow, evidence, old))
            versions = self.follow.versions
            returned(decision, self.follow.setup, versions[state.live.version], versions[old])
            decision.state = goes_live(self.follow, decision.state, old, EMPTY, state.first)
            decision.state = decision.state._replace(lives=without_newest(state.lives))
            past = versions[old].row < state.agenda.since
            since = state.scores.rows if past else state.agenda.since
            hold = state.row + self.follow.setup.holdoff
            decision.remember(phase=WATCH, hold=hold, since=since)
