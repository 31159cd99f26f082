"""Is a version off at one command alone? Another machine is off at the next one, too.

A form that is wrong at some commands (a drive that starts late and stops later) looks like another
machine when one of these is held, and like the former one as soon as another command comes.

>>> u = np.repeat([0.5, 0.1, 0.4], 40)[:, None]
>>> alone, both = np.repeat([9.0, 0.1], 40), np.repeat([9.0, 4.0], 40)
>>> one_command(u, 40, alone).others, one_command(u, 40, both)
(40, None)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Inputs, Vector

HELD = 0.5
"""Share of the rows that repeat the one before, of an input that is commanded in steps."""
NEARLY_ALL = 0.8
"""Part of what it is off by that one command is off by."""


class Alone(NamedTuple):
    """A command that nearly all of it is of.

    >>> Alone(0).others
    0
    """

    others: int
    """Rows behind it, with other commands, which are no smaller: at rest nothing shows."""


def one_command(u: Inputs, since: int, squares: Vector) -> Alone | None:
    """The command that nearly all of it is of; None: it is of several, or an input holds no value.

    Args:
        u: inputs of all rows, (n, nu).
        since: the row from which on the version is off.
        squares: of what it is off by from there on, (n − since,).
    """
    same = u[1:] == u[:-1]
    varies = ~same.all(axis=0)
    if not varies.any() or (same.mean(axis=0) <= HELD)[varies].any():
        return None
    told = np.abs(u[since:, varies])
    run = np.concatenate([[0], np.cumsum(~same[since:, varies].all(axis=1))])
    sums = np.bincount(run, np.nan_to_num(squares))
    worst = int(np.argmax(sums))
    at = told[np.flatnonzero(run == worst)[0]]
    large = (told >= np.where(at > 0.0, at, np.inf)) if at.any() else told > 0.0
    others = (run > worst) & large.any(axis=1)
    usual = np.mean(np.nan_to_num(squares[run == worst]))
    quiet = np.nansum(squares[others]) <= (1.0 - NEARLY_ALL) * usual * np.count_nonzero(others)
    alone = sums[worst] > NEARLY_ALL * sums.sum() and quiet
    return Alone(int(np.count_nonzero(others))) if alone else None
