"""The compiled loops of SARSA.

`explore` rolls the original model out from the measured state for every action at once and hands on
one sample per horizon: the level of the set-point and the error of each action. `learn` turns
samples into values, one after the other. Both keep what they need in arrays, so where the rows are
cut cannot matter.
"""

from __future__ import annotations

import math
from typing import Any

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit

CLOSE = 0.5
"""Values this close count as equal: then the least mean deviation decides."""
BEGUN, TASK, OPEN, LEVEL, FRESH, TRAINING, WATCHED = range(7)
"""Places in the integers of a segment: has a row come, its task, is a segment open, its level (−1:
the set-point changed in it), does it begin an episode, training number, is the watch set."""
PENDING, ACTION, STATE, SAMPLES, CHANGED, NUMBER, RANDOM, LOGGED = range(8)
"""Places in the integers of the learner: is a reward pending, for which action and level; samples
of this training, sample at which the table last changed, training number, random state, log."""


@njit(cache=True)
def level_of(value: float, low: float, quantum: float, count: int) -> int:
    """Nearest level of a set-point; −1 outside the range."""
    level = math.floor((value - low) / quantum + 0.5)
    return int(level) if 0 <= level < count else -1


@njit(cache=True)
def explore(
    step: int, observe: int, context: Any, rows: Any, where: Any, size: Any, actions: Any, p: Any,
    x0: Any, x: Any, elapsed: Any, n: Any, watched: Any, out: Any, restarted: Any, scratch: Any,
) -> int:  # fmt: skip
    """Rows in, samples out; the number of samples.

    Args:
        step, observe, context: the original model's kernel.
        rows: (dt, u, y, mark, task, gap) of a block.
        where: (channel, scored outputs, watched inputs), columns.
        size: horizon, low, quantum, tolerance of the watch.
        actions: values of the actions, (A,).
        p, x0: parameters, and the state of a new start.
        x: states, (1 + A, nx): the original model's, then one per action.
        elapsed: seconds since the segment began, (1,).
        n: the integers above.
        watched: values for which the training began.
        out: (row, level, fresh, training, error (·, A, m)), filled from the start.
        restarted: set where a watched input leaves its value, (n,).
        scratch: (ahead (nx,), u (nu,), y (ny,), predicted (A + 1, ny)).
    """
    # longer than the budget: one row is one thought
    dt, u, y, mark, task, gap = rows
    channel, scored, watch = where
    ahead, command, taken, predicted = scratch
    nu, count = u.shape[1], len(actions)
    c, params, b = context.ctypes.data, p.ctypes.data, ahead.ctypes.data
    command_at, taken_at = command.ctypes.data, taken.ctypes.data
    samples = 0
    for i in range(len(dt)):
        anew = n[BEGUN] == 0 or gap[i] or task[i] != n[TASK]
        for j in range(nu):
            anew = anew or not math.isfinite(u[i, j])
        n[BEGUN], n[TASK] = 1, task[i]
        known = True
        for j in range(y.shape[1]):
            kind = mark[i, nu + j]
            taken[j] = y[i, j] if kind == 0 or kind == 4 or kind == 5 else math.nan
        for j in range(len(scored)):
            known = known and math.isfinite(taken[scored[j]])
        if not anew:
            for j in range(len(watch)):
                if n[WATCHED] == 1 and not abs(u[i, watch[j]] - watched[j]) <= size[3]:
                    n[WATCHED], n[OPEN] = 0, 0
                    n[TRAINING] += 1
                    restarted[i] = True
            if n[WATCHED] == 0:
                n[WATCHED] = 1
                for j in range(len(watch)):
                    watched[j] = u[i, watch[j]]
            command[:] = u[i]
            level = level_of(u[i, channel], size[1], size[2], count)
            if n[OPEN] == 1:
                n[LEVEL] = level if elapsed[0] == 0.0 or n[LEVEL] == level else -1
                elapsed[0] += dt[i]
                # a segment in which the set-point changed is no sample: nobody asks for its end
                for a in range(count if n[LEVEL] >= 0 else 0):
                    command[channel] = actions[a]
                    at, o = x[1 + a].ctypes.data, predicted[a].ctypes.data
                    code = call(step, c, at, command_at, dt[i], params, b, o)
                    x[1 + a] = ahead
                    if code != 0:
                        n[LEVEL] = -1
                command[channel] = u[i, channel]
            o = predicted[count].ctypes.data
            code = call(step, c, x[0].ctypes.data, command_at, dt[i], params, b, o)
            x[0] = ahead
            anew = code != 0
        if anew:
            x[0] = x0
            n[OPEN], n[FRESH] = 0, 1
        elif known and n[OPEN] == 1 and elapsed[0] >= size[0] - 1e-6:
            if n[LEVEL] >= 0:
                out[0][samples], out[1][samples] = i, n[LEVEL]
                out[2][samples], out[3][samples] = n[FRESH], n[TRAINING]
                n[FRESH] = 0
                for a in range(count):
                    for j in range(len(scored)):
                        error = predicted[a, scored[j]] - taken[scored[j]]
                        out[4][samples, a, j] = error * size[0] / elapsed[0]
                samples += 1
            n[OPEN] = 0
        if known and n[OPEN] == 0:
            call(observe, c, x[0].ctypes.data, taken_at)
            for a in range(count):
                x[1 + a] = x[0]
            n[OPEN], elapsed[0] = 1, 0.0
    return samples


