"""One component: the indicator that tells its wear, its life, and the work ahead of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from evertwin.config.prognosis import IndicatorSpec
from evertwin.prognosis.course import Course
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.laws import Indicator, Life, NotEnough, Workload


@dataclass(frozen=True)
class ComponentLife:
    """One component: its indicator and its life.

    >>> ComponentLife.__name__
    'ComponentLife'
    """

    component: str
    rule: IndicatorSpec
    indicator: Indicator
    life: Life | NotEnough
    """Under the work ahead."""
    before: Life | NotEnough
    """If work went on as before."""
    wears: Formula
    """Wear per second of a simulated cycle."""
    work: Workload | None = None
    """Wear ahead, in that of the past; None: as before."""
    course: Course | None = None
    by_law: Mapping[str, Course] = field(default_factory=dict)
    """What the laws of some weight say alone; for pictures."""

    @property
    def age(self) -> float:
        """Time in use since it was new or replaced, on the clock."""
        now = self.indicator.since_replaced()
        start = now.origin if now.origin is not None else (now.at[0] if len(now.at) else 0.0)
        return float(now.at[-1] - start) if len(now.at) else 0.0

    @property
    def rate(self) -> float:
        """Wear under the work ahead over that of the past, on the mean until the median life."""
        if self.work is None or not isinstance(self.life, Life):
            return 1.0
        return self.work.mean_rate(self.life.median)

    @property
    def phases(self) -> list[dict[str, float | None]]:
        """The work ahead: begin and end of each phase, and its wear over that of the past."""
        if self.work is None:
            return []
        begins: list[float] = self.work.time[:-1].tolist()
        ends = [*begins[1:], None]
        rows = zip(begins, ends, self.work.rates.tolist(), strict=True)
        return [{"begin": a, "until": b, "rate": rate} for a, b, rate in rows]

    @property
    def ahead(self) -> str:
        """The work ahead in words; empty where it is as before."""
        if self.work is None or not np.any(self.work.rates != 1.0):
            return ""
        said = []
        for phase in self.phases:
            rate, until = phase["rate"], phase["until"]
            how = "rest" if rate == 0.0 else "as before" if rate == 1.0 else (
                f"{rate:.3g} times as fast"
            )  # fmt: skip
            end = "on" if until is None else f"to {until:g}"
            alone = len(self.work.rates) == 1
            said.append(how if alone else f"from {phase['begin']:g} {end}: {how}")
        return f"wears under the work ahead, by {self.wears.text}: " + "; ".join(said)

    @property
    def urgency(self) -> float:
        """Median life; infinite where it is not known."""
        return self.life.median if isinstance(self.life, Life) else float("inf")

    @property
    def sentence(self) -> str:
        """What is known, in one sentence."""
        return said(self.life)


def said(life: Life | NotEnough) -> str:
    """A life in words.

    >>> said(NotEnough("six values", "there are two"))
    'not enough data: needs six values; there are two'
    """
    if isinstance(life, NotEnough):
        return "; ".join(
            part for part in (f"not enough data: needs {life.needs}", life.reason) if part
        )
    if life.passed is not None:
        return f"life is over: the limit was passed at {life.passed:.4g} {life.unit}"
    low, high = life.interval80
    ends = f"{high:.4g}" if high < float("inf") else "without end"
    law = f", law {life.law}" if life.law else ""
    return (
        f"{life.median:.4g} {life.unit} (80 %: {low:.4g} … {ends}), not before "
        f"{life.not_before:.4g} (95 %){law}"
    )
