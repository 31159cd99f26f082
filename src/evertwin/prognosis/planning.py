"""The maintenance plan: for each component the date at which its use costs least.

Replacing after a further time T ends this life at T or at the failure, whichever is first. With the
age a so far, the distribution F of the remaining life, the cost c_f of a failure in service and c_m
of maintenance in time, the cost per time of use is

    C(T) = (c_f·F(T) + c_m·(1 − F(T))) / (a + ∫₀ᵀ (1 − F(t)) dt)

the age replacement of Barlow and Hunter (1960), given that the component has lived until a. Too
early wastes life, too late risks the failure; where c_f ≤ c_m running to failure is cheapest.
Components whose
best dates fall into one maintenance window are done together.

>>> from evertwin.prognosis.life import LEVELS
>>> life = Life.of("h", LEVELS, 80.0 + 40.0 * LEVELS)
>>> item = cheapest("gearbox", life, age=400.0, cost=Cost(10_000.0, 1_000.0))
>>> 75.0 < item.after < 90.0, item.probability < 0.2
(True, True)
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float64

from evertwin.errors import UsageError
from evertwin.prognosis.life import Life

__all__ = ["Cost", "Decision", "Plan", "PlanItem", "cheapest", "decided", "grouped"]

HEADINGS = (
    "component", "after", "unit", "window", "probability_before", "cost_rate",
    "cost_rate_run_to_failure", "median_life", "decision", "reason",
)  # fmt: skip
WINDOWS = 2000
"""Most windows that are looked at."""


class Cost(NamedTuple):
    """What a component costs.

    >>> Cost(8000.0, 900.0).failure
    8000.0
    """

    failure: float
    """A failure in service, all that follows from it included."""
    maintenance: float
    """Maintenance in time."""


class Decision(NamedTuple):
    """What the operator says to a planned date.

    >>> Decision("postponed", "spare part late", 40.0).until
    40.0
    """

    verdict: Literal["open", "confirmed", "postponed", "declined"]
    reason: str = ""
    until: float = 0.0
    """Not before this time from now (postponed), or at this time (confirmed)."""


@dataclass(frozen=True)
class PlanItem:
    """One component's date.

    >>> PlanItem("pump", "h", 10.0, 0.01, 2.0, 3.0, 50.0).decision.verdict
    'open'
    """

    component: str
    unit: str
    after: float
    """Time from now; infinite: run to failure."""
    probability: float
    """That it fails before."""
    rate: float
    """Cost per time of use with this date."""
    rate_to_failure: float
    """Cost per time of use without any maintenance in time."""
    median: float
    """Of the remaining life."""
    window: int | None = None
    """Number of the maintenance window from now, 0 the next one."""
    decision: Decision = Decision("open")


@dataclass(frozen=True)
class Plan:
    """Every component's date, the earliest first.

    >>> Plan("press", "h", ()).to_csv().splitlines()[0][:15]
    'component,after'
    """

    name: str
    unit: str
    items: tuple[PlanItem, ...]
    without: Mapping[str, str] = field(default_factory=dict)
    """Components without a date, and why."""

    def to_csv(self) -> str:
        """One line per component; an infinite date is an empty cell."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(HEADINGS)
        for one in self.items:
            writer.writerow([
                _safe(one.component), _cell(one.after), one.unit,
                "" if one.window is None else one.window, _cell(one.probability),
                _cell(one.rate), _cell(one.rate_to_failure), _cell(one.median),
                one.decision.verdict, _safe(one.decision.reason),
            ])  # fmt: skip
        return out.getvalue()

    def windows(self) -> dict[int, tuple[str, ...]]:
        """Window → components that are done in it."""
        found: dict[int, tuple[str, ...]] = {}
        for one in self.items:
            if one.window is not None:
                found[one.window] = (*found.get(one.window, ()), one.component)
        return found


def _cell(x: float) -> str:
    return f"{x:.6g}" if np.isfinite(x) else ""


