"""SARSA learns the translation from what was commanded to what the machine does.

The state is the level of the set-point, the action the value that the simulation is given instead,
the reward is known one sample late: +1 if the prediction over the agent's own horizon, from the
measured state, ends within 1 cm of the measurement, −5 otherwise (Müller, Jazdi, Weyrich,
"Self-improving Models for the Intelligent Digital Twin", table 1). The original model keeps
running; the agent's simulations run beside it. As the simulated action does not move the machine,
one measurement can score all actions: that is the mode ``full``, the fastest.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel
>>> from evertwin.signals import Layout
>>> robot = FunctionModel(lambda x, u, dt, p: ([x[0] + u[0] * dt],) * 2,
...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
>>> command = np.repeat([0.03, 0.10, 0.19], 6)
>>> effect = np.select([command < 0.06, command > 0.16], [0.0, 0.16], command)
>>> rows = make_block(t=np.arange(18) * 10**9, u=command[:, None], y=np.cumsum(effect)[:, None])
>>> table = learn_table(robot, robot.parameters.values, (rows,), SarsaSettings("v"))
>>> table.values[[3, 10, 19]].tolist(), int(table.visits.sum())
([0.0, 0.1, 0.16], 17)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evertwin.correction.translation import explore_loop as exploring
from evertwin.correction.translation import learn_loop as learning
from evertwin.correction.translation.explore_loop import Exploration, Lanes
from evertwin.correction.translation.learn_loop import Learned, Rule
from evertwin.correction.translation.sarsa_settings import SarsaSettings
from evertwin.correction.translation.table import Table, read_table
from evertwin.fold import Block, Event, Out, copy
from evertwin.models import Kernel, Model, kernel_of
from evertwin.models.kernels.kernel import looped
from evertwin.types import Float64, Int64, ParameterVector, StateVector


class Samples(NamedTuple):
    """One row per horizon: what every action would have predicted.

    >>> Samples._fields
    ('row', 'level', 'fresh', 'training', 'error')
    """

    row: Int64[np.ndarray, " k"]
    """Row at whose end the sample was measured."""
    level: Int64[np.ndarray, " k"]
    """Level of the set-point."""
    fresh: Int64[np.ndarray, " k"]
    """1 where an episode begins."""
    training: Int64[np.ndarray, " k"]
    """Number of the training sequence."""
    error: Float64[np.ndarray, "k actions scored"]
    """Predicted − measured, per action and scored output."""


class SarsaState(NamedTuple):
    """State of the exploration and of the learner.

    >>> SarsaState._fields[:3]
    ('p', 'x0', 'x')
    """

    p: ParameterVector
    """Parameters of the original model."""
    x0: StateVector
    x: Float64[np.ndarray, "lanes nx"]
    """The original model's state, then one per action."""
    elapsed: Float64[np.ndarray, " one"]
    """Time since the segment began [s]."""
    segment: Int64[np.ndarray, " seven"]
    watched: Float64[np.ndarray, " watched"]
    """Values of the watched inputs that the training began with."""
    q: Float64[np.ndarray, "levels actions"]
    """Values of the actions."""
    tried: Int64[np.ndarray, "levels actions"]
    deviation: Float64[np.ndarray, "levels actions"]
    """Sum of the deviations of tried actions."""
    best: Int64[np.ndarray, " levels"]
    """Action of the table, −1: not learned."""
    reward: Float64[np.ndarray, " actions"]
    """Of the pending sample."""
    done: np.ndarray
    """Did the pending sample end the episode? bool, (actions,)."""
    total: Float64[np.ndarray, " scored"]
    """Accumulated error of the episode."""
    learner: Int64[np.ndarray, " eight"]
    log_level: Int64[np.ndarray, " capacity"]
    """Log for replay; empty in the other modes."""
    log_fresh: Int64[np.ndarray, " capacity"]
    log_error: Float64[np.ndarray, "capacity actions scored"]

    @property
    def lanes(self) -> Lanes:
        """What the exploration goes on from."""
        return Lanes(self.p, self.x0, self.x, self.elapsed, self.segment, self.watched)

    @property
    def learned(self) -> Learned:
        """What the learner goes on from."""
        return Learned(
            self.q, self.tried, self.deviation, self.best, self.reward, self.done, self.total,
            self.learner,
        )  # fmt: skip

    @property
    def log(self) -> tuple[np.ndarray, ...]:
        """Level, fresh and error of what replay goes through."""
        return self.log_level, self.log_fresh, self.log_error


