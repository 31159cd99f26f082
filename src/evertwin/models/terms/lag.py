"""A delay and a first-order lag of one input, or of all: what a drive makes of a command in time.

Variants: delay and lag, or the delay alone. Both are exact for inputs that are held between their
changes. The term keeps the newest changes, as many as fit into the delay.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from evertwin.compiled.functions import njit
from evertwin.models.contract import Model
from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import (
    SHAPED,
    SIMPLE,
    Candidate,
    CorrectionTerm,
    Functions,
    Intervals,
    Place,
    nothing,
    told,
)
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.rows import Rows, rows_within
from evertwin.signals.channels import Channel

CAPACITY = 16
"""Changes of the input that are remembered; ``levels=(64,)`` says otherwise."""
MOST = 250
"""Most changes that a proposal remembers."""
STARTS = (
    (0.02, 0.1),
    (0.1, 0.3),
    (0.25, 0.05),
    (0.4, 0.05),
    (0.55, 0.05),
    (0.7, 0.05),
    (0.85, 0.05),
    (0.1, 1.0),
    (0.1, 3.0),
)
"""Delays and time constants that the search begins at, in horizons."""
SLOW = 10.0
"""Largest time constant that is sought, in horizons: what was commanded before a prediction began
is remembered, so that slower ones show, too."""
LONG = 1e6
"""Seconds for which the first command is taken to have been held before it was seen."""


@njit(cache=True)
def _remember(at: Place, u: Any, first: int, m: int, dt: float, x: Any) -> None:
    """The history with this row's input: newest first, one entry per change of the input.

    Memory: has a row come, filtered inputs (m), durations (capacity), values (capacity · m).
    """
    capacity = at.extra
    h, v = 1 + m, 1 + m + capacity
    if x[0] == 0.0:
        for k in range(1 + m + capacity * (1 + m)):
            x[k] = 0.0
        x[0], x[h] = 1.0, LONG
        for c in range(m):
            x[1 + c] = u[first + c]
            x[v + c] = u[first + c]
        return
    same = True
    for c in range(m):
        same = same and u[first + c] == x[v + c]
    if same:
        x[h] += dt
        return
    for j in range(capacity - 1, 0, -1):
        x[h + j] = x[h + j - 1]
        for c in range(m):
            x[v + j * m + c] = x[v + (j - 1) * m + c]
    x[h] = dt
    for c in range(m):
        x[v + c] = u[first + c]


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """Delay and lag over one row; ``u`` becomes the *mean* over the row.

    Over a piece of length o with value a the lagged value f goes to a + (f − a)·exp(−o/τ) and its
    integral is a·o + (f − a)·τ·(1 − exp(−o/τ)).
    """
    own = placed(at)
    first, m = (0, own.inputs) if own.channel < 0 else (own.channel, 1)
    for c in range(m):
        if not math.isfinite(u[first + c]):
            return 1
    _remember(own, u, first, m, dt, x)
    delay, tau = p[0], p[1] if own.variant == 0 else 0.0
    h, v = 1 + m, 1 + m + own.extra
    oldest, edge = 0, x[h]
    while oldest + 1 < own.extra and edge < delay + dt and x[h + oldest + 1] > 0.0:
        oldest += 1
        edge += x[h + oldest]
    for c in range(m):
        f, total, far, end = x[1 + c], 0.0, delay + dt, edge
        for j in range(oldest, -1, -1):
            end = end - x[h + j] if j > 0 else 0.0
            piece = far - max(end, delay)
            far = min(far, end)
            if piece <= 0.0:
                continue
            a = x[v + j * m + c]
            decay = math.exp(-piece / tau) if tau > 1e-9 else 0.0
            total += a * piece + (f - a) * tau * (1.0 - decay)
            f = a + (f - a) * decay
        x[1 + c] = f
        u[first + c] = total / dt if dt > 0.0 else f
    return 0


class Lag(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("lag", "*"), (0.1, 0.25), "1", {})
    'all inputs: delay of 0.1 s and a first-order lag of 0.25 s'
    """

    kind, rank, variants, steps = "lag", 3, ("", "delay"), ("delay",)
    alike = "sensors that tell of the outputs as late would look the same"
    functions = Functions(before)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        tau = [] if term.variant else [Parameter("tau", 0.0, "s", low=0.0)]
        # with a time constant beside it the delay is found once, and not tuned any more
        return [Parameter("delay", 0.0, "s", low=0.0, editable=not tau), *tau]

    def channel(self, term: Term, model: Model) -> int:
        return -1 if term.channel == "*" else super().channel(term, model)

    def unit(self, term: Term, model: Model) -> str:
        return "1" if term.channel == "*" else super().unit(term, model)

    def extra(self, term: Term, model: Model) -> int:
        """Changes that are remembered."""
        return int(term.levels[0]) if term.levels else CAPACITY

    def memory(self, term: Term, number: int, model: Model) -> Sequence[Channel]:
        layout = model.inputs if term.channel == "*" else model.inputs.select([term.channel])
        capacity, stem = self.extra(term, model), f"lag{number}"
        found = [Channel(f"{stem}.begun", "1")]
        found += [Channel(f"{stem}.{c.name}", c.unit) for c in layout]
        found += [Channel(f"{stem}.duration.{k}", "s") for k in range(capacity)]
        found += [Channel(f"{stem}.{c.name}.{k}", c.unit) for k in range(capacity) for c in layout]
        return found

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        """A delay up to the horizon, whose changes are remembered, and a time constant that may be
        longer."""
        horizon, chosen = rows.horizon, rows.chosen
        capacity = min(rows_within(rows.windows, horizon) + 2, MOST)
        starts = tuple((a * horizon, b * horizon) for a, b in STARTS)
        # one that all inputs share first; what an input has beyond it, where there are others
        tiers = {"*": SIMPLE} | dict.fromkeys(chosen if len(rows.model.inputs) > 1 else (), SHAPED)
        for channel, tier in tiers.items() if chosen else ():
            yield Candidate(
                Term(self.kind, channel, levels=(float(capacity),)), tier, starts,
                (0.0, 1e-3 * horizon), (horizon, SLOW * horizon), (0.05 * horizon,) * 2,
            )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        who = "all inputs" if term.channel == "*" else term.channel
        said = [f"delay of {told('delay', values[0], 's', intervals)}"]
        if len(values) > 1:
            said.append(f"a first-order lag of {told('tau', values[1], 's', intervals)}")
        late = values[0] > 0.0 and not nothing("delay", intervals)
        slow = len(values) > 1 and values[1] > 0.0
        kept = said if late and slow else said[-1:] if slow or not values[0] else said[:1]
        return f"{who}: {' and '.join(kept)}"


KIND = Lag()
