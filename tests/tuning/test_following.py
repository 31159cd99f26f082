"""Parameters that follow the stream: partition, evidence, trust, recordings between which time
has passed."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from evertwin.fold import Block, copy, equal, take
from evertwin.tuning import Following
from evertwin.tuning.stream.following_loop import learn

P = np.array([3.0, 1.0, 2.0, 4.0, 0.02])
BEAT = 50


def stage(axes: Any, **changes: Any) -> Following:
    """Two axes, known with a fifth less friction than they have."""
    model = axes(2)
    return Following(model, model.parameters.editable, np.append(0.8 * P[:4], 0.02), **changes)


def recording(measured: Any, axes: Any, p: Any = P, n: int = 400, seed: int = 0) -> Block:
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(n, 2))
    block: Block = measured(axes(2), u, p, 0.1 * rng.normal(size=u.shape))
    return block._replace(dt=np.full(n, 0.02))


def run(one: Following, state: Any, block: Block, cuts: tuple[int, ...] = ()) -> Any:
    """The state after a recording: a beat every 50 rows, wherever the rows are cut."""
    edges = sorted({0, len(block.t), *cuts, *range(0, len(block.t), BEAT)})
    for start, stop in pairwise(edges):
        if start % BEAT == 0:
            state = one.beat(state)
        state = one.step(state, take(block, start, stop))
    return one.beat(state)


def test_the_partition_law_holds(axes: Any, measured: Any) -> None:
    one, block = stage(axes), recording(measured, axes)
    whole = run(one, one.init(), block)
    for cuts in ((1, 2, 3), (49, 51, 260), tuple(range(400))):
        assert equal(run(one, one.init(), block, cuts), whole)


def test_a_recording_is_followed_and_each_axis_by_itself(axes: Any, measured: Any) -> None:
    one = stage(axes, moving=((1, 1, 100.0),))  # the second axis never moves
    state = run(one, one.init(), recording(measured, axes))
    np.testing.assert_allclose(one.live(state)[[0, 2]], P[[0, 2]], rtol=0.05)
    assert one.live(state)[[1, 3]].tolist() == (0.8 * P[[1, 3]]).tolist()
    assert state.chosen.tolist() == [1, 0]


def test_nothing_is_learned_from_what_is_not_trusted(axes: Any, measured: Any) -> None:
    one, block = stage(axes), recording(measured, axes)
    clean = run(one, one.init(), block)
    y, mark = block.y.copy(), block.mark.copy()
    y[110:150], mark[110:150, 2:] = 50.0, 7
    marked = run(one, one.init(), block._replace(y=y, mark=mark))
    np.testing.assert_allclose(one.live(marked), one.live(clean), rtol=0.05)
    y[200] = 1e30  # not marked: far outside of all that is usual
    wild = run(one, one.init(), block._replace(y=y, mark=mark))
    np.testing.assert_allclose(one.live(wild), one.live(clean), rtol=0.05)


def test_what_a_beat_has_learned_can_be_taken_back(axes: Any, measured: Any) -> None:
    one, block = stage(axes), recording(measured, axes)
    state = run(one, one.init(), block)
    before = copy(state)
    pushed = one.step(state, take(block._replace(y=block.y + 0.5), 0, BEAT))
    assert equal(one.beat(pushed, back=True).learned, before.learned)


def test_an_estimate_that_does_worse_than_its_version_does_not_predict(
    axes: Any, measured: Any
) -> None:
    model = axes(2)
    one = Following(model, model.parameters.editable, P, memory=0.1, spread=10.0, caution=0.1)
    state = run(one, one.init(), recording(measured, axes))
    assert state.chosen.tolist() == [0, 0]  # it chases noise
    assert one.live(state).tolist() == P.tolist()


def test_between_recordings_the_machine_may_have_changed(axes: Any, measured: Any) -> None:
    one, short = stage(axes), 300
    state = run(one, one.init(), recording(measured, axes, n=2000))
    sure, estimate = one.loosened(copy(state)), one.live(state)
    np.testing.assert_allclose(one.live(one.beat(copy(sure))), estimate)  # nothing was lost
    warm = recording(measured, axes, np.append(1.2 * P[:4], 0.02), short, 1)
    off = [np.abs(one.live(run(one, s, warm))[:4] / P[:4] - 1.2).max() for s in (state, sure)]
    assert off[1] < 0.5 * off[0], off


def test_another_version_of_the_same_is_as_sure(axes: Any, measured: Any) -> None:
    one = stage(axes)
    known = run(one, one.init(), recording(measured, axes, n=2000))
    other = Following(one.model, one.names, one.live(known))
    sure, anew = other.as_sure(copy(known)), other.init()
    assert other.live(sure).tolist() == one.live(known).tolist()
    short = recording(measured, axes, np.append(1.2 * P[:4], 0.02), 150, 1)
    moved = [np.abs(run(other, s, short).p - other.values).max() for s in (sure, anew)]
    assert moved[0] < 0.5 * moved[1]


def test_the_kernel_equals_its_plain_twin_bit_for_bit(axes: Any, measured: Any) -> None:
    one, block = stage(axes, moving=((0, 0, 0.3),)), recording(measured, axes, n=60)
    block.y[20, 0], block.mark[30, 3] = np.nan, 6
    y0, phi = one.model.regressor(np.zeros(0), block.u, block.dt, one.values)
    found = []
    for kernel in (learn.compiled, learn.plain):
        state = one.beat(one.step(one.init(), take(block, 0, 30)))
        kernel(
            (block.dt, block.u, block.y, block.mark), (y0, phi, one.model.columns, one._at),
            one.groups, one._limits, one.memory, (one.values, one._information),
            (state.p, state.weight, *state.learned),
        )  # fmt: skip
        found.append(state)
    assert equal(*found)
