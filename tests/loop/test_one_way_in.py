"""The same samples give the same rows bit for bit, however they arrive in pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.config.spec import (
    ChannelSpec,
    ClockSpec,
    DeriveSpec,
    FilterSpec,
    ModelSpec,
    SignalSpec,
    SourceSpec,
    TimeSpec,
    TwinSpec,
)
from evertwin.errors import DataError
from evertwin.fold import Block, Chunk, concatenate
from evertwin.fold.state import copy, equal, load, save
from evertwin.models import FunctionModel, Parameters
from evertwin.rows.alignment import Alignment, AlignmentState
from evertwin.rows.feed import Feed
from evertwin.signals import Layout
from evertwin.sources.merging import merge
from evertwin.sync import Feed as Brings

MODEL = FunctionModel(
    lambda x, u, dt, p: ([x[0] + u[0] * dt], [x[0] + u[1], x[0], u[1]]),
    Layout.of(v="m/s", load="kg"), Layout.of(a="m", b="m", c="m"), Layout.of(s="m"),
    Parameters.of(),
)  # fmt: skip
DERIVED = (
    DeriveSpec("fast", "derivative", ("a",)),
    DeriveSpec("b", "slope", ("fast",), value=0.1),
    DeriveSpec("load", "mean", ("left", "right")),
    DeriveSpec("c", "way", ("a", "left", "right")),
    DeriveSpec("v", "middle", ("command",)),
)
BRINGS = (Brings("one", ("command", "a")), Brings("two", ("left", "right")))
UNION = (*DERIVED[:1], DeriveSpec("b", "scale", ("fast",), value=2.0), *DERIVED[2:])
PLAIN = TwinSpec(
    "x", ModelSpec("x"), derive=UNION, clock=ClockSpec(gap=0.2),
    signals={"load": SignalSpec(hold=False)},
)  # fmt: skip
GRID = TwinSpec(
    "x", ModelSpec("x"), derive=DERIVED, clock=ClockSpec(rate=100.0, gap=0.2, start=0.05),
    filter=FilterSpec(cutoff=20.0, inputs=("a",)), signals={"load": SignalSpec(hold=False)},
)  # fmt: skip


def samples(seed: int) -> list[Chunk]:
    """Two sources over two tasks, as they arrive: holes, gaps, jitter, infinities."""
    rng = np.random.default_rng(seed)
    found = []
    for task in range(2):
        waiting = []
        for name in ("one", "two"):
            n = int(rng.integers(1, 60))
            steps = rng.integers(5, 15, n) * 10**6
            steps[rng.random(n) < 0.05] = 10**9
            v = rng.normal(size=(n, 2))
            v[rng.random((n, 2)) < 0.1] = np.nan
            v[rng.random((n, 2)) < 0.02] = np.inf
            waiting += [(int(t), name, x) for t, x in zip(np.cumsum(steps) + task * 10**11, v)]
        waiting.sort(key=lambda item: (item[0], item[1]))
        found += [Chunk(name, np.array([t]), x[None], task) for t, name, x in waiting]
    return found


def together(chunks: list[Chunk], rng: np.random.Generator) -> list[Chunk]:
    """The same samples in larger pieces, wherever neighbours are of one source and task."""
    out: list[Chunk] = []
    for chunk in chunks:
        last = out[-1] if out else None
        if last and (last.source, last.task) == (chunk.source, chunk.task) and rng.random() < 0.7:
            t, v = np.r_[last.t, chunk.t], np.concatenate([last.v, chunk.v])
            out[-1] = last._replace(t=t, v=v)
        else:
            out.append(chunk)
    return out


def run(way: Alignment, chunks: list[Chunk]) -> tuple[AlignmentState, Block, list[object]]:
    state, blocks, events = way.init(), [], []
    for chunk in chunks:
        state, block, said = way.step(state, chunk)
        blocks.append(block)
        events += said
    state, block, said = way.flush(state)
    blocks.append(block)
    return state, concatenate([b for b in blocks if b is not None]), [*events, *said]


@pytest.mark.slow
@pytest.mark.parametrize("spec", [PLAIN, GRID], ids=["union", "grid"])
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_pieces_change_no_bit(spec: TwinSpec, seed: int) -> None:
    way = Alignment.of(spec, MODEL, BRINGS)
    one_by_one = samples(seed)
    pieces = together(one_by_one, np.random.default_rng(seed))
    a, b = run(way, one_by_one), run(way, pieces)
    assert equal(a[0], b[0]) and equal(a[1], b[1]) and a[2] == b[2]
    assert np.array_equal(a[1].t, np.unique(a[1].t))


def test_a_checkpoint_goes_on_as_if_nothing_had_been() -> None:
    way, chunks = Alignment.of(GRID, MODEL, BRINGS), samples(5)
    whole = run(way, chunks)
    state, blocks = way.init(), []
    for k, chunk in enumerate(chunks):
        if k == len(chunks) // 2:
            state = load(save(copy(state)), like=way.init())
        state, block, _ = way.step(state, chunk)
        blocks.append(block)
    state, block, _ = way.flush(state)
    blocks.append(block)
    assert equal(concatenate([b for b in blocks if b is not None]), whole[1])


def test_rows_leave_no_later_than_declared() -> None:
    way = Alignment.of(GRID, MODEL, BRINGS)
    state, newest = way.init(), 0
    steady = np.arange(400) * 10**7
    for t in steady:
        for name in ("one", "two"):
            state, block, _ = way.step(state, Chunk(name, np.array([t]), np.ones((1, 2))))
            newest = newest if block is None else int(block.t[-1])
    assert steady[-1] - newest <= way.delay * 10**7
    assert way.delay < 60


@pytest.mark.slow
def test_files_pushed_or_read_give_the_same_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    names = ("command", "a", "left", "right")
    paths = []
    for number in range(2):
        t = np.cumsum(rng.integers(5, 15, 3_000))
        table = np.column_stack([t, rng.normal(size=(len(t), 4))])
        paths.append(tmp_path / f"run{number}.csv")
        np.savetxt(
            paths[-1], table, fmt="%.9g", delimiter=",", header="t," + ",".join(names), comments=""
        )
    source = SourceSpec("log", {n: ChannelSpec(n, unit="1") for n in names},
                        time=TimeSpec(column="t", unit="ms"))  # fmt: skip
    spec = TwinSpec("x", ModelSpec("x"), derive=DERIVED, clock=GRID.clock, filter=GRID.filter,
                    signals=GRID.signals, source=(source,))  # fmt: skip
    feed = Feed(spec, MODEL)
    read = concatenate(list(feed.stream(list(paths))))
    way = Alignment.of(spec, MODEL, feed.brings(list(paths)))
    pushed = run(way, [
        Chunk(c.source, c.t[k : k + 1], c.v[k : k + 1], c.task)
        for c in feed.chunks(list(paths)) for k in range(len(c.t))
    ])  # fmt: skip
    assert equal(read, pushed[1])
    assert sum(len(task.t) for task in feed.blocks(list(paths))) == len(read.t)


def test_sources_with_different_numbers_of_tasks_are_refused() -> None:
    def source(name: str, tasks: int) -> list[Chunk]:
        return [Chunk(name, np.arange(5), np.zeros((5, 1)), task) for task in range(tasks)]

    with pytest.raises(DataError, match="different numbers of tasks"):
        list(merge([iter(source("one", 2)), iter(source("two", 1))]))


@pytest.mark.parametrize(
    ("columns", "said"),
    [({"v": [1.0]}, "expected a column 't'"), ({"t": [0, 1], "v": [1.0]}, "expected 2 values")],
)
def test_columns_by_name_need_a_time_of_their_length(columns: dict[str, list[float]], said: str
                                                     ) -> None:  # fmt: skip
    with pytest.raises(DataError, match=said):
        list(Feed(PLAIN, MODEL).chunks(columns))
