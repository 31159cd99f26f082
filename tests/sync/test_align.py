from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import DataError, UsageError
from evertwin.fold import Chunk, Mark, Out, check_online, copy, equal, join, load, save
from evertwin.signals import Channel, Layout
from evertwin.sync import Align, Feed, Track
from evertwin.sync.alignment import align_loop

from .machines import drive

V, X = Layout.of(v="m/s"), Layout.of(x="m")
HEADING = Layout((Channel("heading", "rad", kind="angle"),))


def pair(**options: Any) -> Align:
    slack, timeout = options.pop("slack", 0.0), options.pop("timeout", np.inf)
    feeds = (Feed("a", ("v", "unused"), slack, timeout), Feed("b", ("x",), slack, timeout))
    return Align(V, X, feeds, **options)


def chunk(source: str, t: Any, v: Any = None, task: int = 0) -> Chunk:
    t = np.array(t, dtype=np.int64)
    width = {"a": 2, "b": 1, "": 0}[source]
    if v is None:
        v = np.outer(t, np.ones(width)) * 1.0
    return Chunk(source, t, np.array(v, dtype=np.float64).reshape(len(t), width), task)


def run(align: Align, chunks: list[Chunk], *, flush: bool = True) -> tuple[Any, Out]:
    state, outs = align.init(), []
    for item in chunks:
        state, out = align.step(state, item)
        outs.append(out)
    if flush:
        state, out = align.flush(state)
        outs.append(out)
    return state, join(outs)


def singles(chunks: list[Chunk]) -> list[Chunk]:
    return [c._replace(t=c.t[i : i + 1], v=c.v[i : i + 1]) for c in chunks for i in range(len(c.t))]


def joined(chunks: list[Chunk]) -> list[Chunk]:
    """Neighbouring chunks of one source and task as one: the same order of arrival."""
    out: list[Chunk] = []
    for c in chunks:
        if out and out[-1].source == c.source and out[-1].task == c.task:
            last = out.pop()
            c = c._replace(t=np.r_[last.t, c.t], v=np.concatenate([last.v, c.v]))
        out.append(c)
    return out


