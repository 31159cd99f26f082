"""Rows on which a state was there, where it came and went: a mean of both is the state of none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block, Mark, Windows
from evertwin.tuning import Fit, Problem, solve
from evertwin.types import Bools, Float64, Vector

PIECE = 0.5
"""Rows are taken to be with the state or without it in pieces of so long [s]."""
TWO = 0.5
"""Part of what one state of all rows leaves that one on some and none on the others leave at
most."""
SOME = 0.1
"""Part of the pieces that is with it at least, and without it."""
ROUNDS = 8
"""Times that the pieces are told anew by the numbers of those before."""
Off = Callable[[Problem, Vector], Float64[np.ndarray, " n"]]
"""How far each row is off by these numbers, (n,)."""


class Part(NamedTuple):
    """The rows on which the state was there.

    >>> Part._fields
    ('problem', 'fit', 'share')
    """

    problem: Problem
    fit: Fit
    share: float
    """Part of the rows that tell; 1: all of them."""


def while_there(
    pose: Callable[[Windows], Problem], windows: Windows, rest: Mapping[str, float], off: Off
) -> Part:
    """The state by the rows on which it was there.

    Args:
        pose: the problem of tuning its numbers on some rows.
        windows: rows of the machine with it, or with and without it in turn.
        rest: its numbers where it is not there.
        off: how far each row is off.
    """
    whole = pose(windows)
    fit = solve(whole)
    start = zip(whole.names, whole.start.tolist(), strict=True)
    resting = np.array([rest.get(name, value) for name, value in start])
    apart, counts = off(whole, resting), whole.rows.used.any(axis=1)
    passed = np.cumsum(np.nan_to_num(whole.rows.dt))
    piece = np.unique(passed // PIECE, return_inverse=True)[1]
    without, rows = np.bincount(piece, apart), np.bincount(piece, counts)
    one, found = off(whole, fit.values), fit
    with_it = np.bincount(piece, one) < without
    for _ in range(ROUNDS):
        if not _both(with_it, rows):
            return Part(whole, fit, 1.0)
        problem = pose(_only(windows, with_it[piece]))
        found = solve(problem)
        there = np.bincount(piece, off(whole, found.values))
        before, with_it = with_it, there < without
        if (with_it == before).all():
            break
    else:
        return Part(whole, fit, 1.0)
    if np.minimum(there, without).sum() > TWO * one.sum():
        return Part(whole, fit, 1.0)
    return Part(problem, found, float(rows[with_it].sum() / rows.sum()))


def _both(with_it: Bools, rows: Vector) -> bool:
    """Are there enough rows of either?"""
    share = rows[with_it].sum() / max(rows.sum(), 1.0)
    return bool(SOME <= share <= 1.0 - SOME)


def _only(windows: Windows, there: Bools) -> Windows:
    """The windows, of which the other rows count for nothing."""
    found, at = list[Block](), 0
    for block in windows:
        mark, nu = block.mark.copy(), block.u.shape[1]
        gone = ~there[at : at + len(block.t)]
        mark[gone, nu:] = np.where(mark[gone, nu:] == Mark.OK, Mark.EXTERNAL, mark[gone, nu:])
        found.append(block._replace(mark=mark))
        at += len(block.t)
    return tuple(found)
