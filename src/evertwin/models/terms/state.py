"""An extra state that exchanges with one of the model's own: the wall behind a box.

With the difference d = state − extra: d' = −(a + b)·d, the state losing a·d, the extra gaining b·d,
solved exactly over a row. Memory: has a row come, extra − state.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evertwin.models.contract import Model
from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import (
    SHAPED,
    Candidate,
    Functions,
    Intervals,
    told,
)
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.of_state import StateTerm
from evertwin.models.terms.rows import Rows
from evertwin.signals.channels import Channel
from evertwin.types import ParameterVector, StateVector


def after(at: Any, dt: float, p: Any, x: Any, ahead: Any, y: Any) -> int:
    """The exchange over a row."""
    own = placed(at)
    c, b = own.channel, own.memory
    ahead[b] = 1.0
    extra = x[c] + x[b + 1]
    both = p[0] + p[1]
    moved = (ahead[c] - extra) * (1.0 - math.exp(-both * dt))
    share = p[0] / both if both > 0.0 else 0.0
    ahead[c] -= share * moved
    ahead[b + 1] = extra + (1.0 - share) * moved - ahead[c]
    if own.extra >= 0:
        y[own.extra] = ahead[c]
    return 0


def adopted(at: Any, before: Any, x: Any) -> int:
    """An extra state that has begun stays where it is."""
    own = placed(at)
    c, b = own.channel, own.memory
    if x[b] != 0.0:
        x[b + 1] += before[c] - x[c]
    return 0


class ExtraState(StateTerm):
    """See the module.

    >>> KIND.say(Term("state", "T"), (0.3, 0.1, -4.0), "K", {})
    'T: exchanges with a hidden state, 0.3 1/s there and 0.1 1/s back, which starts -4 K apart'
    """

    kind, initials = "state", ("start",)
    functions = Functions(after=after, adopted=adopted)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        rates = [Parameter(name, 0.0, "1/s", low=0.0) for name in ("loss", "gain")]
        return [*rates, Parameter("start", 0.0, unit)]

    def memory(self, term: Term, number: int, model: Model) -> Sequence[Channel]:
        stem = f"state{number}"
        unit = self.unit(term, model)
        return [Channel(f"{stem}.begun", "1"), Channel(f"{stem}.difference", unit)]

    def start(self, p: ParameterVector, size: int) -> StateVector:
        return np.array([0.0, p[2]])

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        """At several speeds of exchange: the window's length sets the scale."""
        fast = [1.0 / (rows.span / part) for part in (3.0, 30.0, 300.0)]
        starts, most = tuple((rate, rate, 0.0) for rate in fast), 100.0 * fast[-1]
        for state in rows.states:
            yield Candidate(
                Term(self.kind, state), SHAPED, starts, (0.0, 0.0, -np.inf), (most, most, np.inf),
                (0.3 * fast[1], 0.3 * fast[1], 1.0),
            )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        loss, gain = (
            told(name, value, "1/s", intervals)
            for name, value in zip(("loss", "gain"), values[:2], strict=True)
        )
        apart = told("start", values[2], unit, intervals, "+.3g")
        return (
            f"{term.channel}: exchanges with a hidden state, {loss} there and {gain} back, which "
            f"starts {apart} apart"
        )


KIND = ExtraState()