@dataclass(frozen=True)
class Sarsa:
    """The learning agent as a stage of the stream. See the module for an example.

    >>> from evertwin.models import FunctionModel
    >>> from evertwin.signals import Layout
    >>> robot = FunctionModel(lambda x, u, dt, p: ([x[0] + u[0] * dt],) * 2,
    ...     Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
    >>> Sarsa(robot, SarsaSettings("v")).init().q.shape
    (21, 21)
    """

    model: Model
    """The original model."""
    settings: SarsaSettings

    @cached_property
    def _kernel(self) -> Kernel:
        return kernel_of(self.model)

    @cached_property
    def _where(self) -> tuple[int, np.ndarray, np.ndarray]:
        inputs, outputs, settings = self.model.inputs, self.model.outputs, self.settings
        scored = [outputs.index(name) for name in settings.outputs or outputs.names]
        watch = [inputs.index(name) for name in settings.watch]
        return (
            inputs.index(settings.channel), np.array(scored, dtype=np.int64),
            np.array(watch, dtype=np.int64),
        )  # fmt: skip

    @cached_property
    def rule(self) -> Rule:
        """What the loops are told of the update."""
        s = self.settings
        return Rule(
            float(s.near), float(s.reward), float(s.penalty), float(s.end), float(s.end_angle),
            float(s.alpha or 0.0), float(s.gamma), float(s.epsilon), float(s.first),
            s.mode == "full", s.accumulate, self.model.outputs.angles[self._where[1]],
        )  # fmt: skip

    def init(self) -> SarsaState:
        """The state before the first row."""
        s, p = self.settings, self.model.parameters.values
        x0, (_, scored, watch) = self.model.initial(p), self._where
        k, m = s.count, len(scored)
        log = s.capacity if s.mode == "replay" else 0
        learner = np.zeros(8, dtype=np.int64)
        learner[learning.RANDOM] = s.seed
        return SarsaState(
            p, x0, np.tile(x0, (k + 1, 1)), np.zeros(1), np.zeros(7, dtype=np.int64),
            np.zeros(len(watch)), np.full((k, k), s.first), np.zeros((k, k), dtype=np.int64),
            np.zeros((k, k)), np.full(k, -1), np.zeros(k), np.zeros(k, dtype=np.bool_),
            np.zeros(m), learner, np.zeros(log, dtype=np.int64), np.zeros(log, dtype=np.int64),
            np.zeros((log, k, m)),
        )  # fmt: skip

    def renew(self, state: SarsaState, p: ParameterVector) -> SarsaState:
        """The state with other parameters of the original model. Consumes ``state``."""
        values = np.array(p, dtype=np.float64)
        return state._replace(p=values, x0=self.model.initial(values))

    def step(self, state: SarsaState, block: Block) -> tuple[SarsaState, Out]:
        """More rows; `Out.rows` are the `Samples`. Consumes ``state``.

        An event ``training_restarted`` tells that a watched input left its value.
        """
        before = int(state.segment[exploring.TRAINING])
        restarted = np.zeros(len(block.t), dtype=np.bool_)
        samples = self._explore(state, block, restarted)
        taken = (samples.level, samples.fresh, samples.training, samples.error)
        if self.settings.mode == "replay":
            learning.remember(taken, state.log, state.learner)
        else:
            learning.learn(taken, self.rule, state.learned)
        return state, Out(samples, self._events(block, restarted, before))

    def _explore(self, state: SarsaState, block: Block, restarted: np.ndarray) -> Samples:
        settings, (channel, scored, watch) = self.settings, self._where
        n, k, ny = len(block.t), settings.count, block.y.shape[1]
        out = (
            *(np.zeros(n, dtype=np.int64) for _ in range(4)), np.zeros((n, k, len(scored))),
        )  # fmt: skip
        exploration = Exploration(
            (block.dt, block.u, block.y, block.mark, block.task, block.gap), state.lanes, channel,
            scored, watch, (float(settings.low), float(settings.quantum), k),
            float(settings.horizon), float(settings.tolerance), settings.actions, out, restarted,
            np.zeros(state.x.shape[1]), np.zeros(block.u.shape[1]), np.zeros(ny),
            np.zeros((k + 1, ny)),
        )  # fmt: skip
        count = looped(exploring.explore, self._kernel, exploration)
        row, *others = (column[:count] for column in out)
        return Samples(row + block.row, *others)

    def _events(self, block: Block, restarted: np.ndarray, before: int) -> tuple[Event, ...]:
        """An event per new training sequence, at the row where it begins."""
        names = ", ".join(self.settings.watch)
        return tuple(
            Event(
                block.row + int(i), int(block.t[i]), "training_restarted", self.settings.channel,
                f"{names} left the value that the table was learned for",
                {"training": before + k, "tolerance": self.settings.tolerance},
            )
            for k, i in enumerate(np.flatnonzero(restarted), 1)
        )  # fmt: skip

    def table(self, state: SarsaState) -> Table:
        """The translation table as learned so far; in replay mode the log is gone through now.

        The pending reward counts. ``state`` stays as it is.
        """
        own = copy(state)
        if self.settings.mode == "replay":
            logged, size = int(own.learner[learning.LOGGED]), len(own.log_level)
            order = np.arange(max(logged - size, 0), logged) % size
            number = np.full(len(order), own.learner[learning.NUMBER])
            log = own.log_level[order], own.log_fresh[order], number, own.log_error[order]
            for _ in range(self.settings.passes):
                learning.learn(log, self.rule, own.learned)
        learning.settle(self.rule, own.learned, -1, 0)
        return read_table(self.settings, own.tried, own.deviation, own.best)

    def converged(self, state: SarsaState) -> bool:
        """Has every level that came up been seen often enough, and did the table stand still?"""
        learner, s = state.learner, self.settings
        if s.mode == "replay":
            visits = np.bincount(state.log_level[: learner[learning.LOGGED]], minlength=s.count)
            return bool(visits.any() and (visits[visits > 0] >= s.enough).all())
        visits = state.tried.max(axis=1) if s.mode == "full" else state.tried.sum(axis=1)
        still = learner[learning.SAMPLES] - learner[learning.CHANGED] >= s.steady
        return bool(still and visits.any() and (visits[visits > 0] >= s.enough).all())


def learn_table(
    model: Model, p: ParameterVector, windows: tuple[Block, ...], settings: SarsaSettings
) -> Table:
    """The table learned on recorded windows, each a stretch of its own.

    Args:
        model: the original model.
        p: its parameters, (np,).
        windows: recorded rows.
        settings: of the agent.
    """
    agent = Sarsa(model, settings)
    state = agent.renew(agent.init(), p)
    for window in windows:
        state.segment[exploring.BEGUN] = 0
        state, _ = agent.step(state, window)
    return agent.table(state)
