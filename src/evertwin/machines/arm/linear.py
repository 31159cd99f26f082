"""The arm's regressor: what each linear parameter is multiplied with, joint by joint.

Only what acts on a joint has a column there: its own drive, the inertial numbers of links beyond
it, the payload.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import behind
from evertwin.machines.arm.layout import Drives
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.arm.shafts import Shaft, column_places
from evertwin.machines.friction.kernel import FEATURE, PLACE, SHAPE, feature
from evertwin.types import Int64

UNUSED, INERTIA, FRICTION = -1, -2, -3
"""Codes of columns; from 0 on: position among the bodies' columns."""
_PIECE = 512
"""Rows that are filled at a time: as many as stay near the processor."""


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

    @property
    def without_bodies(self) -> Columns:
        """The same, where the bodies' numbers are in the rigid torques already."""
        return self._replace(places=np.where(self.code >= 0, UNUSED, self.places))


def columns_of(
    drives: Drives, base: Sequence[int], firsts: tuple[int, int, int], carries: Sequence[int],
    shafts: Sequence[Shaft],
) -> Columns:  # fmt: skip
    """Columns of every joint.

    Args:
        base: chosen inertial numbers.
        firsts: index in ``p`` of the first of them, of the payload's and of the shafts' first
            number, −1 without one.
        carries: the first link that each output carries; its own, unless motors are coupled.
        shafts: those that turn with several axes.
    """
    rows, (first, payload, shaft) = [], firsts
    code = len(base) + (BODY if payload >= 0 else 0)
    for j, (rotor, terms) in enumerate(zip(drives.inertia, drives.terms, strict=True)):
        row = [(rotor, INERTIA, 0, 0)] if rotor >= 0 else []
        row += [(t[PLACE], FRICTION, t[FEATURE], t[SHAPE]) for t in terms.tolist()]
        row += [(first + k, k, 0, 0) for k, flat in enumerate(base) if flat // BODY >= carries[j]]
        if payload >= 0:
            row += [(payload + k, len(base) + k, 0, 0) for k in range(BODY)]
        row += column_places(shafts, shaft, code, j)
        rows.append(row)
    width = max(len(row) for row in rows)
    found = np.full((len(rows), width, 4), UNUSED, dtype=np.int64)
    for j, row in enumerate(rows):
        found[j, : len(row)] = np.array(row, dtype=np.int64).reshape(-1, 4)
    return Columns(*(found[:, :, k].copy() for k in range(4)))


@njit(cache=True)
def fill(columns: Columns, p: Any, u: Any, s: Any, load: Any, bodies: Any, phi: Any) -> None:
    """Fills ``phi`` (rows, n, m); switch ``s`` and ``load`` (rows, n), ``bodies`` (rows, n, k)."""
    for a in range(0, len(u), _PIECE):
        part = slice(a, a + _PIECE)
        for j in range(columns.code.shape[0]):
            for k in range(columns.code.shape[1]):
                out = phi[part, j, k]
                _column(columns, j, k, p, u[part], s[part], load[part], bodies[part], out)


@njit(cache=True)
def split(
    columns: Columns, slot: Any, p: Any, u: Any, s: Any, load: Any, bodies: Any, y0: Any, phi: Any
) -> None:
    """Fills ``phi`` (rows, n, t) with the columns that have a ``slot`` (n, m) there, and adds the
    others, times their values in ``p``, to ``y0`` (rows, n)."""
    phi[:] = 0.0
    one, total = np.empty(_PIECE), np.empty(_PIECE)
    for a in range(0, len(u), _PIECE):
        part, rows = slice(a, a + _PIECE), min(_PIECE, len(u) - a)
        seen = u[part], s[part], load[part], bodies[part]
        for j in range(columns.code.shape[0]):
            total[:] = 0.0
            for k in range(columns.code.shape[1]):
                place = columns.places[j, k]
                if slot[j, k] >= 0:
                    _column(columns, j, k, p, *seen, phi[part, j, slot[j, k]])
                elif place >= 0 and p[place] != 0.0:
                    _column(columns, j, k, p, *seen, one[:rows])
                    for i in range(rows):
                        total[i] += p[place] * one[i]
            for i in range(rows):
                y0[a + i, j] += total[i]


@njit(cache=True)
def _column(
    columns: Columns, j: int, k: int, p: Any, u: Any, s: Any, load: Any, bodies: Any, out: Any
) -> None:
    """Fills ``out`` (rows,) with what one parameter is multiplied with."""
    n, code = columns.code.shape[0], columns.code[j, k]
    if code == FRICTION:
        own, what = behind(p, columns.shape[j, k]), columns.feature[j, k]
        for i in range(len(out)):
            out[i] = feature(what, u[i, n + j], s[i, j], load[i, j], math.nan, u[i, j], own)
    elif code >= 0:
        for i in range(len(out)):
            out[i] = bodies[i, j, code]
    else:
        for i in range(len(out)):
            out[i] = u[i, 2 * n + j] if code == INERTIA else 0.0
