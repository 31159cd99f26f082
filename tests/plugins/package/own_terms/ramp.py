"""A rate limit: the effective command follows the command by so much a second, and no more."""

import math

from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import SIMPLE, Candidate, CorrectionTerm, Functions, told
from evertwin.models.terms.kernel import placed
from evertwin.signals import Channel


def before(at, grid, u, dt, p, x):
    """The mean over the row; memory: has a row come, the effective command at its end."""
    own = placed(at)
    wanted = u[own.channel]
    if not math.isfinite(wanted):
        return 1
    if x[0] == 0.0:
        x[0], x[1] = 1.0, wanted
    way, most = wanted - x[1], p[0] * dt
    if abs(way) <= most:
        late = 0.5 * way * abs(way) / p[0] if p[0] > 0.0 else 0.0
        u[own.channel] = wanted - late / dt if dt > 0.0 else wanted
        x[1] = wanted
        return 0
    step = math.copysign(most, way)
    u[own.channel] = x[1] + 0.5 * step
    x[1] += step
    return 0


class Ramp(CorrectionTerm):
    """One number: the rate."""

    kind, rank = "ramp", 1
    functions = Functions(before)

    def parameters(self, term, unit, source):
        return [Parameter("rate", 1e9, f"({unit})/s", low=0.0)]

    def memory(self, term, number, model):
        unit = self.unit(term, model)
        return [Channel(f"ramp{number}.begun", "1"), Channel(f"ramp{number}.reached", unit)]

    def propose(self, rows):
        for channel in rows.chosen:
            reach = rows.reach[channel]
            starts = tuple((share * reach / rows.horizon,) for share in (1.0, 4.0, 16.0))
            yield Candidate(
                Term(self.kind, channel), SIMPLE, starts, (0.01 * reach / rows.horizon,),
                (1e3 * reach / rows.horizon,), (0.3 * reach / rows.horizon,),
            )  # fmt: skip

    def say(self, term, values, unit, intervals):
        rate = told("rate", values[0], unit, intervals)
        return f"{term.channel}: changes by at most {rate} a second"


RAMP = Ramp()
