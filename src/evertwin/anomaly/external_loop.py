"""The compiled loop of `evertwin.anomaly.external`: rows through the memory of each output.

Counts of rows beyond a limit take the place of a median: more than half of the newest rows beyond
it on one side is a median beyond it. They are whole numbers, so cuts cannot matter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit

RESIDUAL, BEYOND, MOVES = range(3)
"""Columns of the ring of the newest rows."""
(
    RUN, WAY, SORT, SINCE, CALM, COUNT, SEEN, OPEN, PART, BEGAN, NEED, SIDE, RESTS, WITH, PASSED,
    NUMBERS,
) = range(16)  # fmt: skip
"""Places of an output's numbers, and how many. Its motion: rows in one direction, the direction,
the sort (0 slow, else the direction), row since which, that of the last one that began calm; Σ of
`BEYOND`; moving rows seen. Off: on which side now, was it in this excursion, sort where it came
into it, must it still be seen calm, on which side was it last, rows of it at rest: what began with
a motion but is there at rest, beyond friction, too is no part of that motion. A push begins one.
Did it come into it with a motion of its own; motions since, off as they began."""
(
    SQUARE, BASE, NEAR, SLOW, NOISE, HOLD, USUAL, LEVEL, ROWS, EDGE, TOLD, ALIKE, EXPECTED, SHORT,
    LONG, BY_SHORT, BY_LONG, SHORT_SHORT, SHORT_LONG, LONG_LONG, PACED, FOURTH,
    APART, SLOWER, SHIFT, FIGURES,
) = range(26)  # fmt: skip
"""Places of an output's figures, and how many. Moving: the residual's mean square and mean, its
mean over a window and that one's mean square. Mean step from row to row; widest friction since it
was slow; share of motions that began calm. Of the rows that are off in this excursion Σ residual
and number, and how far the first are from those before; mean level of what was found. Moving: mean
product of measured and expected, mean square of what was expected; what was expected a short and a
longer moment ago; mean products of the residual with what was expected less that, and of these; of
the residual's square with that of the short one, and of this with itself. Of a motion that goes on:
mean square by which the residual is off its mean over the window before; that mean over two
windows, and how far both are from each other, mean square."""
(
    NEXT, STATE, START, STAMP, OURS, LATE, FOUND, FIRST, LAST, SAID, BLIND, NEWS, SHARP, OWN,
    WHOSE, PLACES,
) = range(16)  # fmt: skip
"""Places of the machine's numbers: rows so far, `IDLE` …, row and stamp of the excursion's start,
may it come from outside, did it begin with a motion (−1: it began that motion), is one found, its
rows, was it told at a beat, rows at which a standing output had no friction to judge by, row after
the first since the newest beat at which there was something for the next (0: none), did an output
go off at once, row after that since which each motion was off (0: it is not so) and of which
output, and how many places."""
IDLE, ON, ENDS, LASTS = range(4)
FAR, FARTHEST = 2.0, 1.5
"""Measured over expected from which, or from whose inverse, a model is out of scale; the part of
what was expected that a row counts as off at most: a contact is not a matter of scale."""
LARGE = 9.0
"""Times the mean square that a row counts at most: one contact does not hide the next."""
SMOOTH = 4.0
"""Times the rms of its mean over a window that is off: errors of a model are smooth."""
GOES, SUDDEN, AWAY = 3, 8.0, 3.5
"""Windows for which a motion has to go on before its residual is held against what it was; times
the usual change of its mean, and times its rms, that is none of the model's."""
SURELY = 5.0
"""Times the mean step that a friction must be: smaller ones are not known."""
MOSTLY, SELDOM = 0.6, 0.45
"""Share of motions that have to begin calm for one that does not to be out of the ordinary; the one
below which it is the machine: what holds it at rest before it breaks loose is no push either."""
SEVERAL = 3
"""Motions that pass while an output is off as before: what belongs to one ends with it."""
MOMENTS = (0.125, 0.5)
"""Parts of a window by which a filter of what is measured, or a clock, may lag."""
ALONE = 0.99
"""Squared correlation of both changes from which on one tells no more than the other."""
OF_NOTE = 0.1
"""Share of the residual's mean square that how the expected changes makes, where that counts."""
AT_ONCE, AWAY_YET = 0.5, 0.25
"""Part of its level that an output reaches within half a window, where a motion goes on; part of
how far it left where it was by which it is off at least: less is a return."""


