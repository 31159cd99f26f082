"""A heading and its rate without units: the numbers of the two tell degrees from radians.

How far a heading reaches does not: one that is not cut at half a turn counts turns on and on. What
it changes by over what its rate adds up to does, however a base slips: about 1, 57.3 or 1/57.3. No
base turns at 7 rad/s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.starter.looks.relations import derivative
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import ASK, Match

TURN, SLIP, FASTEST = 180.0 / math.pi, 2.0, 7.0
"""rad in degrees; factor by which a base may turn more or less than told; and how fast [rad/s]."""
REASON = "heading and turn rate fit each other"


def as_turned(matches: Sequence[Match], seen: Sequence[Seen]) -> list[Match]:
    """The matches; of a heading and its rate whose units nobody has stated, those that fit."""
    found = {match.channel: match for match in matches}
    heading, rate = found.get("heading"), found.get("w")
    if heading is None or rate is None or heading.source != rate.source:
        return list(matches)
    if ASK in (heading.column, rate.column, heading.scale, rate.scale):
        return list(matches)
    one = seen[heading.source]
    stated = {column.name for column in one.columns if column.unit}
    if stated & {heading.column, rate.column}:
        return list(matches)
    of, by = one.values(heading.column), one.values(rate.column)
    told = derivative(one.t, of, by)
    if not told.clear or not told.factor > 0.0:
        return list(matches)
    fast = float(np.nanmax(np.abs(by))) > FASTEST
    for ratio, units in ((1.0, ("deg", "deg/s") if fast else ("rad", "rad/s")),
                         (TURN, ("deg", "rad/s")), (1.0 / TURN, ("rad", "deg/s"))):  # fmt: skip
        if 1.0 / SLIP < told.factor / ratio < SLIP:
            new = dict(zip(("heading", "w"), units, strict=True))
            return [replace(m, unit=new[m.channel], reason=REASON) if m.channel in new else m
                    for m in matches]  # fmt: skip
    return list(matches)
