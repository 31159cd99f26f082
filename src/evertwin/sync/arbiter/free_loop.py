"""Compiled: the state as it goes on where a sensor stays, without what that one says.

A state that follows a sensor is held back where it stays, within a historian's dead band as where
it is frozen, and is predicted to leave there at each row anew: what adds up is a way that no
machine goes. So from a part of the way on that a sound sensor stays for, a state runs free of the
group, and its way counts.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

from evertwin.compiled.functions import njit
from evertwin.sync import places as at
from evertwin.sync.arbiter.run_loop import enough, goes
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import HOT

BEGINS = 0.25
"""Part of the way from which on a state runs free."""


@njit(**HOT)
def moves_free(limits: Any, values: Any, members: Any, g: int, expects: Any, moves: Any) -> None:
    """The motion of the free state's outputs counts as the way of the runs, for the state's."""
    for c in range(members.shape[1]):
        j = members[g, c]
        if j < 0:
            break
        moved = wrapped(expects[j] - values[j, at.FREE_AFTER], limits[j, at.ANGLE] > 0)
        values[j, at.FREE_AFTER] = expects[j]
        if moved == moved and moves[j] == moves[j]:
            goes(limits, values, j, moved, moves[j])


@njit(**HOT)
def begins_free(rules: Any, memory: Any, members: Any, g: int) -> bool:
    """Does the longer of a group's runs last, and did the prediction go a part of the way?"""
    values, numbers, _ = memory
    kind = int(numbers[g, at.RUN + 1] >= numbers[g, at.RUN])
    if numbers[g, at.RUN + kind] < 2 or numbers[g, at.CAUSE] > 0:
        return False
    for c in range(members.shape[1]):
        j = members[g, c]
        if j < 0:
            break
        way = abs(values[j, at.GONE + kind])
        if way > BEGINS * enough(rules, values, numbers, g, j, kind):
            numbers[g, at.FREE] = kind + 1
            break
    return bool(numbers[g, at.FREE] > 0)


@njit(**HOT)
def starts_free(values: Any, members: Any, g: int) -> None:
    """The free state is the state after this row."""
    for c in range(members.shape[1]):
        j = members[g, c]
        if j < 0:
            break
        values[j, at.FREE_AFTER] = values[j, at.AFTER]