def _safe(text: str) -> str:
    """A cell that a spreadsheet takes for text, not for a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def cheapest(
    component: str, life: Life, age: float, cost: Cost,
    dates: Float64[np.ndarray, " w"] | None = None,
) -> PlanItem:  # fmt: skip
    """The date of least cost per time of use.

    Args:
        component: its name.
        life: its remaining life.
        age: its age so far, in the life's unit.
        cost: of a failure and of maintenance.
        dates: possible dates from now, rising; None: any time.

    Raises:
        UsageError: a negative age or cost.
    """
    if age < 0.0 or cost.failure < 0.0 or not cost.maintenance > 0.0:
        raise UsageError(
            f"plan of {component}: expected an age and a failure cost of 0 or more and a "
            f"maintenance cost above 0, got {age:g}, {cost.failure:g}, {cost.maintenance:g}"
        )
    finite = life.remaining[np.isfinite(life.remaining)]
    if len(finite) == 0:
        return PlanItem(component, life.unit, np.inf, 0.0, 0.0, 0.0, np.inf)
    grid = np.unique(np.concatenate([[0.0], np.linspace(0.0, finite[-1], 801), finite]))
    times = grid if dates is None else dates[dates <= finite[-1]]
    survival = np.array([1.0 - life.probability_before(t) for t in grid])
    lived = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (survival[1:] + survival[:-1]) / 2)])
    mean = float(lived[-1])
    to_failure = cost.failure / max(age + mean, 1e-300)
    if len(times) == 0:
        at = np.inf if dates is None or len(dates) == 0 else float(dates[0])
        chance = life.probability_before(at) if np.isfinite(at) else 1.0
        return PlanItem(component, life.unit, at, chance, to_failure, to_failure, life.median)
    failed = 1.0 - np.interp(times, grid, survival)
    used = np.maximum(age + np.interp(times, grid, lived), 1e-9 * max(finite[-1], 1e-300))
    rate = (cost.failure * failed + cost.maintenance * (1.0 - failed)) / used
    best = int(np.argmin(rate))
    if rate[best] >= to_failure * (1.0 - 1e-9) and not np.isinf(life.remaining[-1]):
        return PlanItem(component, life.unit, np.inf, 1.0, to_failure, to_failure, life.median)
    return PlanItem(
        component, life.unit, float(times[best]), float(failed[best]), float(rate[best]),
        to_failure, life.median,
    )  # fmt: skip


def grouped(
    lives: Mapping[str, tuple[Life, float, Cost]], every: float | None, first: float = 0.0
) -> tuple[PlanItem, ...]:
    """Dates of several components, the earliest first.

    Args:
        lives: component → remaining life, age, cost.
        every: time between maintenance windows; None: any date is possible.
        first: time from now to the first window.
    """
    items = []
    for name, (life, age, cost) in lives.items():
        dates = None
        if every is not None:
            finite = life.remaining[np.isfinite(life.remaining)]
            last = float(finite[-1]) if len(finite) else first
            count = min(int(max(last - first, 0.0) / every) + 2, WINDOWS)
            dates = first + every * np.arange(count)
        item = cheapest(name, life, age, cost, dates)
        if every is not None and np.isfinite(item.after):
            item = replace(item, window=round((item.after - first) / every))
        items.append(item)
    return tuple(sorted(items, key=lambda one: (one.after, one.component)))


def decided(items: Sequence[PlanItem], decisions: Mapping[str, Decision]) -> tuple[PlanItem, ...]:
    """The dates with what the operator said; a postponed or confirmed date moves."""
    found = []
    for one in items:
        said = decisions.get(one.component)
        if said is None:
            found.append(one)
            continue
        after = one.after
        if said.verdict == "postponed":
            after = max(after, said.until)
        elif said.verdict == "confirmed":
            after = said.until
        moved = replace(one, after=max(after, 0.0), decision=said)
        found.append(moved if after == one.after else replace(moved, window=None))
    return tuple(sorted(found, key=lambda one: (one.after, one.component)))
