"""What a state gains or loses on its own: a constant flow, and a share of itself.

    state' = ... + flow + share · state

held over a row, solved exactly. A leak and a drain that a model leaves out are negative, an inflow
that nothing commands is positive; beside them a law of the state's own, such as Torricelli's, has
another exponent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import (
    SIMPLE,
    Candidate,
    Functions,
    Intervals,
    told,
)
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.of_state import StateTerm
from evertwin.models.terms.rows import Rows


def after(at: Any, dt: float, p: Any, x: Any, ahead: Any, y: Any) -> int:
    """The state that the inner model left, after ``dt`` of it."""
    own = placed(at)
    c, turn = own.channel, p[1] * dt
    grown = math.expm1(turn)
    held = grown / p[1] if abs(turn) > 1e-9 else dt
    ahead[c] += p[0] * held + ahead[c] * grown
    if own.extra >= 0:
        y[own.extra] = ahead[c]
    return 0


class Leak(StateTerm):
    """See the module.

    >>> KIND.say(Term("leak", "level"), (0.02, -0.01), "m", {})
    'level: gains 0.02 m/s and loses 0.01 1/s of itself'
    >>> KIND.say(Term("leak", "level"), (0.0, -0.01), "m", {"share": (-0.02, -0.005)})
    'level: loses 0.01 (0.005 to 0.02) 1/s of itself'
    """

    kind = "leak"
    functions = Functions(after=after)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        return [Parameter("flow", 0.0, f"{unit}/s"), Parameter("share", 0.0, "1/s")]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        """From nothing: the horizon sets the scale."""
        size = 1.0 / rows.horizon
        for state in rows.states:
            yield Candidate(
                Term(self.kind, state), SIMPLE, ((0.0, 0.0),), (-math.inf, -10.0 * size),
                (math.inf, 10.0 * size), (0.1 * size, 0.1 * size),
            )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        parts = [
            f"{'gains' if value > 0 else 'loses'} {_size(name, value, own, intervals)}{of}"
            for name, value, own, of in (
                ("flow", values[0], f"{unit}/s", ""), ("share", values[1], "1/s", " of itself")
            ) if value
        ]  # fmt: skip
        return f"{term.channel}: {' and '.join(parts) or 'gains nothing'}"


def _size(name: str, value: float, unit: str, intervals: Intervals) -> str:
    """What is lost is told by its size."""
    if value < 0.0 and name in intervals:
        low, high = intervals[name]
        intervals = {name: (-high, -low)}
    return told(name, abs(value), unit, intervals)


KIND = Leak()
