"""How fast axes go in the recordings, and from which speed on one counts as moving."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.signals.at_rest import stands
from evertwin.signals.units import conversion
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import ASK, Match, Proposal

USUAL = 0.05
"""Speed of a joint above which it moves [rad/s], where it often goes much faster."""
SLOW, STANDS = 0.2, 0.02
"""Part of the slowest joint's speed at most; and of the fastest one's, below which one stands."""


@unmeasured()
def fastest(proposal: Proposal, seen: Sequence[Seen], speed: str, position: str) -> float:
    """Speed [SI] below which an axis goes for all but a twentieth of the rows; NaN: it is not told.

    Args:
        speed: channel that says it.
        position: channel that says it else, from row to row.
    """
    found = {match.channel: match for match in proposal.matches if match.column != ASK}
    match = found.get(speed) or found.get(position)
    if match is None:
        return math.nan
    table = seen[match.source]
    values = conversion(match.unit)[0] * table.values(match.column)
    if match.channel == position and table.t is not None:
        values = np.diff(values) / np.diff(table.t)
    elif position in found and position != speed and _stands(found[position], match, seen):
        return 0.0
    values = np.abs(values[np.isfinite(values)])
    return float(np.quantile(values, 0.95)) if len(values) else math.nan


def _stands(position: Match, speed: Match, seen: Sequence[Seen]) -> bool:
    """Does the axis stand, whatever its speed says? Not told where they are of two tables."""
    table = seen[speed.source]
    if table.t is None or position.source != speed.source:
        return False
    q, v = (conversion(one.unit)[0] * table.values(one.column) for one in (position, speed))
    return stands(q, v, float(np.median(np.diff(table.t))))


def of_joints(speeds: Sequence[float]) -> float:
    """Speed above which any joint of an arm moves [rad/s], by the slowest of those that go.

    >>> of_joints([1.2, 0.8, 0.9]), of_joints([0.03, 0.07, 0.0001])
    (0.05, 0.006)
    """
    known = [one for one in speeds if math.isfinite(one)]
    going = [one for one in known if one > STANDS * max(known)]
    return min(USUAL, float(f"{SLOW * min(going):.1g}")) if going else USUAL
