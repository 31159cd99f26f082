"""Rows while a file is read are the rows of the task in memory, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.config.spec import (
    ChannelSpec,
    ClockSpec,
    ModelSpec,
    SignalSpec,
    SourceSpec,
    TimeSpec,
    TwinSpec,
)
from evertwin.errors import DataError
from evertwin.fold import Block, Chunk, concatenate
from evertwin.fold.state import equal
from evertwin.loop.feed import Feed
from evertwin.loop.stream import stream
from evertwin.loop.tasks import rows_of_task
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout

MODEL = FunctionModel(
    lambda x, u, dt, p: ([x[0] + u[0] * dt], [x[0] + u[1], x[0]]),
    Layout.of(v="m/s", load="kg"), Layout.of(a="m", b="m"), Layout.of(s="m"), Parameters.of(),
)  # fmt: skip
SPEC = TwinSpec(
    "x", ModelSpec("x"),
    signals={"load": SignalSpec(hold=False), "b": SignalSpec(source="seen")},
    clock=ClockSpec(gap=2e-9),
    source=(
        SourceSpec("one", {"v": ChannelSpec("v", unit="m/s"), "a": ChannelSpec("a", unit="m")},
                   time=TimeSpec(column="t", unit="ns")),
        SourceSpec("two", {"load": ChannelSpec("load", unit="kg"),
                           "seen": ChannelSpec("seen", unit="m")},
                   time=TimeSpec(column="t", unit="ns")),
    ),
)  # fmt: skip


def recording(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps with gaps, two columns with holes."""
    t = np.cumsum(rng.integers(1, 4, n)).astype(np.int64)
    v = rng.normal(size=(n, 2))
    v[rng.random((n, 2)) < rng.choice([0.0, 0.3, 0.9, 1.0])] = np.nan
    return t, v


def chunks(
    name: str, tasks: list[tuple[np.ndarray, np.ndarray]], rng: np.random.Generator
) -> Iterator[Chunk]:
    for task, (t, v) in enumerate(tasks):
        cuts = np.unique(np.r_[0, rng.integers(0, len(t), 4), len(t)])
        for a, b in pairwise(cuts.tolist()):
            yield Chunk(name, t[a:b], v[a:b], task)


def in_memory(tasks: list[dict[str, tuple[np.ndarray, np.ndarray]]]) -> Block:
    row, blocks = 0, []
    for number, series in enumerate(tasks):
        block = rows_of_task(series, SPEC, MODEL, row, number)
        assert block is not None
        blocks.append(block)
        row += len(block.t)
    return concatenate(blocks)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_streamed_rows_are_the_rows_of_the_task(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = [recording(rng, int(rng.integers(1, 40))) for _ in range(2)]
    second = [recording(rng, int(rng.integers(1, 40))) for _ in range(2)]
    feed = Feed(SPEC, MODEL)
    sources = [chunks("one", first, rng), chunks("two", second, rng)]
    streamed = concatenate(list(stream(sources, [2, 2], feed._plan(SPEC.source))))
    tasks = [
        {"v": (a, x[:, 0]), "a": (a, x[:, 1]), "load": (b, y[:, 0]), "seen": (b, y[:, 1])}
        for (a, x), (b, y) in zip(first, second, strict=True)
    ]
    assert equal(streamed, in_memory(tasks))


def test_a_single_source_is_streamed_from_its_files(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    path = tmp_path / "run.csv"
    t = 10 * np.arange(2_000)
    table = np.column_stack([t, rng.normal(size=(len(t), 4))])
    np.savetxt(path, table, fmt="%.6g", delimiter=",", header="t,v,a,load,seen", comments="")
    names = ("v", "a", "load", "seen")
    channels = {n: ChannelSpec(n, unit="kg" if n == "load" else "m/s" if n == "v" else "m")
                for n in names}  # fmt: skip
    source = SourceSpec("log", channels, time=TimeSpec(column="t", unit="ms"))
    spec = TwinSpec("x", ModelSpec("x"), signals=SPEC.signals, source=(source,))
    feed = Feed(spec, MODEL)
    pieces = concatenate(list(feed.stream([path, path])))
    assert pieces.task.tolist() == [0] * 2_000 + [1] * 2_000
    assert equal(pieces, concatenate(list(feed.blocks([path, path]))))


def test_sources_with_different_numbers_of_tasks_are_refused() -> None:
    rng = np.random.default_rng(0)
    one, two = [recording(rng, 5) for _ in range(2)], [recording(rng, 5)]
    sources = [chunks("one", one, rng), chunks("two", two, rng)]
    with pytest.raises(DataError, match="different numbers of tasks"):
        list(stream(sources, [2, 2], Feed(SPEC, MODEL)._plan(SPEC.source)))
