"""The compiled loop of `evertwin.anomaly.kinematics`: rows through the memory of each pair."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit

ROWS, START, AGREED, BAD, GOOD, OPEN, FIRST, SAID, LEAPT, LEAP_SAID, PENDING, AFTER = range(12)
"""Places of a pair's numbers: rows of this stretch and the first of them; stretches that agreed;
those that did not, and those that did again, in a row; is a contradiction open, since which row,
and was it told? The row after the one at which the position leapt, and that one as it was told; the
same of a leap that may be one, and the rows since."""
(
    GONE, WAY, POSITION, SPEED, USUAL_GONE, USUAL_WAY, XX, XY, YY, ROUGH, SPAN, SINCE,
    MOST, RECENT, LEAP, NET, OFF,
) = range(17)  # fmt: skip
"""Places of a pair's figures: way by the position and by the speed in this stretch; last position
and speed; mean square of each over stretches that agreed; Σ of squares and products of those that
did not, after the first of them, until a contradiction was open. Of this stretch Σ of the changes
of the speed from row to row, and its length [s]; and the time since a row was known last [s]. The
longest way in a row; what the position went beyond its speed over the newest rows; of a leap that
may be one its size, and with the rows since; what the position is off by."""
NUMBERS, FIGURES = 12, 17
"""How many of each."""
NEWS = 0
"""Place of the number of the row after the first since the newest beat that has news; 0: none."""
ALIKE = 0.5
"""Difference of the two ways that is a contradiction, as a share of the larger."""
CLEAR = 5.0
"""Times what the changes of the speed would come to, were they its noise, that a way has to be."""
LEAST = 0.3
"""Share of the usual way that a stretch has to have to say something."""
MEMORY = 50
"""Stretches that the usual way is remembered over."""
KNOWN, SURE, BACK = 10, 3, 10
"""Stretches that must have agreed, those in a row that open a contradiction, that close it: what
stands for good is met by a motion that is just as fast for a while."""
FURTHER, SETTLES = 3.0, 10
"""Times the longest way in a row that a leap is, and rows that it has to stay for: a position that
stood and catches up, or comes back, is none."""


@njit(cache=True)
def differs(number: Any, figure: Any) -> int:
    """Do the ways of a stretch contradict each other? −1: they are too short to tell."""
    x, y = figure[GONE], figure[WAY]
    rows = max(number[ROWS], 1)
    noise = figure[ROUGH] * figure[SPAN] / (rows * np.sqrt(rows))
    if max(abs(x), abs(y)) <= CLEAR * noise:
        return -1
    far = x * x >= LEAST * LEAST * figure[USUAL_GONE] or y * y >= LEAST * LEAST * figure[USUAL_WAY]
    if (x == 0.0 and y == 0.0) or not (far or number[AGREED] == 0):
        return -1
    return int(abs(y - x) > ALIKE * max(abs(x), abs(y)))


@njit(cache=True)
def judged(row: int, number: Any, figure: Any, machine: Any) -> None:
    """The end of a stretch."""
    x, y, differ = figure[GONE], figure[WAY], differs(number, figure)
    if differ < 0:
        return
    if number[PENDING] and number[START] >= number[PENDING] and number[AFTER] >= SETTLES:
        if not differ:  # else it is no leap, but another unit from there on
            figure[OFF] += figure[LEAP]
            back = abs(figure[OFF]) < ALIKE * abs(figure[LEAP])
            number[LEAPT] = 0 if back else number[PENDING]
            figure[OFF] = 0.0 if back else figure[OFF]
            machine[NEWS] = machine[NEWS] or row + 1
        number[PENDING] = 0
    if differ:
        if number[BAD] == 0 and not number[OPEN]:
            number[FIRST] = number[START]
            figure[XX] = figure[XY] = figure[YY] = 0.0
        elif not number[OPEN]:  # the first stretch is of before, too
            figure[XX], figure[XY] = figure[XX] + x * x, figure[XY] + x * y
            figure[YY] += y * y
        number[BAD], number[GOOD] = number[BAD] + 1, 0
        opens = number[BAD] >= SURE and number[AGREED] >= KNOWN and not number[OPEN]
        number[OPEN] = 1 if opens else number[OPEN]
    else:
        opens, number[BAD], number[GOOD] = False, 0, number[GOOD] + 1
        if not number[OPEN]:
            number[AGREED] += 1
            share = 1.0 / min(number[AGREED], MEMORY)
            figure[USUAL_GONE] += (x * x - figure[USUAL_GONE]) * share
            figure[USUAL_WAY] += (y * y - figure[USUAL_WAY]) * share
        elif number[GOOD] >= BACK:
            number[OPEN] = 0
            machine[NEWS] = machine[NEWS] or row + 1
    if opens:
        machine[NEWS] = machine[NEWS] or row + 1


@njit(cache=True)
def leaps(row: int, number: Any, figure: Any, gone: float, way: float, machine: Any) -> None:
    """One row more: did the position go as far in it as it never went, against its speed?"""
    miss = gone - way
    if number[PENDING]:
        number[AFTER] += 1
        if number[AFTER] <= SETTLES:
            figure[NET] += miss
        if number[AFTER] == SETTLES:
            stays = abs(figure[NET] - figure[LEAP]) < ALIKE * abs(figure[LEAP])
            number[PENDING], figure[RECENT] = number[PENDING] if stays else 0, 0.0
        return
    known = number[AGREED] >= KNOWN and not number[OPEN] and number[BAD] == 0
    alone = abs(figure[RECENT]) < ALIKE * abs(miss)
    if known and alone and abs(miss) > FURTHER * figure[MOST]:
        number[PENDING], number[AFTER] = row + 1, 0
        figure[LEAP] = figure[NET] = miss
        return
    figure[MOST] = max(figure[MOST], abs(gone), abs(way))
    figure[RECENT] = (1.0 - 1.0 / SETTLES) * figure[RECENT] + miss


@njit(cache=True)
def begun(row: int, number: Any, figure: Any) -> None:
    """A stretch begins."""
    number[ROWS], number[START] = 1, row
    figure[GONE] = figure[WAY] = figure[ROUGH] = figure[SPAN] = 0.0


@njit(cache=True)
def watch(row: int, dt: Any, u: Any, pairs: Any, rule: Any, state: Any, marked: Any) -> None:
    """Rows through; ``marked`` where a contradiction is open.

    Args:
        row: number of the first.
        dt: interval before each row [s], (n,).
        u: inputs, (n, nu).
        pairs: columns of position and speed, and 1 where the position is an angle, (np, 3).
        rule: rows of a stretch, and the longest interval between two rows [s].
        state: numbers (np, 12), figures (np, 17), machine (1,).
        marked: (n,), written.
    """
    numbers, figures, machine = state
    for i in range(u.shape[0]):
        for k in range(pairs.shape[0]):
            number, figure = numbers[k], figures[k]
            q, v = u[i, pairs[k, 0]], u[i, pairs[k, 1]]
            figure[SINCE] += dt[i]
            if not (np.isfinite(q) and np.isfinite(v)):
                continue
            since, figure[SINCE] = figure[SINCE], 0.0
            if number[ROWS] == 0 or not 0.0 < since <= rule[1]:
                begun(row + i, number, figure)
                number[PENDING], figure[RECENT] = 0, 0.0
            else:
                gone = q - figure[POSITION]
                if pairs[k, 2]:
                    gone -= 2.0 * np.pi * np.floor(gone / (2.0 * np.pi) + 0.5)
                way = 0.5 * since * (v + figure[SPEED])
                leaps(row + i, number, figure, gone, way, machine)
                if number[PENDING] == row + i + 1:
                    gone = way  # else the leap would be a stretch's contradiction
                figure[GONE] += gone
                figure[WAY] += way
                figure[ROUGH] += abs(v - figure[SPEED])
                figure[SPAN] += since
                number[ROWS] += 1
                if number[ROWS] > rule[0]:
                    judged(row + i, number, figure, machine)
                    begun(row + i, number, figure)
            figure[POSITION], figure[SPEED] = q, v
            known = number[AGREED] >= KNOWN
            doubted = known and (number[BAD] > 0 or differs(number, figure) > 0)
            marked[i] |= number[OPEN] != 0 or doubted
