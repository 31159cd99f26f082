"""The settings of SARSA: table 1 of Müller, Jazdi and Weyrich, and what it leaves open.

The paper prints action space, reward and end of an episode. Sample period, learning rate, discount,
exploration, first values and whether the deviation accumulates are settings here.

>>> settings = SarsaSettings("v")
>>> settings.actions[[0, 1, -1]].tolist(), len(settings.actions)
([0.0, 0.01, 0.2], 21)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from evertwin.errors import UsageError
from evertwin.types import Vector


@dataclass(frozen=True)
class SarsaSettings:
    """What the agent may do and what it is rewarded for.

    >>> SarsaSettings("v", mode="replay").passes
    50
    """

    channel: str
    """Input that is translated: the set-point that the machine does not follow."""
    low: float = 0.0
    """Smallest action, in the channel's unit."""
    quantum: float = 0.01
    """Step from action to action: 1 cm/s."""
    count: int = 21
    """Number of actions, and of levels of the set-point."""
    near: float = 0.01
    """Deviation below which an action is rewarded: 1 cm."""
    reward: float = 1.0
    penalty: float = -5.0
    end: float = 0.02
    """Deviation beyond which an episode ends: 2 cm."""
    end_angle: float = 0.01
    """Rotational deviation beyond which an episode ends [rad]."""
    outputs: tuple[str, ...] = ()
    """Outputs that are scored; by default all."""
    mode: Literal["full", "replay", "literal"] = "full"
    """``full``: every sample scores all actions, since the shadow's action does not move the
    machine. ``replay``: the log is gone through ``passes`` times. ``literal``: one action per
    sample, once."""
    horizon: float = 1.0
    """SARSA's own step: deviation of a prediction this long, from the measured state [s]."""
    alpha: float | None = None
    """Learning rate; None: 1 / number of visits."""
    gamma: float = 0.0
    """Discount. The set-points that follow do not depend on the action, so 0 loses nothing."""
    epsilon: float = 0.1
    """Share of actions tried at random (literal and replay)."""
    first: float = 0.0
    """Value of an action before it was tried."""
    accumulate: bool = False
    """Does the deviation add up over an episode, as the paper may be read?"""
    passes: int = 50
    """Times that replay goes through the log."""
    capacity: int = 2000
    """Newest samples that replay remembers."""
    enough: int = 5
    """Samples per level before it counts as learned."""
    steady: int = 20
    """Samples without a change of the table before it counts as converged."""
    watch: tuple[str, ...] = ()
    """Inputs for whose value the table is learned (the cross control, for example)."""
    tolerance: float = math.inf
    """Change of such an input that starts a new training sequence."""
    seed: int = 1

    def __post_init__(self) -> None:
        positive = ("quantum", "near", "end", "end_angle", "horizon", "tolerance")
        for name in positive:
            if not getattr(self, name) > 0:
                raise UsageError(f"SARSA: expected {name} above 0, got {getattr(self, name)}")
        for name, least in (("count", 2), ("passes", 1), ("capacity", 1), ("enough", 1)):
            if getattr(self, name) < least:
                raise UsageError(
                    f"SARSA: expected {name} of at least {least}, got {getattr(self, name)}"
                )
        if self.alpha is not None and not 0 < self.alpha <= 1:
            raise UsageError(f"SARSA: expected alpha within (0, 1], got {self.alpha}")
        if not (0 <= self.gamma < 1 and 0 <= self.epsilon <= 1):
            raise UsageError(
                f"SARSA: expected gamma within [0, 1) and epsilon within [0, 1], got "
                f"{self.gamma} and {self.epsilon}"
            )
        if not 0 < self.seed < 2**31 - 1:
            raise UsageError(f"SARSA: expected a seed within 1 … 2147483646, got {self.seed}")

    @cached_property
    def actions(self) -> Vector:
        """Values of the actions, in the channel's unit, (count,)."""
        return np.round(self.low + self.quantum * np.arange(self.count), 12)


def propose(command: Vector, effect: Vector, levels: int = 41) -> tuple[float, float, int]:
    """(low, quantum, count) that cover the data: coarse first.

    The range covers every set-point and every observed effect; the quantum is the largest of 1, 2,
    5 times a power of ten that stays at or below half the deviation to be learned.

    Args:
        command: set-points of the samples, (k,).
        effect: what the machine did, in the same unit, (k,).
        levels: levels at most; a finer quantum is not proposed.

    Raises:
        UsageError: nothing was observed, or nothing deviates.

    >>> propose(np.array([0.0, 0.1, 0.2]), np.array([0.0, 0.12, 0.16]))
    (0.0, 0.01, 21)
    """
    known = np.isfinite(command) & np.isfinite(effect)
    command, effect = command[known], effect[known]
    expected = float(np.sqrt(np.mean((effect - command) ** 2))) if len(command) else 0.0
    if not expected > 0:
        raise UsageError("SARSA: expected samples that deviate from their set-points, got none")
    least = float(min(command.min(), effect.min()))
    most = float(max(command.max(), effect.max()))
    target = max(expected / 2, (most - least) / (levels - 1))
    decade = 10.0 ** math.floor(math.log10(target))
    quantum = max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= target * 1.000001)
    if (most - least) / quantum > levels - 1:
        quantum = next(
            s * decade for s in (2.0, 5.0, 10.0) if (most - least) / (s * decade) <= levels - 1
        )
    low = math.floor(least / quantum + 1e-9) * quantum
    count = math.ceil((most - low) / quantum - 1e-9) + 1
    return round(low, 12), round(quantum, 12), max(count, 2)


def findings(settings: SarsaSettings, command: Vector, effect: Vector) -> tuple[str, ...]:
    """What is wrong with the action space for this data; empty if nothing is.

    >>> findings(SarsaSettings("v", count=11), np.array([0.2]), np.array([0.16]))
    ('1 of 1 samples lie outside 0 … 0.1: widen the range',)
    """
    known = np.isfinite(command) & np.isfinite(effect)
    both = np.stack([command[known], effect[known]])
    half = settings.quantum / 2
    low, high = settings.low, float(settings.actions[-1])
    outside = int(np.count_nonzero(((both < low - half) | (both > high + half)).any(axis=0)))
    found = []
    if outside:
        found.append(
            f"{outside} of {both.shape[1]} samples lie outside {low:g} … {high:g}: widen the range"
        )
    deviation = float(np.sqrt(np.mean((both[1] - both[0]) ** 2))) if both.size else 0.0
    if deviation < settings.quantum:
        found.append(
            f"the quantum {settings.quantum:g} is not below the deviation {deviation:.3g} that is "
            "to be learned: make it finer"
        )
    return tuple(found)
