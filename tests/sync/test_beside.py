"""What was believed and turns out to be a measurement error later."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.fold import Block, Mark, check_online, fold, make_block
from evertwin.sync import Arbiter, Rule, Track

from .machines import drive

N, RATE = 600, 10


def shuttle(seed: int, noise: float = 0.01) -> tuple[Block, np.ndarray]:
    """A robot that goes to and fro about the origin, and its true position."""
    rng = np.random.default_rng(seed)
    v = 0.3 * np.sin(2 * np.pi * np.arange(N) / RATE / 20 + rng.uniform(0, 6))
    truth = np.concatenate([[0.0], np.cumsum(v[1:] / RATE)])
    y = truth + rng.normal(0, noise, N)
    return make_block(t=np.arange(N) * (10**9 // RATE), u=v[:, None], y=y[:, None]), truth


def error(block: Block, truth: np.ndarray, rule: Rule) -> tuple[float, Any]:
    """RMSE of the predicted position, and what was found."""
    _, out = fold(Track(drive(1.05), Arbiter(rule)), [block])
    return float(np.sqrt(np.nanmean((out.rows.y[:, 0] - truth) ** 2))), out


RULES = {
    "as it is": Rule(use="blend", sigma=0.01),
    "gate halved": Rule(use="blend", sigma=0.01, gate=3.0),
    "gate doubled": Rule(use="blend", sigma=0.01, gate=8.0),
    "vote halved": Rule(use="blend", sigma=0.01, vote=4),
    "vote doubled": Rule(use="blend", sigma=0.01, vote=16),
}


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("factor", [-1.0, 1 / 0.3048, 10.0, 0.1])
def test_a_factor_that_begins_or_passes_near_the_origin(factor: float, rule: str) -> None:
    near = 0  # within a few deviations of the noise of the origin nothing tells a turned sign
    for seed in range(12):
        block, truth = shuttle(seed)
        away = np.abs(truth[100:])
        onset = 100 + int(np.argmax((away > 0.06) & (away < 0.2)))
        wrong = slice(onset, onset + 100)
        told = block._replace(y=block.y.copy())
        told.y[wrong] = np.nan
        block.y[wrong] *= factor
        ours, known = (error(b, truth, RULES[rule])[0] for b in (block, told))
        near += ours <= 1.5 * known + 0.01
    assert near >= 10


def test_a_burst_longer_than_the_vote_is_over_when_it_is() -> None:
    for seed in range(5):
        block, truth = shuttle(seed)
        block.y[200:209] += 2.0
        _, out = error(block, truth, RULES["as it is"])
        assert [r.row for r in out.records if r.kind == "overruled"] == [207]
        (told,) = [r for r in out.records if r.kind == "measurement_error"]
        assert (told.row, told.evidence["cause"]) == (209, "away")
        assert told.evidence["onset"] == 200 and told.evidence["end"] == 208
        assert out.rows.mark[209, 0] == Mark.OVERRULED
        assert np.abs(out.rows.y[210:, 0] - truth[210:]).max() < 0.1


def test_a_machine_that_was_moved_stays_where_it_is() -> None:
    for seed in range(5):
        block, truth = shuttle(seed)
        block.y[200:] += 1.0
        truth[200:] += 1.0
        _, out = error(block, truth, RULES["as it is"])
        assert [(r.row, r.kind) for r in out.records] == [(207, "overruled")]
        assert np.abs(out.rows.y[208:, 0] - truth[208:]).max() < 0.1


@pytest.mark.parametrize("slope", [-1.0, 0.5, 2.0])
def test_a_machine_that_moves_by_a_factor_from_where_it_stands_is_believed(slope: float) -> None:
    """Half a metre off the origin, a sensor's factor would show in the position, too."""
    for seed in range(5):
        block, truth = shuttle(seed)
        truth[200:] = truth[200] + slope * (truth[200:] - truth[200])
        block.y[:, 0] = truth - truth[200] + 0.6 + np.random.default_rng(seed).normal(0, 0.01, N)
        _, out = error(block, truth, RULES["as it is"])
        assert "factor" not in [r.evidence.get("cause") for r in out.records]


def test_the_account_is_cut_anywhere() -> None:
    block, _ = shuttle(7)
    block.y[154:254] *= -1.0
    block.y[400:411] += 2.0
    cuts = [[155, 170, 209], [405, 408, 410, 412], list(range(1, N, 7))]
    check_online(Track(drive(1.05), Arbiter(RULES["as it is"])), block, cuts)


@pytest.mark.parametrize("place", [0.0, 7.0])
def test_a_start_is_not_believed_blindly(place: float) -> None:
    """Millimetres from the first row on: told once the robot has moved, wherever it started."""
    for seed in range(4):
        block, truth = shuttle(seed)
        block.y[:, 0] += place
        block.y[:200] *= 1000.0
        _, out = error(block, truth, RULES["as it is"])
        factors = [r for r in out.records if r.evidence.get("factor") == 1000.0]
        assert [(r.kind, r.evidence["onset"]) for r in factors] == [
            ("measurement_error", 0), ("measurement_restored", 0)
        ]  # fmt: skip
        assert factors[0].row < 60 and factors[1].row <= 203
        assert np.abs(out.rows.y[60:, 0] - truth[60:] - place).max() < 0.2


def test_a_sound_start_is_believed_wherever_it_is() -> None:
    for place in (-50.0, 0.0, 3.0):
        block, truth = shuttle(3)
        block.y[:, 0] += place
        _, out = error(block, truth, RULES["as it is"])
        assert out.records == ()
        assert np.abs(out.rows.y[1:, 0] - truth[1:] - place).max() < 0.06
