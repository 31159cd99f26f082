"""The twin's small parts, each against a plain computation."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from evertwin.config.spec import AnomalySpec
from evertwin.errors import StoreError, UsageError
from evertwin.fold import Answer, Event, make_block, take
from evertwin.fold.state import equal
from evertwin.ledger.ledger import Ledger
from evertwin.ledger.versions import Versions
from evertwin.models import FunctionModel, Parameters
from evertwin.models.form import Form
from evertwin.outcome.trace import Trace
from evertwin.rows.ring import Ring
from evertwin.setup.detectors import Detect
from evertwin.setup.deviation import (
    Sums,
    count_in,
    deviation,
    judged_deviation,
    new_sums,
    new_usual,
)
from evertwin.setup.released import Released
from evertwin.setup.residual_filter import ResidualFilter
from evertwin.setup.scores import accumulate, new_scores
from evertwin.signals import Layout
from evertwin.signals.fir import Symmetric
from evertwin.signals.sizes import sizes
from evertwin.store import Batch, SqliteStore

RMS = np.zeros(2, np.bool_)
"""Outputs whose size is their rms."""
CUTS = st.lists(st.integers(1, 99), max_size=8)


def pieces(cuts: list[int], n: int = 100) -> list[slice]:
    edges = [0, *sorted(set(cuts)), n]
    return [slice(a, b) for a, b in pairwise(edges)]


def released(seed: int = 0, n: int = 100, ny: int = 2) -> Released:
    rng = np.random.default_rng(seed)

    def values() -> np.ndarray:
        v = rng.normal(size=(n, ny))
        v[rng.random((n, ny)) < 0.2] = np.nan
        return v

    return Released(
        np.arange(n), np.arange(n) * 10**7, np.zeros(n, dtype=np.int64), rng.normal(size=(n, ny)),
        values(), values(), values(), rng.random((n, ny)) < 0.5, np.arange(n) % 10 == 9,
        np.arange(n) % 17 == 3,
    )  # fmt: skip


def part(rows: Released, where: slice) -> Released:
    return Released(*(column[where] for column in rows))


# ------------------------------------------------------------------ books


@settings(max_examples=20, deadline=None)
@given(CUTS)
def test_books_are_plain_sums_wherever_rows_are_cut(cuts: list[int]) -> None:
    rows = released()
    books, pairs = new_scores(new_usual(RMS), np.zeros(2, np.int64), 0, np.array([1.0, 2.0])), []
    for where in pieces(cuts):
        books, found, *_ = accumulate(books, part(rows, where))
        pairs.append(found)
    known = ~np.isnan(rows.live)
    assert books.watch.samples.tolist() == (known & rows.moving).sum(axis=0).tolist()
    known &= ~rows.outside[:, None]
    moving = known & rows.moving
    assert books.live.samples.tolist() == known.sum(axis=0).tolist()
    inside = ~rows.outside
    np.testing.assert_allclose(books.live.residual, np.nansum(rows.live[inside] ** 2, axis=0))
    np.testing.assert_allclose(books.first.residual, np.nansum(rows.first[inside] ** 2, axis=0))
    np.testing.assert_allclose(
        books.live_moving.measured, np.where(moving, rows.measured**2, 0.0).sum(axis=0)
    )
    both = ~np.isnan(rows.live) & rows.moving & ~np.isnan(rows.other)
    size = np.array([1.0, 2.0])
    count = both.reshape(10, -1).sum(axis=1)
    squares = [np.where(both, (r / size) ** 2, 0.0) for r in (rows.live, rows.other)]
    loss = [square.reshape(10, -1).sum(axis=1) / count for square in squares]
    np.testing.assert_allclose(np.concatenate(pairs), np.stack(loss, axis=1))


def test_books_do_not_depend_on_cuts_by_a_bit() -> None:
    rows = released(1)

    def end(cuts: list[int]) -> object:
        books = new_scores(new_usual(RMS), np.zeros(2, np.int64), 0, np.ones(2))
        for where in pieces(cuts):
            books, *_ = accumulate(books, part(rows, where))
        return books

    assert equal(end([]), end(list(range(1, 100))))


def test_sums_without_rows_have_no_deviation() -> None:
    assert np.isnan(deviation(new_sums(1), relative=True)).all()
    sums = Sums(np.array([25.0]), np.array([50.0]), np.array([2]))
    assert deviation(sums, relative=False)[0] == pytest.approx(np.sqrt(12.5))
    assert deviation(sums, relative=True)[0] == pytest.approx(np.sqrt(0.5))


def test_rows_near_zero_are_not_far_off() -> None:
    usual = new_usual(RMS[:1])._replace(measured=np.array([1e5]), samples=np.array([1000]))
    quiet = Sums(np.array([20 * 0.3**2]), np.array([20.0]), np.array([20]))
    assert deviation(quiet, relative=True)[0] == pytest.approx(0.3)
    assert judged_deviation(quiet, True, usual)[0] == pytest.approx(0.03)

    assert judged_deviation(quiet, False, usual)[0] == pytest.approx(0.3)
    busy = Sums(np.array([9.0]), np.array([40000.0]), np.array([100]))
    for own in (busy, quiet):
        alone = judged_deviation(own, True, new_usual(RMS[:1]))
        assert alone == pytest.approx(deviation(own, relative=True))
    assert judged_deviation(busy, True, usual) == pytest.approx(deviation(busy, relative=True))
    assert np.isnan(judged_deviation(new_sums(1), True, usual)).all()


@pytest.mark.parametrize(("low", "high", "expected"), [(290.0, 310.0, 0.02), (300.0, 300.0, 0.07)])
def test_a_temperature_is_off_by_a_share_of_its_range(
    low: float, high: float, expected: float
) -> None:
    """One that stood yet scatters by 0.1 K has no range: forty times its noise counts."""
    y = np.repeat(np.linspace(low, high, 50), 20) + np.tile([0.1, -0.1], 500)
    sums = Sums(np.array([1000 * 0.4**2]), np.array([np.sum(y**2)]), np.array([1000]))
    usual = new_usual(np.array([True]))
    for value in y:
        count_in(0, usual, value)
        usual.last[0] = value
    (size,) = sizes(y[:, None], np.array([True]))
    assert judged_deviation(sums, True, usual)[0] == pytest.approx(expected, rel=0.05)
    assert deviation(sums, True, usual)[0] == pytest.approx(0.4 / size, rel=1e-3)


# ------------------------------------------------------------------ newest rows


@settings(max_examples=20, deadline=None)
@given(CUTS, st.integers(1, 130))
def test_a_ring_keeps_the_newest_rows(cuts: list[int], capacity: int) -> None:
    task = np.repeat([0, 1], 50)
    rows = make_block(t=np.arange(100), u=np.arange(100.0)[:, None], y=np.ones((100, 1)), task=task)
    ring = Ring(capacity, 1, 1)
    state = ring.init()
    for where in pieces(cuts):
        state = ring.push(state, take(rows, where.start, where.stop))
    found = ring.between(state, 20, 90)
    first = max(20, 100 - capacity)
    if first >= 90:
        assert found == ()
        return
    assert np.concatenate([b.u[:, 0] for b in found]).tolist() == list(range(first, 90))
    assert [b.task[0] for b in found] == sorted({int(t) for t in task[first:90]})
    assert found[0].row == first


def test_a_ring_needs_room() -> None:
    with pytest.raises(UsageError, match="at least 1 row"):
        Ring(0, 1, 1)


# ------------------------------------------------------------------ trace


@settings(max_examples=30, deadline=None)
@given(CUTS, st.integers(1, 120))
def test_a_trace_keeps_every_nth_row_wherever_cut(cuts: list[int], most: int) -> None:
    trace, x = Trace(most=most), np.arange(200.0).reshape(100, 2)
    for where in pieces(cuts):
        trace.add({"row": np.arange(100)[where], "x": x[where]})
    kept = trace.columns()
    step = next(2**k for k in range(8) if -(-100 // 2**k) <= most)
    assert (trace.step, kept["row"].tolist()) == (step, list(range(0, 100, step)))
    assert kept["x"].tolist() == x[::step].tolist()
    assert np.arange(7, 50)[trace.places(7)].tolist() == [k for k in range(7, 50) if k % step == 0]


def test_an_empty_trace_has_no_columns() -> None:
    assert Trace().columns() == {}


# ------------------------------------------------------------------ one filter for both sides


LOW = Symmetric.butterworth(10.0, 100.0, 2)


def test_without_a_filter_rows_pass() -> None:
    rows, stage = released(), ResidualFilter(None, 2)
    state, out = stage.step(stage.init(), rows)
    assert out is rows
    assert stage.flush(state)[1] is None


@pytest.mark.parametrize("low", [LOW, None], ids=["filtered", "as they are"])
@pytest.mark.parametrize("hold", [0, 4])
@settings(max_examples=20, deadline=None)
@given(CUTS)
def test_rows_leave_when_those_behind_them_have_come(
    low: Symmetric | None, hold: int, cuts: list[int]
) -> None:
    """At row 40 it is known that something outside acts: it may since ``hold`` rows, and what is
    filtered with these rows is no version's either."""
    whole, stage = released(2), ResidualFilter(low, 2, hold)
    whole = whole._replace(outside=whole.row == 40)
    state, found = stage.init(), []
    for where in pieces(cuts):
        state, out = stage.step(state, part(whole, where))
        found.append(out)
        assert sum(len(o.row) for o in found) == max(where.stop - stage.delay, 0)
    state, last = stage.flush(state)
    found += [last] if last else []
    out = Released(*(np.concatenate(c) for c in zip(*found, strict=True)))
    assert out.row.tolist() == whole.row.tolist()
    np.testing.assert_array_equal(out.live, whole.live if low is None else low.smooth(whole.live))
    np.testing.assert_array_equal(out.moving, whole.moving)
    near = 0 if low is None else low.delay
    assert np.flatnonzero(out.outside).tolist() == list(
        range(max(40 - hold - near, 0), min(41 + near, len(whole.row)))
    )
    assert stage.flush(state)[1] is None and equal(state, stage.init())


