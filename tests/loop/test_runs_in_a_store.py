"""A store that outlives runs: rows are run once, whoever stops, and whatever is named again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.config import read
from evertwin.config.spec import AnomalySpec, CorrectionSpec, StoreSpec, TrialSpec
from evertwin.errors import StoreError
from evertwin.fold import Block, Event, concatenate, make_block, take
from evertwin.fold.span import Span
from evertwin.loop.run import settings_hash
from evertwin.models.form import Form
from evertwin.outcome.result import RunResult
from evertwin.store import Batch, SqliteStore
from evertwin.twin import Twin
from proofs.kills import POINTS

from .machines import robot

TWINS = Path(__file__).parents[2] / "twins"

Log = list[tuple[int, str, int, str]]


class PowerFailure(Exception):
    """The machine under the twin stops."""


def until(rows: Block, stop: int) -> Iterator[Block]:
    yield take(rows, 0, stop)
    raise PowerFailure


def day(number: int) -> Block:
    """A day's recording: its stamps are its own."""
    rows = robot().rows
    return rows._replace(t=rows.t + number * 86_400 * 10**9, y=rows.y + 1e-9 * number)


def both() -> Block:
    """Monday and Tuesday as one recording of two tasks."""
    first, second = day(1), day(2)
    n = len(first.t)
    gap = second.gap.copy()
    gap[0] = True
    return concatenate([first, second._replace(row=n, task=second.task + 1, gap=gap)])


def log(store: SqliteStore) -> Log:
    return [entry[1:5] for entry in store.entries()]


def twin(store: SqliteStore, **changes: Any) -> Twin:
    return Twin(replace(robot().spec, **changes), store=store)


def same(a: RunResult, b: RunResult) -> None:
    """Everything but the time it took."""
    for one, other in ((a.to_dict(), b.to_dict()),):
        assert one | {"seconds": 0} == other | {"seconds": 0}  # type: ignore[operator]
    assert a.trace.keys() == b.trace.keys()
    for name, column in a.trace.items():
        assert np.array_equal(column, b.trace[name], equal_nan=column.dtype.kind == "f"), name


def test_monday_and_tuesday_are_both_there() -> None:
    store = SqliteStore(":memory:")
    for number in (1, 2):
        result = twin(store).run([day(number)])
        assert result.samples == len(day(number).t)
    ran = [e.evidence for e in events(store, "ran")]
    assert [e["tasks"] for e in ran] == [1, 1]
    assert [e.evidence["tasks_before"] for e in events(store, "started")] == [0, 1]
    assert [e.run for e in store.entries() if e.kind == "event" and '"promoted"' in e.content]


def test_a_run_that_is_repeated_shows_what_it_showed_and_adds_nothing() -> None:
    store = SqliteStore(":memory:")
    first = twin(store).run([day(1)])
    kept = log(store)
    same(twin(store).run([day(1)]), first)
    twin(store).run([day(2)])
    later = log(store)
    same_but_versions = twin(store).run([day(1)])  # an older run is folded again, from the log
    assert same_but_versions.events == first.events and log(store) == later
    assert kept == later[: len(kept)]
    again = twin(store).run([day(1)], again=True)
    assert again.samples == first.samples and len(log(store)) > len(later)


def test_rows_of_runs_before_are_passed_over() -> None:
    one, other = SqliteStore(":memory:"), SqliteStore(":memory:")
    for number in (1, 2):
        twin(one).run([day(number)])
    twin(other).run([day(1)])
    result = twin(other).run([both()])
    assert result.samples == len(day(2).t) and log(other) == log(one)
    twin(other).run([both()])
    assert log(other) == log(one)


@pytest.mark.parametrize("stop", [0.1, 0.5, 0.9])
def test_an_interrupted_command_repeated_gives_the_unbroken_result(stop: float) -> None:
    whole, broken = SqliteStore(":memory:"), SqliteStore(":memory:")
    first = twin(whole).run([day(1)])
    with pytest.raises(PowerFailure):
        twin(broken).run(until(day(1), int(stop * len(day(1).t))), every=50)
    same(twin(broken).run([day(1)]), first)
    assert log(broken) == log(whole)


