"""Without a gap in the twin file, what is usual tells when nothing came for too long."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.fold import Chunk, equal, join
from evertwin.signals import Layout
from evertwin.sync import Align, Feed

V, X = Layout.of(v="m/s"), Layout.of(x="m")
SECOND = 10**9
SEEDS = range(5)


def stamps(steps: Any) -> Any:
    return np.cumsum(np.round(np.asarray(steps) * SECOND)).astype(np.int64)


def gaps(t: Any, rate: float | None = None) -> list[int]:
    """Rows that begin anew, whole and cut anywhere; the first one is left out."""
    align = Align(V, X, (Feed("log", ("v", "x")),), usual=True, rate=rate)
    rows = []
    for pieces in (1, 7):
        state, outs = align.init(), []
        for part in np.array_split(t, pieces):
            state, out = align.step(state, Chunk("log", part, np.ones((len(part), 2))))
            outs.append(out)
        rows.append(join([*outs, align.flush(state)[1]]).rows)
    assert equal(*rows)
    opened: list[int] = rows[0].t[rows[0].gap].tolist()
    return opened[1:]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("period", [0.02, 1.0, 60.0])
@pytest.mark.parametrize("rate", [None, 2.0])
def test_holes_in_regular_samples_are_gaps(seed: int, period: float, rate: float | None) -> None:
    rng = np.random.default_rng(seed)
    steps = period * rng.uniform(0.7, 1.3, 600)
    where = rng.choice(np.arange(20, 600, 40), 4, replace=False)
    steps[where] = period * rng.uniform(8.0, 2000.0, 4)
    t = stamps(steps)
    assert gaps(t, rate and rate / period) == t[np.sort(where)].tolist()


@pytest.mark.parametrize("rate", [None, 2.0])
def test_where_stamps_are_counted_from_does_not_matter(rate: float | None) -> None:
    """A recording that a trigger ends begins before zero, and may cross it."""
    steps = np.full(400, 0.5)
    steps[[100, 300]] = 30.0, 300.0
    t = stamps(steps)
    opened = gaps(t, rate)
    for start in (-(10**5), -600, -200, -1):
        moved = t + start * SECOND
        assert gaps(moved, rate) == [one + start * SECOND for one in opened]


@pytest.mark.parametrize("seed", SEEDS)
def test_jitter_single_losses_and_a_slower_pace_are_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    jitter = 0.1 * rng.lognormal(0.0, 0.4, 3000)
    lost = 0.1 * rng.choice([1, 2, 3], 3000, p=[0.9, 0.08, 0.02])
    assert not gaps(stamps(jitter)) and not gaps(stamps(lost))
    slower = np.r_[np.full(300, 0.1), np.full(300, 2.0)]
    assert len(gaps(stamps(slower))) <= 3  # until it is usual


@pytest.mark.parametrize("seed", SEEDS)
def test_pauses_of_what_sends_only_changes_are_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert not gaps(stamps(rng.exponential(2.0, 3000) + 1e-3))
    bursts = np.where(rng.random(3000) < 0.15, rng.uniform(2.0, 60.0, 3000), 0.1)
    assert len(gaps(stamps(bursts))) <= 3  # of some 450 pauses
    assert not gaps(stamps(np.resize([0.1, 0.1, 0.1, 0.1, 20.0], 600)))


def test_a_command_is_held_while_a_sensor_goes_on() -> None:
    align = Align(V, X, (Feed("command", ("v",)), Feed("pose", ("x",))), usual=True)
    state, _ = align.step(align.init(), Chunk("command", stamps([0.0, 0.1, 0.1]), np.ones((3, 1))))
    t = stamps(np.full(300, 0.1))
    state, out = align.step(state, Chunk("pose", t, np.ones((300, 1))))
    rows = join([out, align.flush(state)[1]]).rows
    assert not rows.gap[1:].any() and (rows.u[2:, 0] == 1.0).all()


def test_a_gap_is_told_once_and_again_where_it_is_far_longer() -> None:
    steps = np.full(400, 0.1)
    steps[[100, 200, 300]] = 5.0, 6.0, 60.0
    align = Align(V, X, (Feed("log", ("v", "x")),), usual=True)
    _, out = align.step(align.init(), Chunk("log", stamps(steps), np.ones((400, 2))))
    assert [(e.kind, e.row) for e in out.records] == [("gap", 100), ("gap", 300)]
    assert out.records[0].reason.startswith("nothing came for 5 s, far longer than usual")


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rate", [None, 2.0])
def test_a_gap_that_the_twin_file_states_is_told_as_well(seed: int, rate: float | None) -> None:
    steps = np.random.default_rng(seed).uniform(0.7, 1.3, 400)
    steps[[100, 200, 300]] = 8.0, 1440.0, 2.0  # over the gap and far over it; below four times
    for gap, told in ((4.5, [8, 1440]), (10.0, [1440]), (2000.0, []), (float("inf"), [])):
        align = Align(V, X, (Feed("log", ("v", "x")),), gap=gap, rate=rate)
        for pieces in (1, 7):
            state, events = align.init(), []
            for part in np.array_split(stamps(steps), pieces):
                state, out = align.step(state, Chunk("log", part, np.ones((len(part), 2))))
                events += out.records
            events += align.flush(state)[1].records
            found = [e.evidence["seconds"] for e in events if e.kind == "gap"]
            assert np.round(found).tolist() == told
