"""Without a time-out, a channel of which nothing comes for far longer than usual is told of."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Block, fold
from evertwin.sync import Arbiter, Rule, Track

from .machines import drive, drive_rows

SEEDS = range(5)
RULES = [Rule(use="blend"), Rule(use="tolerance", tolerance=0.1), Rule()]


def rows(seed: int, n: int = 3000) -> Block:
    block = drive_rows(seed, n=n)
    return block._replace(y=block.y.copy())


def told(block: Block, rule: Rule) -> list[tuple[str, int]]:
    _, out = fold(Track(drive(), Arbiter(rule)), [block])
    return [(r.kind, r.row) for r in out.records if r.kind in ("not_valid", "valid")]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rule", RULES)
def test_a_channel_that_gives_nothing_is_missed_soon_and_each_time(seed: int, rule: Rule) -> None:
    block = rows(seed)
    block.y[500:1400] = np.nan
    block.y[2600:2700] = np.nan
    said = told(block, rule)
    assert [kind for kind, _ in said] == ["not_valid", "valid"] * 2
    assert 510 <= said[0][1] <= 512 and said[1][1] == 1400  # after 1 s at 10 Hz
    assert 2610 <= said[2][1] <= 2670 and said[3][1] == 2700


@pytest.mark.parametrize("seed", SEEDS)
def test_seldom_samples_and_lost_ones_are_usual(seed: int) -> None:
    rng = np.random.default_rng(seed)
    seldom, lost = rows(seed), rows(seed)
    seldom.y[np.arange(3000) % 20 > 0] = np.nan
    lost.y[rng.random(3000) < 0.3] = np.nan
    assert not told(seldom, RULES[0]) and not told(lost, RULES[0])
    seldom.y[2000:2110] = np.nan
    assert told(seldom, RULES[0])[0] == ("not_valid", 2081)  # after five of its own


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_seen_now_and_then_is_told_of_until_that_is_usual(seed: int) -> None:
    block = rows(seed, 12_000)
    block.y[np.arange(12_000) % 400 > 100] = np.nan
    missed = [row for kind, row in told(block, RULES[0]) if kind == "not_valid"]
    assert len(missed) <= 4 and max(missed) < 2000


def test_behind_a_gap_or_in_another_task_nothing_is_missed() -> None:
    block, at = rows(0), 1500
    block.y[at : at + 5] = np.nan
    t = block.t.copy()
    t[at:] += 60 * 10**9
    gap, task = block.gap.copy(), block.task.copy()
    gap[at], task[at:] = True, 1
    dt = block.dt.copy()
    dt[at] = 60.1
    assert not told(block._replace(t=t, gap=gap, dt=dt), RULES[0])
    assert not told(block._replace(t=t, gap=gap, dt=np.where(gap, 0.0, dt), task=task), RULES[0])