def test_what_was_cut_off_is_given_up_for_other_rows() -> None:
    store = SqliteStore(":memory:")
    with pytest.raises(PowerFailure):
        twin(store).run(until(day(1), 200), every=50)
    twin(store).run([day(2)])
    given_up = events(store, "ran")[0]
    assert given_up.evidence["given_up"] and given_up.evidence["tasks"] == 1
    assert "run 1 was cut off and is given up" in given_up.reason
    assert events(store, "started")[1].evidence["tasks_before"] == 1
    assert twin(store).run([day(1)]).samples == len(day(1).t)
    assert [entry.run for entry in store.entries() if '"ran"' in entry.content] == [1, 2, 3]


def test_a_run_that_was_cut_off_ends_where_the_twin_file_says_otherwise() -> None:
    store = SqliteStore(":memory:")
    with pytest.raises(PowerFailure):
        twin(store).run(until(day(1), 200), every=50)
    twin(store, beat=Span(10)).run([day(1)])
    assert events(store, "ran")[0].reason == "run 1 ends: the twin file says otherwise from here on"


def test_other_settings_run_the_rows_anew() -> None:
    store = SqliteStore(":memory:")
    twin(store).run([day(1)])
    twin(store, beat=Span(10)).run([day(1)])
    assert len(events(store, "ran")) == 2


def test_an_iterator_is_read_once_and_is_always_new() -> None:
    store = SqliteStore(":memory:")
    for _ in range(2):
        twin(store).run(iter([day(1)]))
    assert len(events(store, "ran")) == 2


def test_checkpoints_fall_inside_a_block_too() -> None:
    store, kept = SqliteStore(":memory:"), list[int]()
    inner = store.commit

    def commit(batch: Batch, *, wait: bool = True) -> Any:
        if batch.checkpoint is not None:
            kept.append(batch.checkpoint.row)
        return inner(batch, wait=wait)

    store.commit = commit  # type: ignore[method-assign]
    twin(store).run([day(1)], every=100)
    n = len(day(1).t)
    assert kept == [*range(100, n, 100), n]


def test_what_the_operator_says_meanwhile_is_heeded_where_it_stands() -> None:
    """Cut off, pinned by hand, gone on, cut off again, gone on from an older checkpoint."""
    logs = []
    for breaks in ((), (160,), (160, 210)):
        store = SqliteStore(":memory:")
        with pytest.raises(PowerFailure):
            twin(store).run(until(day(1), 120), every=50)
        spoken = twin(store)
        spoken.pin(0, "hands off")
        spoken._versions.add(Form(), {"gain": 1.25}, parent=0, reason="by hand")
        spoken._ledger.say()
        for stop in breaks:
            with pytest.raises(PowerFailure):
                twin(store).run(until_again(store, stop), every=1000)
        result = twin(store).run([day(1)], every=1000)
        assert not result.of_kind("promoted") and result.champion.number == 0
        assert result.samples == len(day(1).t)
        logs.append(log(store))
    assert logs[0] == logs[1] == logs[2]


class until_again(list[Block]):
    """The rows up to a stop, as a list that breaks off while it is read for the second time."""

    def __init__(self, store: SqliteStore, stop: int) -> None:
        super().__init__([take(day(1), 0, stop), take(day(1), stop, len(day(1).t))])
        self.times = 0

    def __iter__(self) -> Iterator[Block]:
        self.times += 1
        yield self[0]
        if self.times > 1:
            raise PowerFailure
        yield self[1]


def test_a_promotion_by_hand_reaches_a_run_that_goes_on() -> None:
    store = SqliteStore(":memory:")
    kept = twin(store)
    kept._versions.add(Form(), {"gain": 0.5}, parent=0, reason="by hand")
    kept._ledger.say()

    def rows() -> Iterator[Block]:
        yield take(day(1), 0, 72)
        kept.promote(1, "to see")
        yield take(day(1), 72, 100)

    result = kept.run(rows())
    assert result.champion.number == 1
    assert result.trace["version"].tolist() == [0] * 75 + [1] * 25  # the next beat


