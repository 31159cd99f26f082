"""Compiled: is an empty cell of a command a value that was lost, or no new command?

A command acts until the next one. Where each row of its source has one beside the same measurement,
an empty cell is no such pause: what was commanded then nobody knows, until the next value says so.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit

BESIDE, GIVEN, EMPTY, LOST, TIMES = range(5)
"""Memory per channel: a column that comes with it, plus one; samples that had both, that had that
one alone; is its value unknown now? How often was it lost?"""
SINGLY = 8
"""Losses that are told one by one; of more each doubling is."""
LEARN, MOSTLY = 10, 3
"""Samples with both from which on there is a habit; times as many of them as of the others."""


@njit(cache=True, error_model="numpy")
def given(habit: Any, row: Any, k: int, column: int) -> None:
    """The command has a value in this sample."""
    beside = habit[k, BESIDE] - 1
    if beside < 0 or not np.isfinite(row[beside]):
        for c in range(row.shape[0]):
            if c != column and np.isfinite(row[c]):
                beside = c
                break
    habit[k, BESIDE], habit[k, LOST] = beside + 1, 0
    habit[k, GIVEN] += beside >= 0 and np.isfinite(row[beside])


@njit(cache=True, error_model="numpy")
def missing(habit: Any, row: Any, k: int) -> int:
    """The command has no value in this sample: has it just been lost? How often by now; 0: no."""
    beside, before = habit[k, BESIDE] - 1, habit[k, LOST]
    if beside >= 0 and np.isfinite(row[beside]):
        habit[k, EMPTY] += 1
        if habit[k, GIVEN] >= max(LEARN, MOSTLY * habit[k, EMPTY]):
            habit[k, LOST] = 1
    lost = habit[k, LOST] > before
    habit[k, TIMES] += lost
    return int(habit[k, TIMES]) if lost else 0


@njit(cache=True, error_model="numpy")
def is_told(times: int) -> bool:
    """Is a loss worth an event, after so many of the same channel?"""
    return times <= SINGLY or times & (times - 1) == 0


@njit(cache=True, error_model="numpy")
def given_all(habit: Any, rows: Any, k: int, column: int) -> None:
    """The command has a value in each of these samples."""
    for i in range(rows.shape[0]):
        given(habit, rows[i], k, column)
