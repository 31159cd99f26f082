"""A pose that scans tell: its lidar turned, its beams the other way round, its stamps late."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin
from evertwin.fold import Block, make_block
from evertwin.gauges.delays.late_scans import late_scans, said_late
from evertwin.gauges.units.misread import likeliest
from evertwin.gauges.units.turned import Numbered, turned
from evertwin.setup.setup import Setup
from planted.twins import shipped

FINE = 50
"""Steps a second of the machine."""


@pytest.fixture(scope="module")
def setup() -> Setup:
    with Twin(shipped("robot_live")) as twin:
        return twin.setup.at(None)


def drawn(seed: int, late: float = 0.0, drive: tuple[float, float] = (0.0, 0.0)) -> Block:
    """Poses by scans, stamped ``late``, of a base whose drive does v and w so much later [s]."""
    rng = np.random.default_rng(seed)
    seconds, period = 300, int(rng.choice([1, 2]))
    v, w = rng.choice([0.0, 0.05, 0.1, 0.15, 0.2], seconds), rng.uniform(-0.4, 0.4, seconds)
    told = np.repeat(np.c_[v, w], period, axis=0)[:seconds]
    at = np.arange(seconds * FINE) / FINE
    done = np.column_stack([told[np.clip(at - lag + 1e-6, 0, None).astype(int), k]
                            for k, lag in enumerate(drive)])  # fmt: skip
    gain, still = rng.uniform(0.85, 1.15), rng.uniform(0.0, 0.04)
    step, turn = gain * np.where(done[:, 0] > still, done[:, 0], 0.0) / FINE, done[:, 1] / FINE
    heading = np.cumsum(turn) - turn
    steps = step * np.array([np.cos(heading), np.sin(heading)])
    pose = np.column_stack([*(np.cumsum(steps, axis=1) - steps), heading])
    own = np.arange(4, len(at), FINE // 2)  # scans twice a second
    stamps, commands = at[own] + late, np.arange(seconds) * 1.0
    t = np.unique(np.r_[commands, stamps[stamps > 0]])
    held = np.clip(np.searchsorted(commands, t, side="left") - 1, 0, None)
    y = np.full((len(t), 3), np.nan)
    rows = np.searchsorted(t, stamps[stamps > 0])
    y[rows] = pose[own][stamps > 0] + rng.normal(0.0, [0.003, 0.003, 0.001], (len(rows), 3))
    return make_block(t=np.rint(t * 1e9).astype(np.int64), u=told[held], y=y)


SEEDS = range(6)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("late", [-0.3, -0.1, 0.1, 0.2, 0.4])
def test_scans_that_are_stamped_late_or_early(setup: Setup, seed: int, late: float) -> None:
    found = late_scans(setup, setup.model, setup.model.parameters.values, (drawn(seed, late),))
    assert found is not None and found[0].seconds == pytest.approx(late, abs=0.01)
    said = said_late(setup, found)
    assert ("either the drive" in said) == (late > 0.0) and ("no drive does" in said) == (late < 0)


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_not_late_as_a_whole(setup: Setup, seed: int) -> None:
    """A healthy base, and drives that do one of the two late."""
    p = setup.model.parameters.values
    for drive in ((0.0, 0.0), (0.3, 0.0), (0.0, 0.3)):
        assert late_scans(setup, setup.model, p, (drawn(seed, drive=drive),)) is None
    both = late_scans(setup, setup.model, p, (drawn(seed, drive=(0.2, 0.2)),))
    assert both is not None and "either the drive" in said_late(setup, both)


@pytest.mark.parametrize("seed", SEEDS)
def test_beams_that_run_the_other_way_round(setup: Setup, seed: int) -> None:
    block = drawn(seed)
    mirrored = block._replace(y=block.y * [1.0, -1.0, -1.0])
    first, *others = likeliest(setup, setup.model, setup.model.parameters.values, [mirrored])
    assert first.said.startswith("the beams of scan look to run the other way round ([perception]")
    assert any(one.said == "the sign of w looks turned" for one in others)
    assert likeliest(setup, setup.model, setup.model.parameters.values, [block]) == ()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_lidar_that_looks_elsewhere(setup: Setup, seed: int) -> None:
    by = np.random.default_rng(seed).uniform(0.3, 2.5)
    block, form = drawn(seed), Numbered(setup.model, setup.model.parameters.values)
    found = turned(setup, [form], (block._replace(y=block.y + np.array([0.0, 0.0, by])),))
    assert found is not None and found.channel == "heading"
    said = found.step(setup)
    assert said.endswith("in [perception], if that is confirmed") and said.startswith("turned = '")
    assert float(said.split("'")[1].split()[0]) == pytest.approx(np.degrees(by), abs=4.0)
