"""What each wheel of a base makes of its share of a speed v and a turn rate w.

    left  = v − w·track/2,      right = v + w·track/2
    v = (left' + right')/2,     w = (right' − left')/track

where each wheel has a law of its own: it stands up to its threshold, and goes no faster than its
cap. A base of which one wheel starts later turns where it is told to go straight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from evertwin.compiled.functions import njit
from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import (
    SIMPLE,
    Candidate,
    CorrectionTerm,
    Functions,
    Intervals,
    told,
)
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.law import STATIC, UNBOUNDED
from evertwin.models.terms.rows import Rows
from evertwin.signals.units import si_unit

SIDES = ("left", "right")
SHARES = (0.1, 0.2, 0.35, 0.5, 0.8, 1.2)
"""Speeds of a wheel in the fastest turn, by the fastest speed, that the search begins at."""
STARTS = (0.1, 0.2, 0.35)
"""Thresholds, by the fastest speed."""
CAPS = (1.5, 0.75)
"""Caps, by what the fastest wheel is told."""


def wheeled(rows: Rows) -> tuple[str, str, float, float] | None:
    """Speed and turn rate of a base that is told nothing else, its fastest speed, and the distance
    of wheels that run as fast in its fastest turn; None: it is told something else."""
    inputs = rows.model.inputs
    if inputs.units != ("m/s", "rad/s") or not {*inputs.names} <= {*rows.chosen}:
        return None
    v, w = inputs.names
    return v, w, rows.reach[v], 2.0 * rows.reach[v] / rows.reach[w]


@njit(cache=True)
def wheel(speed: float, threshold: float, cap: float) -> float:
    """The law of one wheel."""
    if speed > threshold:
        return min(speed, cap)
    return max(speed, -cap) if speed < -threshold else 0.0


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """Both wheels."""
    own = placed(at)
    v, half = u[own.channel], 0.5 * p[0] * u[own.source]
    left, right = wheel(v - half, p[1], p[3]), wheel(v + half, p[2], p[4])
    u[own.channel] = 0.5 * (left + right)
    if p[0] > 0.0:
        u[own.source] = (right - left) / p[0]
    return 0


class Wheels(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("wheels", "v", "w"), (0.3, 0.05, 0.08, 1e9, 1e9), "m/s", {})
    'wheels 0.3 m apart: left starts at 0.05 m/s, right at 0.08 m/s (dead zone)'
    >>> KIND.say(Term("wheels", "v", "w"), (0.3, 0.0, 0.0, 0.2, 0.2), "m/s", {"left": (0, 0.01)})
    'wheels 0.3 m apart: saturation of left at 0.2 m/s, right at 0.2 m/s'
    """

    kind, pairs = "wheels", True
    steps = slopeless = ("track", *SIDES)
    functions = Functions(before)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        track = Parameter("track", 0.0, si_unit(f"({unit})/({source})"), low=0.0, editable=False)
        # no slope leads to the end of a dead zone, nor surely to what moves wheels out of it
        starts = [Parameter(side, 0.0, unit, low=0.0, editable=False) for side in SIDES]
        caps = [Parameter(f"{side}_cap", UNBOUNDED, unit, low=0.0) for side in SIDES]
        return [track, *starts, *caps]

    def by_channel(self, name: str) -> bool:
        return name != "track"

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        if not (base := wheeled(rows)):
            return
        v, w, fast, lever = base
        starts = tuple(
            (share * lever, a * fast, b * fast, *(cap * (1.0 + share) * fast,) * 2)
            for cap in CAPS for share in SHARES for a in STARTS for b in STARTS
        )  # fmt: skip
        yield Candidate(
            Term(self.kind, v, w), SIMPLE, starts,
            (0.02 * lever, 0.0, 0.0, 0.3 * fast, 0.3 * fast),
            (3.0 * lever, *(0.7 * fast,) * 2, *(5.0 * fast,) * 2),
            (0.05 * lever, *(0.05 * fast,) * 2, *(0.2 * fast,) * 2),
            fixed=(0, 1, 2), replaces=STATIC,
        )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        track, *numbers = values
        starts = [(side, side, v) for side, v in zip(SIDES, numbers[:2], strict=True)]
        caps = [(side, f"{side}_cap", v) for side, v in zip(SIDES, numbers[2:], strict=True)]
        said = []
        if any(v for _, _, v in starts):
            each = ", ".join(f"{s} at {told(n, v, unit, intervals)}" for s, n, v in starts)
            said.append(f"{each.replace(' at', ' starts at', 1)} (dead zone)")
        if ends := [f"{s} at {told(n, v, unit, intervals)}" for s, n, v in caps if v < UNBOUNDED]:
            said.append(f"saturation of {', '.join(ends)}")
        apart = told("track", track, "m", intervals)
        return f"wheels {apart} apart: {', '.join(said) or 'as they are told'}"


KIND = Wheels()
