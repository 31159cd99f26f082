"""A rate limit: what a drive makes of a command changes by no more than so much a second."""

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
from evertwin.models.terms.law import UNBOUNDED
from evertwin.models.terms.rows import Rows
from evertwin.signals.channels import Channel
from evertwin.signals.units import si_unit

STARTS = (0.3, 1.0, 3.0)
"""Times from rest to its reach that the search begins at, in horizons."""


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """The mean over a row on the way to its command, which counts as held before it was seen.

    Memory: has a row come, what was reached.
    """
    c = placed(at).channel
    command = u[c]
    if not math.isfinite(command):
        return 1
    if x[0] == 0.0:
        x[0], x[1] = 1.0, command
    way, most = command - x[1], p[0] * dt
    if abs(way) > most:
        u[c] = x[1] + math.copysign(0.5 * most, way)
        x[1] += math.copysign(most, way)
    else:
        u[c] = command - (0.5 * way * abs(way) / most if most > 0.0 else 0.0)
        x[1] = command
    return 0


class Slew(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("slew", "v"), (0.4,), "m/s", {"rate": (0.3, 0.5)})
    'v: changes by at most 0.4 (0.3 to 0.5) m/s in a second (rate limit)'
    """

    kind, rank = "slew", 3
    functions = Functions(before)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        return [Parameter("rate", UNBOUNDED, si_unit(f"({unit})/s"), low=0.0)]

    def memory(self, term: Term, number: int, model: Model) -> Sequence[Channel]:
        unit = self.unit(term, model)
        return [Channel(f"slew{number}.begun", "1"), Channel(f"slew{number}.reached", unit)]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        for c in rows.chosen:
            fast = rows.reach[c] / rows.horizon
            yield Candidate(
                Term(self.kind, c), SIMPLE, tuple((fast / one,) for one in STARTS),
                (0.02 * fast,), (100.0 * fast,), (0.1 * fast,),
            )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        rate = told("rate", values[0], unit, intervals)
        return f"{term.channel}: changes by at most {rate} in a second (rate limit)"


KIND = Slew()