def test_a_filter_in_the_stream_is_that_of_a_whole_recording() -> None:
    slow = np.cumsum(np.random.default_rng(1).normal(size=(400, 1)), axis=0)
    inner = slice(2 * LOW.delay, -2 * LOW.delay)
    both_ways = sosfiltfilt(butter(2, 10.0, fs=100.0, output="sos"), slow, axis=0)
    assert np.abs(LOW.smooth(slow) - both_ways)[inner].max() < 2e-3 * np.abs(slow).max()


def test_what_is_not_known_stays_so_and_counts_for_nothing() -> None:
    v = np.ones((40, 2))
    v[[3, 20, 21], 0] = np.nan
    v[:, 1] = np.nan
    out = LOW.smooth(v)
    assert np.array_equal(np.isnan(out), np.isnan(v))
    assert np.nanmax(np.abs(out[:, 0] - 1.0)) < 1e-12


# ------------------------------------------------------------------ detectors


def test_detectors_begin_silent_and_tell_a_shift() -> None:
    rng, n = np.random.default_rng(4), 3000
    stage = Detect.of(
        AnomalySpec(snr=6.0, calibration=1200.0),
        Layout.of(a="m", b="m"),
        np.array([True, False]),
        1,
    )
    live = rng.normal(size=(n, 2))
    live[2000:, 0] += 6.0
    state, alarms = stage.init(), []
    for start in range(0, n, 100):
        at = slice(start, start + 100)
        rows = Released(
            np.arange(n)[at], (np.arange(n) * 10**9)[at], np.zeros(100, np.int64), live[at],
            live[at], live[at], live[at], np.ones((100, 2), np.bool_),
            *(np.zeros(100, np.bool_) for _ in range(2)),
        )  # fmt: skip
        state, _ = stage.step(state, rows)
        state, _ = stage.beat(state)
        alarms.append(state.pending)
    assert not any(alarm.kind for alarm in alarms[:20])
    first = alarms[-1]
    assert (first.kind, first.signal) == ("suspected", "a") and 2000 <= first.row < 2010
    assert first in alarms[20:22], "the oldest stays until it is acted on"
    assert state.drift.calibration.ready


