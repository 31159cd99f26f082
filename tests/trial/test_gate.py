"""The gate on a simulated one-axis robot: 10 Hz, position noise 1 cm, 600 s."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import UsageError
from evertwin.fold import copy, equal, load, save
from evertwin.trial import PROBATION, Trial, admit
from evertwin.trial.betting import GRID, LENGTHS, evidence, open_bets, place
from evertwin.trial.gate_loop import run, unsafe
from evertwin.trial.odds import odds
from evertwin.trial.spec import TrialSpec

RATE, HORIZON, RUNS = 10, 20, 200


def segments(
    rng: np.random.Generator, gain: float, models: tuple[float, float], size: float = 1.0
) -> np.ndarray:
    """Losses of two model gains over segments of 2 s, from the measured position, (300, 2)."""
    n = 600 * RATE
    u = np.repeat(rng.uniform(-0.3, 0.3, 300), rng.integers(20, 61, 300))[:n]
    y = np.cumsum(gain * u / RATE) + 0.01 * rng.standard_normal(n)
    start = np.r_[0.0, y[HORIZON - 1 : -1 : HORIZON]]
    way = np.cumsum(u.reshape(-1, HORIZON) / RATE, axis=1)
    measured = y.reshape(-1, HORIZON) - start[:, None]
    return size * np.stack([((g * way - measured) ** 2).mean(axis=1) for g in models], axis=1)


def verdicts(stage: Trial, gain: float, models: tuple[float, float]) -> list[object]:
    rng = np.random.default_rng(1)
    return [stage.step(stage.init(), segments(rng, gain, models))[1] for _ in range(RUNS)]


@pytest.mark.parametrize(("horizon", "least"), [(5.0, 20), (1.0, 30), (0.1, 40), (0.02, 40)])
def test_a_fast_machine_need_not_run_for_long(horizon: float, least: int) -> None:
    rule = TrialSpec()
    stage = Trial(horizon=horizon, duration=rule.lasts(horizon))
    assert stage.least == least


def test_a_gain_error_of_ten_percent_is_promoted() -> None:
    assert verdicts(Trial(horizon=2.0), 1.1, (1.0, 1.1)).count("promote") >= 0.95 * RUNS


def test_without_deviation_nothing_is_promoted() -> None:
    for fitted in (0.99, 0.999, 1.0, 1.003, 1.01):
        assert verdicts(Trial(horizon=2.0), 1.0, (1.0, fitted)).count("promote") <= 0.01 * RUNS


def test_a_gain_that_is_not_worth_a_switch_is_not_promoted() -> None:
    assert "promote" not in verdicts(Trial(horizon=2.0), 1.01, (1.0, 1.01))


def test_a_worse_challenger_is_rejected_early() -> None:
    assert verdicts(Trial(horizon=2.0), 1.0, (1.0, 1.1)).count("reject") >= 0.95 * RUNS


@pytest.mark.parametrize("bad", [0.9, 1.1])
def test_a_bad_promotion_is_rolled_back(bad: float) -> None:
    assert verdicts(PROBATION, 1.0, (bad, 1.0)).count("roll_back") >= 0.95 * RUNS


def test_a_good_promotion_is_kept() -> None:
    assert verdicts(PROBATION, 1.1, (1.1, 1.0)) == ["keep"] * RUNS
    assert verdicts(PROBATION, 1.0, (1.0, 1.002)).count("roll_back") <= 0.05 * RUNS


@pytest.mark.parametrize("size", [1e-12, 1e9])
def test_the_unit_of_the_loss_does_not_matter(size: float) -> None:
    stage = Trial(horizon=2.0)
    one, other = (
        stage.step(stage.init(), segments(np.random.default_rng(3), 1.1, (1.0, 1.1), s))
        for s in (1.0, size)
    )
    assert one[1] == other[1] == "promote"
    assert one[0].tally.tolist() == other[0].tally.tolist()


def test_a_slow_disturbance_is_not_taken_for_evidence() -> None:
    """An offset fitted to 60 s of a disturbance with a time constant of 10 s."""
    promoted = 0
    rng = np.random.default_rng(9)
    for _ in range(RUNS):
        noise = rng.standard_normal(600)
        w = np.empty(600)
        w[0] = noise[0]
        for i in range(1, 600):
            w[i] = np.exp(-0.1) * w[i - 1] + np.sqrt(1 - np.exp(-0.2)) * noise[i]
        offset = w[:60].mean()
        losses = np.stack([w[60:] ** 2, (w[60:] - offset) ** 2], axis=1)
        promoted += Trial().step(Trial().init(), losses)[1] == "promote"
    assert promoted <= 0.03 * RUNS


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(1, 299), max_size=12), st.integers(0, 9))
def test_where_segments_are_cut_does_not_matter(cuts: list[int], seed: int) -> None:
    losses = segments(np.random.default_rng(seed), 1.06, (1.0, 1.06))
    stage = Trial(horizon=2.0)
    whole, verdict = stage.step(stage.init(), losses)
    state, last = stage.init(), None
    for piece in np.split(losses, sorted(cuts)):
        state, last = stage.step(state, piece)
        state = load(save(copy(state)), like=stage.init())
    assert equal(whole, state)
    assert verdict == last


def test_a_decision_is_final() -> None:
    stage = Trial(horizon=2.0)
    state, _ = stage.step(stage.init(), segments(np.random.default_rng(0), 1.1, (1.0, 1.1)))
    kept = copy(state)
    state, verdict = stage.step(state, np.ones((50, 2)) * [1.0, 9.0])
    assert verdict == "promote"
    assert equal(kept, state)


def test_the_compiled_loops_equal_their_plain_twins() -> None:
    losses = segments(np.random.default_rng(4), 1.1, (1.0, 1.1))
    stage = Trial(horizon=2.0)
    state = stage.init()
    run.compiled(losses, stage.rule, LENGTHS, GRID, state)
    fast, slow = open_bets(), open_bets()
    for c, x in np.sqrt(losses):
        place.compiled(c, x, 0.02, LENGTHS, GRID, fast)
        place.plain(c, x, 0.02, LENGTHS, GRID, slow)
    assert equal(fast, slow)
    assert evidence.compiled(fast) == evidence.plain(slow)
    twin = stage.init()
    run.plain(losses, stage.rule, LENGTHS, GRID, twin)
    assert equal(state, twin)


def test_a_challenger_that_exceeds_limits_more_often_is_not_promoted() -> None:
    losses = segments(np.random.default_rng(5), 1.1, (1.0, 1.1))
    harm = np.zeros((len(losses), 2))
    stage = Trial(horizon=2.0, measures=1)
    assert stage.step(stage.init(), np.hstack([losses, harm]))[1] == "promote"
    harm[:, 1] = 1.0
    state, verdict = stage.step(stage.init(), np.hstack([losses, harm]))
    assert verdict is None
    assert stage.verdict(state)[1]["missed"] == ("safety",)
    assert unsafe.plain(state.harm)


def test_perfect_and_absent_losses() -> None:
    stage = Trial(horizon=2.0)
    assert stage.step(stage.init(), np.zeros((100, 2)))[1] is None
    assert stage.step(stage.init(), np.tile([1.0, 0.0], (100, 1)))[1] == "promote"
    assert stage.step(stage.init(), np.zeros((0, 2)))[1] is None


def test_what_runs_away_is_worse_than_what_does_not() -> None:
    stage, away = Trial(horizon=2.0), np.tile([np.inf, 1.0], (15, 1))
    state, verdict = stage.step(stage.init(), away)
    more, why = stage.to_come(state)
    assert verdict is None and more is not None and not why
    assert stage.step(state, away)[1] == "promote"
    assert stage.step(stage.init(), np.tile([1.0, np.inf], (60, 1)))[1] == "reject"
    both = stage.step(stage.init(), np.full((60, 2), np.inf))[0]
    assert stage.to_come(both) == (None, "the gain is below 5 %")


def test_the_limit_ends_a_trial() -> None:
    stage = Trial(horizon=2.0, limit=50)
    state, verdict = stage.step(stage.init(), np.ones((80, 2)))
    assert verdict == "reject"
    assert state.tally[1] == 50


def test_messages_say_what_was_expected() -> None:
    with pytest.raises(UsageError, match="4 columns"):
        Trial(measures=1).step(Trial(measures=1).init(), np.ones((3, 2)))
    with pytest.raises(UsageError, match="alpha"):
        Trial(alpha=0.0)
    with pytest.raises(UsageError, match="proven <= margin"):
        Trial(proven=0.2)
    with pytest.raises(UsageError, match="horizon"):
        Trial(horizon=0.0)
    with pytest.raises(UsageError, match="alpha_reject"):
        Trial(alpha_reject=1.0)


def test_repeated_fits_must_lie_inside_their_intervals() -> None:
    p, low, high = np.array([1.0, 2.0]), np.array([0.0, 0.0]), np.array([3.0, 3.0])
    sigma = np.array([0.01, np.inf])
    assert all(c.passed for c in admit(p, low, high, np.array([[1.01, 9.0]]), sigma))
    assert not admit(p, low, high, np.array([[1.05, 2.0]]), sigma)[1].passed
    assert not admit(np.array([np.nan, 1.0]), low, high)[0].passed


def test_how_long_a_trial_takes_is_foretold_from_its_pace() -> None:
    stage, rng = Trial(horizon=2.0, alpha=1e-6), np.random.default_rng(5)
    losses = segments(rng, 1.1, (1.0, 1.1))
    took = next(n for n in range(300) if stage.step(stage.init(), losses[:n])[1] == "promote")
    part = 2 * took // 3
    more, why = stage.to_come(stage.step(stage.init(), losses[:part])[0])
    assert why == "" and more is not None and 0.5 < (part + more) / took < 2.0


def test_what_cannot_be_foretold_says_why() -> None:
    noise = np.random.default_rng(6).normal(size=60) ** 2
    equal_ones = Trial().step(Trial().init(), np.stack([noise, noise], axis=1))[0]
    assert Trial().to_come(equal_ones) == (None, "the gain is below 5 %")
    stage = Trial(margin=0.0, proven=0.0)
    flat = stage.step(stage.init(), np.stack([noise, noise], axis=1))[0]
    assert stage.to_come(flat) == (None, "the evidence does not grow")
    slow = Trial(segments=10, duration=0.0, limit=10, alpha=1e-12)
    state, _ = slow.step(slow.init(), np.stack([1.5 * noise[:8], noise[:8]], axis=1))
    assert slow.to_come(state)[1] == "at this pace the limit of 10 segments comes first"
    risky = Trial(measures=1)
    harm = np.stack([4.0 * noise, noise, 0.0 * noise, 0.0 * noise + 9.0], axis=1)
    state, _ = risky.step(risky.init(), harm)
    assert risky.to_come(state) == (None, "a safety measure is worse")


def test_a_verdict_is_told_in_odds_and_its_evidence_in_figures() -> None:
    trial = Trial()
    state, _ = trial.step(trial.init(), np.tile([4.0, 1.0], (40, 1)))
    verdict, found = trial.verdict(state)
    assert verdict == "promote" and found["e_value"] > 20.0
    assert f"odds of {odds(found['e_value'])} that it is no chance" in found["sentence"]
    assert "e-value" not in found["sentence"]
