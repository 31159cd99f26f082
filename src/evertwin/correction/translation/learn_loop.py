"""Compiled: SARSA's samples into values, one after the other."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from evertwin.compiled.functions import njit

CLOSE = 0.5
"""Values this close count as equal: then the least mean deviation decides."""
PENDING, ACTION, STATE, SAMPLES, CHANGED, NUMBER, RANDOM, LOGGED = range(8)
"""Places in the integers of the learner: is a reward pending, for which action and level; samples
of this training, sample at which the table last changed, training number, random state, log."""


class Rule(NamedTuple):
    """What `evertwin.correction.translation.sarsa_settings.SarsaSettings` say of learning.

    >>> Rule._fields[:3]
    ('near', 'reward', 'penalty')
    """

    near: float
    reward: float
    penalty: float
    end: float
    end_angle: float
    alpha: float
    """Learning rate; 0: 1 / number of visits."""
    gamma: float
    epsilon: float
    first: float
    full: bool
    """Does a sample score all actions?"""
    accumulate: bool
    angle: Any
    """True where a scored output is an angle, (m,)."""


class Learned(NamedTuple):
    """What was learned so far, as in `evertwin.correction.translation.sarsa.SarsaState`.

    >>> Learned._fields[:3]
    ('q', 'tried', 'deviation')
    """

    q: Any
    """Values, (L, A)."""
    tried: Any
    """Samples per level and action, (L, A)."""
    deviation: Any
    """Sum of their deviations, cut at the end of an episode, (L, A)."""
    best: Any
    """Action of the table per level, (L,)."""
    reward: Any
    """Of the pending sample, (A,)."""
    done: Any
    """Did it end the episode, (A,)."""
    total: Any
    """Accumulated error, (m,)."""
    n: Any
    """The integers above."""


@njit(cache=True)
def _next(n: Any) -> float:
    """A number in [0, 1) from the learner's own generator (Lehmer, 48271)."""
    n[RANDOM] = n[RANDOM] * 48271 % 2147483647
    return float(n[RANDOM] - 1) / 2147483646.0


@njit(cache=True)
def choose(own: Learned, level: int, close: float) -> int:
    """The best action of a level: among those whose value is within ``close`` of the best, the one
    with the least mean deviation, then the one nearest to the set-point.
    """
    q, tried = own.q, own.tried
    best = q[level, 0]
    for a in range(q.shape[1]):
        best = max(best, q[level, a])
    found, least = -1, math.inf
    for distance in range(q.shape[1]):
        for side in range(2):
            a = level - distance if side == 0 else level + distance
            if a < 0 or a >= q.shape[1] or q[level, a] < best - close:
                continue
            mean = own.deviation[level, a] / tried[level, a] if tried[level, a] > 0 else 1e300
            if found < 0 or mean < least:
                found, least = a, mean
    return found


@njit(cache=True)
def learn(samples: tuple[Any, ...], rule: Rule, own: Learned) -> None:
    """Samples into values, in place.

    Args:
        samples: (level (k,), fresh (k,), training (k,), error (k, A, m)).
    """
    levels, fresh, training, errors = samples
    n, count = own.n, own.q.shape[1]
    for k in range(len(levels)):
        s = levels[k]
        if training[k] != n[NUMBER]:
            _forget(rule.first, own)
            n[NUMBER] = training[k]
        if fresh[k]:
            settle(rule, own, -1, 0)
            own.total[:] = 0.0
        action = choose(own, s, 0.0)
        if not rule.full and _next(n) < rule.epsilon:
            action = int(_next(n) * count)
        settle(rule, own, s, action)
        _reward(errors[k], rule, own, s, action)
        if rule.accumulate:
            for j in range(len(rule.angle)):
                own.total[j] = 0.0 if own.done[action] else own.total[j] + errors[k, action, j]
        n[PENDING], n[ACTION], n[STATE] = 1, action, s
        n[SAMPLES] += 1


@njit(cache=True)
def _reward(error: Any, rule: Rule, own: Learned, s: int, action: int) -> None:
    """What the actions earn by a sample of a level, pending; what was tried counts."""
    for a in range(own.q.shape[1]):
        far, turn = 0.0, 0.0
        for j in range(len(rule.angle)):
            off = error[a, j] + (own.total[j] if rule.accumulate else 0.0)
            if rule.angle[j]:
                turn = max(turn, abs(math.pi - (math.pi - off) % (2 * math.pi)))
            else:
                far += off * off
        far = math.sqrt(far)
        own.reward[a] = rule.reward if far < rule.near else rule.penalty
        own.done[a] = far > rule.end or turn > rule.end_angle
        if rule.full or a == action:
            own.tried[s, a] += 1
            own.deviation[s, a] += min(far, rule.end)


@njit(cache=True)
def settle(rule: Rule, own: Learned, s: int, action: int) -> None:
    """The pending reward goes into the values, now that the next state and action are known."""
    n, q = own.n, own.q
    if n[PENDING] == 0:
        return
    n[PENDING] = 0
    follow = q[s, action] if s >= 0 else 0.0
    before = n[STATE]
    for a in range(q.shape[1]):
        if rule.full or a == n[ACTION]:
            rate = rule.alpha if rule.alpha > 0.0 else 1.0 / own.tried[before, a]
            target = own.reward[a] + (0.0 if own.done[a] else rule.gamma * follow)
            q[before, a] += rate * (target - q[before, a])
    chosen = choose(own, before, CLOSE)
    if chosen != own.best[before]:
        own.best[before] = chosen
        n[CHANGED] = n[SAMPLES]


@njit(cache=True)
def _forget(first: float, own: Learned) -> None:
    """A new training sequence."""
    own.q[:] = first
    own.tried[:] = 0
    own.deviation[:] = 0.0
    own.best[:] = -1
    n = own.n
    n[PENDING], n[SAMPLES], n[CHANGED], n[LOGGED] = 0, 0, 0, 0


@njit(cache=True)
def remember(samples: tuple[Any, ...], log: tuple[Any, ...], n: Any) -> None:
    """Samples into the log (level, fresh, error) that replay goes through; the oldest give way."""
    levels, fresh, errors = log
    for k in range(len(samples[0])):
        if samples[2][k] != n[NUMBER]:
            n[NUMBER], n[LOGGED], n[SAMPLES] = samples[2][k], 0, 0
        at = n[LOGGED] % len(levels)
        levels[at], fresh[at], errors[at] = samples[0][k], samples[1][k], samples[3][k]
        n[LOGGED] += 1
        n[SAMPLES] += 1
