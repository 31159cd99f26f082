"""A continuous law of one input: min(gain·|u| + offset, cap), odd in u, with a start threshold.

Variants: without a threshold; *dead zone*, no motion up to it; *clamp*, never slower than it. A
clamp does not act below its only level, where it has one: there no command is meant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import (
    SIMPLE,
    Candidate,
    CorrectionTerm,
    Functions,
    Intervals,
    nothing,
    told,
)
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.rows import Rows, quiet_level
from evertwin.types import Vector

UNBOUNDED = 1e9
"""A cap that never acts."""
DEAF = 0.02
"""Gain up to which a machine does not answer to a command; a turned sign ends there, too."""
STATIC = ("law", "direction", "hysteresis", "wheels", "table", "coupling")
"""Kinds that say what comes of a command: each may take the place of the others."""
EXACT = 1e-6
"""Share of its reach by which a threshold moves that is one of the commands."""
THRESHOLDS = 12
"""Start thresholds that are tried for a dead zone."""


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """The law; no motion below the quiet level in any variant."""
    own = placed(at)
    first, quiet = 0 if own.variant == 0 else 1, grid[0] if own.size > 0 else 0.0
    command = u[own.channel]
    a = abs(command)
    if a < quiet or a == 0.0 or (own.variant == 1 and a <= p[0]):
        u[own.channel] = 0.0 * command
        return 0
    v = p[first] * a + p[first + 1]
    if own.variant == 2:
        v = max(v, p[0])
    u[own.channel] = math.copysign(min(max(v, 0.0), p[first + 2]), command)
    return 0


class Law(CorrectionTerm):
    """See the module.

    >>> law = Term("law", "v", variant="dead zone")
    >>> KIND.say(law, (0.06, 0.97, 0.0, 0.16), "m/s", {"threshold": (0.05, 0.07)})
    'v: start threshold 0.06 (0.05 to 0.07) m/s (dead zone), gain 0.97, saturation at 0.16 m/s'
    >>> KIND.say(law, (0.0, 0.97, 0.0, 0.16), "m/s", {})
    'v: gain 0.97, saturation at 0.16 m/s'
    >>> KIND.say(law, (0.0, 1.0, -0.05, 0.16), "m/s", {"offset": (-0.06, -0.04)})
    'v: start threshold 0.05 (0.04 to 0.06) m/s (lost of every command), saturation at 0.16 m/s'
    >>> KIND.say(Term("law", "v"), (1.0, 0.002, UNBOUNDED), "m/s", {"offset": (-0.001, 0.005)})
    'v: offset 0.002 (-0.001 to 0.005) m/s'
    """

    kind, variants = "law", ("", "dead zone", "clamp")
    steps, slopeless, gain = ("threshold",), ("threshold",), "gain"
    functions = Functions(before)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        # no slope leads to the end of a dead zone
        slides = term.variant != "dead zone"
        threshold = Parameter("threshold", 0.0, unit, low=0.0, editable=slides)
        gain = [Parameter("gain", 1.0, "1", low=0.0), Parameter("offset", 0.0, unit)]
        start = [threshold] if term.variant else []
        return [*start, *gain, Parameter("cap", UNBOUNDED, unit, low=0.0)]

    def by_channel(self, name: str) -> bool:
        return name in ("threshold", "cap")

    def behind_gain(self, term: Term, values: tuple[float, ...]) -> tuple[float, ...]:
        *start, gain, offset, cap = values
        if not gain > DEAF:
            return values
        start = [one / gain for one in start] if term.variant == "clamp" else start
        most = cap / gain if cap < UNBOUNDED else cap
        return (*start, 1.0, offset / gain, most)

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        for channel in rows.chosen:
            yield from _laws(channel, rows.inputs(channel), rows.reach[channel])

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        said = []
        gain, offset, cap = values[-3:]
        capped = cap < UNBOUNDED
        alone = gain == 1.0 and not (capped or term.variant)  # what it says is its offset, if any
        lost = abs(offset) > (5e-3 * cap if capped else 0.0)
        lost = lost and (alone or not nothing("offset", intervals))
        clamped = term.variant == "clamp" and values[0] > 0.0
        starts = -offset / gain if lost and gain > DEAF and not clamped else 0.0
        if term.variant and values[0] > max(starts, 0.0):
            threshold = told("threshold", values[0], unit, intervals)
            said.append(f"start threshold {threshold} ({term.variant})")
        elif starts > 0.0:
            threshold = told("threshold", starts, unit, _starts(values, intervals))
            said.append(f"start threshold {threshold} (lost of every command)")
            lost = False  # gain and threshold tell it
        if gain <= DEAF:
            said.append("no answer to it (or its sign is turned)")
        elif gain != 1.0 or not (said or lost or capped):
            said.append(f"gain {told('gain', gain, '', intervals)}")
        if lost:
            said.append(f"offset {told('offset', offset, unit, intervals)}")
        if capped:
            said.append(f"saturation at {told('cap', cap, unit, intervals)}")
        return f"{term.channel}: " + ", ".join(said)


def _starts(values: Sequence[float], intervals: Intervals) -> Intervals:
    """Where ``gain·|u| + offset`` rises above nothing, at most as far apart as both may be."""
    if "offset" not in intervals:
        return {}
    (low, high), gains = intervals["offset"], intervals.get("gain", (values[-3],) * 2)
    if not gains[0] > 0.0:
        return {}
    return {"threshold": (max(-high, 0.0) / gains[1], max(-low, 0.0) / gains[0])}


def _laws(c: str, u: Vector, reach: float) -> Iterator[Candidate]:
    low, high = (0.2, -0.5 * reach, 0.2 * reach), (3.0, 0.5 * reach, 5.0 * reach)
    typical = (0.1, 0.05 * reach, 0.2 * reach)
    slopes = [(1.0, 0.0, 1.5 * reach), (1.0, 0.0, 0.8 * reach)]
    yield Candidate(Term("law", c), SIMPLE, tuple(slopes), low, high, typical, replaces=STATIC)
    quiet = quiet_level(u)
    levels = (quiet,) if quiet > 0.0 else ()
    clamps = tuple((share * reach, *slope) for share in (0.1, 0.3) for slope in slopes)
    bounds = (0.0, *low), (0.6 * reach, *high), (0.05 * reach, *typical)
    clamp = Term("law", c, variant="clamp", levels=levels)
    yield Candidate(clamp, SIMPLE, clamps, *bounds, replaces=STATIC)
    some, near = thresholds(u, reach), 0.05 * reach
    if len(some) < THRESHOLDS:  # each command is tried, and it is one of them that starts nothing
        near = EXACT * reach
    zones = tuple((threshold, *slope) for threshold in some for slope in slopes)
    if zones:
        yield Candidate(
            Term("law", c, variant="dead zone"), SIMPLE, zones, *bounds[:2], (near, *typical),
            fixed=(0,), replaces=STATIC,
        )  # fmt: skip


def thresholds(u: Vector, reach: float) -> list[float]:
    """Where a dead zone may end: the commands themselves if they are few, else shares of them.

    >>> thresholds(np.array([0.0, 0.1, -0.2, 0.5, 1.0]), reach=1.0)
    [0.1, 0.2, 0.5]
    """
    size = np.unique(np.abs(u).round(12))
    size = size[(size > 0.0) & (size < 0.6 * reach)]
    if len(size) > THRESHOLDS:
        size = np.unique(np.quantile(size, np.linspace(0.03, 0.97, THRESHOLDS)))
    return [float(v) for v in size]


KIND = Law()
