"""A machine that goes on changing: challengers that take each other's place end a trial."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec
from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.succession import makes_room
from evertwin.loop.driver import Driver
from evertwin.setup.twin_state import PROBATION, WATCH
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
    assert evidence(state.ahead) == pytest.approx(before)
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


def axis(off: float) -> dict[str, np.ndarray]:
    """A force that depends on its input by a gain, which changes by ``off`` after half of it."""
    rng, n = np.random.default_rng(6), 8000
    u = np.sin(np.arange(n) * 0.07) + np.sin(np.arange(n) * 0.031)
    gain = np.where(np.arange(n) < n // 2, 1.0, 1.0 + off)
    return {"t": np.arange(n) * 0.01, "u": u, "y": gain * u + 0.001 * rng.normal(size=n)}


@pytest.mark.parametrize(("off", "told"), [(0.005, False), (0.03, True)])
def test_an_alarm_counts_where_the_twin_is_off_by_a_part_of_what_is_asked(
    off: float, told: bool
) -> None:
    """Both changes are many times the noise; the first is a tenth of the requirement."""
    model = FunctionModel(lambda x, u, dt, p: (x, u), Layout.of(u="1"), Layout.of(y="1"))
    rule = AnomalySpec(requirement=0.05, relative=True)
    with Twin(TwinSpec("axis", ModelSpec("given"), anomaly=rule), model) as twin:
        twin.run(axis(off))
        found = [e for e in twin.events if e.kind in ("suspected", "drift")]
    assert bool(found) is told
    assert all(e.row >= 4000 for e in found)


def test_a_probation_in_which_nothing_tells_both_apart_ends_where_the_twin_deviates() -> None:
    """Live since row 0; then a current in mA: as far off by the version before."""

    def phase(losses: np.ndarray) -> int:
        with Twin(TwinSpec("cart", ModelSpec("robot1d"))) as twin:
            setup, state = (
                twin.setup,
                Driver(twin.setup, Versions(twin.setup.model), lambda row, said: None).init(),
            )
            trial, _ = setup.probation.step(setup.probation.init(), losses)
            agenda = state.agenda._replace(phase=PROBATION)
            decision = Decision(state._replace(trial=trial, agenda=agenda), [], [])
            makes_room(setup, decision)
        return int(decision.state.agenda.phase)

    noise = np.random.default_rng(5).uniform(0.9, 1.1, (12, 2)) ** 2
    assert phase(1e6 * noise) == WATCH
    assert phase(noise * (1.1, 1.0)) == PROBATION
