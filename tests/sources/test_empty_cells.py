"""Cells without a value are counted and told; what is recorded less often is no loss."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.sources import Cell, Clock, Recorded, Tally

N = 1200


def read(folder: Path, cells: list[str], t: list[float] | None = None) -> Tally:
    stamps = [0.01 * i for i in range(N)] if t is None else t
    rows = [f"{s:.4f},{i},{cell}" for i, (s, cell) in enumerate(zip(stamps, cells, strict=True))]
    (folder / "run.csv").write_text("\n".join(["t,x,f", *rows]) + "\n")
    found = tuple(Cell(name, name, "1") for name in "xf")
    source = Recorded("log", (folder / "run.csv",), found, Clock(0, "s"), tally=Tally("log"))
    assert sum(len(chunk.t) for chunk in source.read()) == N
    return source.tally


@pytest.mark.parametrize(
    ("empty", "count", "finding"),
    [
        (lambda i: i % 3 == 0, 400, True),
        (lambda i: i > 800, 399, True),  # it died
        (lambda i: i < 40, 40, True),
        (lambda i: 300 < i < 360 or i % 50 == 49, 82, True),
        (lambda i: i in (5, 600), 2, False),  # below 1 %
        (lambda i: True, N, True),
        (lambda i: i % 10 > 0, 0, False),  # a tenth of the rate
        (lambda i: i % 2 > 0, 0, False),
        (lambda i: i not in (4, 9, 300, 301, 700), 0, False),  # only where it changed
    ],
)
def test_empty_cells(tmp_path: Path, empty: object, count: int, finding: bool) -> None:
    assert callable(empty)
    tally = read(tmp_path, ["nan" if empty(i) else "1.5" for i in range(N)])
    assert (tally.counts.get("empty", 0), tally.finding, tally.left_out) == (count, finding, 0)
    assert ("f: no value" in str(tally)) is bool(count)
    assert ("f lacks" in str(tally)) is finding


def test_two_clocks_in_one_table_lose_nothing(tmp_path: Path) -> None:
    """100 Hz and 7 Hz, each row with the stamp of one of them: the union of both."""
    slow, fast = [0.003 + k / 7 for k in range(78)], [0.01 * k for k in range(N - 78)]
    both = sorted([(t, "") for t in slow] + [(t, "2.5") for t in fast])
    tally = read(tmp_path, [cell for _, cell in both], [t for t, _ in both])
    assert "empty" not in tally.counts and not tally.finding