@njit(cache=True)
def learned(x: float, number: Any, figure: Any, rule: Any) -> None:
    """A row that leaves the window calm, of a moving output."""
    number[SEEN] += 1
    square = x * x
    if number[SEEN] > rule[1]:
        square = min(square, LARGE * figure[SQUARE])
    figure[SQUARE] += (square - figure[SQUARE]) / min(number[SEEN], rule[2])
    figure[BASE] += (x - figure[BASE]) / min(number[SEEN], rule[3])
    if number[SEEN] > rule[1] and number[RUN] >= GOES * rule[4]:
        memory = min(number[SEEN] - rule[1], rule[2])
        apart, shift = x - figure[NEAR], figure[NEAR] - figure[SLOWER]
        apart, shift = apart * apart, shift * shift
        if number[SEEN] > 2 * rule[1]:
            apart = min(apart, LARGE * figure[APART])
            shift = min(shift, LARGE * figure[SHIFT])
        figure[APART] += (apart - figure[APART]) / memory
        figure[SHIFT] += (shift - figure[SHIFT]) / memory
    figure[SLOWER] += (x - figure[SLOWER]) / min(number[SEEN], 2 * rule[4])
    figure[NEAR] += (x - figure[NEAR]) / min(number[SEEN], rule[4])
    figure[SLOW] += (figure[NEAR] * figure[NEAR] - figure[SLOW]) / min(number[SEEN], rule[2])


@njit(cache=True)
def weigh(x: float, expected: float, number: Any, figure: Any, rule: Any) -> None:
    """How large a moving output is, and was expected."""
    memory, square = min(max(number[SEEN], 1), rule[2]), expected * expected
    if square == square and x == x:
        by = min(max(x * expected, -FARTHEST * square), FARTHEST * square)
        figure[ALIKE] += (square + by - figure[ALIKE]) / memory
        figure[EXPECTED] += (square - figure[EXPECTED]) / memory


@njit(cache=True)
def lagging(expected: float, n: int, figure: Any) -> tuple[float, float]:
    """By how much the expected is ahead of what it was a short and a longer moment ago."""
    short, long = MOMENTS
    if expected != expected:
        return np.nan, np.nan
    if figure[SHORT] == 0.0 and figure[LONG] == 0.0:
        figure[SHORT] = figure[LONG] = expected
    figure[SHORT] += (expected - figure[SHORT]) / (1.0 + max(short * n, 1.0))
    figure[LONG] += (expected - figure[LONG]) / (1.0 + max(long * n, 1.0))
    return expected - figure[SHORT], expected - figure[LONG]


@njit(cache=True)
def in_time(x: float, ahead: tuple[float, float], number: Any, figure: Any, rule: Any) -> float:
    """The residual of a moving output without what measuring late leaves of it, where that makes
    it smaller: that goes with how the expected changes, as nothing from outside does.

    What is usual is learned of the whole residual, so a lag never makes a limit narrower."""
    a, b = ahead
    if not (x == x and a == a and b == b):
        return x
    aa, ab, bb = figure[SHORT_SHORT], figure[SHORT_LONG], figure[LONG_LONG]
    xa, xb, free, short, long = figure[BY_SHORT], figure[BY_LONG], aa * bb - ab * ab, 0.0, 0.0
    if free > (1.0 - ALONE) * aa * bb:
        short, long = (bb * xa - ab * xb) / free, (aa * xb - ab * xa) / free
    elif bb > 0.0:
        long = xb / bb
    own = short * a + long * b if short * xa + long * xb > OF_NOTE * figure[SQUARE] else 0.0
    left = x - own
    if number[OPEN] == 0:
        most = np.sqrt(LARGE * figure[SQUARE])
        weight = most / abs(left) if abs(left) > most else 1.0  # a push tells little
        weight /= min(max(number[SEEN], 1), rule[2])
        square = min(x * x, LARGE * figure[SQUARE])
        for place, more in (
            (BY_SHORT, x * a), (BY_LONG, x * b), (SHORT_SHORT, a * a), (SHORT_LONG, a * b),
            (LONG_LONG, b * b), (PACED, square * a * a), (FOURTH, a * a * a * a),
        ):  # fmt: skip
            figure[place] += weight * (more - figure[place])
    return 0.0 if left * x < 0.0 else left if abs(left) < abs(x) else x


