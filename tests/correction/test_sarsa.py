"""SARSA on a simulated drive: start threshold 6 cm/s, cap 16 cm/s, position noise 2 mm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.correction.translation import explore_loop as exploring
from evertwin.correction.translation import learn_loop as learning
from evertwin.correction.translation.sarsa import Sarsa, SarsaState, learn_table
from evertwin.correction.translation.sarsa_settings import SarsaSettings, findings, propose
from evertwin.errors import UsageError
from evertwin.fold import Block, Mark, check_online, copy, equal, fold, make_block, take
from evertwin.machines.mobile import Robot1D
from evertwin.models import FunctionModel
from evertwin.signals import Channel, Layout

ROBOT = Robot1D()
FULL = SarsaSettings("v")


def effect(command: np.ndarray) -> np.ndarray:
    """Dead zone 6 cm/s, then 0.97·u + 0.2, cap 16 cm/s."""
    return np.where(command <= 0.06, 0.0, np.minimum(0.97 * command + 0.002, 0.16))


def drive(
    command: np.ndarray, seed: int = 0, rate: int = 1, noise: float = 0.002, drift: float = 0.002
) -> Block:
    """Commands held for a second each, positions at ``rate`` Hz."""
    rng = np.random.default_rng(seed)
    u = np.repeat(command, rate)
    way = effect(u) / rate + drift * rng.standard_normal(len(u)) / np.sqrt(rate)
    y = np.cumsum(way) + noise * rng.standard_normal(len(u))
    t = np.arange(len(u)) * (10**9 // rate)
    return make_block(t=t, u=u[:, None], y=y[:, None])


def sweep(repeats: int = 5) -> np.ndarray:
    return np.repeat(np.arange(1, 21) * 0.01, repeats)


TRUE = np.round(effect(np.arange(21) * 0.01), 2)


@pytest.mark.parametrize("mode", ["full", "replay"])
@pytest.mark.parametrize("seed", range(3))
def test_the_table_is_found_after_100_samples(mode: str, seed: int) -> None:
    rows = drive(np.r_[0.01, sweep()], seed)
    table = learn_table(ROBOT, ROBOT.parameters.values, (rows,), replace(FULL, mode=mode))
    assert np.abs(table.values - TRUE).max() <= 0.0101
    assert np.mean(np.abs(table.values - TRUE) < 0.005) >= 0.8
    assert table.visits[1:].min() >= 4
    assert not table.learned[0]
    assert table.values[0] == 0.0


def test_one_action_per_sample_needs_a_thousand_samples() -> None:
    rng = np.random.default_rng(2)
    literal = replace(FULL, mode="literal", alpha=0.3)
    errors = []
    for samples in (100, 1500):
        rows = drive(np.repeat(rng.integers(1, 21, samples // 4), 4) * 0.01, 3)
        table = learn_table(ROBOT, ROBOT.parameters.values, (rows,), literal)
        errors.append(np.abs(table.values - TRUE)[1:].mean())
    assert errors[0] > 0.009
    assert errors[1] < 0.006


def test_at_ten_hertz_its_own_horizon_finds_the_same_table() -> None:
    rows = drive(np.r_[0.01, sweep()], 1, rate=10)
    table = learn_table(ROBOT, ROBOT.parameters.values, (rows,), FULL)
    assert np.abs(table.values - TRUE).max() <= 0.0101
    alike = []
    for horizon in (0.1, 1.0):
        state, _ = fold(Sarsa(ROBOT, replace(FULL, horizon=horizon)), [rows])
        alike.append(int(np.sum(state.q[10] > state.q[10].max() - learning.CLOSE)))
    assert alike[0] > 10, "over 0.1 s the 1 cm reward cannot tell actions apart"
    assert alike[1] <= 3


def test_an_outlier_does_not_move_the_table() -> None:
    rows = drive(np.r_[0.01, sweep()], 1)
    y = rows.y.copy()
    y[40:42] += 3.0
    table = learn_table(ROBOT, ROBOT.parameters.values, (rows._replace(y=y),), FULL)
    assert np.abs(table.values - TRUE).max() <= 0.0101


def test_refused_samples_are_not_learned_from() -> None:
    rows = drive(np.r_[0.01, sweep()], 1)
    mark = rows.mark.copy()
    mark[30:50, 1] = Mark.ERROR
    _, out = fold(Sarsa(ROBOT, FULL), [rows._replace(mark=mark)])
    assert not set(out.rows.row) & set(range(30, 50))


def test_a_set_point_that_changes_within_the_horizon_gives_no_sample() -> None:
    rows = drive(sweep(), 1, rate=2)
    _, out = fold(Sarsa(ROBOT, replace(FULL, horizon=2.0)), [rows])
    command = rows.u[:, 0]
    for row in out.rows.row:
        assert np.ptp(command[row - 3 : row + 1]) == 0


MODES = [
    replace(FULL, gamma=0.5),
    replace(FULL, mode="replay", passes=2, capacity=30),
    replace(FULL, mode="literal", alpha=0.3, gamma=0.5, accumulate=True),
]


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 2), st.lists(st.integers(1, 119), max_size=6), st.integers(0, 5),
    st.sampled_from([1, 2, 10]),
)  # fmt: skip
def test_where_rows_are_cut_does_not_matter(
    mode: int, cuts: list[int], seed: int, rate: int
) -> None:
    rng = np.random.default_rng(seed)
    rows = take(drive(np.repeat(rng.integers(0, 24, 40), 3) * 0.01, seed, rate), 0, 120)
    y, gap = rows.y.copy(), rows.gap.copy()
    y[rng.integers(0, 120, 9)] = np.nan
    gap[rng.integers(0, 120, 2)] = True
    rows = make_block(t=rows.t, u=rows.u, y=y)._replace(gap=gap)
    check_online(Sarsa(ROBOT, MODES[mode]), rows, cuts=[sorted(set(cuts))])


def test_samples_equal_the_model_simulated_from_the_measured_state() -> None:
    rows = drive(sweep(), 4, rate=5)
    _, out = fold(Sarsa(ROBOT, FULL), [rows])
    for k in (0, 3, 50):
        end = int(out.rows.row[k])
        start = end - 5
        for a in (0, 7, 20):
            u = np.full((5, 1), FULL.actions[a])
            x = ROBOT.observe(ROBOT.initial(ROBOT.parameters.values), rows.y[start])
            _, y = ROBOT.simulate(x, u, rows.dt[start + 1 : end + 1], ROBOT.parameters.values)
            error = (y[-1, 0] - rows.y[end, 0]) * 1.0 / rows.dt[start + 1 : end + 1].sum()
            assert out.rows.error[k, a, 0] == pytest.approx(error, abs=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_the_compiled_learner_equals_its_plain_twin(mode: SarsaSettings) -> None:
    rows = drive(sweep(2), 4)
    agent = Sarsa(ROBOT, mode)
    state, out = fold(agent, [rows])
    samples = (out.rows.level, out.rows.fresh, out.rows.training, out.rows.error)
    results = []
    for learn in (learning.learn.compiled, learning.learn.plain):
        own = agent.init()
        learn(samples, agent.rule, own.learned)
        results.append(own)
    assert equal(*results)
    levels = [exploring.level_of.plain(v, (0.0, 0.01, 21)) for v in (-0.1, 0.004, 0.006, 0.3)]
    assert levels == [-1, 0, 1, -1]
    if mode.mode == "replay":
        own = agent.init()
        learning.remember.plain(samples, own.log, own.learner)
        assert equal(own.log_error, state.log_error)


def test_the_plain_choice_settles_and_forgets_alike() -> None:
    q = np.array([[1.0, 1.2, -5.0], [0.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    tried = np.array([[4, 4, 4], [0, 0, 0], [2, 2, 2]])
    deviation = np.array([[0.1, 0.4, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    empty = Sarsa(ROBOT, FULL).init().learned
    own = empty._replace(q=q, tried=tried, deviation=deviation)
    for level, action in ((0, 0), (1, 1), (2, 2)):
        assert learning.choose.plain(own, level, learning.CLOSE) == action
        assert learning.choose.compiled(own, level, learning.CLOSE) == action


def two_inputs() -> FunctionModel:
    return FunctionModel(
        lambda x, u, dt, p: ([x[0] + u[0] * dt, x[1] + u[1] * dt],) * 2,
        Layout.of(v="m/s", w="rad/s"),
        Layout((Channel("s", "m"), Channel("h", "rad", kind="angle"))),
        Layout.of(s="m", h="rad"),
    )


def cross(turn: np.ndarray) -> Block:
    command = np.r_[sweep(2), sweep(2)]
    y = np.stack([np.cumsum(effect(command)), np.cumsum(turn)], axis=1)
    return make_block(t=np.arange(len(command)) * 10**9, u=np.stack([command, turn], axis=1), y=y)


def test_a_changed_cross_control_starts_a_new_training() -> None:
    rows = cross(np.repeat([0.0, 0.5], 40))
    watching = replace(FULL, watch=("w",), tolerance=0.1)
    agent = Sarsa(two_inputs(), watching)
    state, out = fold(agent, [rows])
    assert [(e.row, e.kind) for e in out.records] == [(40, "training_restarted")]
    assert int(state.learner[learning.SAMPLES]) == 39
    check_online(agent, rows, cuts=[(40,), (13, 41)])


def test_a_rotation_ends_the_episode() -> None:
    """An episode that ended is not continued: no value of the next level enters."""
    agent = Sarsa(two_inputs(), replace(FULL, gamma=0.9, alpha=1.0))
    straight, _ = fold(agent, [cross(np.zeros(80))])
    rows = cross(np.zeros(80))
    y = rows.y.copy()
    y[:, 1] = np.cumsum(np.full(80, 0.02))
    turning, _ = fold(agent, [rows._replace(y=y)])
    assert straight.q.max() > 1.5
    assert turning.q.max() == 1.0


def test_convergence_asks_for_samples_and_rest() -> None:
    agent = Sarsa(ROBOT, FULL)
    short, _ = fold(agent, [drive(sweep(2), 1)])
    assert not agent.converged(short)
    long, _ = fold(agent, [drive(np.tile(sweep(6), 2), 1, noise=0.0, drift=0.0)])
    assert agent.converged(long)
    replay = Sarsa(ROBOT, replace(FULL, mode="replay"))
    assert not replay.converged(fold(replay, [drive(sweep(2), 1)])[0])
    assert replay.converged(fold(replay, [drive(sweep(7), 1)])[0])


def test_reading_the_table_changes_nothing() -> None:
    for mode in MODES:
        agent = Sarsa(ROBOT, mode)
        state, _ = fold(agent, [drive(sweep(3), 1)])
        kept: SarsaState = copy(state)
        first, second = agent.table(state), agent.table(state)
        assert equal(kept, state)
        assert first.values.tolist() == second.values.tolist()


def test_the_action_space_is_proposed_and_checked() -> None:
    command = np.arange(0, 21) * 0.01
    low, quantum, count = propose(command, effect(command))
    assert (low, quantum) == (0.0, 0.01)
    assert count == 21
    assert findings(replace(FULL, low=low, quantum=quantum, count=count), command, command) != ()
    assert findings(FULL, command, effect(command)) == ()
    assert propose(command - 0.1, effect(command) - 0.1)[0] == pytest.approx(-0.1)
    assert propose(np.linspace(0, 100.0, 9), np.linspace(0, 100.0, 9) + 0.01)[2] <= 41
    with pytest.raises(UsageError, match="deviate"):
        propose(command, command)


@pytest.mark.parametrize(
    "change",
    [
        {"quantum": 0.0}, {"count": 1}, {"alpha": 2.0}, {"gamma": 1.0}, {"epsilon": -0.1},
        {"passes": 0}, {"seed": 0}, {"tolerance": 0.0},
    ],
)  # fmt: skip
def test_settings_that_cannot_be_meant_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="SARSA: expected"):
        replace(FULL, **change)
    with pytest.raises(UsageError, match="no channel"):
        Sarsa(ROBOT, SarsaSettings("speed")).init()
