"""Whatever the clock does, what comes out increases, and every row is accounted for."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evertwin.sources.clocks.guard import GAP, Guarded, Watch
from evertwin.sources.clocks.stamps import NO_STAMP


def run(t: np.ndarray, cuts: list[int]) -> Guarded:
    n = len(t)
    edges = sorted({0, n, *(c % (n + 1) for c in cuts)})
    v = np.arange(n, dtype=np.float64)[:, None]
    watch = Watch(10**7)
    out = [watch.take(np.arange(a, b), t[a:b], v[a:b]) for a, b in itertools.pairwise(edges)]
    out.append(watch.finish(1))
    return Guarded(
        np.concatenate([o.line for o in out]),
        np.concatenate([o.t for o in out]),
        np.concatenate([o.v for o in out]),
        tuple(p for o in out for p in o.problems),
    )


steps = st.lists(
    st.one_of(
        st.integers(1, 10**8),
        st.sampled_from([0, -1, -(10**8), 2 * 10**9, -(10**11), 10**18, -(10**18)]),
    ),
    min_size=5,
    max_size=60,
)


@given(steps, st.lists(st.integers(0, 100), max_size=5))
def test_increases_and_accounts_for_every_row(moves: list[int], cuts: list[int]) -> None:
    t = np.clip(np.cumsum([int(m) for m in moves], dtype=object), -(2**62), 2**62)
    out = run(t.astype(np.int64), cuts)
    assert (np.diff(out.t) > 0).all()
    dropped = [p for p in out.problems if p.kind not in ("gap", "clock_set")]
    assert len(out.t) + len(dropped) == len(t)
    assert sorted([*out.line.tolist(), *(p.line for p in dropped)]) == list(range(len(t)))
    assert (out.v[:, 0] == out.line).all()


@given(steps, st.lists(st.integers(0, 100), max_size=8))
def test_where_it_is_cut_does_not_matter(moves: list[int], cuts: list[int]) -> None:
    t = np.clip(np.cumsum([int(m) for m in moves], dtype=object), -(2**62), 2**62)
    whole, cut = run(t.astype(np.int64), []), run(t.astype(np.int64), cuts)
    assert whole.t.tolist() == cut.t.tolist() and whole.line.tolist() == cut.line.tolist()
    assert whole.problems == cut.problems


def test_clean_clock_passes_untouched() -> None:
    t = np.arange(100) * 10**7
    out = run(t, [13, 50])
    assert out.t.tolist() == t.tolist() and not out.problems


def test_clock_set_75_years_ahead_does_not_stop_the_stream() -> None:
    t = np.arange(100) * 10**7
    t[50:] += 75 * 365 * 86_400 * 10**9
    out = run(t, [])
    assert len(out.t) == 100 and [p.kind for p in out.problems] == ["clock_set"]
    assert out.t[50] - out.t[49] == GAP + 1
    assert set(np.diff(out.t[50:]).tolist()) == {10**7}


def test_a_pause_stays_in_time() -> None:
    t = np.arange(100) * 10**7
    t[50:] += 3600 * 10**9
    out = run(t, [])
    assert out.t.tolist() == t.tolist() and [p.kind for p in out.problems] == ["gap"]


def test_wedge_of_one_bad_stamp_costs_one_row() -> None:
    t = np.arange(100) * 10**7
    for bad in (2**61, -(2**61), 10**7, 49 * 10**7, NO_STAMP):
        spoilt = t.copy()
        spoilt[50] = bad
        out = run(spoilt, [])
        assert len(out.t) == 99 and len(out.problems) == 1