@njit(cache=True)
def moved(row: int, moves: bool, v: float, half: float, k: int, n: int, state: Any) -> None:
    """The sort of motion of an output, and the friction that may hold it."""
    number, figure, machine = state[0][k], state[1][k], state[2]
    way = 0
    if moves:
        way = -1 if v < 0.0 else 1
    number[RUN] = number[RUN] + 1 if way == number[WAY] else 1
    number[WAY] = way
    sort = way if number[RUN] >= n // 2 else 0
    if sort != number[SORT]:
        number[SORT], number[SINCE] = sort, row
    if not moves:
        figure[HOLD] = max(figure[HOLD], half)
    elif sort != 0:
        figure[HOLD] = 0.0
    if sort != 0 and row - number[SINCE] == n:
        before, calm = figure[USUAL], number[OPEN] == 0
        if not calm and machine[OURS] != 0:
            number[PASSED] += 1
            if number[PASSED] > 1:  # what came once and is still there does not come again
                return
        figure[USUAL] += ((1.0 if calm else 0.0) - before) / 4.0
        if calm:
            number[CALM] = number[SINCE]
        elif figure[USUAL] < SELDOM <= before:
            machine[OWN], machine[WHOSE], machine[OURS] = number[CALM] + 1, k, 0
            machine[NEWS] = machine[NEWS] or row + 1


@njit(cache=True)
def limit_of(e: float, ahead: float, number: Any, figure: Any, times: float, rule: Any) -> float:
    """How far off an output may be of which ``e`` is expected, ``ahead`` more than a moment ago;
    infinite where that is not known."""
    form, hold = np.sqrt(figure[SLOW]), figure[HOLD]
    pace = figure[SHORT_SHORT]
    spread, square = figure[FOURTH] - pace * pace, figure[SQUARE]
    if ahead * ahead > pace and spread > 0.0:  # as far as it was more off where that changes fast
        more = (figure[PACED] - square * pace) / spread
        if more * pace > OF_NOTE * square:
            square += more * (ahead * ahead - pace)
    scale = max(times * np.sqrt(square), SMOOTH * form)
    known = number[SEEN] >= rule[1]
    alike, expected = figure[ALIKE], figure[EXPECTED]
    if alike > FAR * expected or expected > FAR * alike:
        return float(np.inf)
    if number[SORT] != 0:
        if e * e > expected > 0.0:  # errors of a model, of a scale, grow with what it says
            scale *= np.sqrt(e * e / expected)
        return float(scale if known else np.inf)
    rests = number[WAY] == 0 and number[RUN] >= rule[3]
    if hold <= SURELY * figure[NOISE] or hold < form or not (known or rests):
        return float(np.inf)  # a model that motion has not tried yet is believed at rest alone
    return float(hold + (scale if known else times * figure[NOISE]))


@njit(cache=True)
def leaves(left: float, limit: float, number: Any, figure: Any, times: float, rule: Any) -> int:
    """The side to which the residual of a motion that goes on has left at once where it was, by
    more than it ever changes within a window, however far off the model is; 0: it has not, or is
    back to nothing."""
    if not limit < np.inf or number[SEEN] <= 2 * rule[2] or number[RUN] < GOES * rule[4]:
        return 0
    most = max(times * np.sqrt(figure[APART]), SUDDEN * np.sqrt(figure[SHIFT]))
    most = max(most, AWAY * np.sqrt(figure[SQUARE]))
    apart = left - figure[NEAR]
    if abs(apart) <= most or left * apart < AWAY_YET * apart * apart:
        return 0
    return 1 if apart > 0.0 else -1


