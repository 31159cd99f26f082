"""What a person says to an event acts: on alarms, on what is tuned first, on the rows of a fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, StoreSpec, TuningSpec
from evertwin.errors import UsageError
from evertwin.fold import Answer, Block, make_block, take
from evertwin.fold.span import Span
from evertwin.ledger.label import Label
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.refit.work import Work
from evertwin.rows.ring import Ring
from evertwin.setup.detectors import Alarm, Detect, DetectState
from evertwin.setup.released import Released
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from evertwin.signals import Layout
from evertwin.store import SqliteStore
from planted.draws import first_of

from .machines import robot

SPEC = TwinSpec(
    "axis", ModelSpec("function"), beat=Span(20), prediction=PredictionSpec(horizon=1.0),
    anomaly=AnomalySpec(requirement=0.05, window=Span(100)),
    tuning=TuningSpec(window=Span(400), causes={"friction": ("Fc", "Fv"), "load": ("mass",)}),
)  # fmt: skip
TRUE = np.array([4.0, 2.0, 3.0])


def pushed(x: Any, u: Any, dt: float, p: Any) -> Any:
    return [], [p[0] * np.sign(u[0]) + p[1] * u[0] + p[2] * u[1]]


def model() -> FunctionModel:
    return translated(FunctionModel(
        pushed, Layout.of(v="m/s", a="m/s²"), Layout.of(force="N"),
        parameters=Parameters.of(Fc=(4.0, "N"), Fv=(2.0, "N s/m"), mass=(3.0, "kg")),
    ))  # fmt: skip


def rows(seed: int, *parts: tuple[int, Any]) -> Block:
    """An axis to and fro; each part: so many rows, and the force's parameters or its gain there."""
    rng, n = np.random.default_rng(seed), sum(count for count, _ in parts)
    t = 0.1 * np.arange(n)
    w = rng.uniform(0.7, 1.3)
    u = np.stack([np.sin(w * t), w * np.cos(w * t)], axis=1)
    bases, force, at = np.stack([np.sign(u[:, 0]), u[:, 0], u[:, 1]], axis=1), np.empty(n), 0
    for count, p in parts:
        part = slice(at, at + count)
        factor, numbers = (p, TRUE) if np.isscalar(p) else (1.0, np.asarray(p))
        force[part] = factor * bases[part] @ numbers
        at += count
    force += rng.normal(0.0, 0.05, n)
    return make_block(t=np.rint(t * 1e9).astype(np.int64), u=u, y=force[:, None])


def twin(store: SqliteStore | None = None) -> Twin:
    return Twin(SPEC, model=model(), store=store)


def numbers(of: Twin) -> np.ndarray:
    return np.array(of.champion.values)


def first(of: Twin, kind: str) -> int:
    entries = of.store.entries(kinds=("event",))
    return next(e.number for e in entries if f'"kind":"{kind}"' in e.content)


Told = list[tuple[int, dict[str, Any]]]


def labelled(of: Twin, block: Block, told: Told, kind: str = "suspected") -> Iterator[Block]:
    """The rows; before some of them somebody says something to the first event of a kind."""
    at = 0
    for row, said in told:
        yield take(block, at, row)
        of.label(Label(event=first(of, kind), reason="I saw it", person="ada", **said))
        at = row
    yield take(block, at, len(block.t))


# ------------------------------------------------------------------ rows


def test_rows_that_are_left_out_are_in_no_window_and_cut_it() -> None:
    ring = Ring(50, 1, 1)
    block = make_block(t=range(80), u=np.arange(80.0)[:, None], y=np.zeros((80, 1)))
    state = ring.push(ring.init(), block)
    assert ring.leave_out(state, 10, 34) == 5 and ring.leave_out(state, 60, 64) == 5
    found = ring.between(state, 0, 80)
    assert [(b.row, len(b.t)) for b in found] == [(35, 25), (65, 15)]
    assert ring.leave_out(state, 10**30, 10**31) == ring.leave_out(state, -(10**31), -3) == 0
    later = ring.push(state, block._replace(row=80))
    assert sum(len(b.t) for b in ring.between(later, 0, 160)) == 50, "new rows take their place"


