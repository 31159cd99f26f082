"""Compiled: SARSA's simulations, from the measured state, for every action at once.

What is needed from row to row stands in arrays, so where the rows are cut cannot matter.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from evertwin.compiled.calls import call
from evertwin.compiled.functions import njit
from evertwin.compiled.memory import copied

BEGUN, TASK, OPEN, LEVEL, FRESH, TRAINING, WATCHED = range(7)
"""Places in the integers of a segment: has a row come, its task, is a segment open, its level (−1:
the set-point changed in it), does it begin an episode, training number, is the watch set."""


class Lanes(NamedTuple):
    """The simulations from row to row, as in `evertwin.correction.translation.sarsa.SarsaState`.

    >>> Lanes._fields
    ('p', 'x0', 'x', 'elapsed', 'n', 'watched')
    """

    p: Any
    x0: Any
    """State of a new start."""
    x: Any
    """The original model's state, then one per action."""
    elapsed: Any
    """Seconds since the segment began, (1,)."""
    n: Any
    """The integers above."""
    watched: Any
    """Values of the watched inputs that the training began with."""


class Exploration(NamedTuple):
    """One pass over a block.

    >>> Exploration._fields[:3]
    ('rows', 'lanes', 'channel')
    """

    rows: tuple[Any, ...]
    """Of the block: dt, u, y, mark, task, gap."""
    lanes: Lanes
    channel: int
    """Column of the set-point; of what is scored among the outputs, and watched of the inputs:"""
    scored: Any
    watch: Any
    levels: tuple[float, float, int]
    """The lowest, their step and how many there are."""
    horizon: float
    tolerance: float
    """Change of a watched input that begins a new training."""
    actions: Any
    out: tuple[Any, ...]
    """Row, level, fresh, training and errors (·, A, m) of the samples, filled from the start."""
    restarted: Any
    """Set where a training begins, (n,)."""
    ahead: Any
    """Room for a state, inputs, measured outputs, and predicted ones (A + 1, ny)."""
    command: Any
    taken: Any
    predicted: Any


@njit(cache=True)
def level_of(value: float, levels: tuple[float, float, int]) -> int:
    """Nearest level of a set-point; −1 outside the range."""
    level = math.floor((value - levels[0]) / levels[1] + 0.5)
    return int(level) if 0 <= level < levels[2] else -1


@njit(cache=True)
def explore(step: int, observe: int, context: Any, it: Exploration) -> int:
    """Rows in, samples out: the number of samples. The first three are the original model's
    kernel."""
    model = step, context.ctypes.data, it.lanes.p.ctypes.data
    n, elapsed, x = it.lanes.n, it.lanes.elapsed, it.lanes.x
    samples = 0
    for i in range(len(it.rows[0])):
        anew, known = _begins(it, i), _measured(it, i)
        if not anew:
            _watched(it, i)
            anew = _simulated(it, i, model)
        if anew:
            x[0] = it.lanes.x0
            n[OPEN], n[FRESH] = 0, 1
        elif known and n[OPEN] == 1 and elapsed[0] >= it.horizon - 1e-6:
            if n[LEVEL] >= 0:
                _sampled(it, i, samples)
                samples += 1
            n[OPEN] = 0
        if known and n[OPEN] == 0:
            call(observe, model[1], x[0].ctypes.data, it.taken.ctypes.data)
            for a in range(len(it.actions)):
                x[1 + a] = x[0]
            n[OPEN], elapsed[0] = 1, 0.0
    return samples


@njit(cache=True)
def _begins(it: Exploration, i: int) -> bool:
    """Does something new begin at the row, or is an input of it not known?"""
    _, u, _, _, task, gap = it.rows
    n = it.lanes.n
    anew = n[BEGUN] == 0 or gap[i] or task[i] != n[TASK]
    n[BEGUN], n[TASK] = 1, task[i]
    for j in range(u.shape[1]):
        anew = anew or not math.isfinite(u[i, j])
    return bool(anew)


@njit(cache=True)
def _measured(it: Exploration, i: int) -> bool:
    """Trusted outputs of the row, the others as NaN; is all there that is scored?"""
    _, u, y, mark, _, _ = it.rows
    for j in range(y.shape[1]):
        kind = mark[i, u.shape[1] + j]
        it.taken[j] = y[i, j] if kind == 0 or kind == 4 or kind == 5 else math.nan
    known = True
    for j in range(len(it.scored)):
        known = known and math.isfinite(it.taken[it.scored[j]])
    return known


@njit(cache=True)
def _watched(it: Exploration, i: int) -> None:
    """A new training begins where a watched input left its value."""
    u, n, watched = it.rows[1], it.lanes.n, it.lanes.watched
    for j in range(len(it.watch)):
        if n[WATCHED] == 1 and not abs(u[i, it.watch[j]] - watched[j]) <= it.tolerance:
            n[WATCHED], n[OPEN] = 0, 0
            n[TRAINING] += 1
            it.restarted[i] = True
    if n[WATCHED] == 0:
        n[WATCHED] = 1
        for j in range(len(it.watch)):
            watched[j] = u[i, it.watch[j]]


@njit(cache=True)
def _simulated(it: Exploration, i: int, model: tuple[int, int, int]) -> bool:
    """All states one row on; could the original model not follow?"""
    dt, u, n, x, command = it.rows[0][i], it.rows[1], it.lanes.n, it.lanes.x, it.command
    step, c, params = model
    ahead, at, count = it.ahead.ctypes.data, command.ctypes.data, len(it.actions)
    copied(command, u[i])
    level = level_of(u[i, it.channel], it.levels)
    if n[OPEN] == 1:
        n[LEVEL] = level if it.lanes.elapsed[0] == 0.0 or n[LEVEL] == level else -1
        it.lanes.elapsed[0] += dt
        # a segment in which the set-point changed is no sample: nobody asks for its end
        for a in range(count if n[LEVEL] >= 0 else 0):
            command[it.channel] = it.actions[a]
            o = it.predicted[a].ctypes.data
            code = call(step, c, x[1 + a].ctypes.data, at, dt, params, ahead, o)
            x[1 + a] = it.ahead
            if code != 0:
                n[LEVEL] = -1
        command[it.channel] = u[i, it.channel]
    o = it.predicted[count].ctypes.data
    code = call(step, c, x[0].ctypes.data, at, dt, params, ahead, o)
    x[0] = it.ahead
    return bool(code != 0)


@njit(cache=True)
def _sampled(it: Exploration, i: int, k: int) -> None:
    """The segment that ends at the row is a sample: errors as of one horizon."""
    row, level, fresh, training, errors = it.out
    n = it.lanes.n
    row[k], level[k], fresh[k], training[k] = i, n[LEVEL], n[FRESH], n[TRAINING]
    n[FRESH] = 0
    for a in range(len(it.actions)):
        for j in range(len(it.scored)):
            error = it.predicted[a, it.scored[j]] - it.taken[it.scored[j]]
            errors[k, a, j] = error * it.horizon / it.lanes.elapsed[0]
