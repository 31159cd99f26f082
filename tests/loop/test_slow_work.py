"""Slow work in other processes: the same run bit for bit; live, the fold never waits for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from evertwin.engine import EngineSpec, InProcess, Job, Pool
from evertwin.fold import Answer, Event, Record, Request, copy, take
from evertwin.ledger.versions import Versions
from evertwin.loop.driver import Driver
from evertwin.refit.work import work_of
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.store import SqliteStore
from evertwin.twin import Twin
from planted.draws import first_of

from .machines import CASES, Case, play, robot, whole
from .test_friction_laws import PowerFailure, breaks, same, until

NAMES = pytest.mark.parametrize("name", ["robot", "arm"])


def pool(case: Case, **limits: float) -> Pool:
    return Pool(1, EngineSpec(**limits), partial(work_of, case.spec, None))  # type: ignore[arg-type]


class Late(InProcess):
    """Answers come so many beats later than they are asked for first."""

    def __init__(self, beats: int) -> None:
        super().__init__()
        self.beats = beats
        self.left = beats
        self.waits = 0
        self.dropped: list[int] = []

    def submit(self, request: Request, job: Job) -> None:
        self.left = self.beats
        super().submit(request, job)

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        self.left -= 1
        self.waits += until is not None
        return super().answers(until) if self.left <= 0 or until is not None else ()

    def drop(self, number: int) -> None:
        self.dropped.append(number)
        super().drop(number)


# ---------------------------------------------------------------------- the same run


@pytest.mark.slow
def test_a_run_with_workers_is_the_run_without() -> None:
    """An arm; of a robot the stores below hold the same."""
    case = CASES["arm"]()
    with pool(case) as engine:
        same(play(case, [case.rows], engine=engine), whole("arm"))


@pytest.mark.slow
def test_the_stores_of_both_hold_the_same(tmp_path: Path) -> None:
    case, heads = robot(), []
    for workers in (0, 2):
        store = SqliteStore(str(tmp_path / f"{workers}.db"))
        with Twin(case.spec, store=store) as twin:
            twin.run([case.rows], workers=workers)
            heads.append((store.head, store.entries()))
    assert heads[0] == heads[1]


@pytest.mark.slow
@first_of("name", ["robot", "arm"])
@first_of("places", [slice(1, 2), slice(None)])
def test_work_that_a_restored_state_asks_for_is_done_again(name: str, places: slice) -> None:
    """Within the first request; and wherever a run is broken."""
    case, unbroken = CASES[name](), SqliteStore(":memory:")
    Twin(case.spec, store=unbroken).run([case.rows])
    spec = replace(case.spec, engine=EngineSpec(workers=1))
    for stop in breaks(name)[places]:
        store = SqliteStore(":memory:")
        with pytest.raises(PowerFailure):
            Twin(case.spec, store=store).run(until(case.rows, stop), every=1)
        twin = Twin(spec, store=store)
        twin.run([case.rows])
        assert store.entries() == unbroken.entries(), stop
        twin.close()


def test_a_model_given_as_an_object_works_here_alone() -> None:
    case = robot()
    spec = replace(case.spec, engine=EngineSpec(workers=1))
    with Twin(spec, model_of(case.spec)) as twin:
        with pytest.raises(Exception, match="each process builds it anew"):
            twin.run([case.rows])
        assert twin.run([case.rows], workers=0).of_kind("promoted")


# ---------------------------------------------------------------------- live


@NAMES
@pytest.mark.parametrize("beats", [1, 2, 7])
def test_a_live_run_takes_the_answer_that_is_there(name: str, beats: int) -> None:
    case, engine = CASES[name](), Late(beats)
    run = play(case, [case.rows], engine=engine, live=True)
    asked = {r.id: r for r in run.records if isinstance(r, Request)}
    for number, (row, _) in run.answered.items():
        ahead = row - asked[number].row
        assert ahead == beats * case.spec.beat.rows or row == len(case.rows.t), number
    # what was asked beside a trial that ended in a promotion is not answered any more
    live = {r.row for r in run.records if isinstance(r, Event) and r.kind == "promoted"}
    late = beats * case.spec.beat.rows
    dropped = [r for r in asked.values() if any(r.row < row <= r.row + late for row in live)]
    assert run.answered and len(asked) - len(run.answered) <= len(dropped)


@NAMES
@pytest.mark.parametrize("beats", [1, 7, 10**6])
def test_a_live_run_is_repeated_from_its_log(name: str, beats: int) -> None:
    case = CASES[name]()
    run = play(case, [case.rows], engine=Late(beats), live=True)
    idle = Late(0)
    for live in (False, True):
        same(play(case, [case.rows], run.answered, engine=idle, live=live), run)
    assert idle.waits == 0 and not idle._open, "work was done again that the log has"


def test_a_live_run_waits_for_nothing_but_its_end() -> None:
    case, engine = robot(), Late(10**6)
    run = play(case, [case.rows], engine=engine, live=True)
    assert {row for row, _ in run.answered.values()} == {len(case.rows.t)}
    assert engine.waits == len(run.answered)


def test_a_live_run_with_processes_is_repeated_from_its_log() -> None:
    case = robot()
    with pool(case) as engine:
        run = play(case, [case.rows], engine=engine, live=True)
    assert run.answered
    same(play(case, [case.rows], run.answered), run)


# ---------------------------------------------------------------------- what goes wrong


def driver_of(case: Case, said: list[Record], engine: InProcess) -> Driver:
    setup = Setup(case.spec, model_of(case.spec))
    return Driver(setup, Versions(setup.model), lambda row, more: said.extend(more), engine=engine)


def asked(case: Case, engine: InProcess) -> tuple[Driver, Any]:
    """A driver, and its state after it has asked for slow work."""
    said: list[Record] = []
    driver, rows = driver_of(case, said, engine), case.rows
    request = next(r for r in whole("robot").records if isinstance(r, Request))
    state = driver.run([take(rows, 0, request.row + 1)])
    assert state.agenda.open == request.id
    return driver, state


def test_what_nobody_waits_for_is_dropped() -> None:
    engine = Late(10**6)
    driver, state = asked(robot(), engine)
    driver.slow.send(state)
    assert list(engine._open) == [state.agenda.open], "sent once"
    driver.slow.send(state._replace(agenda=state.agenda._replace(open=0)))
    assert not engine._open and state.agenda.open in engine.dropped


def test_an_answer_to_another_request_is_not_taken() -> None:
    engine = Late(0)
    driver, state = asked(robot(), engine)
    number = state.agenda.open
    other = Request(number + 7, "fit", 0, 0, 0, (0, 1))
    engine.submit(other, lambda: {"events": []})
    answer = driver.slow.take(state, wait=True)
    assert answer is not None and answer.id == number


def test_rows_are_those_of_the_request_however_late_it_is() -> None:
    """The ring has gone on when the work begins."""
    case, run = robot(), whole("robot")
    live = play(case, [case.rows], engine=Late(10**6), live=True)
    first = min(run.answered)
    told = [dict(r.answered[first][1].content) for r in (run, live)]
    when = {"time": 0, "elapsed": 0, "task": 0}
    assert told[0] | when == told[1] | when


@pytest.fixture(scope="module")
def limited() -> Iterator[Any]:
    """A run in which each piece of work takes too long."""
    case = robot()
    with pool(case, time=1e-3) as engine:
        yield play(case, [case.rows], engine=engine)


def test_work_beyond_its_limits_is_a_rejection_with_its_reason(limited: Any) -> None:
    events = [r for r in limited.records if isinstance(r, Event) and r.kind == "rejected"]
    assert events and all("longer than 0.001 s" in event.reason for event in events)
    assert limited.state.row == len(robot().rows.t) and len(limited.versions) == 1


def test_a_run_with_lost_work_is_repeated_from_its_log(limited: Any) -> None:
    case = robot()
    same(play(case, [case.rows], limited.answered), limited)


def test_rows_that_are_gone_are_a_rejection() -> None:
    """After a crash in a live run the window may have left the ring."""
    engine = Late(0)
    driver, state = asked(robot(), engine)
    engine.drop(state.agenda.open)
    driver.slow = driver_of(robot(), [], engine).slow
    gone = state._replace(agenda=state.agenda._replace(start=-20, stop=-10))
    answer = driver.slow.take(gone, wait=True)
    assert answer is not None
    (event,) = answer.content["events"]  # type: ignore[misc, union-attr]
    assert event["kind"] == "rejected" and "rows" in event["reason"]  # type: ignore[index]
    after = driver.beat(copy(state), task_end=False)
    assert after.row == state.row