@first_of("seed", range(4))
def test_rows_called_faulty_are_not_learned_from(seed: int) -> None:
    """A gauge reads 40 % too much for a while; what is fitted later does not know of it."""
    block, spec = rows(seed, (300, 1.0), (120, 1.4), (250, 1.0)), replace(
        SPEC, anomaly=AnomalySpec(requirement=0.4, window=Span(100)),
        tuning=replace(SPEC.tuning, every=20.0),
    )  # fmt: skip
    with Twin(spec, model=model()) as deaf, Twin(spec, model=model()) as heard:
        assert deaf.run(iter([block])).of_kind("tuned"), "unsaid, the fit follows the gauge"
        said = {"verdict": "faulty", "rows": (300, 419)}
        result = heard.run(labelled(heard, block, [(430, said)], "normal"))
        newest = [a for a in heard.store.read("answer") if isinstance(a, Answer)][-1]
        assert not result.of_kind("tuned") and "the fit under way begins anew" in str(
            result.of_kind("heeded")[0].reason
        )
        assert str(newest.content["waits"]) < "tuning explains 5 %", "nothing is left to explain"


def test_what_was_learned_from_faulty_rows_is_dropped() -> None:
    block = rows(0, (300, 1.0), (120, 1.4), (500, 1.0))
    with twin() as one:
        result = one.run(labelled(one, block, [(421, {"verdict": "faulty", "rows": (300, 419)})]))
        (said,) = result.of_kind("heeded")
        assert "120 rows leave the window of fits" in said.reason
        assert "version 1, which was on trial, was learned from them and is dropped" in said.reason
        assert said.evidence["event"] == first(one, "suspected")
        assert result.trial is None


def test_work_on_faulty_rows_begins_anew_without_them() -> None:
    block = rows(0, (300, 1.0), (50, 1.4), (500, np.array([6.0, 2.0, 3.0])))
    with twin() as one:
        result = one.run(labelled(one, block, [(361, {"verdict": "faulty", "rows": (300, 349)})]))
        (said,) = result.of_kind("heeded")
        assert "the fit under way begins anew" in said.reason
        assert abs(numbers(one)[0] - 6.0) < 0.2


# ------------------------------------------------------------------ causes


def worked(cause: str, truth: np.ndarray) -> dict[str, Any]:
    with twin() as one:
        work = Work(Setup(one.spec, one.model), one._versions)
        block = rows(3, (400, truth))
        return dict(work.content(Task("fit", one.champion, (block,), 0, cause=cause)))


def test_a_named_cause_is_tried_first_and_alone() -> None:
    content = worked("friction", np.array([6.0, 2.0, 3.0]))
    assert content["events"][0]["kind"] == "normal"
    assert "friction, which was named, explains" in content["events"][0]["reason"]
    values = content["candidate"]["values"]
    assert abs(values["Fc"] - 6.0) < 0.1 and values.get("mass", 3.0) == 3.0


def test_a_wrong_cause_is_said_so_and_all_is_tuned() -> None:
    content = worked("load", np.array([6.0, 2.0, 3.0]))
    told = next(e for e in content["events"] if e["kind"] == "heeded")
    assert "load, which was named, explains" in told["reason"] and "all is tuned" in told["reason"]
    assert abs(content["candidate"]["values"]["Fc"] - 6.0) < 0.1


def test_a_cause_that_the_twin_file_has_no_longer_stops_no_fit() -> None:
    content = worked("rust", np.array([6.0, 2.0, 3.0]))
    assert "no cause 'rust'" in content["events"][0]["reason"]
    assert abs(content["candidate"]["values"]["Fc"] - 6.0) < 0.1


