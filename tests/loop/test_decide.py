"""Every transition of a twin's decisions, from states that lead to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from evertwin import Twin
from evertwin.anomaly import external_loop
from evertwin.config.spec import AnomalySpec, CorrectionSpec, PredictionSpec, Span, TuningSpec
from evertwin.fold import Answer, Event, Request, copy, make_block
from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.follow import EMPTY
from evertwin.loop.driver import Driver
from evertwin.models.form import Form, Term
from evertwin.setup.configured_model import model_of
from evertwin.setup.detectors import Alarm
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import PROBATION, TRIAL, WATCH, TwinState

from .machines import robot

TABLE = Form((Term("lag", "v"),))


class Step(NamedTuple):
    """The outcome of one beat."""

    state: TwinState
    events: list[Event]
    requests: list[Request]

    @property
    def kinds(self) -> list[str]:
        return [event.kind for event in self.events]


class Bench:
    """A driver whose state is brought to a phase by hand."""

    def __init__(self, *, pinned: bool = False, rows: int = 50, **changes: Any) -> None:
        spec = replace(robot().spec, **changes)
        self.setup = Setup(spec, model_of(spec, None))
        self.versions = Versions(self.setup.model)
        self.log: list[Any] = []
        self.driver = Driver(
            self.setup, self.versions, lambda row, said: self.log.extend(said), pinned=pinned
        )
        t = np.arange(rows) * 10**9
        v = np.full(rows, 0.1)
        block = make_block(t=t, u=v[:, None], y=(0.1 * np.arange(rows))[:, None])
        self.state = self.driver.run([block])

    def challenger(self, phase: int) -> TwinState:
        """Version 1 on trial, or live in probation with version 0 as the other."""
        self.versions.add(Form(), {"gain": 1.1}, parent=0, reason="tuned")
        lane = self.driver.follow.lane(1, tracked=phase == PROBATION)
        state = self.state
        if phase == PROBATION:
            other = state.live._replace(track=())
            state = state._replace(live=lane, first=copy(state.live), other=copy(other),
                                   trial=self.setup.probation.init())  # fmt: skip
        else:
            state = state._replace(other=lane)
        return state._replace(agenda=state.agenda._replace(phase=phase))

    def beat(self, state: TwinState, answer: Answer | None = None, *, end: bool = False) -> Step:
        return Step(*self.driver.decide.step(state, answer, end))


def losses(live: float, other: float, n: int = 400) -> np.ndarray:
    noise = np.random.default_rng(0).normal(size=n) ** 2
    return np.stack([live * noise, other * noise], axis=1)


def test_a_better_challenger_goes_live_in_probation() -> None:
    bench = Bench()
    state = bench.challenger(TRIAL)
    bench.setup.trial.step(state.trial, losses(4.0, 1.0))
    done = bench.beat(state)
    assert done.kinds == ["promoted"]
    assert (done.state.live.version, done.state.other.version) == (1, 0)
    assert done.state.first.version == 0
    assert done.state.agenda.phase == PROBATION
    assert done.state.scores.live.samples.sum() == 0
    assert done.events[0].evidence["version"] == 1


def test_a_worse_challenger_is_rejected_and_waited_after() -> None:
    bench = Bench()
    state = bench.challenger(TRIAL)
    bench.setup.trial.step(state.trial, losses(1.0, 9.0, 2500))
    done = bench.beat(state)
    assert done.kinds == ["rejected"]
    assert done.state.other is EMPTY
    assert done.state.agenda.phase == WATCH
    assert done.state.agenda.hold == done.state.row + bench.setup.holdoff


def test_a_pinned_champion_stays() -> None:
    bench = Bench(pinned=True)
    state = bench.challenger(TRIAL)
    bench.setup.trial.step(state.trial, losses(4.0, 1.0))
    done = bench.beat(state)
    assert done.kinds == []
    assert done.state.live.version == 0


def test_an_undecided_challenger_makes_room_for_newer_data() -> None:
    bench = Bench(anomaly=AnomalySpec(requirement=1e-12, relative=False, window=Span(10)))
    state = bench.challenger(TRIAL)
    bench.setup.trial.step(state.trial, losses(1.0, 1.0, 5 * bench.setup.trial.least + 1))
    state.scores.watch.residual[:] = 1.0
    state.scores.watch.samples[:], state.scores.seen[:] = 50, 50
    done = bench.beat(state)
    assert done.kinds == ["rejected", "suspected"]
    assert "superseded" in done.events[0].reason
    assert [request.kind for request in done.requests] == ["fit"]
    assert (done.state.agenda.phase, done.state.agenda.kind) == (WATCH, "fit")


def deviating(bench: Bench, state: TwinState) -> TwinState:
    state.scores.watch.residual[:] = 1.0
    state.scores.watch.samples[:], state.scores.seen[:] = 50, 50
    return state


def test_a_deviation_beside_a_trial_asks_for_what_surpasses_the_challenger() -> None:
    bench = Bench(anomaly=AnomalySpec(requirement=1e-12, relative=False, window=Span(10)))
    state = bench.challenger(TRIAL)
    begun = bench.beat(deviating(bench, copy(state)))
    assert begun.kinds == ["suspected"] and not begun.requests
    assert bench.beat(deviating(bench, begun.state)).kinds == []  # told once
    bench.setup.trial.step(state.trial, losses(1.2, 1.0, bench.setup.trial.least + 1))
    done = bench.beat(deviating(bench, state))
    assert done.kinds == ["suspected"]
    assert [request.kind for request in done.requests] == ["fit"]
    agenda = done.state.agenda
    assert (agenda.phase, agenda.rival, agenda.again) == (TRIAL, 1, 0)
    candidate = {"form": {"terms": [], "variant": []}, "values": {"gain": 0.9}, "scale": [0.01],
                 "reason": "tuned gain", "watched": []}  # fmt: skip
    answer = Answer(agenda.open, 0, {"events": [], "candidate": candidate})
    later = bench.beat(done.state, answer)
    assert later.kinds == ["superseded"] and "makes room" in later.events[0].reason
    assert (later.state.agenda.phase, later.state.other.version) == (TRIAL, 2)


@pytest.mark.parametrize(("horizon", "asked"), [(5.0, []), (60.0, ["fit"])])
def test_a_challenger_of_a_long_trial_is_surpassed_where_a_window_behind_it_deviates(
    horizon: float, asked: list[str]
) -> None:
    bench = Bench(
        anomaly=AnomalySpec(requirement=1e-12, relative=False, window=Span(10)),
        prediction=PredictionSpec(horizon=horizon),
    )
    state = bench.challenger(TRIAL)
    bench.setup.trial.step(state.trial, losses(1.2, 1.0, 6))
    assert bench.setup.trial.least > 6
    done = bench.beat(deviating(bench, state))
    assert [request.kind for request in done.requests] == asked
    assert (done.state.agenda.phase, done.state.agenda.rival) == (TRIAL, len(asked))


@pytest.mark.parametrize("commissioned", [True, False])
def test_a_window_behind_a_change_tells_it_anew_once(commissioned: bool) -> None:
    bench = Bench(tuning=TuningSpec(window=Span(30)))
    state = bench.challenger(TRIAL)
    state = state._replace(agenda=state.agenda._replace(commissioned=commissioned))
    bench.setup.trial.step(state.trial, losses(4.0, 1.0))
    state = bench.beat(state).state
    learned, size = bench.versions[1].row, bench.setup.window("retell")
    assert state.agenda.retell == (learned + size if commissioned else 0)
    state = state._replace(agenda=state.agenda._replace(phase=WATCH, retell=min(size, state.row)))
    done = bench.beat(state)
    assert [request.kind for request in done.requests] == ["retell"]
    assert done.state.agenda.retell == -1
    again = done.state._replace(agenda=done.state.agenda._replace(open=0))
    assert not bench.beat(again).requests


def test_a_promotion_drops_what_was_asked_beside_it() -> None:
    bench = Bench()
    state = bench.challenger(TRIAL)
    state = state._replace(agenda=state.agenda._replace(open=1, due=60, stop=50, asked=1, rival=1))
    bench.setup.trial.step(state.trial, losses(4.0, 1.0))
    done = bench.beat(state)
    assert done.kinds == ["promoted"]
    assert done.state.agenda.open == 0


def test_levels_that_were_missing_are_learned_when_they_may_have_come() -> None:
    rule = CorrectionSpec(channels=("v",), terms=("lag",), window=Span(30))
    bench = Bench(correction=rule)
    bench.versions.add(TABLE, {}, parent=0, reason="learned")
    state = bench.state._replace(live=bench.driver.follow.lane(1, tracked=True))
    for stop, lacking, kinds in [(20, 0, []), (30, 3, []), (20, 3, ["correct"])]:
        agenda = state.agenda._replace(stop=stop, lacking=lacking)
        done = bench.beat(copy(state)._replace(agenda=agenda))
        assert [request.kind for request in done.requests] == kinds
    assert done.state.agenda.rival == 1
    number = done.state.agenda.open
    for left, after in [(3, 0), (2, 2)]:  # as many as before: no more come
        answer = Answer(number, 1, {"events": [], "lacking": left})
        assert bench.beat(copy(done.state), answer).state.agenda.lacking == after


def test_a_champion_that_does_worse_is_rolled_back() -> None:
    bench = Bench()
    state = bench.challenger(PROBATION)
    bench.setup.probation.step(state.trial, losses(9.0, 1.0))
    done = bench.beat(state)
    assert done.kinds == ["rolled_back"]
    assert done.state.live.version == 0
    assert done.state.first.version == -1
    assert done.state.agenda.phase == WATCH
    assert done.state.agenda.hold > done.state.row


def test_a_champion_that_lasts_is_kept() -> None:
    bench = Bench()
    state = bench.challenger(PROBATION)
    bench.setup.probation.step(state.trial, losses(1.0, 4.0, bench.setup.probation.limit + 1))
    done = bench.beat(state)
    assert done.kinds == []
    assert (done.state.live.version, done.state.other.version) == (1, -1)
    assert done.state.agenda.phase == WATCH


def test_a_deviation_asks_for_a_fit() -> None:
    bench = Bench(anomaly=AnomalySpec(requirement=0.01, relative=False, window=Span(40)))
    bench.state.scores.watch.residual[:], bench.state.scores.watch.samples[:] = 1.0, 50
    bench.state.scores.seen[:] = 50
    done = bench.beat(bench.state)
    assert done.kinds == ["suspected"]
    assert done.requests[0].window == (0, 50)
    assert done.requests[0].due == 50 + bench.setup.latency
    assert done.state.scores.watch.samples.sum() == 0


def test_a_fit_looks_at_what_the_deviation_was_found_on() -> None:
    judged = AnomalySpec(requirement=0.01, window=Span(98))
    bench = Bench(anomaly=judged, tuning=TuningSpec(window=Span(40)))
    assert bench.setup.window("fit") == 98


@pytest.mark.parametrize(("off", "early"), [(0.012, []), (0.2, ["suspected"])])
def test_too_few_rows_ask_for_nothing_before_the_task_ends(off: float, early: list[str]) -> None:
    """What the rest of the window cannot help is told, once."""
    rule = AnomalySpec(requirement=0.01, relative=False, window=Span(98))
    bench = Bench(anomaly=rule)
    bench.state.scores.watch.residual[:] = off**2 * bench.state.scores.watch.samples
    before = bench.beat(copy(bench.state))
    assert (before.kinds, before.requests) == (early, [])
    assert bench.beat(before.state).kinds == []
    assert bench.beat(before.state, end=True).kinds == ([] if early else ["suspected"])


@pytest.mark.parametrize(
    ("square", "seen", "kinds", "kept"),
    [
        # grown from 4 to 6 mm, where 10 mm are asked and 5 mm count
        (0.006**2, 20, [], True),
        # 8 mm: over a quarter of a window too little, over a half enough
        (0.008**2, 10, [], True),
        (0.008**2, 25, ["drift"], False),
        # a whole window behind it was as before
        (0.004**2, 40, [], False),
    ],
)
def test_an_alarm_counts_where_the_deviation_grew(
    square: float, seen: int, kinds: list[str], kept: bool
) -> None:
    rule = AnomalySpec(requirement=0.01, relative=False, window=Span(40))
    bench = Bench(rows=400, anomaly=rule)
    scores, detect = bench.state.scores, bench.state.detect
    for sums, rows, size in ((scores.watch, seen, square), (scores.live_moving, 300, 0.004**2)):
        sums.residual[:], sums.samples[:] = rows * size, rows
    for now, all_rows in zip(scores.watch, scores.live_moving, strict=True):
        all_rows += now
    scores.seen[:] = seen
    alarm = Alarm("drift", "x", "its mean moved", bench.state.row - seen)
    state = bench.state._replace(detect=detect._replace(pending=alarm))
    done = bench.beat(state)
    assert done.kinds == kinds
    assert (done.state.detect.pending.kind == "drift") == kept


@pytest.mark.parametrize(("every", "asks"), [(np.inf, False), (1e6, True)])
def test_without_a_requirement_an_alarm_is_told_and_nothing_is_asked(
    every: float, asks: bool
) -> None:
    """Where there is a schedule something is tuned, and an alarm is no worse a reason."""
    bench = Bench(rows=400, anomaly=AnomalySpec(), tuning=TuningSpec(every=every))
    alarm = Alarm("suspected", "x", "its mean moved", bench.state.row - 1)
    detect = bench.state.detect._replace(pending=alarm)
    done = bench.beat(bench.state._replace(detect=detect))
    assert done.kinds == ["suspected"] and bool(done.requests) == asks


def test_a_schedule_asks_without_suspicion() -> None:
    bench = Bench(tuning=TuningSpec(every=30.0, window=Span(120)))
    requests = [record for record in bench.log if isinstance(record, Request)]
    assert [(r.row, r.detail) for r in requests] == [(35, {"reason": "scheduled"})]
    assert "suspected" not in [r.kind for r in bench.log if isinstance(r, Event)]


def asked(bench: Bench) -> TwinState:
    agenda = bench.state.agenda._replace(open=1, due=50, stop=50, asked=1)
    return bench.state._replace(agenda=agenda)


def test_an_answer_about_another_version_is_ignored() -> None:
    bench = Bench()
    done = bench.beat(asked(bench), Answer(1, 7, {"events": []}))
    assert done.state.agenda.open == 1


@pytest.mark.parametrize(("since", "left"), [(40, 0), (50, 1)])
def test_what_was_asked_about_rows_of_a_contact_is_dropped(since: int, left: int) -> None:
    bench = Bench()
    state = asked(bench)
    machine = state.external.machine
    machine[external_loop.OURS], machine[external_loop.STATE] = 1, external_loop.ON
    machine[external_loop.LATE], machine[external_loop.START] = 1, since
    assert bench.beat(state).state.agenda.open == left


def test_an_answer_without_candidate_is_waited_after() -> None:
    bench = Bench()
    said = {"kind": "not_identifiable", "signal": "gain", "reason": "constant", "evidence": {}}
    done = bench.beat(asked(bench), Answer(1, 0, {"events": [said], "tuned": True}))
    assert done.kinds == ["not_identifiable"]
    assert done.state.agenda.tunings == 1
    assert done.state.agenda.hold == 50 + bench.setup.holdoff


@pytest.mark.parametrize(
    ("kind", "before", "windows", "after"),
    [("abnormal", 0, 0, 1), ("abnormal", 1, 1, 2), ("abnormal", 2, 3, 2), ("noise", 2, 0, 0)],
)
def test_a_form_that_stays_wrong_is_asked_about_ever_more_rarely(
    kind: str, before: int, windows: int, after: int
) -> None:
    """So many windows later, after so many answers of which nothing came."""
    bench = Bench()
    state = asked(bench)
    state = state._replace(agenda=state.agenda._replace(vain=before))
    said = {"kind": kind, "signal": "", "reason": "depends on u", "evidence": {}}
    done = bench.beat(state, Answer(1, 0, {"events": [said], "tuned": True}))
    pause = bench.setup.holdoff + windows * bench.setup.enough
    assert (done.state.agenda.hold, done.state.agenda.vain) == (50 + pause, after)


@pytest.mark.parametrize(("told", "again"), [({}, 0), ({"changed": 45}, 45)])
def test_a_change_too_new_to_be_fitted_is_asked_about_again(
    told: dict[str, int], again: int
) -> None:
    """The last that was asked of a deviation, or what was asked in a trial, remembers none."""
    bench = Bench()
    done = bench.beat(asked(bench), Answer(1, 0, {"events": [], "waits": "too few", **told}))
    assert done.state.agenda.again == again
    assert done.state.agenda.hold == 50 + (bench.setup.latency if again else bench.setup.holdoff)


def test_that_a_number_is_not_determined_is_said_once_until_rows_do() -> None:
    bench, state = Bench(), None
    said = {"kind": "not_identifiable", "signal": "gain", "reason": "± 80 %", "evidence": {}}
    found = []
    for verdict in ("not", "not", "weak", "not", "not"):
        fit = {"parameters": {"gain": {"verdict": verdict}}}
        events = [said] if verdict == "not" else []
        state = asked(bench) if state is None else state
        state = state._replace(agenda=state.agenda._replace(open=1, due=50, stop=50, asked=1))
        done = bench.beat(state, Answer(1, 0, {"events": events, "fit": fit}))
        state = done.state
        found.append(done.kinds)
    assert found == [["not_identifiable"], [], [], ["not_identifiable"], []]


def test_an_answer_may_ask_for_a_correction() -> None:
    bench = Bench()
    done = bench.beat(asked(bench), Answer(1, 0, {"events": [], "next": "correct"}))
    assert [request.kind for request in done.requests] == ["correct"]
    assert done.state.agenda.kind == "correct"


def test_a_candidate_goes_on_trial() -> None:
    bench = Bench()
    candidate = {"form": {"terms": [], "variant": []}, "values": {"gain": 0.9}, "scale": [0.01],
                 "reason": "tuned gain", "watched": []}  # fmt: skip
    done = bench.beat(asked(bench), Answer(1, 0, {"events": [], "candidate": candidate}))
    assert done.state.agenda.phase == TRIAL
    assert done.state.other.version == 1
    assert done.state.agenda.versions == 2
    assert done.state.scores.scale.tolist() == [0.01]
    assert bench.versions[1].reason == "tuned gain"


def test_leaving_the_range_of_a_correction_starts_new_training() -> None:
    rule = CorrectionSpec(channels=("v",), terms=("lag",), watch=("v",), window=Span(120))
    bench = Bench(correction=rule)
    bench.versions.add(TABLE, {}, parent=0, reason="learned")
    state = bench.state._replace(
        live=bench.driver.follow.lane(1, tracked=True), watched=np.array([[0.2, 0.4]])
    )
    done = bench.beat(state)
    assert done.kinds == ["training_restarted"]
    assert done.events[0].signal == "v"
    assert done.state.agenda.since == 50
    assert done.state.agenda.retrain == 50 + bench.setup.spec.anomaly.window.rows
    later = bench.beat(done.state._replace(row=done.state.agenda.retrain))
    assert [request.kind for request in later.requests] == ["correct"]
    assert later.requests[0].window[0] == 50


def test_within_the_range_nothing_happens() -> None:
    rule = CorrectionSpec(channels=("v",), terms=("lag",), watch=("v",), window=Span(120))
    bench = Bench(correction=rule)
    bench.versions.add(TABLE, {}, parent=0, reason="learned")
    state = bench.state._replace(
        live=bench.driver.follow.lane(1, tracked=True), watched=np.array([[0.0, 0.4]])
    )
    assert bench.beat(state).kinds == []


def test_the_end_of_the_data_answers_what_is_open() -> None:
    bench = Bench(anomaly=AnomalySpec(requirement=1e-9, relative=False, window=Span(40)))
    bench.state.scores.watch.residual[:], bench.state.scores.watch.samples[:] = 1.0, 50
    bench.state.scores.seen[:] = 50
    state = bench.beat(bench.state).state
    assert state.agenda.open == 1
    done = bench.driver.finish(state)
    assert done.agenda.open == 0
    assert [r.id for r in bench.log if isinstance(r, Answer)][:1] == [1]


@pytest.mark.parametrize("relative", [True, False])
def test_a_deviation_is_shown_in_its_unit(relative: bool) -> None:
    bench = Bench(anomaly=AnomalySpec(requirement=0.01, relative=relative, window=Span(40)))
    assert bench.setup.shown(0, 0.05) == ("5.0 %" if relative else "50 mm")


def test_a_number_of_a_correction_that_no_row_touches_stays_and_the_others_follow() -> None:
    """A cap learned from faster commands, then slower ones and a machine that lost a fifth."""
    rng, n = np.random.default_rng(0), 1100
    start, cap, gain = rng.uniform(0.03, 0.08), rng.uniform(0.13, 0.18), rng.uniform(0.85, 1.1)
    free = np.repeat(0.01 * rng.integers(0, 21, n), rng.integers(3, 9, n))
    v = np.concatenate([np.repeat(0.01 * np.arange(21), 5), free])[:n]
    late = np.arange(n) >= 700
    v = np.where(late, np.minimum(v, 0.1), v)
    true = np.where(v < start, 0.0, np.minimum(np.where(late, 0.8, 1.0) * gain * v, cap))
    x = np.r_[0.0, np.cumsum(true[:-1])] + np.random.default_rng(2).normal(0.0, 0.002, n)
    with Twin.open("twins/robot1d.toml") as twin:
        result = twin.run({"t": np.arange(n) * 1.0, "v": v, "x": x})
        known = dict(zip(twin.champion.names, twin.champion.values, strict=True))
        late_rows = {k: c[700:] for k, c in {"t": np.arange(n) * 1.0, "v": v, "x": x}.items()}
        found = twin.fit(late_rows)
    promoted = [event.row for event in result.events if event.kind == "promoted"]
    assert promoted[0] < 700 < promoted[1]
    assert not [e.reason for e in result.events if "not connected" in e.reason]
    numbers = {item.name: item for item in found.parameters}
    assert numbers["law.v.cap"].value == known["law.v.cap"]
    assert numbers["gain"].value == known["gain"] and "gain as before" in found.fit.message
    assert found.fit.verdict[found.fit.names.index("law.v.gain")] == "identifiable"
