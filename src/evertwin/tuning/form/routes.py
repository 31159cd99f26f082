"""Two ways to the same numbers, side by side: a force fit and a free run, two days, two models.

Each fit is sure of its own numbers. Where both tell a number and their 95 % intervals have nothing
in common, one of the two forms lacks something, and neither interval is to be believed.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> from evertwin.tuning import Problem, solve
>>> spring = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(z="m"),
...     Layout.of(force="N"), parameters=Parameters.of(stiffness=(2.0, "N/m")))
>>> z, rng = np.linspace(-1.0, 1.0, 50)[:, None], np.random.default_rng(0)
>>> def by(k):
...     return make_block(t=np.arange(50), u=z, y=k * z + rng.normal(0.0, 0.01, z.shape))
>>> cold, warm = (solve(Problem(spring, (by(k),))) for k in (3.0, 2.5))
>>> routes = beside(cold, warm)
>>> [(one.name, one.contradict) for one in routes]
[('stiffness', True)]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.fold import plain
from evertwin.tuning.intervals.fit import Fit
from evertwin.types import Json


@dataclass(frozen=True)
class Told:
    """A number as one fit tells it.

    >>> str(Told(20.0, (18.0, 22.0), "identifiable"))
    '20 (18 to 22)'
    """

    value: float
    interval95: tuple[float, float]
    verdict: str

    def __str__(self) -> str:
        """Value and interval."""
        low, high = self.interval95
        if self.verdict == "not" or not np.isfinite([low, high]).all():
            return f"{self.value:.5g} (not told)"
        return f"{self.value:.5g} ({low:.4g} to {high:.4g})"


@dataclass(frozen=True)
class Route:
    """A number that both fits tune.

    >>> Route("Fv", "Ns/m", Told(1.0, (0.0, 2.0), "weak"), Told(5, (4, 6), "weak")).contradict
    True
    """

    name: str
    unit: str
    here: Told
    there: Told

    @property
    def contradict(self) -> bool:
        """Do both tell it, and have their intervals nothing in common?"""
        (a, b), (c, d) = self.here.interval95, self.there.interval95
        return "not" not in (self.here.verdict, self.there.verdict) and bool(b < c or d < a)

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        return plain(vars(self) | {"contradict": self.contradict})  # type: ignore[return-value]


def beside(here: Fit, there: Fit) -> tuple[Route, ...]:
    """The numbers that both fits tune, by name and unit, in the order of the first."""
    units = dict(zip(there.names, there.units, strict=True))
    shared = [n for n, unit in zip(here.names, here.units, strict=True) if units.get(n) == unit]
    return tuple(Route(name, units[name], _told(here, name), _told(there, name)) for name in shared)


def shown(routes: tuple[Route, ...], titles: tuple[str, str]) -> str:
    """The table as text; what contradicts is marked, and said below."""
    rows = [("", titles[0], titles[1], "", "")]
    rows += [
        (r.name, str(r.here), str(r.there), r.unit, "contradict" if r.contradict else "")
        for r in routes
    ]
    wide = [max(len(row[k]) for row in rows) for k in range(5)]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, wide, strict=True)).rstrip() for row in rows]
    if bad := [route.name for route in routes if route.contradict]:
        lines.append(
            f"{', '.join(bad)}: the two fits contradict each other, so one of the forms lacks "
            "something: believe neither interval"
        )
    return "\n".join(lines)


def _told(fit: Fit, name: str) -> Told:
    k = fit.names.index(name)
    return Told(fit[name], fit.interval(name), fit.verdict[k])