def test_a_cause_is_used_once_and_only_one_there_is() -> None:
    block = rows(1, (300, TRUE), (500, np.array([6.0, 2.0, 3.0])))
    with twin() as one:
        said = {"verdict": "cause", "cause": "friction"}
        result = one.run(labelled(one, block, [(330, said)]))
        told = [e for e in result.events if "friction" in (e.reason + e.signal)]
        assert told[0].kind == "heeded" and "tried first" in told[0].reason
        assert len([e for e in told if "which was named" in e.reason]) == 1
        assert abs(numbers(one)[0] - 6.0) < 0.2 and numbers(one)[2] == 3.0
        with pytest.raises(UsageError, match="there are friction, load"):
            one.label(Label(1, "cause", "x", cause="rust"))
    none = replace(SPEC, tuning=replace(SPEC.tuning, editable=("Fc",)))
    with Twin(none, model=model()) as fixed:
        assert fixed.causes == ("friction",)
        with pytest.raises(UsageError, match="mass may not be tuned"):
            fixed.label(Label(1, "cause", "x", cause="load"))


# ------------------------------------------------------------------ false alarms


def alarms(
    seed: int, *, told: bool, bump: float = 2.5, shift: float = 0.0
) -> tuple[DetectState, list[int], list[str]]:
    """Noise that somebody leans against now and then, which its calm rows do not know; ``told``:
    each alarm is called false. Rows of the alarms, and what was said."""
    rng, n = np.random.default_rng(seed), 40_000
    stage = Detect.of(AnomalySpec(calibration=2000.0), Layout.of(a="m"), np.array([True]), 1)
    level, at = np.zeros(n), 3000
    while at < n - 1500:
        level[at : at + int(rng.integers(40, 80))] = bump
        at += int(rng.integers(1200, 2400))
    level[-500:] += shift
    live, state, found, said = (rng.normal(size=n) + level)[:, None], stage.init(), [], []
    for start in range(0, n, 100):
        part = slice(start, start + 100)
        piece = Released(
            np.arange(n)[part], (np.arange(n) * 10**9)[part], np.zeros(100, np.int64), live[part],
            live[part], live[part], live[part], np.ones((100, 1), np.bool_),
            *(np.zeros(100, np.bool_) for _ in range(2)),
        )  # fmt: skip
        state, _ = stage.step(state, piece)
        state, _ = stage.beat(state)
        if (alarm := state.pending).kind and (not told or state.cusum.seen[0, 1] < 0):
            found.append(alarm.row)
            if told:
                state, sentence = stage.mistaken(state, "a", alarm.evidence)
                said.append(sentence)
            state = state._replace(pending=Alarm())
    return state, found + [state.pending.row] * bool(state.pending.kind), said


@pytest.mark.parametrize("seed", range(4))
def test_what_was_called_false_is_no_alarm_again_and_a_real_one_is(seed: int) -> None:
    deaf = alarms(seed, told=False)[1]
    state, heard, said = alarms(seed, told=True)
    assert len(deaf) >= 10 and len(heard) <= len(deaf) / 2, (deaf, heard)
    assert state.false.sum() == len(heard) and "false alarm 2 of a, after" in said[1]
    real = alarms(seed, told=True, shift=8.0)[1]
    assert real[-1] >= 39_500, "a shift far beyond what is calm is still an alarm"


def test_what_is_called_false_and_goes_on_is_learned_anew() -> None:
    stage = Detect.of(AnomalySpec(), Layout.of(a="m"), np.array([True]), 1)
    state, found, _ = alarms(0, told=False, bump=0.0, shift=4.0)
    assert found and state.cusum.seen[0, 1] >= 0
    alarm = Alarm("suspected", "a", "", found[0], "cusum")
    state, said = stage.mistaken(state, "a", alarm.evidence)
    assert "learned anew" in said and not state.cusum.calibration.ready
    assert state.false.sum() == 1 and state.calm[0, 0] > 0, "another champion: it counts on"


def test_a_false_alarm_of_the_requirement_is_no_evidence_again() -> None:
    block = rows(2, (300, 1.0), (100, 1.4), (400, 1.0))
    with twin() as one:
        result = one.run(labelled(one, block, [(401, {"verdict": "false alarm"})]))
        assert not result.of_kind("promoted") and (numbers(one) == TRUE).all()
        assert "rows leave the window" in result.of_kind("heeded")[0].reason


# ------------------------------------------------------------------ inputs of the fold


def log(store: SqliteStore) -> list[tuple[int, str, int, str]]:
    return [entry[1:5] for entry in store.entries()]


