"""Compiled: a change of units near zero, where its factor does not show in a single value.

A sensor that reports millimetres for metres says 1000·(0 ± 0.01) = ± 10 when the machine is at
zero: no single value tells this from a machine that was carried away. Several do, because the
factor multiplies the noise as well. A machine that was moved keeps the sensor's noise; so the vote
may overrule the simulation only where the scatter of its samples is nearer to the noise than to the
factor times the noise. See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.sync import places as at
from evertwin.sync.arbiter.plausible_loop import breaks, in_scale, leapt, stands_out
from evertwin.sync.arbiter.run_loop import step_of
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Cause
from evertwin.sync.workspace import Case

FACTOR = int(Cause.FACTOR)
CLEAR = 4.0
"""Evidence by which a row speaks for a sound sensor, and the most that it may say for a factor
[log-likelihood]."""
OVER = 4.0 * CLEAR
"""Evidence from which a factor is over: near zero a row or two look sound by chance."""
COMMON = 3.0
"""How much likelier a machine that moved is than a factor, and one that keeps its speed than one
that does not [log]."""
FOLLOWED = 0.2
"""Share of a row in the drift of the prediction while a factor holds."""
SLOWLY = 10
"""Votes of rows that neither a factor nor sound values explain, which end it: a form that is wrong,
or not tuned yet, leaves many."""


@njit(**COLD)
def allowed(rules: Any, values: Any, g: int, j: int, growth: float) -> float:
    """How far a sound value may be off: the gate, and a tenth of what was predicted to move; of an
    output that no state adopts no more than of its usual size, however long it went to and fro."""
    gate = rules[g, at.GATE] * np.sqrt(values[j, at.BASE] * growth)
    size = np.sqrt(values[j, at.EXPECTED]) if values[j, at.EXPECTED] > 0.0 else np.inf
    return float(gate + 0.1 * min(values[j, at.PATH], size))


@njit(**HOT)
def weigh(limits: Any, values: Any, j: int, y: float, expected: float) -> None:
    """Learns the scale of the model, and what it is off by, from a trusted sample of an output that
    no state adopts."""
    if not limits[j, at.ADOPTS] > 0:
        values[j, at.ALIKE] += (y * expected - values[j, at.ALIKE]) / at.SCALE
        values[j, at.EXPECTED] += (expected * expected - values[j, at.EXPECTED]) / at.SCALE
        missed(values, j, (y - expected) * (y - expected), 1.0 / at.SCALE)


@njit(**HOT)
def missed(values: Any, j: int, square: float, weight: float) -> None:
    """The model is off by this much."""
    known = values[j, at.SQUARE] if values[j, at.SQUARE] < np.inf else 0.0
    values[j, at.SQUARE] = known + weight * (square - known)


@njit(**COLD)
def weigh_anew(limits: Any, values: Any, board: Any, room: Any, size: int, votes: int) -> None:
    """Agreeing samples of an output that no state adopts overrule what was expected: they tell its
    scale at once, as far as as much is expected of them as usual, and what it is off by."""
    ring, expected = board[0], board[4]
    for k in range(size):
        j = room[k]
        if limits[j, at.ADOPTS] > 0:
            continue
        alike, square, off = 0.0, 0.0, 0.0
        for i in range(votes):
            predicted = expected[i, j] - values[j, at.OFFSET]
            alike += (expected[i, j] + ring[i, j]) * predicted
            square += predicted * predicted
            missing = ring[i, j] + values[j, at.OFFSET]
            off += missing * missing
        share = min(square, votes * values[j, at.EXPECTED])
        if share > 0.0:
            weight = share / (votes * values[j, at.EXPECTED])
            scale = alike / square * values[j, at.EXPECTED]
            values[j, at.ALIKE] += weight * (scale - values[j, at.ALIKE])
        missed(values, j, off / votes, votes / at.SCALE)


@njit(**COLD)
def carriers(case: Case, g: int, size: int, growth: float) -> bool:
    """Are outputs of the open fault known to be off by its factor? Those that a row tells clearly
    are remembered; beside them the others say nothing: a pose in mm has its heading in rad."""
    (limits, rules, _), (values, numbers, figures) = case.settings, case.memory
    room, y, f, found = case.sample[0], case.sample[1], figures[g, at.FACTOR], False
    own = numbers[g, at.ONSET] + 1.0
    for k in range(size):
        j = room[k]
        nu = values[j, at.NU]
        more = abs(nu) - abs(wrapped(y[j] / f - (y[j] - nu), limits[j, at.ANGLE] > 0))
        if more > allowed(rules, values, g, j, growth):
            values[j, at.CARRIES] = own
        found = found or values[j, at.CARRIES] == own
    return found


@njit(**COLD)
def persists(case: Case, g: int, size: int, growth: float) -> int:
    """Does the factor of the open fault still hold? 1: the row says so, 0: unknown, −1: it is over.

    The log-likelihood of the sound sensor against that of the factor is summed from the last row
    that spoke for the factor; it is over from `OVER` on. How far the prediction has drifted by now
    is known from measured/f, and the same for both: so a passage through zero, where both explain
    a row, ends nothing; nor does a drift, however far it goes, of a fault that began with a leap.
    The step of a coarse sensor comes behind the factor, and measured/f is off by as much of it.
    Rows that neither explains speak against the factor, too.
    """
    (limits, rules, _), (values, numbers, figures) = case.settings, case.memory
    room, y, f, gain, held = case.sample[0], case.sample[1], figures[g, at.FACTOR], 0.0, True
    own, known = numbers[g, at.ONSET] + 1.0, carriers(case, g, size, growth)
    for k in range(size):
        j = room[k]
        if known and values[j, at.CARRIES] != own:
            continue
        angle, nu, drift = limits[j, at.ANGLE] > 0, values[j, at.NU], values[j, at.DRIFT]
        step = step_of(values, j) / f
        rounded = 1.0 + step * step / (12.0 * values[j, at.BASE])
        near = allowed(rules, values, g, j, growth * rounded)
        spoken, plain = wrapped(y[j] / f - (y[j] - nu) - drift, angle), wrapped(nu - drift, angle)
        sure = breaks(values[j, at.AWAY_FROM], values[j, at.AWAY_AT], f, angle)
        held = held and abs(spoken if sure else wrapped(spoken + drift, angle)) <= near
        factor = 0.5 * spoken * spoken / (values[j, at.BASE] * rounded)
        factor += math.log(abs(f) * math.sqrt(rounded))
        gain += factor - 0.5 * plain * plain / values[j, at.BASE]
    if not held:  # by neither, row after row: what is no longer so ends
        gain = max(gain, OVER / (SLOWLY * rules[g, at.VOTE]))
    gain = min(max(gain, -CLEAR), OVER)
    held = held and gain < CLEAR
    figures[g, at.SOUND_BY] = max(0.0, figures[g, at.SOUND_BY] + gain)
    for k in range(size):
        j = room[k]
        if held and gain <= 0.0 and (values[j, at.CARRIES] == own or not known):
            off = wrapped(y[j] / f - (y[j] - values[j, at.NU]), limits[j, at.ANGLE] > 0)
            values[j, at.DRIFT] += (off - values[j, at.DRIFT]) * FOLLOWED
    if figures[g, at.SOUND_BY] >= OVER:
        return -1
    return 1 if held else 0


@njit(**COLD)
def scatter(
    board: Any, votes: int, g: int, j: int, f: float, angle: bool
) -> tuple[float, float, float]:
    """Squares of measured/f − expected about its mean and about its line; how far that rises."""
    ring, times, expected = board[0], board[2], board[4]
    last = votes - 1
    y = expected[last, j] + ring[last, j]
    end = wrapped(y / f - expected[last, j], angle)
    s1, s2, r0, r1, r2 = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(votes):
        a = (times[i, g] - times[last, g]) * 1e-9
        y = expected[i, j] + ring[i, j]
        d = wrapped(wrapped(y / f - expected[i, j], angle) - end, angle)
        s1, s2, r0, r1, r2 = s1 + a, s2 + a * a, r0 + d, r1 + a * d, r2 + d * d
    about = max(r2 - r0 * r0 / votes, 0.0)
    slope = (votes * r1 - s1 * r0) / (votes * s2 - s1 * s1)
    line = max(about - slope * (r1 - s1 * r0 / votes), 0.0)
    return about, line, abs(slope * (times[last, g] - times[0, g]) * 1e-9)


@njit(**COLD)
def explained(board: Any, votes: int, j: int, f: float, room_for: float, angle: bool) -> bool:
    """Is every contested value, divided by ``f``, where it was expected?"""
    return bool(farthest(board, votes, j, f, angle) <= room_for)


@njit(**COLD)
def farthest(board: Any, votes: int, j: int, f: float, angle: bool) -> float:
    """How far a contested value, divided by ``f``, is from where it was expected, at most."""
    ring, expected, most = board[0], board[4], 0.0
    for i in range(votes):
        off = abs(wrapped((expected[i, j] + ring[i, j]) / f - expected[i, j], angle))
        if not off <= most:
            most = off  # not a number is too far, too
    return most


@njit(**COLD)
def likelier(case: Case, g: int, j: int, f: float, room_for: float) -> bool:
    """Are the contested values likelier f times sound ones than those of a machine that was moved?

    Normal likelihoods with the sensor's noise: measured/f − expected about a level,
    whose noise f has multiplied, against measured − expected about a level or a line. A machine
    that was moved may land anywhere: that it lies as near to the factor's place is a coincidence,
    and that it moves otherwise than predicted from then on is another.
    """
    (limits, rules, _), board = case.settings, case.board
    votes, angle = int(rules[g, at.VOTE]), limits[j, at.ANGLE] > 0
    # An innovation is the difference of two measurements; only one of them is multiplied.
    noise = 0.5 * case.memory[0][j, at.BASE]
    factor = scatter(board, votes, g, j, f, angle)[0]
    level, line, rise = scatter(board, votes, g, j, 1.0, angle)
    far = abs(wrapped(board[0][votes - 1, j], angle))
    chance = math.log(max(far / room_for, 1.0)) - COMMON
    otherwise = COMMON + math.log(max(rise / math.sqrt(noise), 1.0))
    moved = min(level, line + 2.0 * noise * otherwise)
    more = 0.5 * (moved - factor) / noise - (votes - 2) * math.log(abs(f)) + chance
    return bool(more >= 0.0)


@njit(**COLD)
def misfit(case: Case, g: int, size: int, growth: float, k: int, f: float) -> float:
    """How far a factor, place ``k`` of all, leaves the outputs of the group from what was expected,
    in what is allowed; infinite where it does not explain every one that stands out of its gate.

    Of two near each other the unit of the quantity is meant, unless another is nearer by that.
    """
    (limits, rules, _), board, room = case.settings, case.board, case.sample[0]
    values, votes, found = case.memory[0], int(rules[g, at.VOTE]), False
    turn, most = k == at.TURN, 0.0
    for i in range(size):
        j = room[i]
        angle, room_for = limits[j, at.ANGLE] > 0, allowed(rules, values, g, j, growth)
        if f < 0.0 and not limits[j, at.ADOPTS] > 0:
            return np.inf
        sound = explained(board, votes, j, 1.0, room_for, angle)
        if sound and abs(f) > 1.0:
            continue
        offset = values[j, at.OFFSET]
        if (
            (turn or not angle)
            and limits[j, at.TRIED + k] != at.NEVER
            and leapt(limits, values, j, values[j, at.AWAY_FROM], values[j, at.AWAY_AT], f)
            and explained(board, votes, j, f, room_for, angle)
            and stands_out(limits, values, j, np.abs(board[0][:votes, j] + offset).max())
            and likelier(case, g, j, f, room_for)
        ):
            more = 0.0 if limits[j, at.TRIED + k] == at.OWN else 1.0
            most = max(most, farthest(board, votes, j, f, angle) / room_for + more)
            found = True
        elif not sound:
            return np.inf
    return most if found else np.inf


@njit(**COLD)
def scaled(case: Case, g: int, size: int, growth: float) -> float:
    """The factor that explains the contested samples better than a machine that was moved; else 0.

    Asked only where the noise is known from enough trusted samples: a factor shows in nothing else.
    And only where the model is in scale: of an untuned one it cannot be told which is wrong.
    """
    (limits, rules, _), counts, (values, numbers, _) = (
        case.settings,
        case.statistics[1],
        case.memory,
    )
    widened, pool, room = numbers[g, at.WIDENED], counts.shape[0] - 1, case.sample[0]
    if rules[g, at.VOTE] < 3 or 0 < widened > numbers[g, at.SAMPLES] - at.AGAIN:
        return 0.0
    for k in range(size):
        j = room[k]
        if counts[pool, j] < at.KNOWN or not in_scale(limits, values, j):
            return 0.0
    found, least = 0.0, np.inf
    for k in range(at.FACTORS.shape[0]):
        for f in (at.FACTORS[k], 1.0 / at.FACTORS[k]):
            off = misfit(case, g, size, growth, k, f)
            if off < least:
                found, least = float(f), off
    return found


@njit(**COLD)
def blamed(memory: Any, g: int, f: float) -> int:
    """The contested samples become errors by a factor: how many there are, and no vote on them."""
    numbers, figures = memory[1], memory[2]
    figures[g, at.FACTOR] = f
    number = numbers[g, at.BATCH]
    numbers[g, at.BATCH] = 0
    return int(number)