# ------------------------------------------------------------------ versions and book


def model(gain: float = 1.0) -> FunctionModel:
    return FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(u="1"), Layout.of(y="1"), Layout(),
        Parameters.of(gain=(gain, "1")),
    )  # fmt: skip


def test_versions_are_numbered_for_ever() -> None:
    versions = Versions(model())
    first = versions.add(Form(), {"gain": 2.0}, parent=0, reason="tuned", row=5)
    with pytest.raises(UsageError, match="no parameters"):
        versions.add(Form(), {"mass": 1.0}, parent=0, reason="tuned")
    with pytest.raises(UsageError, match="there are 0 to 1"):
        _ = versions[2]
    assert versions.values(1) == {"gain": 2.0}
    assert [v.number for v in versions] == [0, 1]
    versions.rewind(1)
    assert versions.add(Form(), {"gain": 2.0}, parent=0, reason="tuned", row=5) == first
    assert len(versions) == 2
    versions.rewind(1)
    other = versions.add(Form(), {"gain": 3.0}, parent=0, reason="tuned", row=5)
    assert (other.number, len(versions)) == (2, 3)


def test_a_ledger_opens_as_it_was_left(tmp_path: Path) -> None:
    path = tmp_path / "twin.db"
    store = SqliteStore(path)
    ledger = Ledger(store, versions := Versions(model()))
    versions.add(Form(), {"gain": 2.0}, parent=0, reason="tuned", row=5)
    ledger.say(Event(9, 90, "promoted", "", "better", {"version": 1}))
    ledger.pin(None, "hands off")
    ledger.pin(0, "trusted")
    assert (ledger.champion, ledger.before, ledger.pinned) == (0, 1, True)
    store.close()
    store = SqliteStore(path)
    again = Ledger(store, versions := Versions(model()))
    assert (again.champion, again.before, again.pinned) == (0, 1, True)
    assert versions.values(1) == {"gain": 2.0}
    store.close()


