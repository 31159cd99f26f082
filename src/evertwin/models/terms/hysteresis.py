"""A drive that starts at one command and, once it runs, goes on down to a smaller one.

It stands while |u| ≤ start, then runs until |u| ≤ stop; turned round it has to start again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from evertwin.models.contract import Model
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
from evertwin.models.terms.law import STATIC, UNBOUNDED, thresholds
from evertwin.models.terms.rows import Rows
from evertwin.signals.channels import Channel


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """Memory: the direction that it runs in, 0 while it stands."""
    c = placed(at).channel
    command = u[c]
    if not math.isfinite(command):
        return 1
    a = abs(command)
    if x[0] * command > 0.0:
        runs = a > p[1]
    else:
        runs = a > p[0]
    if runs:
        x[0] = math.copysign(1.0, command)
        u[c] = math.copysign(min(p[2] * a, p[3]), command)
    else:
        x[0] = 0.0
        u[c] = 0.0
    return 0


class Hysteresis(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("hysteresis", "v"), (0.06, 0.03, 1.0, 1e9), "m/s", {"start": (0.05, 0.06)})
    'v: starts at 0.06 (0.05 to 0.06) m/s, goes on down to 0.03 m/s (hysteresis)'
    """

    kind, gain, plain, rank = "hysteresis", "gain", "law", 1
    steps = slopeless = ("start", "stop")
    functions = Functions(before)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        # no slope leads to where it starts
        starts = [Parameter(n, 0.0, unit, low=0.0, editable=False) for n in self.steps]
        gain = Parameter("gain", 1.0, "1", low=0.0)
        return [*starts, gain, Parameter("cap", UNBOUNDED, unit, low=0.0)]

    def by_channel(self, name: str) -> bool:
        return name != "gain"

    def behind_gain(self, term: Term, values: tuple[float, ...]) -> tuple[float, ...]:
        *starts, gain, cap = values
        if not gain > 0.0:
            return values
        return (*starts, 1.0, cap / gain if cap < UNBOUNDED else cap)

    def memory(self, term: Term, number: int, model: Model) -> Sequence[Channel]:
        return [Channel(f"hysteresis{number}.runs", "1")]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        for c in rows.chosen:
            reach = rows.reach[c]
            some = (0.0, *thresholds(rows.inputs(c), reach))
            pairs = [(start, stop) for start in some for stop in some if stop < start]
            if pairs:
                yield Candidate(
                    Term(self.kind, c), SIMPLE, tuple((*p, 1.0, 1.5 * reach) for p in pairs),
                    (0.0, 0.0, 0.2, 0.2 * reach), (0.6 * reach, 0.6 * reach, 3.0, 5.0 * reach),
                    (0.05 * reach, 0.05 * reach, 0.1, 0.2 * reach), fixed=(0, 1),
                    replaces=STATIC,
                )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        start, stop, gain, cap = values
        goes = f"starts at {told('start', start, unit, intervals)}, goes on down to "
        said = [f"{goes}{told('stop', stop, unit, intervals)} (hysteresis)"]
        if gain != 1.0:
            said.append(f"gain {told('gain', gain, '', intervals)}")
        if cap < UNBOUNDED:
            said.append(f"saturation at {told('cap', cap, unit, intervals)}")
        return f"{term.channel}: {', '.join(said)}"


KIND = Hysteresis()
