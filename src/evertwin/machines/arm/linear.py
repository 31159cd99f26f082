"""The arm's regressor: what each linear parameter is multiplied with, joint by joint.

Only what acts on a joint has a column there: its own drive, the inertial numbers of links beyond
it, the payload.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Int64
from numba import njit

from evertwin.machines.arm.rnea import BODY
from evertwin.machines.friction import COLUMNS, INERTIA, VS, feature

__all__ = ["Columns", "columns_of", "fill"]

BODIES = 100
"""Codes from here on mean a body's column."""


class Columns(NamedTuple):
    """Which column means what.

    >>> Columns._fields
    ('places', 'code')
    """

    places: Int64[np.ndarray, "ny m"]
    """Index in ``p``, −1 for an unused place."""
    code: Int64[np.ndarray, "ny m"]
    """Slot of the drive, or ``BODIES`` + position among the bodies' columns, or −1."""


def columns_of(
    tables: Int64[np.ndarray, "ny slots"],
    base: Sequence[int],
    first: int,
    payload: int,
    carries: Sequence[int],
) -> Columns:
    """Columns of every joint.

    Args:
        tables: of the drives, index in ``p`` or −1.
        base: chosen inertial numbers; ``first``: index in ``p`` of the first.
        payload: index in ``p`` of the payload's first number, −1 without one.
        carries: the first link that each output carries; its own, unless motors are coupled.
    """
    rows = []
    for j, table in enumerate(tables.tolist()):
        row = [(table[slot], slot) for slot in range(COLUMNS) if table[slot] >= 0]
        row += [
            (first + k, BODIES + k) for k, flat in enumerate(base) if flat // BODY >= carries[j]
        ]
        if payload >= 0:
            row += [(payload + k, BODIES + len(base) + k) for k in range(BODY)]
        rows.append(row)
    width = max(len(row) for row in rows)
    both = np.full((len(rows), width, 2), -1, dtype=np.int64)
    for j, row in enumerate(rows):
        both[j, : len(row)] = np.array(row, dtype=np.int64).reshape(-1, 2)
    return Columns(both[:, :, 0].copy(), both[:, :, 1].copy())


@njit(cache=True)
def fill(tables: Any, code: Any, p: Any, u: Any, s: Any, load: Any, bodies: Any, phi: Any) -> None:
    """Fills ``phi`` (rows, n, m); switch ``s`` and ``load`` (rows, n), ``bodies`` (rows, n, k)."""
    n, m = code.shape
    for i in range(u.shape[0]):
        for j in range(n):
            v = u[i, n + j]
            vs = p[tables[j, VS]] if tables[j, VS] >= 0 else 1.0
            for k in range(m):
                slot = code[j, k]
                if slot < 0:
                    phi[i, j, k] = 0.0
                elif slot >= BODIES:
                    phi[i, j, k] = bodies[i, j, slot - BODIES]
                elif slot == INERTIA:
                    phi[i, j, k] = u[i, 2 * n + j]
                else:
                    phi[i, j, k] = feature(slot, v, s[i, j], load[i, j], vs)