def test_a_version_without_its_event_is_configured_again(tmp_path: Path) -> None:
    """As a process leaves it that is killed between the two, where they are not one decision."""
    store = SqliteStore(":memory:")
    store.commit(Batch([Versions(model())[0]]))
    ledger = Ledger(store, Versions(model()))
    assert (ledger.champion, ledger.kept) == (0, 1)
    assert [e.kind for e in store.read("event")] == ["configured"]  # type: ignore[union-attr]
    assert store.head.length == 2


def test_a_changed_twin_file_opens_another_version(tmp_path: Path) -> None:
    path = tmp_path / "twin.db"
    store = SqliteStore(path)
    Ledger(store, Versions(model()))
    store.close()
    reader = SqliteStore(path, read_only=True)
    ledger = Ledger(reader, Versions(model(gain=1.5)), reading=True)
    assert (ledger.champion, reader.head.length) == (1, 2)
    reader.close()
    store = SqliteStore(path)
    ledger = Ledger(store, versions := Versions(model(gain=1.5)))
    assert (ledger.champion, len(versions)) == (1, 2)
    assert versions.values(1) == {"gain": 1.5}
    store.close()


def test_a_store_belongs_to_one_twin() -> None:
    store = SqliteStore(":memory:")
    Ledger(store, Versions(model()), "cart")
    Ledger(store, Versions(model()), "cart")
    with pytest.raises(StoreError, match="that of the twin 'cart', and this is 'lift'"):
        Ledger(store, Versions(model()), "lift")


def test_a_ledger_refuses_what_names_no_version() -> None:
    ledger = Ledger(SqliteStore(":memory:"), Versions(model()))
    with pytest.raises(UsageError, match="versions 0 to 0"):
        ledger.pin(4, "no such")
    before = ledger.store.head
    with pytest.raises(StoreError, match="names no known version"):
        ledger.say(Event(0, 0, "promoted", "", "?", {"version": 7}))
    assert ledger.store.head == before  # nothing of it is kept


def test_a_ledger_keeps_the_history_of_parameters_with_its_answer() -> None:
    ledger = Ledger(SqliteStore(":memory:"), Versions(model()))
    item = {"value": 2.0, "interval95": [None, 2.5], "verdict": "weak"}
    answers = Answer(1, 0, {"fit": {"parameters": {"gain": item}}}), Answer(2, 0, {"events": []})
    for row, answer in enumerate(answers):
        ledger.commit(Batch(ledger.batch([answer], row), row))
    (kept,) = ledger.store.read("estimate")
    assert (kept.name, kept.low, kept.high) == ("gain", -np.inf, 2.5)  # type: ignore[union-attr]
    assert [entry.kind for entry in ledger.store.entries(2)] == ["answer", "estimate", "answer"]