@njit(cache=True)
def opened(row: int, k: int, stamp: int, driven: bool, ring: Any, state: Any) -> None:
    """An output has gone off: an excursion begins, or it joins one. ``driven``: its motion is."""
    numbers, figures, machine = state
    number, figure, n = numbers[k], figures[k], ring.shape[1]
    age = 0
    for back in range(n):
        if ring[BEYOND, (machine[NEXT] - back) % n, k] == number[OPEN]:
            age = back
    calm = row - age - number[SINCE] >= n // 2
    if machine[STATE] == ENDS:
        # on the same side after a reversal: it has not ended; on the other: so is friction
        machine[STATE] = ON
        if number[NEED] and number[SIDE] != number[OPEN]:
            machine[OURS] = 0
    elif machine[STATE] == IDLE:
        machine[STATE], machine[START], machine[STAMP] = ON, row - age, stamp
        machine[LATE], machine[SAID], machine[SHARP] = 0 if calm else -1 if driven else 1, 0, 0
        moves = calm and number[SORT] != 0
        usual = figure[USUAL] >= (SELDOM if calm or driven else MOSTLY)
        machine[OURS] = 1 if moves or usual else 0
        numbers[:, PART], numbers[:, NEED] = 0, 0
        if machine[OURS] and not machine[NEWS]:
            machine[NEWS] = row + 1
    if not number[PART]:
        number[BEGAN], figure[LEVEL], figure[ROWS], number[RESTS] = number[SORT], 0.0, 0.0, 0
        number[WITH] = 0 if calm else 1
    for m in range(n):
        if ring[BEYOND, m, k] == number[OPEN] and m != machine[NEXT] % n:
            figure[LEVEL] += abs(ring[RESIDUAL, m, k])
            figure[ROWS] += 1.0
    if not number[PART] or number[SIDE] != number[OPEN]:
        number[PASSED] = 0
    number[PART], number[SIDE] = 1, number[OPEN]
    figure[EDGE] = edge(ring[RESIDUAL, :, k], machine[NEXT] % n, number[OPEN])


@njit(cache=True)
def summed(values: Any) -> tuple[float, int]:
    """Sum and number of those that are known."""
    total, rows = 0.0, 0
    for x in values:
        if x == x:
            total, rows = total + x, rows + 1
    return total, rows


