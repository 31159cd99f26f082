"""The environment agrees with Gymnasium's checker and with the agent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from evertwin.correction.environment import Translation
from evertwin.correction.sarsa import learn_table
from evertwin.correction.sarsa_settings import SarsaSettings
from evertwin.errors import DataError
from evertwin.fold import make_block
from evertwin.machines.mobile import Robot1D

SETTINGS = SarsaSettings("v")
ROBOT = Robot1D()


def log() -> tuple[object, ...]:
    command = np.repeat(np.arange(1, 21) * 0.01, 5)
    y = np.cumsum(np.where(command <= 0.06, 0.0, np.minimum(command, 0.16)))
    return (make_block(t=np.arange(100) * 10**9, u=command[:, None], y=y[:, None]),)


def test_it_passes_the_public_checker() -> None:
    check_env(
        Translation.of(ROBOT, ROBOT.parameters.values, log(), SETTINGS), skip_render_check=True
    )


def test_the_learned_table_earns_every_reward() -> None:
    p = ROBOT.parameters.values
    world = Translation.of(ROBOT, p, log(), SETTINGS)
    table = learn_table(ROBOT, p, log(), SETTINGS)
    level, _ = world.reset(seed=0, options={"start": 0})
    total, steps, last = 0.0, 0, False
    while not last:
        action = np.int64(round(table.values[level] / SETTINGS.quantum))
        level, reward, over, last, _ = world.step(action)
        total, steps = total + reward, steps + 1
        assert not over
    assert (total, steps) == (99.0, 99)


def test_deviations_accumulate_if_asked() -> None:
    world = Translation.of(
        ROBOT, ROBOT.parameters.values, log(), replace(SETTINGS, accumulate=True)
    )
    world.reset(seed=0, options={"start": 70})
    deviations = [world.step(np.int64(15))[4]["deviation"] for _ in range(4)]
    assert np.diff(deviations) == pytest.approx(0.0, abs=1e-9) or np.all(np.diff(deviations) > 0)


def test_an_empty_log_is_refused() -> None:
    with pytest.raises(DataError, match="at least one sample"):
        Translation.of(ROBOT, ROBOT.parameters.values, log(), replace(SETTINGS, low=5.0))
