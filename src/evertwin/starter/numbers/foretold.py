"""How far what is judged moves in a prediction, beside what its sensor scatters by."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from evertwin.gauges.changes.noise import rounding
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import same_kind
from evertwin.starter.proposal import ASK, Match
from evertwin.types import Vector

CLEAR = 30.0
"""So many times its scatter a prediction's move has to be for a share of it to be told."""


class Answer(NamedTuple):
    """An output's column.

    >>> Answer(np.zeros(0), "").unit
    ''
    """

    values: Vector
    """Its first rows, in ``unit``; none where no column says it."""
    unit: str


def answer_of(names: Collection[str], found: Sequence[Match], seen: Sequence[Seen]) -> Answer:
    """The first of ``names`` that a column is found for."""
    match = next((m for m in found if m.channel in names), None)
    if match is None or match.column == ASK:
        return Answer(np.zeros(0), "")
    factor = match.scale if isinstance(match.scale, float) else 1.0
    unit = "K" if same_kind(match.unit, "K") else match.unit
    return Answer(abs(factor) * seen[match.source].values(match.column), unit)


def moved(values: Vector, rows: int) -> float:
    """How far they go within so many rows (0: within all of them), without the rarest twentieths.

    >>> moved(np.arange(100.0), 10), moved(np.zeros(0), 0)
    (0.0, 0.0)
    """
    if 0 < rows < len(values):
        values = values[rows:] - values[:-rows]
    values = values[np.isfinite(values)]
    return float(np.ptp(np.quantile(values, (0.05, 0.95)))) if len(values) else 0.0


def buried(values: Vector, rows: float) -> bool:
    """Is what they move within so many rows too little beside what they scatter by?

    >>> values = np.round(np.sin(0.01 * np.arange(1000.0)), 1)
    >>> buried(values, 10), buried(values, 200)
    (True, False)
    """
    known = values[np.isfinite(values)]
    white = (
        np.median(np.abs(np.diff(known, 2))) / (0.6745 * math.sqrt(6.0)) if len(known) > 2 else 0
    )
    return moved(values, round(rows)) < CLEAR * max(float(white), rounding([np.diff(known)]))
