"""Files to chunks: units, tasks, clocks, sentinels; several sources by stamp."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.errors import DataError, LawBroken, UsageError
from evertwin.fold import Chunk
from evertwin.sources import Cell, Clock, Recorded, check_source, merge


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "run.csv"
    rows = [f"{i // 10},{0.05 * i:.2f},{i},{20 + i}" for i in range(40)]
    path.write_text("\n".join(["window,t,speed,box", *rows]) + "\n")
    return path


def values(source: Recorded) -> np.ndarray:
    return np.concatenate([c.v for c in source.read()])


def test_units_scale_and_offset(csv: Path) -> None:
    cells = (
        Cell("v", "speed", "cm/s", scale=2.0, offset=1.0), Cell("T", "box", "degC"),
    )  # fmt: skip
    v = values(Recorded("r", (csv,), cells, Clock("t")))
    np.testing.assert_allclose(v[:, 0], (2 * np.arange(40) + 1) / 100)
    np.testing.assert_allclose(v[:, 1], 293.15 + np.arange(40))


def test_a_task_column_opens_tasks(csv: Path) -> None:
    source = Recorded("r", (csv, csv), (Cell("v", "speed", "1"),), Clock(rate=20.0), "window")
    chunks = list(source.read())
    assert [c.task for c in chunks] == list(range(8))
    assert [len(c.t) for c in chunks] == [10] * 8
    assert chunks[1].t.tolist() == [(10 + i) * 50_000_000 for i in range(10)]


def test_each_task_has_a_clock_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{w},{0.1 * i:.1f},{i}" for w in range(3) for i in range(20)]
    rows[5] = "0,0.4,99"
    path.write_text("\n".join(["window,t,x", *rows]) + "\n")
    source = Recorded("r", (path,), (Cell("x", "x", "1"),), Clock("t"), "window")
    chunks = list(source.read())
    assert [(c.task, len(c.t), int(c.t[0])) for c in chunks] == [(0, 19, 0), (1, 20, 0), (2, 20, 0)]
    assert source.tally.counts == {"repeated": 1}
    moved = list(merge([source.read()], gap=10**9))
    assert moved[1].t[0] - moved[0].t[-1] == 10**9


def test_a_log_with_a_few_even_lines_is_no_table(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text("".join(f"{i} " * (i % 7 + 1) + "\n" for i in range(60)))
    with pytest.raises(DataError, match="no table"):
        list(Recorded("r", (path,), (Cell("x", 0, "1"),), Clock(rate=1.0)).read())


def test_rate_keeps_time_over_rows_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("x,y\n" + "".join(f"{i},{i}\n" if i != 3 else "3,3,3\n" for i in range(6)))
    source = Recorded("r", (path,), (Cell("x", "x", "1"),), Clock(rate=1000.0))
    (chunk,) = source.read()
    assert (chunk.t // 1_000_000).tolist() == chunk.v[:, 0].tolist() == [0, 1, 2, 4, 5]
    third = Recorded("r", (path,), (Cell("x", "x", "1"),), Clock(rate=3.0))
    assert next(third.read()).t.tolist()[1] == 333_333_333


def test_positions_count_from_zero_and_clock_offset(csv: Path) -> None:
    source = Recorded("r", (csv,), (Cell("v", 2, "1"),), Clock(1, "ms", offset=-7))
    assert next(source.read()).t[:2].tolist() == [-7, 50_000 - 7]


def test_a_command_is_taken_in_whole_steps(tmp_path: Path) -> None:
    file = tmp_path / "steps.csv"
    file.write_text("t,w\n0,28.2743\n1,2.8\n2,-3.0\n3,8.5\n")
    cell = Cell("w", "w", "rad/s", step=2.82743)
    found = values(Recorded("r", (file,), (cell,), Clock("t")))
    assert np.allclose(found.ravel(), np.array([10, 0, -1, 3]) * 2.82743)


def test_sentinels_are_errors_not_values(csv: Path) -> None:
    v = values(Recorded("r", (csv,), (Cell("v", "speed", "1", sentinels=(5.0,)),), Clock("t")))
    assert np.isinf(v[5, 0]) and np.isfinite(np.delete(v, 5)).all()


@pytest.mark.parametrize(
    ("cell", "clock", "message"),
    [
        (Cell("v", "spede", "1"), Clock("t"), "did you mean 'speed'"),
        (Cell("v", 9, "1"), Clock("t"), "counted from 0"),
        (Cell("v", "speed", "1"), Clock("time"), "no column 'time'"),
    ],
)
def test_what_is_not_there(csv: Path, cell: Cell, clock: Clock, message: str) -> None:
    with pytest.raises(DataError, match=message):
        Recorded("r", (csv,), (cell,), clock).open()


def test_misuse() -> None:
    with pytest.raises(UsageError, match="scale"):
        Cell("v", "v", "m/s", scale=0.0)
    with pytest.raises(UsageError, match="not known"):
        Cell("v", "v", "parsnip")
    with pytest.raises(UsageError, match="rate"):
        Clock(rate=-1.0)


def test_no_time_at_all(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("x,y\n" + "".join(f"{i % 2},{i}\n" for i in range(6)))
    with pytest.raises(DataError, match="no column of time"):
        list(Recorded("r", (path,), (Cell("x", "x", "1"),)).read())


def test_obeys_the_contract(csv: Path) -> None:
    check_source(Recorded("r", (csv, csv), (Cell("v", "speed", "1"),), Clock("t"), "window"))


class Wrong:
    """A source that breaks one law, by name."""

    def __init__(self, law: str) -> None:
        self.law, self.opened = law, 0

    def open(self) -> None:
        self.opened += 1

    async def chunks(self):  # type: ignore[no-untyped-def]
        t, v = np.array([0, 1]), np.zeros((2, 1))
        yield Chunk("a", t, v)
        if self.law == "rows":
            yield Chunk("a", t[:0], v[:0])
        if self.law == "types":
            yield Chunk("a", t + 2, np.zeros((2, 1), np.float32))
        if self.law == "one source":
            yield Chunk("b", t + 2, v)
        if self.law == "time":
            yield Chunk("a", t, v)
        if self.law == "again":
            yield Chunk("a", t + 2, v + self.opened)

    def close(self) -> None:
        pass


@pytest.mark.parametrize("law", ["rows", "types", "one source", "time", "again"])
def test_checker_names_the_law(law: str) -> None:
    with pytest.raises(LawBroken, match=f"^{law}"):
        check_source(Wrong(law))


def chunked(name: str, t: np.ndarray, cuts: list[int], task: int = 0) -> list[Chunk]:
    edges = sorted({0, len(t), *(c % (len(t) + 1) for c in cuts)})
    v = t[:, None].astype(np.float64)
    return [
        Chunk(name, t[a:b], v[a:b], task) for a, b in itertools.pairwise(edges)
    ]  # fmt: skip


stamp_lists = st.lists(st.integers(0, 1000), min_size=1, max_size=40, unique=True).map(sorted)


@given(stamp_lists, stamp_lists, st.lists(st.integers(0, 50), max_size=6))
def test_merged_chunks_lose_nothing_and_stay_close(
    a: list[int], b: list[int], cuts: list[int]
) -> None:
    sources = {"a": np.array(a), "b": np.array(b)}
    merged = list(merge([iter(chunked(n, t, cuts)) for n, t in sources.items()]))
    for name, t in sources.items():
        got = [c for c in merged if c.source == name]
        assert np.concatenate([c.t for c in got]).tolist() == t.tolist()
        assert np.concatenate([c.v for c in got])[:, 0].tolist() == t.tolist()
    assert all(len(c.t) for c in merged)


def test_tasks_that_overlap_are_moved_together() -> None:
    t = np.array([0, 5, 10])
    a = [*chunked("a", t, []), *chunked("a", t, [], 1)]
    b = [*chunked("b", t + 2, []), *chunked("b", t + 2, [], 1)]
    merged = list(merge([iter(a), iter(b)], gap=100))
    starts = {(c.source, c.task): int(c.t[0]) for c in reversed(merged)}
    assert starts == {("a", 0): 0, ("b", 0): 2, ("a", 1): 112, ("b", 1): 114}
    later = [*chunked("a", t, []), *chunked("a", t + 50, [], 1)]
    assert [c.t[0] for c in merge([iter(later)])] == [0, 50]
