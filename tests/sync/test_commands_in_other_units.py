"""A command that comes in another unit from a row on, whatever it was before that row."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Block, fold, make_block
from evertwin.machines.mobile import Differential
from evertwin.sync import Arbiter, Rule, Track
from evertwin.sync.track_state import TrackState

RATE, SIGMA, ONSET, OVER, N = 10, 0.003, 600, 900, 1200
STAGE = Track(Differential(), Arbiter(Rule(use="blend")))


def driven(seed: int, cap: float = np.inf, wide: slice = slice(0, 0)) -> Block:
    """A base whose commands change every 3 s; in rows ``wide`` its speeds are asked for thrice as
    fast, and the machine does ``cap`` of them at most."""
    rng, hold = np.random.default_rng(seed), 3 * RATE
    v = np.repeat(rng.uniform(-0.15, 0.5, N // hold) * (rng.random(N // hold) > 0.15), hold)
    w = np.repeat(rng.uniform(-0.6, 0.6, N // hold) * (rng.random(N // hold) > 0.25), hold)
    v[wide] *= 3.0
    done = np.clip(v, -cap, cap)
    pose = np.zeros((N, 3))
    for i in range(1, N):
        x, y, a = pose[i - 1]
        for _ in range(10):
            a += 0.5 * w[i] / RATE / 10
            x, y = x + done[i] * np.cos(a) / RATE / 10, y + done[i] * np.sin(a) / RATE / 10
            a += 0.5 * w[i] / RATE / 10
        pose[i] = x, y, a
    y = pose + rng.normal(0.0, SIGMA, pose.shape)
    return make_block(t=np.arange(N) * 10**8, u=np.stack([v, w], axis=1), y=y)


def in_another_unit(seed: int, column: int, factor: float) -> tuple[Block, Block, TrackState]:
    """The rows as they are, and as they were recorded; the state after those before the onset."""
    block = driven(seed)
    u = block.u.copy()
    u[ONSET:OVER, column] *= factor
    return block, block._replace(u=u), STAGE.init()


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(
    ("column", "factor"),
    [(0, 1000.0), (0, 100.0), (0, 1 / 0.0254), (1, 180.0 / np.pi), (0, 1 / 0.3048), (0, 3.6)],
)
def test_the_unit_is_named_and_nothing_else_is_accused(
    column: int, factor: float, seed: int
) -> None:
    block, recorded, state = in_another_unit(seed, column, factor)
    _, out = fold(STAGE, [recorded], state)
    name, told = ("v", "w")[column], [r for r in out.records if r.kind == "measurement_error"]
    own = [r for r in told if "factor" in r.evidence and r.signal == name]
    assert own and {r.signal for r in told} <= {name, "pose"}
    assert [r.evidence["factor"] for r in own] == pytest.approx([factor] * len(own), rel=1e-3)
    first = ONSET + int(np.argmax(np.abs(block.u[ONSET:, column]) > 0.05))
    assert own[0].row < first + 19 * RATE + 100  # degrees and turns a minute are near each other
    known = slice(own[-1].row + 1, OVER)
    np.testing.assert_allclose(out.rows.u[known], block.u[known], atol=1e-9)
    assert (out.rows.doubt[OVER + 9 * RATE :] == 0).all()


@pytest.mark.parametrize("cap", [np.inf, 0.5, 0.0])
def test_a_machine_that_is_asked_for_more_than_ever_is_in_no_other_unit(cap: float) -> None:
    """It goes as fast, as fast as it can, or it is blocked. What it can be as fast as what two
    commands were, divided by a factor."""
    told, doubted = [], []
    for seed in range(20):
        block = driven(seed, cap, slice(ONSET, OVER))
        block.y[:ONSET] = driven(seed).y[:ONSET]
        block.y[ONSET:, :2] += block.y[ONSET - 1, :2] - block.y[ONSET, :2]
        _, out = fold(STAGE, [block])
        told.append(any(r.signal in ("v", "w") for r in out.records))
        doubted.append((out.rows.doubt != 0).any(axis=1).sum())
    assert sum(told) <= (cap == 0.5)
    assert np.sort(doubted)[-2] <= 16  # untold, where it leapt by a factor


@pytest.mark.parametrize("seed", range(5))
def test_rows_in_another_unit_do_not_tell_how_far_predictions_are_off(seed: int) -> None:
    """What is predicted to move by metres excuses no sensor that is off by as much."""
    _, recorded, state = in_another_unit(seed, 1, 180.0 / np.pi)
    before, _ = fold(STAGE, [recorded], state)
    sound, _ = fold(STAGE, [driven(seed)])
    assert (before.variance[-1] < 4.0 * sound.variance[-1]).all()