class Off(Exception):
    """The machine under the twin stops."""


def cut(block: Block, stop: int) -> Iterator[Block]:
    yield take(block, 0, stop)
    raise Off


def test_what_was_said_is_heeded_again_at_the_same_beat() -> None:
    """Cut off, labelled, gone on; cut off once more, and folded again from its beginning."""
    block, logs = rows(0, (300, 1.0), (120, 1.4), (300, 1.0)), []
    for stops in ((), (500,), (430, 600)):
        store = SqliteStore(":memory:")
        with pytest.raises(Off):
            twin(store).run(cut(block, 425), every=50)
        spoken = twin(store)
        spoken.label(Label(first(spoken, "suspected"), "faulty", "gauge", rows=(300, 419)))
        for stop in stops:
            with pytest.raises(Off):
                twin(store).run(broken(block, stop), every=1000)
        result = twin(store).run([block], every=1000)
        assert len(result.of_kind("heeded")) == 1
        logs.append(log(store))
    assert logs[0] == logs[1] == logs[2]


class broken(list[Block]):
    """Rows that break off while they are read for the second time."""

    def __init__(self, block: Block, stop: int) -> None:
        super().__init__([take(block, 0, stop), take(block, stop, len(block.t))])
        self.times = 0

    def __iter__(self) -> Iterator[Block]:
        self.times += 1
        yield self[0]
        if self.times > 1:
            raise Off
        yield self[1]


def test_a_label_between_two_runs_is_heeded_by_the_next_one() -> None:
    """The report is read, something is said, the next day is run: its rows have other numbers."""
    day, logs = rows(0, (300, 1.0), (120, 1.4)), []
    next_day = rows(5, (400, 1.0))
    next_day = next_day._replace(t=next_day.t + 86_400 * 10**9)
    for stop in (None, 200):
        store = SqliteStore(":memory:")
        twin(store).run([day])
        spoken = twin(store)
        spoken.label(Label(first(spoken, "suspected"), "faulty", "gauge", rows=(300, 419)))
        if stop is not None:
            with pytest.raises(Off):
                twin(store).run(broken(next_day, stop), every=50)
        result = twin(store).run([next_day])
        (said,) = result.of_kind("heeded")
        assert "row -120, in a run before to row -1, in a run before" in said.reason
        assert said.row == SPEC.beat.at(None) and "120 rows leave" in said.reason
        logs.append(log(store))
        twin(store).run([next_day])
        assert log(store) == logs[-1], "said once, heeded once"
    assert logs[0] == logs[1]


def test_what_cannot_be_meant_is_refused() -> None:
    with twin() as one:
        with pytest.raises(UsageError, match="no event 77"):
            one.label(Label(77, "true", "x"))
        event = first(one, "configured")
        with pytest.raises(UsageError, match="is about no rows"):
            one.label(Label(event, "faulty", "x"))
        for wrong in (
            {"verdict": "true", "cause": "load"}, {"verdict": "faulty", "rows": (5, 4)},
            {"verdict": "cause"},
        ):  # fmt: skip
            with pytest.raises(UsageError, match="label"):
                Label(event=1, reason="x", **wrong)  # type: ignore[arg-type]
        kept = one.label(Label(event, "acknowledged", "seen", "ada"))
        assert kept.evidence == {
            "event": event, "kind": "configured", "verdict": "acknowledged", "person": "ada"
        }  # fmt: skip


def test_a_label_from_another_process_is_heeded_at_the_next_beat(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evertwin.ledger.run_log.SECONDS", 0.0)
    spec = replace(robot().spec, store=StoreSpec("a.db"), folder=str(tmp_path))

    def day() -> Iterator[Block]:
        yield take(robot().rows, 0, 72)
        with Twin(spec, reading=True) as other:
            other.label(
                Label(first(other, "configured"), "faulty", "unplugged", "ada", rows=(9, 18))
            )
        yield take(robot().rows, 72, 100)

    with Twin(spec) as kept:
        (said,) = kept.run(day()).of_kind("heeded")
        assert said.row == 75 and "10 rows leave the window of fits" in said.reason
