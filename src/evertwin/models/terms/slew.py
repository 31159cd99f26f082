"""A rate limit: what a drive makes of a command changes by no more than so much a second.

Of a speed, of any other input, or of each wheel of a base that is told a speed v and a turn rate w
(`evertwin.models.terms.wheels`). Variant: it slows down at a rate of
its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from evertwin.compiled.functions import njit
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
from evertwin.models.terms.wheels import SIDES, wheeled
from evertwin.signals.channels import Channel
from evertwin.signals.units import si_unit

STARTS = (0.3, 1.0, 3.0)
"""Times from rest to its reach that the search begins at, in horizons."""
SHARES = (0.2, 0.5, 1.0)
"""Speeds of a wheel in the fastest turn, by the fastest speed, that it begins at."""
BRAKING = (0.2, 5.0)
"""How many times as fast it slows down, at least and at most."""


@njit(cache=True)
def ramp(now: float, goal: float, rate: float, dt: float) -> tuple[float, float, float]:
    """(what is reached, its sum over time, time left) on the way to a goal."""
    way = goal - now
    if abs(way) > rate * dt:
        end = now + rate * dt if way > 0.0 else now - rate * dt
        return end, 0.5 * (now + end) * dt, 0.0
    took = abs(way) / rate if rate > 0.0 else 0.0
    return goal, 0.5 * (now + goal) * took, dt - took


@njit(cache=True)
def limited(
    now: float, command: float, rate: float, braking: float, dt: float
) -> tuple[float, float]:
    """(what is reached, mean over the row) on the way to a command that is held from now on."""
    total, left = 0.0, dt
    if now * command < 0.0 or abs(command) < abs(now):
        slower = command if now * command > 0.0 else 0.0
        now, total, left = ramp(now, slower, rate * braking, dt)
    now, more, left = ramp(now, command, rate, left)
    return now, (total + more + command * left) / dt if dt > 0.0 else now


def before(at: Any, grid: Any, u: Any, dt: float, p: Any, x: Any) -> int:
    """What is on the way to its command, which counts as held before it was seen.

    Memory: has a row come, what was reached.
    """
    own = placed(at)
    c, s, first = own.channel, own.source, 0 if own.source < 0 else 1
    rate, braking = p[first], p[first + 1] if own.variant == 1 else 1.0
    if s < 0:
        if not math.isfinite(u[c]):
            return 1
        x[1] = x[1] if x[0] != 0.0 else u[c]
        x[1], u[c] = limited(x[1], u[c], rate, braking, dt)
    else:
        half = 0.5 * p[0] * u[s]
        left, right = u[c] - half, u[c] + half
        if not math.isfinite(left):
            return 1
        if x[0] == 0.0:
            x[1], x[2] = left, right
        x[1], left = limited(x[1], left, rate, braking, dt)
        x[2], right = limited(x[2], right, rate, braking, dt)
        u[c] = 0.5 * (left + right)
        if p[0] > 0.0:
            u[s] = (right - left) / p[0]
    x[0] = 1.0
    return 0


class Slew(CorrectionTerm):
    """See the module.

    >>> KIND.say(Term("slew", "v"), (0.4,), "m/s", {"rate": (0.3, 0.5)})
    'v: changes by at most 0.4 (0.3 to 0.5) m/s in a second (rate limit)'
    >>> KIND.say(Term("slew", "v", "w", "braking"), (0.3, 0.4, 2.0), "m/s", {})
    'wheels 0.3 m apart: each changes by at most 0.4 m/s in a second, slows down 2 times as fast (rate limit)'
    """  # noqa: E501

    kind, plain, rank, variants = "slew", "slew", 2, ("", "braking")
    functions = Functions(before)

    def check(self, term: Term, model: Model) -> None:
        if term.source:
            model.inputs.index(term.source)
        super().check(replace(term, source=""), model)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        track = [Parameter("track", 0.0, si_unit(f"({unit})/({source})"), low=0.0)]
        rate = Parameter("rate", UNBOUNDED, si_unit(f"({unit})/s"), low=0.0)
        braking = [Parameter("braking", 1.0, "1", low=0.0)]
        return [*track * bool(term.source), rate, *braking * bool(term.variant)]

    def memory(self, term: Term, number: int, model: Model) -> Sequence[Channel]:
        unit = self.unit(term, model)
        reached = SIDES if term.source else ("reached",)
        names = [Channel(f"slew{number}.{name}", unit) for name in reached]
        return [Channel(f"slew{number}.begun", "1"), *names]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        found = [(Term(self.kind, c), rows.reach[c], 0.0) for c in rows.chosen]
        if base := wheeled(rows):
            v, w, fast, lever = base
            found.append((Term(self.kind, v, w), fast, lever))
        for term, reach, lever in found:
            fast = reach / rows.horizon
            most = max(reach / rows.step, 4.0 * fast)  # one that takes no row longer is like a lag
            track = [share * lever for share in SHARES], 0.02 * lever, 3.0 * lever, 0.05 * lever
            rate = [fast / time for time in STARTS], 0.02 * fast, most, 0.1 * fast
            for variant in self.variants:
                richer = bool(term.source), bool(variant)
                columns = [*[track] * richer[0], rate, *[([1.0], *BRAKING, 0.2)] * richer[1]]
                starts, low, high, typical = zip(*columns, strict=True)
                yield Candidate(
                    replace(term, variant=variant), SIMPLE, tuple(product(*starts)), low, high,
                    typical, replaces=(self.kind,) * any(richer),
                )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        names = [one.name for one in self.parameters(term, unit, "1")]
        known = dict(zip(names, values, strict=True))
        said = {name: told(name, value, "", intervals) for name, value in known.items()}
        who = f"wheels {said['track']} m apart: each" if term.source else f"{term.channel}:"
        down = f", slows down {said['braking']} times as fast" if term.variant else ""
        return f"{who} changes by at most {said['rate']} {unit} in a second{down} (rate limit)"


KIND = Slew()
