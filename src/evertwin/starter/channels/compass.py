"""Which way a heading counts: from the x axis to the left, or as a compass does.

A compass counts from north clockwise. Where x is said to be east and y north, the way that was
driven tells which of the two a heading is; a name that says compass needs no such way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.signals import conversion
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import words
from evertwin.starter.proposal import ASK, Match
from evertwin.types import Vector

COMPASS = {"compass", "azimuth"}
EAST, NORTH = {"east", "easting", "eastings"}, {"north", "northing", "northings"}
_SPAN = 5
"""Samples of a pose that a way is taken over."""
_CLEAR = 0.8
"""Length of the mean of unit vectors from which directions agree."""


def as_compass(matches: Sequence[Match], seen: Sequence[Seen]) -> list[Match]:
    """The matches; of a heading that counts as a compass does, sign and offset turned round."""
    found = {match.channel: match for match in matches}
    heading = found.get("heading")
    if heading is None or heading.column == ASK or heading.scale != 1.0:
        return list(matches)
    said = not COMPASS.isdisjoint(words(heading.column))
    places = [found.get("x"), found.get("y")]
    if not said and not all(
        one is not None and not known.isdisjoint(words(one.column))
        for one, known in zip(places, (EAST, NORTH), strict=True)
    ):
        return list(matches)
    clockwise = None if said else _clockwise(found, seen)
    if not said and clockwise is False:
        return list(matches)
    reason = "clockwise from north: by its name" if said else "clockwise from north: by the way"
    if not said and clockwise is None:
        turned = replace(heading, scale=ASK, reason="1 to the left from east, or as a compass? "
                         "Then -1, and an offset of 90 deg")  # fmt: skip
    else:
        quarter = float(f"{0.5 * np.pi / conversion(heading.unit)[0]:.7g}")
        turned = replace(heading, scale=-1.0, offset=quarter, reason=reason)
    return [turned if match is heading else match for match in matches]


def _clockwise(found: dict[str, Match], seen: Sequence[Seen]) -> bool | None:
    """Does the heading follow the way as a compass would? None where both, or neither, fit."""
    columns = [found[name] for name in ("x", "y", "heading")]
    if len({one.source for one in columns}) > 1:
        return None
    rows = np.column_stack(
        [conversion(m.unit)[0] * seen[m.source].values(m.column) for m in columns]
    )
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < 10 * _SPAN:
        return None
    way = rows[_SPAN:, :2] - rows[:-_SPAN, :2]
    size = np.hypot(*way.T)
    far = size > np.quantile(size, 0.7)
    course, heading = np.arctan2(way[:, 1], way[:, 0])[far], rows[_SPAN // 2 :, 2][: len(way)][far]
    if _agree(heading) > _CLEAR:  # it hardly turns
        return None
    left, right = _agree(heading - course), _agree(heading + course - 0.5 * np.pi)
    return right > left if max(left, right) > _CLEAR > min(left, right) else None


def _agree(angle: Vector) -> float:
    """How well directions agree, from 0 to 1; backwards is the same as forwards."""
    return float(np.abs(np.mean(np.exp(2j * angle))))