@njit(cache=True)
def edge(ring: Any, newest: int, side: int) -> float:
    """The largest step within a window: mean of the rows after less that of the rows before."""
    n, most, young, count = len(ring), 0.0, 0.0, 0
    total, rows = summed(ring)
    for back in range(n - max(n // 4, 1)):
        x = ring[(newest - back) % n]
        if x == x:
            young, count = young + x, count + 1
        if back + 1 >= max(n // 4, 1) and 0 < count < rows:
            most = max(most, side * (young / count - (total - young) / (rows - count)))
    return most


@njit(cache=True)
def closed(row: int, k: int, ring: Any, state: Any) -> None:
    """An output is calm again."""
    numbers, figures, machine = state
    number, n = numbers[k], ring.shape[1]
    level = AT_ONCE * figures[k, LEVEL] / figures[k, ROWS]
    if machine[LATE] > 0:
        total, rows = summed(ring[RESIDUAL, :, k])
        at_once = rows > 0 and abs(total) < level * rows
    else:
        at_once = number[BEGAN] == 0 or figures[k, EDGE] > level
    if at_once:
        machine[SHARP] = 1
    number[OPEN] = 0
    number[NEED] = 1 if row - number[SINCE] < n and machine[LATE] >= 0 else 0


@njit(cache=True)
def settled(row: int, stamp: int, longest: int, n: int, state: Any) -> None:
    """The machine as a whole, after all outputs of a row."""
    numbers, figures, machine = state
    off = (numbers[:, OPEN] != 0).any()
    if machine[STATE] == LASTS and not off:
        machine[STATE] = IDLE
    if machine[STATE] == ON and stamp - machine[STAMP] > longest:
        machine[STATE], machine[NEWS] = LASTS, machine[NEWS] or row + 1
    if machine[STATE] == ON and not off:
        # it came and went with one motion, not after several
        own = (numbers[:, NEED] * numbers[:, WITH] * (numbers[:, PASSED] < SEVERAL) != 0).any()
        told = machine[OURS] and machine[SHARP] and not (own and machine[LATE] > 0)
        machine[STATE] = ENDS if told else IDLE
        machine[LAST] = row
    if machine[STATE] != ENDS:
        return
    for k in range(len(numbers)):
        same = numbers[k, SORT] == numbers[k, BEGAN] or numbers[k, SORT] * numbers[k, BEGAN] != 0
        same = same or numbers[k, PASSED] >= SEVERAL  # it was there in motions of any sort
        if same and row - numbers[k, SINCE] >= n:
            numbers[k, NEED] = 0
    if not (numbers[:, NEED] != 0).any():
        machine[STATE] = IDLE
        machine[FIRST] = min(machine[FIRST], machine[START]) if machine[FOUND] else machine[START]
        machine[FOUND], machine[NEWS] = 1, machine[NEWS] or row + 1
        for k in range(len(numbers)):
            if numbers[k, PART]:
                figures[k, TOLD] = figures[k, LEVEL] / figures[k, ROWS]


@njit(cache=True)
def watch(rows: Any, times: float, rule: Any, own: Any, marked: Any) -> None:
    """Rows through; ``marked`` where something outside is at work.

    Args:
        rows: as `evertwin.anomaly.external.Seen`; beyond so many ``times`` the rms they are off.
        rule: longest excursion [ns], rows to learn from, of the mean square's memory, of the
            mean's, of a window.
        own: as `evertwin.anomaly.external.ExternalState`.
    """
    row, t, r, half, v, moving, expected = rows
    ring, numbers, figures, machine = own
    state = (numbers, figures, machine)
    n, ny = ring.shape[1], r.shape[1]
    for i in range(r.shape[0]):
        place = machine[NEXT] % n
        for k in range(ny):
            number, figure, x, old = numbers[k], figures[k], r[i, k], ring[RESIDUAL, place, k]
            number[COUNT] -= int(ring[BEYOND, place, k])
            ours = number[OPEN] != 0 and machine[STATE] == ON and machine[OURS] != 0
            if ring[MOVES, place, k] > 0.0 and old == old and not ours:
                learned(old, number, figure, rule)
            if moving[i, k]:
                weigh(x, expected[i, k], number, figure, rule)
            moved(row + i, moving[i, k], v[i, k], half[i, k], k, n, state)
            ahead = lagging(expected[i, k], n, figure)
            limit = limit_of(expected[i, k], ahead[0], number, figure, times, rule)
            if not moving[i, k] and machine[BLIND] >= 0:  # below: it was said
                machine[BLIND] = max(machine[BLIND] + (1 if limit == np.inf else -1), 0)
            side, base, left = 0, figure[BASE] if number[SORT] != 0 else 0.0, x
            if moving[i, k]:
                left = in_time(x, ahead, number, figure, rule)
            if left == left and abs(left) > limit:
                side = 1 if left > 0.0 else -1
                if side * (left - base) <= limit:
                    side = 0
            if side == 0 and left == left and number[SORT] != 0:
                side = leaves(left, limit, number, figure, times, rule)
            before = (machine[NEXT] - 1) % n
            step = abs(x - ring[RESIDUAL, before, k])
            if step == step and side == 0 and ring[BEYOND, before, k] == 0.0:
                figure[NOISE] += (step - figure[NOISE]) / rule[3]  # a push is no noise
            ring[RESIDUAL, place, k], ring[BEYOND, place, k] = x, side
            ring[MOVES, place, k] = moving[i, k]
            number[COUNT] += side
            if number[OPEN] == 0 and 2 * abs(number[COUNT]) > n:
                number[OPEN] = 1 if number[COUNT] > 0 else -1
                e = expected[i, k] if number[WAY] * expected[i, k] > 0.0 else 0.0
                # the actuator brakes a motion that it is expected to drive
                driven = number[WAY] * (x + e) < -limit and e != 0.0
                opened(row + i, k, t[i], driven, ring, state)
            if number[OPEN] != 0:
                if side == number[OPEN]:
                    figure[LEVEL] += abs(x)
                    figure[ROWS] += 1.0
                    number[RESTS] += 0 if moving[i, k] else 1
                    if 2 * number[RESTS] > n:
                        machine[LATE] = min(machine[LATE], 0)
                if 4 * abs(number[COUNT]) <= n:
                    closed(row + i, k, ring, state)
        settled(row + i, t[i], rule[0], n, state)
        marked[i] = machine[STATE] == ON and machine[OURS] != 0
        machine[NEXT] += 1
