"""A law that differs by the sign of its input: a drive that starts later backwards, or goes slower.

    u > forward:      min(gain·u, cap)
    u < −backward:   −min(gain·reverse·|u|, cap)
    else              0

Learned from commands of both signs. What is odd in the input is a ``law``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
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
    told,
)
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.law import STATIC, UNBOUNDED, thresholds
from evertwin.models.terms.rows import Rows
from evertwin.types import Vector

BOTH = 0.02
"""Least share of the commands in either direction."""


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """The law of the direction that is commanded."""
    c = placed(at).channel
    command = u[c]
    if command > p[0]:
        u[c] = min(p[2] * command, p[4])
    elif command < -p[1]:
        u[c] = max(p[2] * p[3] * command, -p[4])
    else:
        u[c] = 0.0 * command
    return 0


class Direction(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("direction", "v"), (0.06, 0.09, 1.0, 1.0, 1e9), "m/s", {})
    'v: starts at 0.06 m/s forwards, at 0.09 m/s backwards (dead zone)'
    >>> KIND.say(Term("direction", "v"), (0.0, 0.0, 1.0, 0.8, 0.3), "m/s", {"reverse": (0.7, 0.9)})
    'v: 0.8 (0.7 to 0.9) times as fast backwards, saturation at 0.3 m/s'
    """

    kind, gain, plain = "direction", "gain", "law"
    steps = slopeless = ("forward", "backward")
    functions = Functions(before)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        # no slope leads to the end of a dead zone
        starts = [Parameter(n, 0.0, unit, low=0.0, editable=False) for n in self.steps]
        gains = [Parameter(n, 1.0, "1", low=0.0) for n in ("gain", "reverse")]
        return [*starts, *gains, Parameter("cap", UNBOUNDED, unit, low=0.0)]

    def by_channel(self, name: str) -> bool:
        return name in (*self.steps, "cap")

    def behind_gain(self, term: Term, values: tuple[float, ...]) -> tuple[float, ...]:
        *starts, gain, reverse, cap = values
        if not gain > 0.0:
            return values
        return (*starts, 1.0, reverse, cap / gain if cap < UNBOUNDED else cap)

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        for channel in rows.chosen:
            yield from _directions(channel, rows.inputs(channel), rows.reach[channel])

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        forward, backward, gain, reverse, cap = values
        said = []
        if max(forward, backward) > 0.0:
            starts = (told(n, v, unit, intervals) for n, v in zip(self.steps, values, strict=False))
            ways = zip(starts, ("forwards", "backwards"), strict=True)
            said.append(f"starts {', '.join(f'at {v} {w}' for v, w in ways)} (dead zone)")
        differs = f"{reverse:.3g}" != "1"
        if gain != 1.0 or not (said or differs or cap < UNBOUNDED):
            said.append(f"gain {told('gain', gain, '', intervals)}")
        if differs:
            said.append(f"{told('reverse', reverse, '', intervals)} times as fast backwards")
        if cap < UNBOUNDED:
            said.append(f"saturation at {told('cap', cap, unit, intervals)}")
        return f"{term.channel}: {', '.join(said)}"


def _directions(c: str, u: Vector, reach: float) -> Iterator[Candidate]:
    if min(np.mean(u > 0.0), np.mean(u < 0.0)) < BOTH:
        return
    some = (0.0, *thresholds(u, reach))
    law = (1.0, 1.0, 1.5 * reach)
    low, high = (0.0, 0.0, 0.2, 0.2, 0.2 * reach), (0.6 * reach,) * 2 + (3.0, 3.0, 5.0 * reach)
    typical = (0.05 * reach, 0.05 * reach, 0.1, 0.1, 0.2 * reach)
    yield Candidate(
        Term("direction", c), SIMPLE, tuple((*pair, *law) for pair in product(some, some)), low,
        high, typical, fixed=(0, 1), replaces=STATIC,
    )  # fmt: skip


KIND = Direction()
