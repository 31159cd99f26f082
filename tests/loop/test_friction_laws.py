"""The laws of a whole twin: no cut matters, no break matters, a replay is the run again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.fold import Block, Event, Request, copy, make_block, take
from evertwin.fold.records import canonical
from evertwin.fold.state import equal, load, save
from evertwin.ledger.versions import Versions
from evertwin.loop.driver import Driver
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import Saved
from evertwin.store import SqliteStore
from evertwin.twin import Twin

from .machines import CASES, Case, Run, arm, cut, play, robot, whole

NAMES = pytest.mark.parametrize("name", ["robot", "arm"])


def same(a: Run, b: Run) -> None:
    assert canonical(a.records) == canonical(b.records)
    assert a.versions == b.versions
    assert equal(a.state, b.state)


def kinds(run: Run) -> list[str]:
    return [record.kind for record in run.records if isinstance(record, Event)]


def test_the_robot_learns_a_table_and_promotes_it() -> None:
    run = whole("robot")
    assert {"suspected", "corrected", "promoted"} <= set(kinds(run))
    assert [term.kind for term in run.versions[run.state.live.version].form.terms] == ["table"]


def test_the_arm_is_tuned_and_promoted() -> None:
    run = whole("arm")
    assert {"suspected", "tuned", "promoted"} <= set(kinds(run))
    live = run.versions[run.state.live.version]
    found = dict(zip(live.names, live.values, strict=True))
    assert found["Fc1"] == pytest.approx(12.0, rel=0.03)
    assert found["Fc6"] == pytest.approx(2.5, rel=0.03)


@NAMES
def test_a_second_run_is_identical(name: str) -> None:
    case = CASES[name]()
    same(play(case, [case.rows]), whole(name))


@NAMES
def test_blocks_of_one_end_the_same(name: str) -> None:
    case, run = CASES[name](), whole(name)
    same(play(case, cut(case.rows, range(len(case.rows.t))), run.answered), run)


@pytest.mark.slow
@NAMES
@settings(max_examples=25, deadline=None)
@given(st.data())
def test_no_cut_matters(name: str, data: st.DataObject) -> None:
    case, run = CASES[name](), whole(name)
    n = len(case.rows.t)
    places = data.draw(st.lists(st.integers(1, n - 1), max_size=60))
    same(play(case, cut(case.rows, places), run.answered), run)


@NAMES
def test_a_cut_does_not_change_slow_work(name: str) -> None:
    case = CASES[name]()
    rng = np.random.default_rng(1)
    places = rng.integers(1, len(case.rows.t), 25).tolist()
    same(play(case, cut(case.rows, places)), whole(name))


class PowerFailure(Exception):
    """The machine under the twin stops."""


def until(rows: Block, stop: int) -> Iterator[Block]:
    yield take(rows, 0, stop)
    raise PowerFailure


def breaks(name: str) -> list[int]:
    """Rows worth breaking at: within an open request, on trial, in probation."""
    run = whole(name)
    requests = [record.row for record in run.records if isinstance(record, Request)]
    events = {r.kind: r.row for r in run.records if isinstance(r, Event)}
    return sorted({1, *(row + 2 for row in requests), events["promoted"] - 3,
                   events["promoted"] + 3})  # fmt: skip


@NAMES
def test_a_broken_run_goes_on_to_the_same_end(name: str) -> None:
    case, run = CASES[name](), whole(name)
    unbroken = SqliteStore(":memory:")
    Twin(case.spec, store=unbroken).run([case.rows])
    for stop in breaks(name):
        store = SqliteStore(":memory:")
        with pytest.raises(PowerFailure):
            Twin(case.spec, store=store).run(until(case.rows, stop), every=1)
        twin = Twin(case.spec, store=store)
        result = twin.run([case.rows])
        assert result.samples == len(case.rows.t)
        assert twin.versions == run.versions, stop
        assert result.champion == run.versions[run.state.live.version]
        kept = store.restore(Saved(_like(twin, run)))
        assert kept is not None and equal(kept.state.twin, run.state), stop
        assert store.entries() == unbroken.entries(), stop


def test_rows_folded_after_the_last_checkpoint_are_folded_again() -> None:
    case, run = robot(), whole("robot")
    promoted = next(r.row for r in run.records if isinstance(r, Event) and r.kind == "promoted")
    unbroken, store = SqliteStore(":memory:"), SqliteStore(":memory:")
    Twin(case.spec, store=unbroken).run([case.rows])
    with pytest.raises(PowerFailure):
        Twin(case.spec, store=store).run(until(case.rows, promoted + 4), every=promoted - 20)
    again = Twin(case.spec, store=store)
    result = again.run([case.rows])
    assert again.versions == run.versions
    assert again.champion == run.versions[run.state.live.version]
    assert store.entries() == unbroken.entries()
    assert [e.kind for e in result.of_kind("promoted")] == ["promoted"]


def silent(case: Case) -> Driver:
    setup = Setup(case.spec, model_of(case.spec, None))
    return Driver(setup, Versions(setup.model), lambda row, said: None)


def _like(twin: Twin, run: Run) -> object:
    driver = Driver(twin.setup, Versions(twin.model), lambda row, said: None)
    driver.versions.restore(list(run.versions))
    state = run.state
    return driver.template(state.live.version, state.first.version, state.other.version)


@NAMES
def test_a_state_survives_save_and_load(name: str) -> None:
    case, run = CASES[name](), whole(name)
    driver = silent(case)
    driver.versions.restore(list(run.versions))
    lanes = (run.state.live.version, run.state.first.version, run.state.other.version)
    loaded = load(save(copy(run.state)), like=driver.template(*lanes))
    assert equal(loaded, run.state)


def test_an_empty_run_ends() -> None:
    case = arm()
    driver = silent(case)
    state = driver.finish(driver.init())
    assert state.row == 0
    one = make_block(t=[0], u=np.zeros((1, 18)), y=np.zeros((1, 6)))
    assert driver.finish(driver.step(state, one)).row == 1
