"""The report of an engineered twin: every choice, with the figures that explain it."""

from __future__ import annotations

import math
from pathlib import Path

from evertwin.engineering.engineer import Engineered
from evertwin.engineering.study import Study
from evertwin.report.html import write_page
from evertwin.tuning import Schedule


def write_engineering(done: Engineered, path: Path) -> None:
    """Writes the report, one file.

    Raises:
        UsageError: the file cannot be written.
    """
    study = done.study
    write_page("engineer.html", path, {
        "done": done, "study": study, "ranks": {one.component: one for one in study.ranks},
        "levels": {one.component: one for one in study.levels},
        "built": {one.component: one for one in done.plan.built},
        "signals": sorted({s.signal for link in study.links for s in link.signals}),
        "effects": {k.parameter: {s.signal: s.effect for s in k.signals} for k in study.links},
        "shade": _shade, "morris": _morris(study), "turns": _turns(study),
    })  # fmt: skip


def _shade(effect: float) -> float:
    """How dark an effect is shown: 0 at 0.01 % of the signal, 1 at all of it."""
    return min(max(0.25 * math.log10(1e4 * effect), 0.0), 1.0)


def _morris(study: Study) -> dict[str, tuple[float, float]]:
    """Largest effect on an output of each parameter, and its spread."""
    found = zip(study.morris.mu.max(axis=0), study.morris.spread.max(axis=0), strict=True)
    return dict(zip(study.morris.names, found, strict=True))


def _turns(study: Study) -> list[tuple[str, ...]]:
    """The parameters of each tuning by the schedule."""
    if study.weighed is None or study.measured is None:
        return []
    schedule = Schedule(study.weighed.weights)
    return [schedule.due(turn) for turn in range(study.measured.tunings)]
