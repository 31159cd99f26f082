"""The arm's regressor: what each linear parameter is multiplied with, joint by joint.

Only what acts on a joint has a column there: its own drive, the inertial numbers of links beyond
it, the payload.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from evertwin.machines.arm.layout import Drives
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.friction.kernel import FEATURE, PLACE, SHAPE, behind, feature
from evertwin.types import Int64

UNUSED, INERTIA, FRICTION = -1, -2, -3
"""Codes of columns; from 0 on: position among the bodies' columns."""


class Columns(NamedTuple):
    """Which column means what.

    >>> Columns._fields
    ('places', 'code', 'feature', 'shape')
    """

    places: Int64[np.ndarray, "ny m"]
    """Index in ``p``, −1 for an unused place."""
    code: Int64[np.ndarray, "ny m"]
    """`UNUSED`, `INERTIA`, `FRICTION` or a position among the bodies' columns."""
    feature: Int64[np.ndarray, "ny m"]
    """Of friction, as `evertwin.machines.friction.kernel.feature` takes it."""
    shape: Int64[np.ndarray, "ny m"]
    """Of friction: index in ``p`` of the term's first shape number."""


def columns_of(
    drives: Drives, base: Sequence[int], first: int, payload: int, carries: Sequence[int]
) -> Columns:
    """Columns of every joint.

    Args:
        base: chosen inertial numbers; ``first``: index in ``p`` of the first.
        payload: index in ``p`` of the payload's first number, −1 without one.
        carries: the first link that each output carries; its own, unless motors are coupled.
    """
    rows = []
    for j, (rotor, terms) in enumerate(zip(drives.inertia, drives.terms, strict=True)):
        row = [(rotor, INERTIA, 0, 0)] if rotor >= 0 else []
        row += [(t[PLACE], FRICTION, t[FEATURE], t[SHAPE]) for t in terms.tolist()]
        row += [(first + k, k, 0, 0) for k, flat in enumerate(base) if flat // BODY >= carries[j]]
        if payload >= 0:
            row += [(payload + k, len(base) + k, 0, 0) for k in range(BODY)]
        rows.append(row)
    width = max(len(row) for row in rows)
    found = np.full((len(rows), width, 4), UNUSED, dtype=np.int64)
    for j, row in enumerate(rows):
        found[j, : len(row)] = np.array(row, dtype=np.int64).reshape(-1, 4)
    return Columns(*(found[:, :, k].copy() for k in range(4)))


@njit(cache=True)
def fill(columns: Columns, p: Any, u: Any, s: Any, load: Any, bodies: Any, phi: Any) -> None:
    """Fills ``phi`` (rows, n, m); switch ``s`` and ``load`` (rows, n), ``bodies`` (rows, n, k)."""
    n, m = columns.code.shape
    for i in range(u.shape[0]):
        for j in range(n):
            q, v = u[i, j], u[i, n + j]
            for k in range(m):
                code = columns.code[j, k]
                if code == FRICTION:
                    own = behind(p, columns.shape[j, k])
                    phi[i, j, k] = feature(
                        columns.feature[j, k], v, s[i, j], load[i, j], math.nan, q, own
                    )
                elif code >= 0:
                    phi[i, j, k] = bodies[i, j, code]
                else:
                    phi[i, j, k] = u[i, 2 * n + j] if code == INERTIA else 0.0
