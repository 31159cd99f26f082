"""A machine that goes on changing: challengers that take each other's place end a trial."""

from __future__ import annotations

import numpy as np

from evertwin.trial import Trial
from evertwin.trial.betting import evidence, open_bets, passed_on


def pairs(live: float, other: float, n: int, seed: int = 0) -> np.ndarray:
    """Squared deviations of n segments."""
    noise = np.random.default_rng(seed).uniform(0.8, 1.2, (n, 2))
    return np.asarray((noise * (live, other)) ** 2)


def test_evidence_goes_on_with_the_next_challenger() -> None:
    gate = Trial()
    state, verdict = gate.step(gate.init(), pairs(1.0, 0.4, 28))
    before = evidence(state.ahead)
    assert verdict is None and before > 2.0
    state = gate.passed_on(state)
    assert 0.15 * before < evidence(state.ahead) <= before
    state, verdict = gate.step(state, pairs(1.0, 0.2, 4, seed=1))
    assert verdict is None, "the newest has predicted four segments of its own, five are asked"
    assert gate.step(state, pairs(1.0, 0.2, 8, seed=2))[1] == "promote"


def test_a_challenger_after_one_that_did_not_win_begins_anew() -> None:
    gate = Trial()
    state, _ = gate.step(gate.init(), pairs(1.0, 1.0, 28))
    assert gate.passed_on(state).tally.tolist() == [0, 0]


def test_what_is_passed_on_is_no_evidence_where_there_was_none() -> None:
    assert evidence(passed_on(open_bets())) == 0.0


def test_a_drift_away_from_the_champion_is_no_run_of_luck() -> None:
    """The challenger is three times better, then five, then ten times: so it is on 40 segments."""
    gate = Trial()
    live = np.linspace(3.0, 10.0, 40)
    noise = np.random.default_rng(3).uniform(0.9, 1.1, (40, 2))
    _, verdict = gate.step(gate.init(), (noise * np.stack([live, np.ones(40)], axis=1)) ** 2)
    assert verdict == "promote"
