"""Rows that are pushed one by one are read as the table of them is, and at the cost of a few
operations."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin import TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.errors import DataError
from evertwin.fold import Chunk
from evertwin.machines.mobile import Robot1D
from evertwin.rows.by_name import ByName
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.sync import Feed

FEED = Feed("log", ("v", "x"))
CHANNELS = {
    "v": ChannelSpec("v_cmd", "cm/s", scale=-3.0, offset=0.7, step=0.25),
    "x": ChannelSpec("x", "mm", sentinels=(-1.0, 65535.0)),
}
NAMED = TwinSpec("cart", ModelSpec("robot1d"))
SOURCE = SourceSpec("log", CHANNELS, time=TimeSpec("when", "ms"), offset=0.125)
FILED = replace(NAMED, source=(SOURCE,))


def reading(spec: TwinSpec) -> ByName:
    return ByName(spec, Robot1D(), FEED)


def drawn(spec: TwinSpec, seed: int) -> Iterator[dict[str, float]]:
    """Rows with what numbers can be: whole, huge, no number, a sentinel."""
    rng = np.random.default_rng(seed)
    odd = [0, 3, -1.0, 65535, np.nan, np.inf, 1e300, 2**60 + 1, np.float64(2.5)]
    v, when = ("v_cmd", "when") if spec is FILED else ("v", "t")
    for k in range(40):
        picked = [rng.normal() if rng.random() < 0.7 else rng.choice(len(odd)) for _ in range(2)]
        cells = [odd[p] if isinstance(p, np.integer) else float(p) for p in picked]
        stamp: float = 1e3 * (k + 1.0) + rng.normal()
        stamp = int(stamp) if rng.random() < 0.2 else stamp
        yield {"other": 1.0, when: stamp, v: cells[0], "x": cells[1]}


def same(one: Chunk, other: Chunk) -> bool:
    return (
        one._replace(t=None, v=None) == other._replace(t=None, v=None)  # type: ignore[arg-type]
        and one.t.tobytes() == other.t.tobytes() and one.t.dtype == other.t.dtype
        and one.v.tobytes() == other.v.tobytes() and one.v.shape == other.v.shape
    )  # fmt: skip


@pytest.mark.parametrize("spec", [NAMED, FILED], ids=["channels", "as the file"])
def test_a_row_after_others_is_read_as_the_table_of_it_alone(spec: TwinSpec) -> None:
    for seed in range(20):
        read = reading(spec)
        for row in drawn(spec, seed):
            table = {name: [value] for name, value in row.items()}
            assert same(read(row), reading(spec)(table))


@pytest.mark.parametrize(
    ("odd", "told"),
    [
        ({"x": "far"}, "expected a number"),
        ({"t": np.nan}, "no stamp"),
        ({"x": 2**70}, "numbers"),
        ({"x": -(2**1100)}, "numbers"),
    ],
)
def test_what_is_wrong_in_a_row_is_told_after_good_ones(odd: dict[str, Any], told: str) -> None:
    read, good = reading(NAMED), {"t": 1.0, "v": 0.0, "x": 0.0}
    for _ in range(3):
        read(good)
    with pytest.raises(DataError, match=told):
        read(good | odd)
    assert same(read(good), reading(NAMED)(good))


def test_rows_of_other_names_are_read_by_theirs() -> None:
    read = reading(FILED)
    rows = [{"when": 5.0, "v_cmd": 100.0, "x": 7.0}, {"t": 5.0, "v": 1.0, "x": 7.0}]
    found = [read(row) for row in rows * 2]
    assert [chunk.t[0] for chunk in found] == [130_000_000, 5_000_000_000] * 2
    assert found[0].v[0, 1] == 0.007 and found[1].v[0, 1] == 7.0


def test_parts_of_a_whole_are_looked_at_in_each_row() -> None:
    """A plane touches the earth where the recording is: another row is of another one."""
    channels = {"v": ChannelSpec("v", "m/s"), "x": ChannelSpec("east", "m")}
    spec = replace(NAMED, source=(SourceSpec("log", channels, time=TimeSpec("t")),))
    read, alone = reading(spec), reading
    for lat, lon in itertools.product((40.0, 50.004), (8.0, 9.003)):
        row = {"t": 1.0, "v": 0.0, "lat": lat, "lon": lon}
        assert same(read(row), alone(spec)(row))


def test_a_row_costs_no_more_than_forty_small_operations() -> None:
    """Of NumPy, beside it: the tenth part of both, on a machine that others use."""
    read, row = reading(FILED), {"when": 5.0, "v_cmd": 100.0, "x": 7.0}
    read(row)
    few, spent, beside = np.zeros(2), list[float](), list[float]()
    for _ in range(400):
        begin = time.thread_time()
        read(row)
        between = time.thread_time()
        for _ in range(40):
            (few + 1.0).any()
        spent.append(between - begin)
        beside.append(time.thread_time() - between)
    assert np.quantile(spent, 0.1) < np.quantile(beside, 0.1)
