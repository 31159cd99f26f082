"""Initial values by experiment: a first fit to the recordings, once, before anything is chosen.

Data sheets give ratios and inertias of rotors; what they do not give (inertias of links, offsets,
friction of a robot whose maker is silent) is found from recordings that excite it. Those values are
written into the twin file with their source; whether they are tuned later is another question.

>>> from evertwin.engineering.breakdown import Breakdown
>>> from evertwin.engineering.parts import Requirements
>>> asked(Breakdown("arm", requirements=Requirements(identify=("links.*",))), ("links.m", "J"))
('links.m',)
"""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from dataclasses import dataclass, replace

from evertwin.engineering.breakdown import Breakdown
from evertwin.errors import ConfigError
from evertwin.tuning import Problem, solve


@dataclass(frozen=True)
class Found:
    """One initial value.

    >>> Found("links.mx", 0.3, 0.01, "kgm", "identifiable").source
    'experiment: first fit to these recordings, ± 0.01 kgm'
    """

    name: str
    value: float
    sigma: float
    unit: str
    verdict: str

    @property
    def source(self) -> str:
        """What the twin file says of it."""
        return f"experiment: first fit to these recordings, ± {self.sigma:.2g} {self.unit}"


@dataclass(frozen=True)
class Identified:
    """Initial values that a first fit found.

    >>> Identified((), {}, {}).found
    ()
    """

    found: tuple[Found, ...]
    """Those that the recordings determine; the others keep what they had."""
    before: dict[str, float]
    """Relative deviation of each output, moving, at the values stated."""
    after: dict[str, float]
    """The same after the first fit."""


def asked(breakdown: Breakdown, known: Sequence[str]) -> tuple[str, ...]:
    """The parameters that a first fit is to find: by pattern, or with source but without value.

    Args:
        known: the model's parameters.

    Raises:
        ConfigError: a pattern matches none of them.
    """
    first = [(one.name, one.said) for one in breakdown.stated]
    wanted = {name for name, said in first if said.value is None and said.source == "experiment"}
    for pattern in breakdown.requirements.identify:
        matched = fnmatch.filter(known, pattern)
        if not matched:
            raise ConfigError(
                f"[requirements] identify: no parameter matches {pattern!r}; the model has "
                f"{', '.join(known)}"
            )
        wanted |= set(matched)
    return tuple(name for name in known if name in wanted)


def identify(problem: Problem, wanted: Sequence[str], drifting: Sequence[str]) -> Identified:
    """Fits the wanted parameters together with those that drift.

    Args:
        problem: model and rows.
        wanted: see `asked`.
        drifting: parameters whose stated values may be off; fitted along, so that the others do not
            take their part.
    """
    names = tuple(dict.fromkeys((*wanted, *drifting)))
    fit = solve(replace(problem, editable=names))
    rows = zip(fit.names, fit.values, fit.sigma, fit.units, fit.verdict, strict=True)
    found = tuple(
        Found(name, float(value), float(sigma), unit, verdict)
        for name, value, sigma, unit, verdict in rows
        if name in wanted and verdict != "not"
    )
    before = dict(zip(fit.outputs, map(float, fit.moving_before), strict=True))
    return Identified(
        found, before, dict(zip(fit.outputs, map(float, fit.moving_after), strict=True))
    )
