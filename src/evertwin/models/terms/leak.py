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


class Leak(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("leak", "level"), (0.02, -0.01), "m", {})
    'level: gains 0.02 m/s and loses 0.01 1/s of itself'
    """

    kind, rank = "leak", 2
    functions = Functions(after=after)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        return [Parameter("flow", 0.0, f"({unit})/s"), Parameter("share", 0.0, "1/s")]

    def channel(self, term: Term, model: Model) -> int:
        return model.states.index(term.channel)

    def unit(self, term: Term, model: Model) -> str:
        return model.states.units[self.channel(term, model)]

    def extra(self, term: Term, model: Model) -> int:
        """The output that shows the state; −1: none."""
        names = model.outputs.names
        return names.index(term.channel) if term.channel in names else -1

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
            f"{'gains' if value > 0 else 'loses'} {told(name, abs(value), own, intervals)}{of}"
            for name, value, own, of in (
                ("flow", values[0], f"{unit}/s", ""), ("share", values[1], "1/s", " of itself")
            ) if value
        ]  # fmt: skip
        return f"{term.channel}: {' and '.join(parts) or 'gains nothing'}"


KIND = Leak()
