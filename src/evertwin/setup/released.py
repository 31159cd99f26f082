"""Rows that are judged, and rows that still wait for their filter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.types import Bools, Outputs


class Released(NamedTuple):
    """Rows that are ready to be judged; filtered where the twin has a filter.

    >>> Released._fields
    ('row', 't', 'phase', 'measured', 'live', 'first', 'other', 'moving', 'end', 'outside')
    """

    row: np.ndarray
    """Row numbers, int64, (n,)."""
    t: np.ndarray
    """Stamps [ns], (n,)."""
    phase: np.ndarray
    """Phase of each row, int64, (n,)."""
    measured: Outputs
    live: Outputs
    """Residuals of the champion, (n, ny); NaN where unknown."""
    first: Outputs
    other: Outputs
    moving: np.ndarray
    """True where the output counts as moving, (n, ny)."""
    end: Bools
    """A segment ends with this row, (n,)."""
    outside: Bools
    """Something outside may act on it, (n,): it counts in no figure."""


class Waiting(NamedTuple):
    """Rows around those that leave next, in the order in which they came.

    >>> Waiting._fields[0]
    'kept'
    """

    kept: np.ndarray
    """Rows that are kept; those of them that have left; int64 (2,)."""
    row: np.ndarray
    t: np.ndarray
    phase: np.ndarray
    values: np.ndarray
    """measured, live, first, other side by side, (capacity, 4·ny)."""
    moving: np.ndarray
    end: np.ndarray
    outside: np.ndarray
