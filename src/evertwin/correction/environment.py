"""The translation problem as a Gymnasium environment, for other learning algorithms.

A recorded log is gone through sample by sample: the observation is the level of the set-point, the
action the value that the simulation is given, the reward that of `SarsaSettings`. An episode
terminates when the deviation exceeds its end, and is truncated at the end of the log.

>>> import gymnasium
>>> from evertwin.machines.mobile import Robot1D
>>> from evertwin.fold import make_block
>>> command = np.repeat([0.05, 0.10, 0.20], 5)
>>> rows = make_block(t=np.arange(15) * 10**9, u=command[:, None],
...     y=np.cumsum(np.minimum(command, 0.16))[:, None])
>>> robot = Robot1D()
>>> world = Translation.of(robot, robot.parameters.values, (rows,), SarsaSettings("v"))
>>> level, _ = world.reset(seed=1, options={"start": 0})
>>> world.step(level)[1:3], world.step(np.int64(0))[1:3]
((1.0, False), (-5.0, True))
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.correction.sarsa import Samples, Sarsa
from evertwin.correction.sarsa_settings import SarsaSettings
from evertwin.errors import DataError, MissingExtra
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.types import Bools, Float64, Int64, ParameterVector

try:
    import gymnasium
except ImportError as error:
    raise MissingExtra.of("gymnasium", "rl") from error


class Translation(gymnasium.Env[np.int64, np.int64]):
    """Choose the simulated value for each commanded one. See the module for an example.

    Args:
        level: level of the set-point per sample, (k,).
        error: predicted − measured per action and scored output, (k, actions, scored).
        fresh: 1 where a stretch of the log begins, (k,).
        angle: True where a scored output is an angle, (scored,).
        settings: reward, end, discretisation, and whether the deviation accumulates.

    Raises:
        DataError: no sample.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own attribute

    def __init__(
        self,
        level: Int64[np.ndarray, " k"],
        error: Float64[np.ndarray, "k actions scored"],
        fresh: Int64[np.ndarray, " k"],
        angle: Bools,
        settings: SarsaSettings,
    ) -> None:
        if len(level) == 0:
            raise DataError(
                "environment: expected at least one sample, got none: the log needs set-points "
                "that are held for one horizon, within the range of the actions"
            )
        self.level, self.error, self.fresh, self.angle = level, error, fresh, angle
        self.settings = settings
        self.observation_space = gymnasium.spaces.Discrete(settings.count)
        self.action_space = gymnasium.spaces.Discrete(settings.count)
        self._at = 0
        self._total = np.zeros(len(angle))

    @classmethod
    def of(
        cls, model: Model, p: ParameterVector, windows: tuple[Block, ...], settings: SarsaSettings
    ) -> Translation:
        """The environment of recorded windows under the original model."""
        agent = Sarsa(model, settings)
        parts: list[Samples] = []
        for window in windows:
            state = agent.renew(agent.init(), p)
            parts.append(agent.step(state, window)[1].rows)
        level, fresh, error = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("level", "fresh", "error")
        )
        scored = [model.outputs.index(name) for name in settings.outputs or model.outputs.names]
        return cls(level, error, fresh, model.outputs.angles[scored], settings)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        """Starts at a random sample, or at ``options["start"]``."""
        super().reset(seed=seed)
        last = len(self.level)
        self._at = int((options or {}).get("start", self.np_random.integers(last)))
        self._total[:] = 0.0
        return np.int64(self.level[self._at]), {"sample": self._at}

    def step(self, action: np.int64) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        """Scores ``action`` for the current sample and goes on to the next."""
        s = self.settings
        if s.accumulate and self.fresh[self._at]:
            self._total[:] = 0.0
        error = self.error[self._at, int(action)] + (self._total if s.accumulate else 0.0)
        far = float(math.sqrt(float(np.sum(error[~self.angle] ** 2))))
        turned = np.abs(np.pi - np.mod(np.pi - error[self.angle], 2 * np.pi))
        over = far > s.end or bool((turned > s.end_angle).any())
        self._total[:] = error
        last = self._at == len(self.level) - 1
        self._at = self._at if last else self._at + 1
        return (
            np.int64(self.level[self._at]), s.reward if far < s.near else s.penalty, over, last,
            {"sample": self._at, "deviation": far},
        )  # fmt: skip
