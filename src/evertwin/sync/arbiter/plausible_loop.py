"""Compiled: innovations with the arbiter's own variance, and the tests of hard plausibility.

``room[:size]`` are the outputs of group ``g`` that were measured at this row; for the tuples of
arrays see `evertwin.sync.workspace`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import ordered
from evertwin.sync import places as at
from evertwin.sync.arbiter.run_loop import is_frozen, may_revive, step_of
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Cause
from evertwin.sync.workspace import Case

NONE, RANGE, RATE = int(Cause.NONE), int(Cause.RANGE), int(Cause.RATE)
FROZEN, SENTINEL, FACTOR = int(Cause.FROZEN), int(Cause.SENTINEL), int(Cause.FACTOR)

BETTER = 4.0
"""Times the variance of the innovations that a straight line errs by where a model is trusted to
tell a sensor's unit from the machine's motion by itself."""

OUT = 3.0
"""Times the rms of what a model is off by from which on an output stands out of it."""


REACHES, SHARP = 16.0, 6.0
"""Squared span of pure noise over the mean square by which it lies off a straight line, at most;
that over its variance."""


@njit(**HOT)
def grown(rules: Any, numbers: Any, figures: Any, g: int, stamp: int) -> float:
    """Growth of the innovation's variance since the last trusted sample; 1 at the interval.

    The state's variance over that of the measurement is ρ. It grows by q at every regular interval
    and a blend by K = ρ/(1 + ρ) leaves ρ = K; so K stays where q = K²/(1 − K).
    """
    k = rules[g, at.BLEND]
    if not figures[g, at.INTERVAL] > 0:
        return 1.0
    steps = (stamp - numbers[g, at.GOOD_AT]) / figures[g, at.INTERVAL]
    return float((1 + figures[g, at.SPREAD] + k * k / (1 - k) * steps) * (1 - k))


@njit(**HOT)
def variance_of(variance: Any, counts: Any, phase: int, j: int) -> float:
    """Regular variance of output ``j``'s innovation; inf while too few are known."""
    pool = variance.shape[0] - 1
    if counts[phase, j] >= at.PHASE:
        return float(variance[phase, j])
    return float(variance[pool, j]) if counts[pool, j] >= at.FEW else np.inf