@st.composite
def arrivals(draw: st.DrawFn) -> list[Chunk]:
    """Two sources and ticks: late, repeated and absurd stamps, holes, tasks."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    out, now = [], {"a": 0, "b": 5}
    task = 0
    for _ in range(draw(st.integers(1, 60))):
        source = rng.choice(["a", "b", "b", "a", ""])
        if source == "":
            out.append(chunk("", [max(now.values()) + int(rng.integers(0, 300))]))
            continue
        n = int(rng.integers(1, 5))
        steps = rng.choice([10, 20, 20, 0, -30, 500], n, p=[0.3, 0.3, 0.25, 0.05, 0.07, 0.03])
        t = now[source] + np.cumsum(steps)
        now[source] = int(t[-1])
        width = 2 if source == "a" else 1
        v = rng.normal(size=(n, width))
        v[rng.random((n, width)) < 0.1] = rng.choice([np.nan, np.inf])
        if rng.random() < 0.02:
            task += 1
            now = {"a": 0, "b": 5}
        out.append(chunk(str(source), t, v, task))
    return out


OPTIONS: list[dict[str, Any]] = [
    {},
    {"slack": 4e-8, "timeout": 1e-7, "gap": 1e-7},
    {"lines": ("v",), "depth": 5},
    {"rate": 7.7e7, "gap": 1.5e-7, "lines": ("v",)},
    {"rate": 2e7, "depth": 16},
    {"jump": 1e-7, "slack": 2e-8},
    {"usual": True, "depth": 16},
    {"usual": True, "rate": 5e7, "lines": ("v",)},
]


@given(arrivals(), st.sampled_from(OPTIONS))
@settings(max_examples=150, deadline=None)
def test_how_samples_are_cut_into_chunks_never_matters(
    chunks: list[Chunk], options: dict[str, Any]
) -> None:
    align = pair(**options)
    whole, parts = run(align, joined(chunks)), run(align, singles(chunks))
    assert equal(whole[0], parts[0])
    assert equal(whole[1].rows, parts[1].rows)
    assert whole[1].records == parts[1].records
    rows = whole[1].rows
    if rows is not None:
        assert (np.diff(rows.t) > 0).all()
        np.testing.assert_array_equal(rows.number, np.arange(len(rows.t)))
        assert not np.isinf(rows.y).any() and not np.isinf(rows.u).any()


def _longer(c: Chunk, k: int) -> Chunk:
    """A hundred regular samples, mostly; some chunks keep their disorder at the end."""
    t = 10_000 * k + 20 * np.arange(100)
    v = np.cos(np.outer(t, [1.0, 2.0]))
    if k % 3 == 1:
        t, v = np.r_[t, t[-1] + c.t], np.concatenate([v, c.v])
    return c._replace(t=t, v=v)


def test_a_known_offset_is_removed() -> None:
    feeds = (Feed("a", ("v", "x"), offset=-5e-9),)
    _, out = run(Align(V, X, feeds), [chunk("a", [10, 20])])
    assert out.rows.t.tolist() == [5, 15]


@pytest.mark.slow
@given(arrivals(), st.integers(0, 10))
@settings(max_examples=60, deadline=None)
def test_a_single_source_takes_the_straight_way_with_the_same_result(
    chunks: list[Chunk], cut: int
) -> None:
    align = Align(
        V, X, (Feed("a", ("v", "x")),), gap=1e-7, lines=() if cut % 2 else ("v",), usual=cut % 3 > 0
    )
    mine = [_longer(c, k) for k, c in enumerate(c for c in chunks if c.source == "a")]
    clean = [c._replace(v=np.nan_to_num(c.v, posinf=1.0)) for c in mine]
    for these in (mine, clean):
        if these:
            whole = run(align, joined(these))
            for parts in (run(align, singles(these)), run(align, these)):
                assert equal(whole[0], parts[0])
                assert equal(whole[1].rows, parts[1].rows)
                assert whole[1].records == parts[1].records


def test_the_straight_way_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    align = Align(V, X, (Feed("a", ("v", "x")),), depth=32)
    chunks = [chunk("a", 10 * np.arange(100 * k, 100 * k + 100)) for k in range(5)]
    expected = run(align, singles(chunks))
    calls = []
    push = align_loop.push
    monkeypatch.setattr(
        "evertwin.sync.alignment.align.loop.push", lambda *a: (calls.append(a[0]), push(*a))[1]
    )
    state, out = run(align, chunks)
    assert equal(state, expected[0]) and equal(out.rows, expected[1].rows)
    assert calls == [0, align_loop.FINISH]


@pytest.mark.parametrize("options", OPTIONS)
def test_compiled_and_plain_loop_agree_bit_for_bit(
    options: dict[str, Any], run_as: Callable[[str], None]
) -> None:
    rng = np.random.default_rng(3)
    chunks = []
    for k in range(60):
        source = "ab"[int(rng.integers(2))]
        t = 40 * k + np.cumsum(rng.choice([10, 5, -30, 0, 800], 4, p=[0.5, 0.3, 0.1, 0.05, 0.05]))
        chunks.append(chunk(source, t, rng.normal(size=(4, 2 if source == "a" else 1)), k // 30))
        chunks.append(chunk("", [40 * k]))
    run_as("machine code")
    compiled = run(pair(**options), chunks)
    run_as("plain")
    other = run(pair(**options), chunks)
    assert equal(compiled[0], other[0]) and equal(compiled[1].rows, other[1].rows)
    assert compiled[1].records == other[1].records


def test_rows_agree_with_a_direct_merge() -> None:
    rng = np.random.default_rng(1)
    a = np.cumsum(rng.integers(1, 30, 300))
    b = np.cumsum(rng.integers(1, 50, 200))
    va, vb = rng.normal(size=(300, 2)), rng.normal(size=(200, 1))
    pieces = [(t[0], chunk("a", t, v)) for t, v in zip(np.split(a, 60), np.split(va, 60))]
    pieces += [(t[0], chunk("b", t, v)) for t, v in zip(np.split(b, 40), np.split(vb, 40))]
    _, out = run(pair(), [c for _, c in sorted(pieces, key=lambda p: p[0])])
    block = out.rows.block
    union = np.unique(np.concatenate([a, b]))
    np.testing.assert_array_equal(block.t, union)
    np.testing.assert_array_equal(block.dt[1:], np.diff(union) * 1e-9)
    y = np.full(len(union), np.nan)
    y[np.searchsorted(union, b)] = vb[:, 0]
    np.testing.assert_array_equal(block.y[:, 0], y)
    before = np.searchsorted(a, union, side="left") - 1
    held = np.where(before >= 0, va[np.maximum(before, 0), 0], np.nan)
    np.testing.assert_array_equal(block.u[1:, 0], held[1:])
    fresh = np.isin(union[:-1], a)
    expected = np.where(np.isnan(held[1:]), Mark.ABSENT, np.where(fresh, Mark.OK, Mark.HELD))
    np.testing.assert_array_equal(block.mark[1:, 0], expected)
    assert out.records == () and block.gap.tolist() == [True] + [False] * (len(union) - 1)


def test_late_within_the_slack_equals_the_run_in_order() -> None:
    t = np.arange(0, 1000, 10)
    order = np.argsort(t + np.random.default_rng(0).uniform(0, 60, 100))
    expected = run(pair(slack=1e-7), [chunk("a", t), chunk("b", t)])
    _, out = run(pair(slack=1e-7), [chunk("a", t[order]), chunk("b", t)])
    assert equal(out.rows, expected[1].rows) and out.records == ()


def test_late_beyond_the_slack_is_recorded_and_not_folded() -> None:
    _, out = run(pair(), [chunk("a", [0, 10, 20]), chunk("b", [0, 10, 20]), chunk("a", [5, 30])])
    assert 5 not in out.rows.t
    (event,) = out.records
    assert (event.kind, event.signal, event.time) == ("late", "a", 5)
    assert event.evidence == {"first": 5, "last": 5, "samples": 1}


def test_repeats_are_folded_once() -> None:
    """Every message three times gives the same rows."""
    once = [chunk(s, [k], [[k, k]] if s == "a" else [[k]]) for k in range(0, 200, 10) for s in "ab"]
    expected = run(pair(), once)
    _, out = run(pair(), [c for c in once for _ in range(3)])
    assert equal(out.rows, expected[1].rows)
    assert {e.kind for e in out.records} == {"repeated"}
    assert sum(e.evidence["samples"] for e in out.records) == 80


def test_a_silent_source_holds_rows_back_until_a_tick_says_so() -> None:
    align = pair(timeout=1e-7)
    start = [chunk("b", [0]), chunk("a", np.arange(0, 500, 10))]
    _, out = run(align, start, flush=False)
    assert out.rows.t.tolist() == [0]
    _, out = run(align, [*start, chunk("", [400])], flush=False)
    assert out.rows.t[-1] == 300
    assert [e.kind for e in out.records] == ["silent"]
    _, out = run(align, [*start, chunk("", [400]), chunk("b", [310, 600])], flush=False)
    assert [e.kind for e in out.records] == ["silent", "back"]
    assert out.rows.t[-1] == 490


def test_memory_is_bounded_when_a_source_never_comes() -> None:
    align = pair(depth=32)
    state, out = run(align, [chunk("a", np.arange(0, 10_000, 10))], flush=False)
    assert len(out.rows.t) == 1000 - 31
    assert [e.kind for e in out.records] == ["overflow"]
    assert state.times.shape == (2, 32)


def test_gaps_are_marked() -> None:
    _, out = run(pair(gap=5e-8), [chunk("a", [0, 40, 100]), chunk("b", [0, 40, 100])])
    assert out.rows.gap.tolist() == [True, False, True]


@pytest.mark.parametrize("way", [-3600, 3600])
def test_a_clock_that_was_set_anew_does_not_wedge_the_twin(way: int) -> None:
    second = 10**9
    align = Align(V, X, (Feed("a", ("v", "x")), Feed("c", ("w",))), jump=10.0)
    state, rows, records = align.init(), [], []
    for k in range(200):
        stamp = k * second + (way * second if k >= 100 else 0)
        for item in (
            Chunk("a", np.array([stamp]), np.ones((1, 2))),
            Chunk("c", np.array([k * second + second // 2]), np.ones((1, 1))),
        ):
            state, out = align.step(state, item)
            rows.append(out)
            records += [e.kind for e in out.records]
    assert records.count("clock_jump") == 1
    out = join(rows)
    assert (np.diff(out.rows.t) > 0).all()
    measured = out.rows.t[~np.isnan(out.rows.y[:, 0])] / second
    # Eight samples are kept out, then the source goes on beside the other's clock.
    assert 185 <= len(measured) <= 193 and measured[-1] < 202
    assert out.rows.gap.sum() >= 2


def test_a_pause_of_everything_keeps_its_stamps() -> None:
    second = 10**9
    align = Align(V, X, (Feed("a", ("v", "x")),), jump=10.0)
    t = np.r_[np.arange(50), 5000 + np.arange(50)] * second
    _, out = run(align, [Chunk("a", t, np.ones((100, 2)))])
    assert out.rows.t[-1] == t[-1]
    assert {e.kind for e in out.records} == {"future", "clock_jump"}
    assert np.flatnonzero(out.rows.gap).tolist() == [0, 50]


def test_one_absurd_stamp_moves_nothing() -> None:
    year = 365 * 86_400 * 10**9
    align = Align(V, X, (Feed("a", ("v", "x")),), jump=10.0)
    t = np.arange(20) * 10**9
    t[7] += 75 * year
    _, out = run(align, [Chunk("a", t, np.ones((20, 2)))])
    assert out.rows.t.tolist() == np.delete(t, 7).tolist()
    assert [e.kind for e in out.records] == ["future"]


def test_tasks_follow_each_other_even_if_each_counts_from_zero() -> None:
    t = [0, 10, 20]
    chunks = [chunk(s, t, task=k) for k in range(3) for s in "ab"]
    _, out = run(pair(), [*chunks, chunk("a", [30], task=1)])
    assert out.rows.task.tolist() == [0] * 3 + [1] * 3 + [2] * 3
    assert out.rows.gap.tolist() == [True, False, False] * 3
    assert (np.diff(out.rows.t) > 0).all()
    assert out.rows.dt[[0, 3, 6]].tolist() == [0.0] * 3
    assert [e.kind for e in out.records] == ["task_shifted", "task_shifted", "late"]


def test_measured_inputs_lie_on_the_line_between_their_samples() -> None:
    align = Align(HEADING, X, (Feed("a", ("heading",)), Feed("b", ("x",))), lines=("heading",))
    a = Chunk("a", np.array([0, 100]), np.array([[3.0], [-3.0]]))
    b = Chunk("b", np.array([0, 25, 50, 100, 110]), np.ones((5, 1)))
    _, out = run(align, [a, b])
    way = 2 * np.pi - 6.0
    expected = [3.0, 3.0 + way / 4, 3.0 + way / 2 - 2 * np.pi, -3.0, -3.0]
    wrapped = (np.array(expected) + np.pi) % (2 * np.pi) - np.pi
    difference = (out.rows.u[:, 0] - wrapped + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(difference, 0.0, atol=1e-12)
    assert out.rows.mark[:, 0].tolist() == [0, 2, 2, 0, 2]


def test_a_uniform_grid() -> None:
    t = np.array([0, 30, 70, 100, 400, 430])
    align = Align(V, X, (Feed("a", ("v", "x")),), rate=5e7, gap=1e-7, lines=("v",))
    v = np.stack([t, 2 * t], axis=1) * 1.0
    _, out = run(align, [Chunk("a", t, v)])
    assert out.rows.t.tolist() == [0, 20, 40, 60, 80, 100, 400, 420]
    np.testing.assert_allclose(out.rows.u[:, 0], out.rows.t)
    np.testing.assert_allclose(out.rows.y[:, 0], 2.0 * out.rows.t)
    assert np.flatnonzero(out.rows.gap).tolist() == [0, 6]


def test_a_command_on_a_grid_is_its_mean_over_the_interval() -> None:
    commands = [(0, 1.0), (130, 2.0), (270, 0.0), (300, 4.0)]
    v = [[value, 0.0] for _, value in commands]
    pieces = [chunk("a", [at for at, _ in commands], v), chunk("b", range(0, 500, 100))]
    _, out = run(pair(rate=1e7), pieces)
    assert out.rows.t.tolist() == [0, 100, 200, 300, 400]
    expected = [1.0, 1.0, 0.3 * 1.0 + 0.7 * 2.0, 0.7 * 2.0 + 0.3 * 0.0, 4.0]
    np.testing.assert_allclose(out.rows.u[:, 0], expected, atol=1e-15)
    assert equal(run(pair(rate=1e7), singles(pieces))[1].rows, out.rows)


def test_a_heading_that_is_commanded_turns_the_short_way() -> None:
    align = Align(HEADING, X, (Feed("a", ("heading",)), Feed("b", ("x",))), rate=1e7)
    turn = Chunk("a", np.array([0, 150]), np.array([[3.0], [-3.0]]))
    _, out = run(align, [turn, chunk("b", [0, 100, 200])])
    half = 3.0 + 0.5 * (2 * np.pi - 6.0)
    np.testing.assert_allclose(out.rows.u[:, 0], [3.0, 3.0, half], atol=1e-12)


@pytest.mark.parametrize("broken", [np.inf, -1e200])
def test_infinite_and_absurd_values_are_errors_and_nan_is_absent(broken: float) -> None:
    v = [[1.0, 0.0], [broken, 0.0], [np.nan, 0.0], [4.0, 0.0]]
    y = [[1.0], [broken], [np.nan], [4.0]]
    _, out = run(pair(), [chunk("a", [0, 1, 2, 3], v), chunk("b", [0, 1, 2, 3], y)])
    assert out.rows.mark[:, 1].tolist() == [Mark.OK, Mark.ERROR, Mark.ABSENT, Mark.OK]
    assert out.rows.u[:, 0].tolist() == [1.0, 1.0, 1.0, 1.0]
    assert out.rows.mark[:, 0].tolist() == [Mark.OK, Mark.OK, Mark.HELD, Mark.HELD]


def test_rows_go_into_the_next_stage_and_states_into_checkpoints() -> None:
    chunks = [chunk("a", np.arange(0, 500, 10)), chunk("b", np.arange(5, 500, 25))]
    align = pair()
    _, out = run(align, chunks)
    check_online(Track(drive()), out.rows.block)
    state, first = align.step(align.init(), chunks[0])
    state = load(save(copy(state)), like=align.init())
    state, second = align.step(state, chunks[1])
    state, last = align.flush(state)
    assert equal(join([first, second, last]).rows, out.rows)


def test_the_findings_of_a_flood_are_all_told() -> None:
    t = np.stack([np.arange(1000) * 10 + 10, np.arange(1000) * 10 + 5], axis=1).ravel()
    align = Align(V, X, (Feed("a", ("v", "x")),))
    _, out = run(align, [Chunk("a", t, np.ones((2000, 2)))])
    assert sum(e.evidence["samples"] for e in out.records) == 1000
    assert len(out.rows.t) == 1000


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: Align(V, X, (Feed("a", ("v",)),)), "channel 'x': expected exactly one source"),
        (lambda: Align(V, X, (Feed("a", ("v", "x")), Feed("b", ("x",)))), "got 2"),
        (lambda: pair(lines=("w",)), "no channel 'w'"),
        (lambda: pair(depth=1), "depth ≥ 2"),
        (lambda: pair(gap=0.0), "gap and jump above 0"),
        (lambda: pair(rate=-1.0), "rows per second"),
    ],
)
def test_settings_are_checked(build: Any, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        build()


def test_foreign_chunks_are_refused() -> None:
    align = pair()
    with pytest.raises(DataError, match="expected one of a, b"):
        align.step(align.init(), Chunk("c", np.array([0]), np.ones((1, 1))))
    with pytest.raises(DataError, match=r"expected 2 columns \(v, unused\)"):
        align.step(align.init(), Chunk("a", np.array([0]), np.ones((1, 1))))
