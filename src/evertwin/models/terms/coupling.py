"""One input weakens another: a base that turns drives more slowly.

Variants: *proportional*, u − k·s; *magnitude*, |u| falls by k·|s|; *share*, gain·u·(1 − k·|s|), as
wheels that scrub turn a base the less the faster it drives; *grip*, the limit of |u| falls with
|s|, as friction does that is used up sideways.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import (
    MIXED,
    SIMPLE,
    Candidate,
    CorrectionTerm,
    Functions,
    Intervals,
    told,
)
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.rows import Rows
from evertwin.signals.units import si_unit


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """The coupling, by its variant."""
    own = placed(at)
    command, source = u[own.channel], u[own.source]
    if own.variant == 0:
        u[own.channel] = command - p[0] * source
    elif command == 0.0:
        u[own.channel] = 0.0 * command
    elif own.variant == 1:
        u[own.channel] = command - math.copysign(p[0] * abs(source), command)
    elif own.variant == 3:
        u[own.channel] = p[0] * command * max(1.0 - p[1] * abs(source), 0.0)
    else:
        slope = p[1] + p[2] * abs(source)
        limited = math.tanh(p[0] * command * slope) / slope if slope > 1e-12 else p[0] * command
        u[own.channel] = limited
    return 0


class Coupling(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("coupling", "v", "w", "magnitude"), (0.065,), "m/s", {})
    'v: falls by 0.065·|w|'
    """

    kind, pairs, gain = "coupling", True, "gain"
    variants = ("proportional", "magnitude", "grip", "share")
    functions = Functions(before)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        if term.variant == "share":
            slip = Parameter("slip", 0.0, si_unit(f"1/({source})"))
            return [Parameter("gain", 1.0, "1", low=0.0), slip]
        if term.variant != "grip":
            return [Parameter("slip", 0.0, si_unit(f"({unit})/({source})"))]
        inverse = si_unit(f"1/({unit})")
        return [
            Parameter("gain", 1.0, "1", low=0.0),
            Parameter("inverse_cap", 0.0, inverse, low=0.0, editable=False),
            Parameter("inverse_grip", 0.0, si_unit(f"1/({unit})/({source})"), low=0.0),
        ]

    def behind_gain(self, term: Term, values: tuple[float, ...]) -> tuple[float, ...]:
        gain, *rest = values
        if term.variant not in ("grip", "share") or not gain > 0.0:
            return values
        return (1.0, *(one * gain if term.variant == "grip" else one for one in rest))

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        for channel in rows.chosen:
            for source in rows.others(channel):
                yield from _couplings(channel, source, rows.reach[channel], rows.reach[source])

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        c, o = term.channel, term.source
        if term.variant == "grip":
            gain, cap, grip = values
            limit = f"1/({cap:.3g} + {grip:.3g}·|{o}|)"
            if cap <= 1e-6 * grip:
                limit = f"{1 / grip:.3g}/|{o}|" if grip > 0.0 else ""
            elif grip == 0.0:
                limit = f"{1 / cap:.3g}"
            limited = f", limited to {limit} {unit}" if limit else ""
            return f"{c}: gain {told('gain', gain, '', intervals)}{limited}"
        size = o if term.variant == "proportional" else f"|{o}|"
        way = "falls" if values[-1] >= 0 else "rises"
        between = intervals.get("slip")
        sizes = {"slip": _sizes(*between)} if between else {}
        slip = told("slip", abs(values[-1]), "", sizes)
        if term.variant == "share":
            own = told("gain", values[0], "", intervals)
            said = "" if values[0] == 1.0 else f" gain {own},"
            return f"{c}:{said} {way} by a share of {slip}·{size}"
        return f"{c}: {way} by {slip}·{size}"


def _sizes(low: float, high: float) -> tuple[float, float]:
    """The interval of a size, from that of a number of either sign."""
    return (-high, -low) if low + high < 0.0 else (low, high)


def _couplings(c: str, o: str, reach: float, other: float) -> Iterator[Candidate]:
    slip, share = reach / other, 1.0 / other
    for variant in ("proportional", "magnitude"):
        yield Candidate(
            Term("coupling", c, o, variant), SIMPLE, ((0.0,),), (-3 * slip,), (3 * slip,),
            (0.1 * slip,),
        )  # fmt: skip
    yield Candidate(
        Term("coupling", c, o, "share"), MIXED, ((1.0, 0.1 * share),), (0.2, -3 * share),
        (3.0, 3 * share), (0.1, 0.1 * share), replaces=("coupling",),
    )  # fmt: skip
    cap, grip = 1 / reach, 1 / (reach * other)
    yield Candidate(
        Term("coupling", c, o, "grip"), SIMPLE, ((1.0, 0.3 * cap, 0.3 * grip),), (0.2, 0.0, 0.0),
        (3.0, 10 * cap, 30 * grip), (0.1, 0.3 * cap, 0.3 * grip), replaces=("coupling", "law"),
    )  # fmt: skip


KIND = Coupling()
