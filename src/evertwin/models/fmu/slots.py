"""Places in the page that a child process and its FMU's kernel share with the twin's process.

The page is one int64 array; numbers of the FMU follow behind the slots, and are read through a
float64 view of the same memory. The twin's process reads `INSIDE` and `COUNT` while a loop runs:
that is how it knows a hanging FMU from a long block.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

LENGTH, INSIDE, COUNT, FROM, SKIP, HELD, THREE, MEMORY, SOLVER = 0, 1, 2, 3, 4, 12, 13, 14, 15
"""Words in all; is the FMU at work?; steps of this call; step from which all fail (−1: none); up to
8 steps that fail; does the FMU hold the last state?; FMI 3?; what holds its memory; solver."""
SKIPS = 8
COMPONENT, RESTORE, EVENTS, LEAVE, DOSTEP, SETTIME, SETX, GETDX = 16, 17, 18, 19, 20, 21, 22, 23
COMPLETED, GETZ, NZ, GETX, GETSTATE, SETSTATE, FREESTATE = 24, 25, 26, 27, 28, 29, 30
SIZESTATE, WRITESTATE, SET, GET = 31, 32, 33, 34
"""The instance, callbacks into Python, and addresses of the FMU's functions (0: not needed)."""
NX, NP, NU, NY, CLOCK, BYTES, CAPACITY, ADOPTS, PAIRS = 36, 37, 38, 39, 40, 41, 42, 43, 44
"""Sizes; place of the time and of the packed state in x (−1: none); words of it; adopted pairs."""
WORK, REALS, LAST_X, LAST_P, STATUS, BAD, FIRST = 46, 47, 48, 49, 50, 51, 52
"""Offsets of numbers [words]; last status other than 0; failed rows of this call, the first."""
GROUPS, FIELDS = 56, 6
"""Per group (inputs, outputs, states, parameters): values, references, and offsets of references,
factors, offsets and buffer."""
HEADER = 80
U, Y, X, P = 0, 1, 2, 3
TIME, STEP, HOLD = 0, 1, 2
"""Numbers at REALS: the FMU's time, the longest step, the step of a static map [s]."""

STATIC, START, SAVED, CONTINUOUS = 0, 1, 2, 3
"""What holds the memory: nothing; start values; the saved state; the continuous states."""
EULER, HEUN, RUNGE_KUTTA = 0, 1, 2

DISCARD, ERROR, FATAL, PENDING = 2, 3, 4, 5
NOT_FINITE_IN, NOT_FINITE, SKIPPED, TOO_MANY, ENDED, TOO_LARGE, REFUSED = 10, 11, 12, 13, 14, 15, 16
"""Status of a row beyond FMI's own."""
EXIT_FATAL, EXIT_LIBRARY = 70, 71
"""Exit codes of the child: the FMU said Fatal; it could not be loaded."""


class Group(NamedTuple):
    """Values that are set or read together.

    >>> Group((3, 4), (1.0, 1.0), (0.0, 0.0), 2).values
    2
    """

    references: tuple[int, ...]
    factors: tuple[float, ...]
    offsets: tuple[float, ...]
    values: int
    """Numbers: as many as references, more where an array hides behind one."""


def group_at(group: int) -> int:
    """First slot of a group.

    >>> group_at(X)
    68
    """
    return GROUPS + FIELDS * group


def layout(
    groups: Sequence[Group], adopts: Sequence[tuple[int, int]], nx: int, indicators: int
) -> np.ndarray:
    """A page with sizes, offsets, references and factors filled in, int64.

    Args:
        groups: inputs, outputs, states and parameters.
        adopts: (output, state) that a position update connects.
        nx: numbers of the state.
        indicators: event indicators.

    >>> page = layout([Group((), (), (), 0)] * 4, [], 0, 0)
    >>> int(page[LENGTH]) == len(page)
    True
    """
    page = np.zeros(HEADER, dtype=np.int64)
    parts: list[Any] = []
    end = HEADER

    def room(values: np.ndarray) -> int:
        nonlocal end
        words = np.zeros(max((values.nbytes + 7) // 8, 1), dtype=np.int64)
        words.view(np.uint8)[: values.nbytes] = values.view(np.uint8)
        parts.append(words)
        end += len(words)
        return end - len(words)

    for number, group in enumerate(groups):
        page[group_at(number) : group_at(number) + FIELDS] = (
            group.values,
            len(group.references),
            room(np.array(group.references, dtype=np.uint32)),
            room(np.array(group.factors, dtype=np.float64)),
            room(np.array(group.offsets, dtype=np.float64)),
            room(np.zeros(group.values)),
        )
    page[[NX, NP, NU, NY]] = nx, groups[P].values, groups[U].values, groups[Y].values
    page[NZ], page[PAIRS] = indicators, len(adopts)
    page[ADOPTS] = room(np.array(adopts, dtype=np.int64).ravel())
    page[WORK] = room(np.zeros(6 * max(nx, 1) + 2 * indicators + 8))
    page[REALS] = room(np.zeros(4))
    page[LAST_X], page[LAST_P] = room(np.zeros(nx)), room(np.zeros(groups[P].values))
    page[LENGTH] = end
    page[FROM] = -1
    page[SKIP : SKIP + SKIPS] = -1
    return np.concatenate([page, *parts])