def test_another_process_reaches_a_run_at_its_next_beat(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is asked for stands in the log once, also when the run is cut off and goes on."""
    monkeypatch.setattr("evertwin.ledger.run_log.SECONDS", 0.0)
    spec = replace(robot().spec, store=StoreSpec("a.db"), folder=str(tmp_path))
    logs = []
    for stop in (len(day(1).t), 90):

        def rows(stop: int = stop) -> Iterator[Block]:
            yield take(day(1), 0, 72)
            with Twin(spec, reading=True) as other:
                other.pin(0, "hands off", "ada")
            yield take(day(1), 72, stop)
            if stop < len(day(1).t):
                raise PowerFailure

        with Twin(spec) as kept:
            if stop < len(day(1).t):
                with pytest.raises(PowerFailure):
                    kept.run(rows(), every=1000)
            else:
                kept.run(rows())
        with Twin(spec) as kept:
            result = kept.run([day(1)])
            assert not result.of_kind("promoted") and kept.pinned
            logs.append(kept.store.entries())
            pinned = [e for e in kept.events if e.kind == "pinned"]
            assert [(e.row, e.evidence["person"]) for e in pinned] == [(75, "ada")]
        for file in tmp_path.glob("a.db*"):
            file.unlink()
    assert logs[0] == logs[1]


def test_a_log_that_says_something_else_is_not_gone_on_with() -> None:
    store = SqliteStore(":memory:")
    with pytest.raises(PowerFailure):
        twin(store).run(until(day(1), 205), every=50)
    run = store.entries()[-1].run
    odd = Event(199, 0, "suspected", "x", "another evertwin", {})
    store.commit(Batch([odd], 199, run))
    with pytest.raises(StoreError, match="run 1 is repeated, and the log has"):
        twin(store).run([day(1)])
    assert twin(store).run([day(1)], again=True).samples == len(day(1).t)


def test_a_store_on_disk_goes_on_too(tmp_path: Path) -> None:
    whole = SqliteStore(":memory:")
    first = twin(whole).run([day(1)])
    store = SqliteStore(tmp_path / "a.db")
    with pytest.raises(PowerFailure):
        twin(store).run(until(day(1), 300), every=100)
    store.close()
    store = SqliteStore(tmp_path / "a.db")
    same(twin(store).run([day(1)]), first)
    assert log(store) == log(whole)
    store.close()


@pytest.mark.parametrize(("module", "name"), POINTS)
def test_the_proof_of_kills_finds_its_points(module: str, name: str) -> None:
    """`python -m proofs.kills` kills before and after each of them."""
    owner, method = name.split(".")
    assert callable(getattr(getattr(import_module(module), owner), method))
    assert method in vars(getattr(import_module(module), owner))


def events(store: SqliteStore, kind: str) -> list[Any]:
    return [e for e in store.read("event") if isinstance(e, Event) and e.kind == kind]


def pieces(count: int) -> list[Block]:
    """The robot's recording as so many of their own."""
    rows, found = robot().rows, []
    edges = np.linspace(0, len(rows.t), count + 1).astype(int)
    for start, stop in pairwise(edges.tolist()):
        part = take(rows, start, stop)
        opens = np.arange(stop - start) == 0
        found.append(part._replace(row=0, gap=part.gap | opens, dt=np.where(opens, 0.0, part.dt)))
    return found


def test_short_recordings_are_learned_from_together() -> None:
    store = SqliteStore(":memory:")
    for piece in pieces(10):  # of 25 rows: a table is learned on 120, a trial lasts 30
        result = twin(store).run([piece])
    assert result.champion.number > 0
    kinds = [e.kind for e in store.read("event") if isinstance(e, Event)]
    assert kinds.index("suspected") < kinds.index("corrected") < kinds.index("promoted")
    assert not any(twin(SqliteStore(":memory:")).run([p]).events for p in pieces(10)[-2:])


def test_what_is_fitted_by_schedule_tells_of_its_own_run() -> None:
    """The gain falls by 1 % a run; whatever is on trial or probation, runs tell their own value."""
    store, spec = SqliteStore(":memory:"), robot().spec
    tuning = replace(spec.tuning, every=15.0)
    wearing = replace(spec, tuning=tuning, anomaly=AnomalySpec(), correction=CorrectionSpec())
    n, h = 200, 0.1
    t = h * np.arange(n)
    v = 0.1 * np.sign(np.sin(0.4 * t)) + 0.05 * np.sin(1.3 * t)
    for run in range(8):
        x = np.cumsum(h * (1.0 - 0.01 * run) * v) + np.random.default_rng(run).normal(0, 3e-4, n)
        rows = make_block(t=(t * 1e9).astype(np.int64), u=v[:, None], y=x[:, None])
        told = len(store.read("estimate"))
        result = Twin(wearing, store=store).run([rows])
        values = [e.value for e in store.read("estimate")[told:] if e.name == "gain"]
        assert values and values == pytest.approx([1.0 - 0.01 * run] * len(values), abs=0.01)
    assert result.champion.number > 0


def test_an_open_trial_is_told_of_as_one_of_a_run_before() -> None:
    store = SqliteStore(":memory:")
    found = [twin(store).run([piece]).trial for piece in pieces(10)]
    open_ones = [trial for trial in found if trial is not None]
    assert any(trial.since < 0 and "since a run before" in str(trial) for trial in open_ones)
    paces = [trial.seconds / trial.more for trial in open_ones if trial.more and trial.seconds]
    assert all(0.9 < pace < 1.2 for pace in paces), paces  # segments of a second


def test_what_a_run_hands_on_is_lost_with_other_settings() -> None:
    store = SqliteStore(":memory:")
    for piece in pieces(10):
        result = twin(store, trial=TrialSpec(segments=20 + len(store.entries()))).run([piece])
    assert result.champion.number == 0


def test_a_run_that_went_on_and_was_cut_off_comes_to_the_same() -> None:
    whole, cut = SqliteStore(":memory:"), SqliteStore(":memory:")
    for piece in pieces(5):
        twin(whole).run([piece])
    for piece in pieces(5):
        with pytest.raises(PowerFailure):
            twin(cut).run(until(piece, 20))
        twin(cut).run([piece])
    assert log(whole) == log(cut)


def test_a_folder_that_moved_is_no_other_twin(tmp_path: Path) -> None:
    here, there = tmp_path / "here.toml", tmp_path / "there" / "t.toml"
    there.parent.mkdir()
    for file in (here, there):
        file.write_text((TWINS / "robot1d.toml").read_text())
    assert settings_hash(read(here)) == settings_hash(read(there))


def test_days_named_again_in_any_order_are_run_once() -> None:
    """What is shown of a day costs the log nothing, and no other day what it began with."""
    store = SqliteStore(":memory:")
    first = [twin(store).run([day(number)]) for number in (1, 2, 3)]
    kept = log(store)
    for number in (1, 2, 3, 2, 1, 3):
        shown = twin(store).run([day(number)])
        assert shown.events == first[number - 1].events and shown.began == shown.samples
        assert shown.champion == first[number - 1].champion
        assert shown.unseen_since == first[number - 1].unseen_since and shown.trace
        assert log(store) == kept
    same(twin(store).run([day(3)]), first[2])


def test_files_that_all_count_from_zero_are_known_behind_others() -> None:
    """Behind others a file is stamped anew; its rows are those that were run alone."""
    plain: Any = {"anomaly": AnomalySpec(), "correction": CorrectionSpec()}
    one, other = SqliteStore(":memory:"), SqliteStore(":memory:")
    u, y = robot().rows.u[:100, 0], robot().rows.y[:100, 0]
    files = [{"t": 0.05 * np.arange(len(u)), "v": u, "x": y + 1e-9 * n} for n in range(3)]
    for file in files:
        twin(one, **plain).run(file)
        twin(other, **plain).run(file)
    shown = twin(one, **plain).run(files)
    assert log(one) == log(other) and shown.began == shown.samples
    assert shown.passed == 2 * len(u) and shown.trace["t"][0] == 0
    twin(one, **plain).run(files[:1])
    twin(one, **plain).run(files[1:])
    assert log(one) == log(other)
