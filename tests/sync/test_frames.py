"""Behind the border of two frames the state starts anew, and nothing is interpolated over it."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Chunk, Out, copy, equal, join, load, save
from evertwin.signals import Layout
from evertwin.sync import Align, Feed

STEP = 10**9


def two(rate: float | None = None) -> Align:
    feeds = (Feed("command", ("v",), slack=1.0), Feed("pose", ("x",), slack=1.0, framed=True))
    return Align(Layout.of(v="m/s"), Layout.of(x="m"), feeds, rate=rate)


def drawn(seed: int) -> tuple[list[Chunk], list[int]]:
    """Commands and poses, some absent, of a few maps; and the stamps of the first of each."""
    rng = np.random.default_rng(seed)
    chunks, frame, firsts = [], 0, list[int]()
    lost = np.sort(rng.choice(np.arange(5, 55), 3, replace=False))
    for k in range(60):
        t = k * STEP + np.array([int(rng.integers(0, STEP // 4))])
        chunks.append(Chunk("command", t, rng.normal(size=(1, 1))))
        gone, was = (bool(((at >= lost) & (at < lost + 2)).any()) for at in (k, k - 1))
        if was and not gone:
            frame += 1
            firsts.append(int(t[0]) + STEP // 3)
        pose = [[np.nan, np.nan]] if gone else [[0.1 * k + 10 * frame, frame]]
        chunks.append(Chunk("pose", t + STEP // 3, np.array(pose)))
    return chunks, firsts


def folded(on: Align, chunks: list[Chunk], rng: np.random.Generator | None = None) -> Out:
    """All rows; with ``rng`` cut off and gone on."""
    state, outs = on.init(), []
    for one in chunks:
        if rng is not None and rng.random() < 0.2:
            state = load(save(copy(state)), like=on.init())
        state, out = on.step(state, one)
        outs.append(out)
    return join([*outs, on.flush(state)[1]])


def whole(chunks: list[Chunk]) -> list[Chunk]:
    """The commands, then the poses: the rows leave later, and are the same."""
    parts = [[c for c in chunks if c.source == name] for name in ("command", "pose")]
    return [Chunk(one[0].source, *(np.concatenate([c[k] for c in one]) for k in (1, 2)))
            for one in parts]  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_the_first_row_of_a_map_is_that_of_a_drive(seed: int) -> None:
    chunks, firsts = drawn(seed)
    rows = folded(two(), chunks).rows
    assert firsts and rows.t[rows.gap].tolist() == [int(rows.t[0]), *firsts]
    assert equal(folded(two(), whole(chunks)).rows, rows)
    assert equal(folded(two(), chunks, np.random.default_rng(seed)).rows, rows)


@pytest.mark.parametrize("seed", range(5))
def test_a_grid_has_no_pose_between_two_maps(seed: int) -> None:
    chunks, firsts = drawn(seed)
    rows = folded(two(rate=2.0), chunks).rows
    assert equal(folded(two(rate=2.0), chunks, np.random.default_rng(seed)).rows, rows)
    assert set(firsts) <= {*rows.t[rows.gap].tolist()}
    frame = np.searchsorted(firsts, rows.t, side="right")
    off = np.abs(rows.y[:, 0] - 10 * frame - 0.1e-9 * rows.t)
    assert np.nanmax(off) < 0.1, "none lies between two frames"