@njit(**COLD)
def learn(statistics: Any, phase: int, j: int, square: float) -> None:
    """One more squared innovation, in its phase and over all of them."""
    variance, counts, warm = statistics
    pool = variance.shape[0] - 1
    n = counts[pool, j]
    if n < at.LEARN:
        warm[n, j] = np.sqrt(square)
        counts[pool, j] = n + 1
        if n + 1 >= at.FEW:
            middle = 1.4826 * ordered(warm[: n + 1, j])[(n + 1) // 2]
            # A few innovations may all be from a standstill: ten times as wide until it is known.
            variance[pool, j] = middle * middle * (1.0 if n + 1 == at.LEARN else 100.0)
        return
    counts[pool, j] = min(n + 1, at.MEMORY)
    variance[pool, j] += (square - variance[pool, j]) / counts[pool, j]
    if phase != pool:
        counts[phase, j] = min(counts[phase, j] + 1, at.MEMORY)
        variance[phase, j] += (square - variance[phase, j]) / counts[phase, j]


@njit(**HOT)
def credible(limits: Any, rules: Any, values: Any, g: int, j: int, steps: float) -> float:
    """How large an innovation may be without any doubt about the sensor.

    What the model predicted to move since the last trusted sample (``steps`` regular intervals
    ago), or usually predicts, may be all wrong: a machine that stands still against the model, or
    moves against it, is no measurement error. Nor is motion of its own that agreeing samples have
    proven before (half as much again), nor anything within the tolerance.
    """
    size = rules[g, at.SHARE] * max(values[j, at.PATH], values[j, at.USUAL] * steps)
    size = max(size, 1.5 * values[j, at.PROVEN] * steps)
    if rules[g, at.USE] == at.UPDATE and limits[j, at.TOLERANCE] < np.inf:
        size = max(size, limits[j, at.TOLERANCE])
    return float(size)


@njit(**HOT)
def measure(case: Case, g: int, size: int, stamp: int, phase: int) -> float:
    """Innovations and variances of a sample; gives the largest test ratio.

    ratio = innovation² / (gate²·S + credible²): S is the regular variance, grown since the last
    trusted sample; what is credible, see `credible`.
    """
    (limits, rules, _), statistics = case.settings, case.statistics
    values, numbers, figures = case.memory
    room, y, predicted, _ = case.sample
    worst = 0.0
    growth = grown(rules, numbers, figures, g, stamp)
    gate = rules[g, at.GATE] * rules[g, at.GATE]
    elapsed = (stamp - numbers[g, at.GOOD_AT]) * 1e-9
    usual = figures[g, at.INTERVAL] * 1e-9
    steps = max(1.0, elapsed / usual) if usual > 0 else 1.0
    revived = may_revive(rules, numbers, g)
    for k in range(size):
        j = room[k]
        nu = wrapped(y[j] - predicted[j] - values[j, at.OFFSET], limits[j, at.ANGLE] > 0)
        floor = 1e-9 * (abs(predicted[j]) + abs(y[j])) + 1e-15
        coarse = step_of(values, j)
        base = variance_of(statistics[0], statistics[1], phase, j) + floor * floor
        base = max(base, coarse * coarse / 12.0)  # what rounding scatters by
        values[j, at.NU], values[j, at.BASE], values[j, at.MOVE] = nu, base, values[j, at.WAY]
        spread = base * growth
        if rules[g, at.GROWTH] > 0:
            spread = base + rules[g, at.GROWTH] * rules[g, at.GROWTH] * elapsed
        room_for = credible(limits, rules, values, g, j, steps) if revived else 0.0
        worst = max(worst, nu * nu / (gate * spread + room_for * room_for))
    return worst


@njit(**HOT)
def implausible(case: Case, g: int, size: int, stamp: int) -> int:
    """Range, rate, and a frozen value: the first cause that holds, or none."""
    (limits, rules, _), (values, numbers, _) = case.settings, case.memory
    room, y = case.sample[0], case.sample[1]
    for k in range(size):
        j = room[k]
        if y[j] < limits[j, at.LOW] or y[j] > limits[j, at.HIGH]:
            return RANGE
    if numbers[g, at.STARTED] == 0:
        return NONE
    since = (stamp - numbers[g, at.GOOD_AT]) * 1e-9
    before = (stamp - numbers[g, at.LAST_AT]) * 1e-9
    for k in range(size):
        j = room[k]
        angle, rate = limits[j, at.ANGLE] > 0, limits[j, at.RATE]
        # The first sample after a real jump is too fast, the second agrees with the first.
        fast = abs(wrapped(y[j] - values[j, at.GOOD], angle)) > rate * since
        if fast and abs(wrapped(y[j] - values[j, at.LAST], angle)) > rate * before:
            return RATE
    return FROZEN if is_frozen(rules, case.memory, room, g, size) else NONE


@njit(**HOT)
def extend(limits: Any, values: Any, numbers: Any, sample: Any, g: int, size: int) -> None:
    """One more trusted sample: how far off the line through the two before, model aside, and how
    far the output has come."""
    room, y = sample[0], sample[1]
    few = min(max(numbers[g, at.SAMPLES], 1), at.MEMORY)
    for k in range(size):
        j = room[k]
        change = wrapped(y[j] - values[j, at.GOOD], limits[j, at.ANGLE] > 0)
        off = change - values[j, at.CHANGE]
        values[j, at.CHANGE] = change
        values[j, at.LINE] += (off * off - values[j, at.LINE]) / few
        values[j, at.TOP] = max(values[j, at.TOP], y[j])
        values[j, at.BOTTOM] = min(values[j, at.BOTTOM], y[j])
        values[j, at.FELL] = max(values[j, at.FELL], values[j, at.TOP] - y[j])
        values[j, at.ROSE] = max(values[j, at.ROSE], y[j] - values[j, at.BOTTOM])
        values[j, at.NET] += change
        values[j, at.LEAST] = min(values[j, at.LEAST], values[j, at.NET])
        values[j, at.MOST] = max(values[j, at.MOST], values[j, at.NET])


@njit(**HOT)
def has_moved(values: Any) -> bool:
    """Has an output come farther than its noise alone reaches?"""
    for j in range(values.shape[0]):
        span = values[j, at.MOST] - values[j, at.LEAST]
        noise = min(values[j, at.LINE], SHARP * values[j, at.BASE])
        if span * span > REACHES * noise:
            return True
    return False


@njit(**COLD)
def mark_onset(values: Any, numbers: Any, sample: Any, g: int, size: int) -> None:
    """The first doubted sample, and where the line through the two trusted ones before it is; codes
    and values out of range tell of no leap."""
    room, y, before = sample[0], sample[1], numbers[g, at.CAUSE]
    if numbers[g, at.GOOD_AT] == numbers[g, at.LAST_AT] or before in (RANGE, SENTINEL):
        for k in range(size):
            j = room[k]
            values[j, at.AWAY_AT] = y[j]
            values[j, at.AWAY_FROM] = values[j, at.GOOD] + values[j, at.CHANGE]


@njit(**COLD)
def breaks(before: float, first: float, f: float, angle: bool) -> bool:
    """Did values leap from ``before`` to ``first``, and is most of it gone divided by ``f``?"""
    rest, leap = abs(wrapped(first / f - before, angle)), abs(wrapped(first - before, angle))
    return bool(rest < 0.5 * leap)


@njit(**COLD)
def leapt(limits: Any, values: Any, j: int, before: float, first: float, f: float) -> bool:
    """Was it the sensor that leapt, if its unit changed by ``f``?

    Only a model that follows its machine far better than a straight line does says so by itself.
    Of any other it has to be a leap off that line.
    """
    good = BETTER * values[j, at.BASE] <= values[j, at.LINE]
    return bool(good or breaks(before, first, f, limits[j, at.ANGLE] > 0))


@njit(**COLD)
def in_scale(limits: Any, values: Any, j: int) -> bool:
    """Were trusted samples about as large as expected? A state that adopts them answers for it."""
    alike, expected = values[j, at.ALIKE], values[j, at.EXPECTED]
    both = expected <= at.FAR * alike and alike <= at.FAR * expected
    return bool(limits[j, at.ADOPTS] > 0 or both)


@njit(**COLD)
def stands_out(limits: Any, values: Any, j: int, off: float) -> bool:
    """Is an output that no state adopts off by more than its model usually is? A friction that no
    model knows makes it so many times what is expected, now and then a unit's number.
    """
    usual = OUT * OUT * values[j, at.SQUARE]
    return bool(limits[j, at.ADOPTS] > 0 or off * off > usual)


@njit(**COLD)
def suspected(
    room: float, noise: float, y: float, expected: float, angle: bool, tried: Any
) -> float:
    """The factor between a measurement and what was expected of it; 0 if there is none.

    It is looked for only where a tenth of the expected value stands out of the noise. Of two that
    lie near each other the unit of the quantity is meant, unless another fits better by more than
    the noise.
    """
    room = min(room, 0.1 * abs(expected))
    if not 0.1 * abs(expected) > noise:
        return 0.0
    found, least = 0.0, np.inf
    for k in range(at.FACTORS.shape[0]):
        if tried[k] == at.NEVER or (angle and k != at.TURN):
            continue
        for f in (at.FACTORS[k], 1.0 / at.FACTORS[k]):
            turns, off = angle and abs(y / f) > 2.0 * np.pi, abs(wrapped(y / f - expected, angle))
            more = 0.0 if tried[k] == at.OWN else noise
            if off <= room and off + more < least and not turns:
                found, least = float(f), off + more
    return found


@njit(**COLD)
def doubted(settings: Any, memory: Any, sample: Any, g: int, size: int) -> int:
    """A value outside the gate: a sentinel code, a suspected factor, or neither."""
    limits, rules, sentinels = settings
    values, _, figures = memory
    room, y = sample[0], sample[1]
    for k in range(size):
        j = room[k]
        noise = rules[g, at.GATE] * np.sqrt(values[j, at.BASE])
        if abs(values[j, at.NU]) <= noise:
            continue
        for s in range(sentinels.shape[0]):
            if y[j] == sentinels[s]:
                return SENTINEL
        if values[j, at.VARIED] < at.VARIES:
            continue
        angle = limits[j, at.ANGLE] > 0
        room_for = noise + credible(limits, rules, values, g, j, 1.0)
        factor = suspected(
            room_for, noise, y[j], y[j] - values[j, at.NU], angle, limits[j, at.TRIED :]
        )
        # Friction turns an output that no state adopts round with the motion.
        told = factor > 0.0 or (factor < 0.0 and limits[j, at.ADOPTS] > 0)
        off = values[j, at.NU] + values[j, at.OFFSET]
        told = told and in_scale(limits, values, j) and stands_out(limits, values, j, off)
        before, first = values[j, at.AWAY_FROM], values[j, at.AWAY_AT]
        if told and leapt(limits, values, j, before, first, factor):
            figures[g, at.FACTOR] = factor
            return FACTOR
    return NONE