@njit(cache=True)
def _next(n: Any) -> float:
    """A number in [0, 1) from the learner's own generator (Lehmer, 48271)."""
    n[RANDOM] = n[RANDOM] * 48271 % 2147483647
    return float(n[RANDOM] - 1) / 2147483646.0


@njit(cache=True)
def choose(q: Any, tried: Any, deviation: Any, level: int, close: float) -> int:
    """The best action of a level: among those whose value is within ``close`` of the best, the one
    with the least mean deviation, then the one nearest to the set-point.
    """
    best = q[level, 0]
    for a in range(q.shape[1]):
        best = max(best, q[level, a])
    found, least = -1, math.inf
    for distance in range(q.shape[1]):
        for side in range(2):
            a = level - distance if side == 0 else level + distance
            if a < 0 or a >= q.shape[1] or q[level, a] < best - close:
                continue
            mean = deviation[level, a] / tried[level, a] if tried[level, a] > 0 else 1e300
            if found < 0 or mean < least:
                found, least = a, mean
    return found


@njit(cache=True)
def learn(
    samples: Any, rule: Any, full: bool, accumulate: bool, angle: Any, q: Any, tried: Any,
    deviation: Any, best: Any, reward: Any, done: Any, total: Any, n: Any,
) -> None:  # fmt: skip
    """Samples into values, in place.

    Args:
        samples: (level (k,), fresh (k,), training (k,), error (k, A, m)).
        rule: near, reward, penalty, end, end of angles, alpha (0: 1/visits), gamma, epsilon, first.
        full: does a sample score all actions?
        accumulate: do errors add up within an episode?
        angle: True where a scored output is an angle, (m,).
        q: values, (L, A).
        tried: samples per level and action, (L, A).
        deviation: sum of their deviations, cut at the end of an episode, (L, A).
        best: action of the table per level, (L,).
        reward: of the pending sample, (A,).
        done: did it end the episode, (A,).
        total: accumulated error, (m,).
        n: the integers above.
    """
    for k in range(len(samples[0])):
        s = samples[0][k]
        if samples[2][k] != n[NUMBER]:
            _forget(rule[8], q, tried, deviation, best, n)
            n[NUMBER] = samples[2][k]
        if samples[1][k]:
            settle(rule, full, q, tried, deviation, best, reward, done, -1, 0, n)
            total[:] = 0.0
        action = choose(q, tried, deviation, s, 0.0)
        if not full and _next(n) < rule[7]:
            action = int(_next(n) * q.shape[1])
        settle(rule, full, q, tried, deviation, best, reward, done, s, action, n)
        for a in range(q.shape[1]):
            far, turn = 0.0, 0.0
            for j in range(len(angle)):
                error = samples[3][k, a, j] + (total[j] if accumulate else 0.0)
                if angle[j]:
                    turn = max(turn, abs(math.pi - (math.pi - error) % (2 * math.pi)))
                else:
                    far += error * error
            far = math.sqrt(far)
            reward[a] = rule[1] if far < rule[0] else rule[2]
            done[a] = far > rule[3] or turn > rule[4]
            if full or a == action:
                tried[s, a] += 1
                deviation[s, a] += min(far, rule[3])
        if accumulate:
            for j in range(len(angle)):
                total[j] = 0.0 if done[action] else total[j] + samples[3][k, action, j]
        n[PENDING], n[ACTION], n[STATE] = 1, action, s
        n[SAMPLES] += 1


@njit(cache=True)
def settle(
    rule: Any, full: bool, q: Any, tried: Any, deviation: Any, best: Any, reward: Any, done: Any,
    s: int, action: int, n: Any,
) -> None:  # fmt: skip
    """The pending reward goes into the values, now that the next state and action are known."""
    if n[PENDING] == 0:
        return
    n[PENDING] = 0
    follow = q[s, action] if s >= 0 else 0.0
    before = n[STATE]
    for a in range(q.shape[1]):
        if full or a == n[ACTION]:
            rate = rule[5] if rule[5] > 0.0 else 1.0 / tried[before, a]
            target = reward[a] + (0.0 if done[a] else rule[6] * follow)
            q[before, a] += rate * (target - q[before, a])
    chosen = choose(q, tried, deviation, before, CLOSE)
    if chosen != best[before]:
        best[before] = chosen
        n[CHANGED] = n[SAMPLES]


@njit(cache=True)
def _forget(first: float, q: Any, tried: Any, deviation: Any, best: Any, n: Any) -> None:
    """A new training sequence."""
    q[:] = first
    tried[:] = 0
    deviation[:] = 0.0
    best[:] = -1
    n[PENDING], n[SAMPLES], n[CHANGED], n[LOGGED] = 0, 0, 0, 0


@njit(cache=True)
def remember(samples: Any, levels: Any, fresh: Any, errors: Any, n: Any) -> None:
    """Samples into the log that replay goes through; the oldest give way."""
    for k in range(len(samples[0])):
        if samples[2][k] != n[NUMBER]:
            n[NUMBER], n[LOGGED], n[SAMPLES] = samples[2][k], 0, 0
        at = n[LOGGED] % len(levels)
        levels[at], fresh[at], errors[at] = samples[0][k], samples[1][k], samples[3][k]
        n[LOGGED] += 1
        n[SAMPLES] += 1
